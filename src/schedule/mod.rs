//! A plan as a value: resources and commands on proxies. Schedule needs no device and can be printed.

use glam::Vec4;
use serde::Serialize;
use std::any::Any;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

mod difference;
mod lifetime;
mod print;

pub use lifetime::{Lifetimes, Placement};

/// A buffer, texture or list, by its index in [`Schedule::resources`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Resource(pub u32);

/// A number on the host that steps set and that sizes of dispatches and ends of loops depend on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Variable(pub u32);

/// What shaders run on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Device {
    /// Whether it is a driver that runs on the cores of the host.
    pub is_software: bool,
    /// Whether it blends into images of 32-bit floats, which WebGPU leaves to the adapter.
    pub blends: bool,
}

impl Device {
    /// Hardware with all that passes can make use of.
    pub const ABLE: Self = Self { is_software: false, blends: true };
    /// A driver on the cores of the host, with the same.
    pub const SOFTWARE: Self = Self { is_software: true, blends: true };
}

/// Everything that one frame does, in order.
#[derive(Default)]
pub struct Schedule {
    pub resources: Vec<ResourceDescription>,
    pub variables: Vec<VariableDescription>,
    pub steps: Vec<Step>,
    /// Histories that stay when the scene changes.
    pub survivors: Histories,
    /// Of these, what stays no longer than a constant by which it is laid out is as it was.
    pub laid_out: Vec<(Resource, Histories)>,
    /// Histories that are the same made anew, from the scene alone: nobody has to keep them.
    pub remade: Histories,
    /// Histories that are worth the same in any frame of a scene, and more the longer they have been added to.
    pub accumulated: Histories,
    /// Of histories that are not used to their ends, what is.
    pub used: Vec<Read>,
    /// None where no frame is run ahead of its picture.
    pub window: Option<Window>,
    /// Nodes that frames which are run ahead leave out: nothing that lives on depends on them.
    pub of_pictures: BTreeSet<String>,
}

/// When a frame is to be run ahead, by the numbers that the last one left. See [`Lapse`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// How many frames later than the last picture; 0 before there is one.
    pub frames: Variable,
    /// How many pictures have been run ahead for that are yet to come: there is time until then.
    pub open: Variable,
}

/// How a frame lies in time to the one that ran before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Lapse {
    /// Frames that it is later; less than 0 where it is earlier.
    pub frames: i32,
    /// Whether it is run for what lives on alone, before the pictures that lie between.
    pub is_ahead: bool,
}

impl Lapse {
    /// Of a picture after a picture.
    pub const NEXT: Self = Self { frames: 1, is_ahead: false };

    /// How many frames ahead of the last picture it is; None for a picture.
    pub fn ahead(self) -> Option<f32> {
        self.is_ahead.then_some(self.frames as f32)
    }
}

impl Schedule {
    /// Whether a frame of a scene that changes finds more of those before it than would be made anew, or is the same in any frame.
    pub fn lives_on(&self) -> bool {
        let is_elsewhere = |resource| self.remade.resources.contains(resource) || self.accumulated.resources.contains(resource);
        self.survivors.resources.iter().any(|resource| !is_elsewhere(resource))
    }

    /// What stays when the scene changes, and these constants with it.
    pub fn survivors_of(&self, constants: &[Resource]) -> Histories {
        let gone: Vec<&Histories> = self.laid_out.iter().filter(|(by, _)| constants.contains(by)).map(|(_, histories)| histories).collect();
        let Histories { resources, variables } = &self.survivors;
        Histories {
            resources: resources.iter().copied().filter(|resource| gone.iter().all(|gone| !gone.resources.contains(resource))).collect(),
            variables: variables.iter().copied().filter(|variable| gone.iter().all(|gone| !gone.variables.contains(variable))).collect(),
        }
    }
}

/// Histories by what they are.
#[derive(Default)]
pub struct Histories {
    pub resources: Vec<Resource>,
    pub variables: Vec<Variable>,
}

pub struct ResourceDescription {
    /// `node.member`.
    pub name: String,
    pub kind: ResourceKind,
    pub lifetime: Lifetime,
}

#[derive(PartialEq)]
pub struct VariableDescription {
    pub name: String,
    /// Whether the value lives on into the next frame; others start every frame at 0.
    pub history: bool,
}

/// What a resource is made of.
#[derive(Debug, Clone, PartialEq)]
pub enum ResourceKind {
    /// A storage or uniform buffer.
    Buffer {
        /// Its length.
        bytes: u64,
    },
    /// An image, or several of one size.
    Texture {
        /// Width and height [texels].
        size: [u32; 2],
        /// How many images.
        layers: u32,
        /// What a texel is.
        format: Format,
    },
    /// Draws that a host step lists.
    Draws,
    /// A host step's own memory.
    State,
}

#[derive(Clone, PartialEq)]
pub enum Lifetime {
    /// Within a frame; shares memory with others whose lifetimes do not meet.
    Transient,
    /// Lives on into the next frame, zero at first; never shares memory.
    History,
    /// Written once, when the plan is made ready.
    Constant(Arc<[u8]>),
    /// Data of the scene or of one of its parts, uploaded once.
    Scene(ScenePart, SceneData),
    /// The camera of the frame, written as each frame starts.
    Frame,
    /// All variables, for loops that the device drives: [`VARIABLES_BEFORE`] words of the loop, then one word each.
    Variables,
}

/// The shaders' name for the variables.
pub const VARIABLES: &str = "variables";

/// Words of [`VARIABLES`] before the first variable, as `shaders/lib/variables.wgsl` has them.
pub const VARIABLES_BEFORE: u32 = 6;

/// Which geometry is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScenePart {
    /// The scene's own.
    Main,
    /// One of [`Scene::parts`](crate::scene::Scene::parts), by its number.
    Other(usize),
}

/// What shaders read of a scene, bound by these names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum SceneData {
    Parameters,
    Positions,
    Corners,
    Attributes,
    /// The hierarchy over the triangles, lights, emitters and materials.
    Tables,
    /// The same with materials without lobes, in their place: bound by the same name.
    AlbedoTables,
    /// Those of all textures, one after the other, as an image.
    Texels,
    /// The first few lights again, as a uniform.
    FirstLights,
    /// The sky as an image.
    Environment,
    /// How far movers have come since the picture before, written as each frame starts.
    Movers,
}

/// What a texel is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Format {
    /// A float of 32 bits.
    R32Float,
    /// A whole number of 32 bits.
    R32Uint,
    /// Four floats of 16 bits.
    Rgba16Float,
    /// Four floats of 32 bits.
    Rgba32Float,
    /// A depth of 32 bits.
    Depth32Float,
}

pub enum Step {
    Node(Node),
    Repeat(Repeat),
}

/// One use of a pass.
#[derive(PartialEq)]
pub struct Node {
    pub name: String,
    pub pass: &'static str,
    pub commands: Vec<Command>,
    /// See [`Keys`].
    pub keys: Keys,
}

/// Of a node's commands, by their places, whose outcome lives on: a number of all that it is made from. Such a command runs where that is another than when it
/// ran last.
#[derive(Debug, Clone, Default)]
pub struct Keys(pub BTreeMap<usize, u64>);

/// Steps that run again until a variable is not 0 or the bound is reached.
pub struct Repeat {
    pub name: String,
    /// Ends the loop after the round that sets it; a loop without it runs all its rounds.
    pub until: Option<Variable>,
    /// Counts the rounds, from 0.
    pub round: Variable,
    pub at_most: u32,
    pub steps: Vec<Step>,
    pub time: TimeShare,
    pub driver: Driver,
}

/// Who decides whether a loop runs another round.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Driver {
    /// The host, which looks at each round's end.
    Host,
    /// The device: rounds are encoded ahead, and those that are not needed do nothing. The loop's first node begins a round and sizes what is in it,
    /// which it leaves here, four words each, and opens and closes a loop that the host does not look at; it has no part in rounds that the host decides on.
    /// Host steps are done by their twins.
    Device { sizes: Resource },
}

/// What a loop has of the time that is given to a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TimeShare {
    /// Rounds that run whatever the time.
    pub at_least: u32,
    /// The number of records that the loop adds to: it runs on, whatever the time, while there is none.
    pub records: Option<Variable>,
    /// Among how many caches the time that is left is shared out: the one that the loop fills, and those of later loops.
    pub caches: u32,
}

/// Why a loop ends although work is left.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Shortfall {
    /// The time given to the frame is over.
    Time,
    /// The loop's bound is reached.
    Rounds,
    /// The cache takes no more records.
    CacheFull,
    /// A frame may make no more records.
    FrameLimit,
    /// The last rounds changed nothing, so that more would not either.
    NoProgress,
}

/// Something that a node does.
#[derive(PartialEq)]
pub enum Command {
    /// Sets every byte or texel to 0.
    Clear(Resource),
    /// Copies every byte or texel to a resource of the same kind.
    Copy {
        /// What is copied.
        from: Resource,
        /// Where to.
        to: Resource,
    },
    /// Copies a texture's texels to a buffer from the byte `offset` on, a row after the other: [`Format::row_bytes`].
    CopyToBuffer {
        /// A texture of one layer.
        from: Resource,
        /// A buffer.
        to: Resource,
        /// [bytes]
        offset: u64,
    },
    /// Copies one image of a texture to another texture.
    CopyLayer {
        /// What is copied.
        from: Resource,
        /// Which of its images.
        layer: u32,
        /// A texture of one layer, of the same size and format.
        to: Resource,
    },
    /// A dispatch.
    Compute(Compute),
    /// Draws.
    Raster(Raster),
    /// Work on the host.
    Host(Host),
    /// Is run only where a loop has ended early, as the time of the frame was up or its rounds led nowhere.
    Late(Host),
}

/// A shader entry point with its specialisation and bindings, by the names in its text.
#[derive(Clone, PartialEq)]
pub struct Program {
    /// File under `shaders/`, without its ending; of a shader that brings its text, any name.
    pub shader: &'static str,
    /// The text of a shader that does not ship; it may import what does.
    pub text: Option<&'static str>,
    /// What the imports in capitals stand for: `("VISIBILITY", "lib/visibility/rays")`.
    pub imports: Vec<(&'static str, &'static str)>,
    /// Values of the shader's `override` constants.
    pub constants: Vec<(&'static str, f64)>,
    /// Variable in the shader, resource. What begins with `scene_` or is called `camera` is bound without being listed.
    pub bindings: Vec<(&'static str, Resource)>,
    /// How many bytes are touched of a binding, where it is not all of them.
    pub parts: Vec<(&'static str, u64)>,
    /// The name of the part of the scene that what begins with `scene_` is of; None for the scene's own.
    pub scene_part: Option<&'static str>,
}

/// A dispatch.
#[derive(PartialEq)]
pub struct Compute {
    /// What is run.
    pub program: Program,
    /// The name of the entry point in its text.
    pub entry: &'static str,
    /// How many of it.
    pub groups: Groups,
}

/// Workgroups of a dispatch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Groups {
    /// So many along each axis.
    Fixed([u32; 3]),
    /// `ceil(variable / divisor) · per` groups in all, along x and from 65,535 on along y too, so that a shader's
    /// linear group is `workgroup_id.x + workgroup_id.y · num_workgroups.x`, and must be checked. None where it is 0.
    Counted {
        /// How many items there are.
        count: Variable,
        /// Items that share groups.
        divisor: u32,
        /// Groups that they share.
        per: u32,
    },
}

/// Draws into images.
#[derive(PartialEq)]
pub struct Raster {
    /// What is run.
    pub program: Program,
    /// The name of the entry point for vertices in its text.
    pub vertex: &'static str,
    /// That for fragments; None for a depth-only pass.
    pub fragment: Option<&'static str>,
    /// What is drawn into, by location.
    pub colours: Vec<Target>,
    /// What keeps the nearest, if anything does.
    pub depth: Option<DepthTarget>,
    /// The buffer of three-float positions at vertex slot 0, if the vertex shader reads one.
    pub vertices: Option<Resource>,
    /// The buffer of four four-float vectors an instance at vertex slot 1, locations 1 to 4, if the vertex shader reads one.
    pub instances: Option<Resource>,
    /// The buffer of u32 that indexed draws find their vertices by.
    pub indices: Option<Resource>,
    /// What vertices make.
    pub topology: Topology,
    /// How many of them.
    pub draws: Draws,
}

/// What vertices make.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Topology {
    /// Each three a triangle.
    Triangles,
    /// Each one with the two before it a triangle.
    TriangleStrip,
}

/// An image that is drawn into.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// Of one layer.
    pub texture: Resource,
    /// Starts from this value; keeps what is there where None.
    pub clear: Option<[f64; 4]>,
    /// What becomes of what is there.
    pub blend: Blend,
}

/// What becomes of what an image holds where something is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Blend {
    /// It is gone.
    Replace,
    /// Adds all four channels.
    Add,
}

/// Reverse Z: 0 is farthest, the greater value is nearer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DepthTarget {
    /// Of [`Format::Depth32Float`].
    pub texture: Resource,
    /// Which of its images.
    pub layer: u32,
    /// Whether it starts from 0, or keeps what is there.
    pub clears: bool,
}

/// How much is drawn.
pub enum Draws {
    /// What the plan knows.
    Fixed(Vec<Draw>),
    /// What a host step put into a [`ResourceKind::Draws`].
    Listed(Resource),
    /// One draw of `vertices` vertices and so many instances.
    Instances {
        /// Of each instance.
        vertices: u32,
        /// How many instances.
        count: Variable,
    },
}

/// One draw.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Draw {
    /// Rectangle that clip space maps to and that fragments are kept in: x, y, width, height [pixels]; None for the whole target.
    pub rectangle: Option<[u32; 4]>,
    /// Numbers of the vertices, or places among the raster command's indices.
    pub vertices: [u32; 2],
    /// Which of both.
    pub is_indexed: bool,
    /// Numbers of the first instance and of that after the last.
    pub instances: [u32; 2],
}

/// Work on the CPU between GPU commands.
pub struct Host {
    /// For messages.
    pub name: &'static str,
    /// What is read back before the step runs, whole or `count · stride` bytes of it.
    pub reads: Vec<Read>,
    /// What it writes, puts back or lists.
    pub writes: Vec<Resource>,
    /// What it does.
    pub run: HostFunction,
    /// Dispatches that do the same to what the step writes and to variables, for loops that the device drives.
    pub twin: Option<Vec<Compute>>,
    /// Whether it changes nothing in frames after the one in which it has run first.
    pub runs_once: bool,
}

/// What a host step is to find.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Read {
    /// Where it is.
    pub resource: Resource,
    /// Bytes an item and the number of items; None for the whole.
    pub counted: Option<(u64, Variable)>,
}

/// What a host step does; what it returns as an error is one of its frame.
pub type HostFunction = Arc<dyn Fn(&mut dyn HostContext) -> Result<(), String> + Send + Sync>;

/// What a host step sees while it runs.
pub trait HostContext {
    /// Bytes of a resource that the step reads, aligned to 16; texture rows without padding.
    fn read(&self, resource: Resource) -> &[u8];
    /// Writes bytes to a buffer before the next command that looks at it, from `offset` on.
    fn write(&mut self, resource: Resource, offset: u64, bytes: &[u8]);
    /// Takes the host's memory of a resource that the step writes, all of it and what it holds if the step also reads it, to be put back.
    fn take(&mut self, resource: Resource) -> Vec<Vec4>;
    /// Puts it back; whatever looks at the resource next sees its first `bytes`, or all of it where there are fewer.
    fn put(&mut self, resource: Resource, contents: Vec<Vec4>, bytes: u64);
    /// A number, as it is now.
    fn variable(&self, variable: Variable) -> u32;
    /// Makes a number another from now on.
    fn set(&mut self, variable: Variable, value: u32);
    /// The list of draws, as the step left it last.
    fn draws(&mut self, resource: Resource) -> &mut Vec<Draw>;
    /// Memory of a node's host steps, empty at the start of a frame.
    fn state(&mut self, resource: Resource) -> &mut Option<Box<dyn Any + Send + Sync>>;
    /// Triangles and the rest, for steps that look at the scene.
    fn scene(&self) -> &crate::scene::Scene;
    /// The hierarchy over the triangles.
    fn bvh(&self) -> &crate::scene::bvh::Bvh;
    /// What emits light and is no point.
    fn emission(&self) -> &crate::scene::emitters::Emission;
    /// Of the scene [scene units].
    fn extent(&self) -> f32;
    /// Whether the round is the last one of its loop: the time given to the frame is over, or the loop's bound is reached. What
    /// the round adds for a later one would be lost.
    fn is_last_round(&self) -> bool;
    /// Whether the time of the frame is limited, known from the first round of a loop on.
    fn is_timed(&self) -> bool;
    /// Tells why the step ends the loop that `until` ends although work is left.
    fn cut_short(&mut self, until: Variable, because: Shortfall);
    /// What movers have done since the frame that ran before: maps of points as they were to where they are.
    fn motions(&self) -> &[crate::scene::stage::Motion];
    /// How the frame lies in time to that.
    fn lapse(&self) -> Lapse;
    /// The camera of the frame and the picture's size.
    fn camera(&self) -> (&crate::scene::Camera, [u32; 2]);
}

impl Shortfall {
    const ALL: [Self; 5] = [Self::Time, Self::Rounds, Self::CacheFull, Self::FrameLimit, Self::NoProgress];

    /// What the device knows it by, from 1 on.
    pub fn code(self) -> u32 {
        self as u32 + 1
    }

    /// What a code stands for; None for 0.
    pub fn of_code(code: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|shortfall| shortfall.code() == code)
    }

    /// Completes "the loop ended because …".
    pub fn phrase(self) -> &'static str {
        match self {
            Self::Time => "the time was up",
            Self::Rounds => "it had no round left",
            Self::CacheFull => "the cache is full",
            Self::FrameLimit => "a frame may add no more records",
            Self::NoProgress => "new records did not cover the pixels that they were made for",
        }
    }

    /// What to do about it.
    pub fn help(self) -> &'static str {
        match self {
            Self::Time => "raise --time, or keep the records with --cache and render again",
            Self::Rounds => "raise `max_rounds` of a Fill, or set it to 0 for as many as there are pixels; raise `rounds` of an Iterate",
            Self::CacheFull => "raise `capacity` of the RecordCache, or its `accuracy`, so that fewer records are needed",
            Self::FrameLimit => "raise `at_most` of the FindMisses, or render more frames",
            Self::NoProgress => "make the loop's records at the requests of the FindMisses that ends it, and add them to the cache that its splats read",
        }
    }
}

impl Command {
    /// The shaders that it runs.
    pub fn programs(&self) -> Vec<&Program> {
        match self {
            Self::Raster(raster) => vec![&raster.program],
            _ => self.computes().iter().map(|compute| &compute.program).collect(),
        }
    }

    /// Its dispatches, a twin's too.
    pub fn computes(&self) -> &[Compute] {
        match self {
            Self::Compute(compute) => std::slice::from_ref(compute),
            Self::Host(Host { twin: Some(twin), .. }) => twin,
            _ => &[],
        }
    }

    /// Leaves out what a loop that the device drives would run in the place of a host step.
    pub fn drop_twin(&mut self) {
        if let Self::Host(host) = self {
            host.twin = None;
        }
    }
}

impl Step {
    pub fn name(&self) -> &str {
        match self {
            Self::Node(node) => &node.name,
            Self::Repeat(repeat) => &repeat.name,
        }
    }
}

impl Raster {
    /// The entry points of its shader.
    pub fn entries(&self) -> Vec<&'static str> {
        [Some(self.vertex), self.fragment].into_iter().flatten().collect()
    }
}

impl Groups {
    pub const ONE: Self = Self::Fixed([1, 1, 1]);

    /// Workgroups along one axis that every adapter runs.
    const MOST_ALONG_ONE: u32 = 65_535;

    /// So many groups in all, as a shader has to read and check those of [`Self::Counted`].
    pub fn linear(count: u32) -> Self {
        Self::Fixed([count.min(Self::MOST_ALONG_ONE), count.div_ceil(Self::MOST_ALONG_ONE), 1])
    }
}

impl Host {
    /// A step that a loop which the device drives cannot have.
    pub fn new(
        name: &'static str,
        reads: Vec<Read>,
        writes: Vec<Resource>,
        run: impl Fn(&mut dyn HostContext) -> Result<(), String> + Send + Sync + 'static,
    ) -> Self {
        Self { name, reads, writes, run: Arc::new(run), twin: None, runs_once: false }
    }

    /// A step that finds its work of an earlier frame done.
    pub fn once(self) -> Self {
        Self { runs_once: true, ..self }
    }
}

impl Program {
    /// Of a shader that ships.
    pub fn new(shader: &'static str) -> Self {
        Self { shader, text: None, imports: Vec::new(), constants: Vec::new(), bindings: Vec::new(), parts: Vec::new(), scene_part: None }
    }

    /// Of a shader that does not ship, for passes of other programs: any name, and its text.
    pub fn own(shader: &'static str, text: &'static str) -> Self {
        Self { text: Some(text), ..Self::new(shader) }
    }

    /// Tells this entry point with these constants and imports from any other.
    pub fn specialisation(&self, entry: &str) -> String {
        format!("{}:{entry} {:?} {:?}{}", self.shader, self.constants, self.imports, self.text.unwrap_or_default())
    }

    /// Says what `#import ALIAS`, in capitals, brings.
    pub fn import(mut self, alias: &'static str, path: &'static str) -> Self {
        self.imports.push((alias, path));
        self
    }

    /// Gives an `override` constant its value.
    pub fn constant(mut self, name: &'static str, value: impl Into<f64>) -> Self {
        self.constants.push((name, value.into()));
        self
    }

    /// Has the shader read the triangles, materials and lights of a [part](crate::scene::Scene::parts) of the scene, by its name, in the place of the scene's.
    pub fn of_part(self, name: &'static str) -> Self {
        Self { scene_part: Some(name), ..self }
    }

    /// Says what a variable of the shader is.
    pub fn bind(mut self, name: &'static str, resource: Resource) -> Self {
        self.bindings.push((name, resource));
        self
    }

    /// Tells the shader by this constant where a variable stands in [`VARIABLES`].
    pub fn variable(self, name: &'static str, variable: Variable) -> Self {
        self.constant(name, VARIABLES_BEFORE + variable.0)
    }

    /// Binds a resource of which only so many bytes are touched.
    pub fn bind_part(mut self, name: &'static str, resource: Resource, bytes: u64) -> Self {
        self.parts.push((name, bytes));
        self.bind(name, resource)
    }
}

/// What data of a part of the scene are called.
pub fn of_part(part: &str, data: &str) -> String {
    format!("{part}: {data}")
}

impl SceneData {
    /// Those of a plan that renders lobes; one that does not has [`SceneData::AlbedoTables`] in the place of [`SceneData::Tables`].
    pub const ALL: [Self; 9] =
        [Self::Parameters, Self::Positions, Self::Corners, Self::Attributes, Self::Tables, Self::Texels, Self::FirstLights, Self::Environment, Self::Movers];

    /// Whether parts of a scene have it in common.
    pub fn is_of_all_parts(self) -> bool {
        matches!(self, Self::Texels | Self::Environment)
    }

    /// The shaders' name for it; positions are vertices and have none.
    pub fn name(self) -> &'static str {
        match self {
            Self::Parameters => "scene_parameters",
            Self::Positions => "scene_positions",
            Self::Corners => "scene_corners",
            Self::Attributes => "scene_attributes",
            Self::Tables | Self::AlbedoTables => "scene_tables",
            Self::Texels => "scene_texels",
            Self::FirstLights => "scene_first_lights",
            Self::Environment => "scene_environment",
            Self::Movers => "scene_movers",
        }
    }
}

impl Format {
    /// Of a texel.
    pub fn bytes(self) -> u64 {
        match self {
            Self::R32Float | Self::R32Uint | Self::Depth32Float => 4,
            Self::Rgba16Float => 8,
            Self::Rgba32Float => 16,
        }
    }

    /// Bytes of a texture's row in a buffer that it is copied to: a multiple of 256, as devices want.
    pub fn row_bytes(self, width: u32) -> u64 {
        (width as u64 * self.bytes()).next_multiple_of(256)
    }
}

impl ResourceKind {
    /// That it takes on the device, unless the device pads it.
    pub fn bytes(&self) -> u64 {
        match self {
            Self::Buffer { bytes } => *bytes,
            Self::Texture { size, layers, format } => size[0] as u64 * size[1] as u64 * *layers as u64 * format.bytes(),
            Self::Draws | Self::State => 0,
        }
    }
}

impl Schedule {
    pub fn resource(&self, resource: Resource) -> &ResourceDescription {
        &self.resources[resource.0 as usize]
    }

    /// The resource of a shader's variable: what the program binds to it, or else the part of the scene or the camera of that name.
    pub fn bound(&self, program: &Program, name: &str) -> Option<Resource> {
        let listed = program.bindings.iter().find(|binding| binding.0 == name).map(|binding| binding.1);
        let named = |name: &str| self.resources.iter().position(|resource| resource.name == name).map(|index| Resource(index as u32));
        // What parts have in common, and the camera, have no name of their own.
        listed.or_else(|| program.scene_part.and_then(|part| named(&of_part(part, name)))).or_else(|| named(name))
    }

    /// All nodes, those inside loops too, in order.
    pub fn nodes(&self) -> Vec<&Node> {
        fn collect<'a>(steps: &'a [Step], into: &mut Vec<&'a Node>) {
            for step in steps {
                match step {
                    Step::Node(node) => into.push(node),
                    Step::Repeat(repeat) => collect(&repeat.steps, into),
                }
            }
        }
        let mut nodes = Vec::new();
        collect(&self.steps, &mut nodes);
        nodes
    }

    /// What the commands of each node touch, scene parts aside.
    pub fn resources_of_nodes(&self) -> BTreeMap<&str, BTreeSet<Resource>> {
        let mut touched: BTreeMap<&str, BTreeSet<Resource>> = BTreeMap::new();
        for node in self.nodes() {
            touched.entry(&node.name).or_default().extend(node.commands.iter().flat_map(Command::resources));
        }
        touched
    }
}

impl Command {
    /// Resources that the command touches, scene parts aside.
    pub fn resources(&self) -> Vec<Resource> {
        match self {
            Self::Clear(resource) => vec![*resource],
            Self::Copy { from, to } | Self::CopyToBuffer { from, to, .. } | Self::CopyLayer { from, to, .. } => vec![*from, *to],
            Self::Compute(compute) => compute.program.bindings.iter().map(|b| b.1).collect(),
            Self::Raster(raster) => {
                let mut all: Vec<_> = raster.program.bindings.iter().map(|b| b.1).collect();
                all.extend(raster.colours.iter().map(|t| t.texture));
                all.extend(raster.depth.iter().map(|t| t.texture));
                all.extend(raster.vertices);
                all.extend(raster.instances);
                all.extend(raster.indices);
                if let Draws::Listed(list) = &raster.draws {
                    all.push(*list);
                }
                all
            }
            Self::Host(host) | Self::Late(host) => {
                let twins = self.computes().iter().flat_map(|compute| compute.program.bindings.iter().map(|b| b.1));
                host.reads.iter().map(|r| r.resource).chain(host.writes.iter().copied()).chain(twins).collect()
            }
        }
    }
}

/// Where the fields of a host struct stand, to be compared with the shader's struct of the same name.
#[derive(Debug, Clone, Copy)]
pub struct HostLayout {
    pub name: &'static str,
    pub bytes: usize,
    pub fields: &'static [HostField],
}

/// A field of a host struct.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HostField {
    pub name: &'static str,
    /// From the struct's start [bytes].
    pub offset: usize,
    /// As Rust writes it: `[f32; 3]`.
    pub kind: &'static str,
}

/// Declares a struct that stands in a buffer, and lists its fields for the test against the shader's struct.
#[macro_export]
macro_rules! host_struct {
    ($(#[$meta:meta])* $visibility:vis struct $name:ident { $($(#[$field_meta:meta])* $field:ident: $type:ty),* $(,)? }) => {
        $(#[$meta])*
        #[repr(C)]
        #[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
        $visibility struct $name { $($(#[$field_meta])* pub $field: $type),* }

        impl $name {
            pub const LAYOUT: $crate::schedule::HostLayout = $crate::schedule::HostLayout {
                name: stringify!($name),
                bytes: std::mem::size_of::<$name>(),
                fields: &[$($crate::schedule::HostField {
                    name: stringify!($field),
                    offset: std::mem::offset_of!($name, $field),
                    kind: stringify!($type),
                }),*],
            };
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_beyond_what_one_axis_takes_go_along_two() {
        const MOST: u32 = Groups::MOST_ALONG_ONE;
        let cases = [(1, [1, 1]), (MOST, [MOST, 1]), (MOST + 1, [MOST, 2]), (3 * MOST, [MOST, 3])];
        for (count, [x, y]) in cases {
            assert_eq!(Groups::linear(count), Groups::Fixed([x, y, 1]));
        }
    }
}

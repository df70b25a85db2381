//! What a pass sees while it records: its arguments and inputs, the scene, and the schedule that it adds to.

use super::tables::TableStore;
use super::{Arguments, Port};
use crate::scene::{Scene, emitters::rays_to_suns, needs::Needs};
use crate::schedule::*;
use std::collections::{BTreeMap, BTreeSet};

/// What a plan is made for.
#[derive(Clone, Copy)]
pub struct Setting<'a> {
    /// What is rendered.
    pub scene: &'a Scene,
    /// What it requires.
    pub needs: &'a Needs,
    /// What runs the shaders.
    pub device: Device,
    /// Width and height of the picture [pixels].
    pub size: [u32; 2],
    /// Where tables that are slow to make are kept, if they are.
    pub tables: Option<&'a dyn TableStore>,
}

/// Why a pass cannot be encoded with these arguments on this scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Refusal {
    /// `plan::…`
    pub code: &'static str,
    /// What cannot be, one sentence.
    pub message: String,
    /// What to do about it.
    pub help: String,
    /// The parameter that is at fault, if one is.
    pub parameter: Option<&'static str>,
}

impl Refusal {
    /// With a code, a message, and what to do about it.
    pub fn new(code: &'static str, message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { code, message: message.into(), help: help.into(), parameter: None }
    }

    /// The same of one parameter, which the document's place of it is shown for.
    pub fn of_parameter(parameter: &'static str, code: &'static str, message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { parameter: Some(parameter), ..Self::new(code, message, help) }
    }
}

/// The ports that inputs are joined to, by their names, in the document's order.
pub type Joined = BTreeMap<&'static str, Vec<Port>>;

/// Encodes one node.
pub struct Encoder<'a> {
    /// The node's name, with those of the loops that hold it.
    pub node: &'a str,
    /// The values of its parameters.
    pub arguments: &'a Arguments,
    /// What the plan is made for.
    pub setting: Setting<'a>,
    /// How many records a round of the fill that holds the node adds at most; None outside of fills.
    pub batch: Option<u32>,
    /// Whether the loop walks one record at a time in the order of pixels, as the papers do; then `batch` is 1.
    pub sequential: bool,
    /// Inputs that are the same in each round of the innermost loop that holds the node; none outside of loops.
    steady: BTreeSet<&'static str>,
    inputs: &'a Joined,
    schedule: &'a mut Schedule,
    encoded: Encoded,
}

/// What a node adds besides resources and variables.
#[derive(Default)]
pub struct Encoded {
    /// By the names of the outputs.
    pub outputs: BTreeMap<&'static str, Port>,
    /// Run each time the innermost loop that holds the node starts; before the other commands where none does.
    pub prologue: Vec<Command>,
    /// In the order in which they run.
    pub commands: Vec<Command>,
    /// Remarks for `explain`: what was adapted and why.
    pub remarks: Vec<String>,
    /// Parameters that change nothing with this scene and these inputs, and why.
    pub idle: Vec<(&'static str, &'static str)>,
    /// Numbers for the run's report: name, buffer of u32 and index.
    pub reports: Vec<(&'static str, Reported)>,
    /// Histories that `--cache` saves and loads.
    pub persistent: Vec<Persistent>,
    /// Rounds that the loop must run whatever the time.
    pub at_least: u32,
    /// See [`Encoder::kept`].
    pub keys: Keys,
}

/// Where a number of the report stands after a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reported {
    /// A u32 of a buffer, by its index.
    Buffer(Resource, u32),
    /// A number of the schedule.
    Variable(Variable),
}

/// A history of items that can be saved and loaded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Persistent {
    /// Of which there is one of each name a node.
    pub name: &'static str,
    /// The buffer.
    pub items: Resource,
    /// Of one of its items.
    pub item_bytes: u64,
    /// How many there are.
    pub count: Variable,
}

impl<'a> Encoder<'a> {
    /// For a node that is in no loop.
    pub fn new(node: &'a str, arguments: &'a Arguments, setting: Setting<'a>, inputs: &'a Joined, schedule: &'a mut Schedule) -> Self {
        Self { node, arguments, setting, batch: None, sequential: false, steady: BTreeSet::new(), inputs, schedule, encoded: Encoded::default() }
    }

    /// For a node inside a loop, with the inputs that are the same in each round.
    pub fn with_steady(self, steady: BTreeSet<&'static str>) -> Self {
        Self { steady, ..self }
    }

    /// Whether the node is in a loop, in each round of which an input is the same: what depends on nothing else can be done before the loop.
    pub fn is_steady(&self, input: &str) -> bool {
        self.steady.contains(input)
    }

    /// For a node inside a fill.
    pub fn in_loop(self, batch: u32, sequential: bool) -> Self {
        Self { batch: Some(batch), sequential, ..self }
    }

    /// What the node has added.
    pub fn finish(self) -> Encoded {
        self.encoded
    }

    /// The port that an input is joined to; None for an optional one that is not there.
    pub fn input(&self, name: &str) -> Option<&'a Port> {
        self.inputs.get(name).and_then(|ports| ports.first())
    }

    /// The images that an input for any number of them is joined to.
    pub fn images(&self, name: &str) -> Vec<super::port::Image> {
        let ports = self.inputs.get(name).into_iter().flatten();
        ports.filter_map(|port| if let Port::Image(image) = port { Some(*image) } else { None }).collect()
    }

    /// Hands on what an output of this name is.
    pub fn output(&mut self, name: &'static str, port: Port) {
        self.encoded.outputs.insert(name, port);
    }

    /// Puts a number of a buffer into the run's report.
    pub fn report(&mut self, name: &'static str, buffer: Resource, index: u32) {
        self.encoded.reports.push((name, Reported::Buffer(buffer, index)));
    }

    /// Puts a number of the schedule into the run's report.
    pub fn report_variable(&mut self, name: &'static str, variable: Variable) {
        self.encoded.reports.push((name, Reported::Variable(variable)));
    }

    /// Makes a history one that `--cache` saves and loads; what ends with the frame is none.
    pub fn persist(&mut self, name: &'static str, items: Resource, item_bytes: u64, count: Variable) {
        if !matches!(self.schedule.resource(items).lifetime, Lifetime::History) {
            return;
        }
        self.encoded.persistent.push(Persistent { name, items, item_bytes, count });
    }

    /// Histories that are added to from frame to frame, whatever these show: where [items](Self::persist) of theirs are saved, a later run goes on with all of them.
    pub fn accumulates(&mut self, resources: &[Resource], variables: &[Variable]) {
        self.schedule.accumulated.resources.extend(resources);
        self.schedule.accumulated.variables.extend(variables);
    }

    /// Tells in `explain` what was adapted, and why.
    pub fn remark(&mut self, remark: impl Into<String>) {
        self.encoded.remarks.push(remark.into());
    }

    /// Tells that a parameter, `outer` or `outer.inner`, changes nothing with this scene and these inputs. `because` completes "no effect, as …".
    pub fn idle(&mut self, parameter: &'static str, because: &'static str) {
        self.encoded.idle.push((parameter, because));
    }

    fn resource(&mut self, member: &str, kind: ResourceKind, lifetime: Lifetime) -> Resource {
        self.schedule.resources.push(ResourceDescription { name: format!("{}.{member}", self.node), kind, lifetime });
        Resource(self.schedule.resources.len() as u32 - 1)
    }

    /// A buffer that lives within the frame.
    pub fn buffer(&mut self, member: &str, bytes: u64) -> Resource {
        self.resource(member, ResourceKind::Buffer { bytes: bytes.max(16).next_multiple_of(4) }, Lifetime::Transient)
    }

    /// A buffer that lives on into the next frame.
    pub fn history_buffer(&mut self, member: &str, bytes: u64) -> Resource {
        self.resource(member, ResourceKind::Buffer { bytes: bytes.max(16).next_multiple_of(4) }, Lifetime::History)
    }

    /// Histories that stay when the scene changes: what reads them knows that they are of a scene that was otherwise.
    pub fn survives(&mut self, resources: &[Resource], variables: &[Variable]) {
        self.schedule.survivors.resources.extend(resources);
        self.schedule.survivors.variables.extend(variables);
    }

    /// The same, but only as long as a constant by which they are laid out is as it was.
    pub fn survives_with(&mut self, by: Resource, resources: &[Resource], variables: &[Variable]) {
        self.survives(resources, variables);
        self.schedule.laid_out.push((by, Histories { resources: resources.into(), variables: variables.into() }));
    }

    /// Has frames run ahead of their pictures, for what survives.
    pub fn looks_ahead(&mut self, window: Window) {
        self.schedule.window = Some(window);
    }

    /// The same for items of which the first so many are in use, whatever stands behind them.
    pub fn history_items(&mut self, member: &str, capacity: u32, item_bytes: u64, count: Variable) -> Resource {
        let items = self.history_buffer(member, u64::from(capacity) * item_bytes);
        self.schedule.used.push(Read::counted(items, item_bytes, count));
        items
    }

    /// Histories that are the same where they are made anew, from the scene alone: a sequence that is gone on with later makes them again. All others are kept
    /// for it.
    pub fn remakes(&mut self, resources: &[Resource], variables: &[Variable]) {
        self.schedule.remade.resources.extend(resources);
        self.schedule.remade.variables.extend(variables);
    }

    /// A buffer with contents known now.
    pub fn constant_buffer(&mut self, member: &str, contents: &[u8]) -> Resource {
        let mut contents = contents.to_vec();
        contents.resize(contents.len().next_multiple_of(16).max(16), 0);
        self.resource(member, ResourceKind::Buffer { bytes: contents.len() as u64 }, Lifetime::Constant(contents.into()))
    }

    /// A texture of one layer.
    pub fn image(&mut self, member: &str, size: [u32; 2], format: Format) -> Resource {
        self.texture(member, size, 1, format)
    }

    /// A texture of several layers that lives within the frame.
    pub fn texture(&mut self, member: &str, size: [u32; 2], layers: u32, format: Format) -> Resource {
        self.resource(member, ResourceKind::Texture { size, layers, format }, Lifetime::Transient)
    }

    /// A texture of several layers that lives on into the next frame.
    pub fn history_texture(&mut self, member: &str, size: [u32; 2], layers: u32, format: Format) -> Resource {
        self.resource(member, ResourceKind::Texture { size, layers, format }, Lifetime::History)
    }

    /// A list of draws for a host step to fill.
    pub fn draws(&mut self, member: &str) -> Resource {
        self.resource(member, ResourceKind::Draws, Lifetime::Transient)
    }

    /// Memory of a host step.
    pub fn state(&mut self, member: &str) -> Resource {
        self.resource(member, ResourceKind::State, Lifetime::Transient)
    }

    /// A number that is 0 as the frame and the innermost loop that holds the node start, or lives on as a history.
    pub fn variable(&mut self, member: &str, history: bool) -> Variable {
        self.schedule.variables.push(VariableDescription { name: format!("{}.{member}", self.node), history });
        Variable(self.schedule.variables.len() as u32 - 1)
    }

    /// Data of the scene, for what is not bound by its name alone, such as vertices.
    pub fn scene_data(&mut self, data: SceneData) -> Resource {
        self.declared(ScenePart::Main, data).unwrap_or_else(|| unreachable!("{data:?} is declared before any pass records"))
    }

    /// The same of a [part](crate::scene::Scene::parts) of the scene, by its name. What is bound by name is that of [`Program::of_part`].
    ///
    /// # Errors
    /// A scene without such a part.
    pub fn data_of_part(&self, name: &str, data: SceneData) -> Result<Resource, Refusal> {
        let parts = &self.setting.scene.parts;
        let number = parts.iter().position(|part| part.name == name);
        number.and_then(|number| self.declared(ScenePart::Other(number), data)).ok_or_else(|| {
            let names: Vec<_> = parts.iter().map(|part| part.name.as_str()).collect();
            let help = if names.is_empty() { "the scene has none: see `Stage::with_part`".into() } else { format!("it has: {}", names.join(", ")) };
            Refusal::new("plan::scene_part", format!("the scene has no part `{name}`"), help)
        })
    }

    fn declared(&self, part: ScenePart, data: SceneData) -> Option<Resource> {
        let is_it = |lifetime: &Lifetime| matches!(lifetime, Lifetime::Scene(of, other) if *of == part && other.name() == data.name());
        self.schedule.resources.iter().position(|resource| is_it(&resource.lifetime)).map(|index| Resource(index as u32))
    }

    /// What a resource is made of.
    pub fn kind(&self, resource: Resource) -> &ResourceKind {
        &self.schedule.resource(resource).kind
    }

    /// Adds a command.
    pub fn command(&mut self, command: Command) {
        self.encoded.commands.push(command);
    }

    /// A command for each time that the innermost loop which holds this node starts.
    pub fn before_loop(&mut self, command: Command) {
        self.encoded.prologue.push(command);
    }

    /// All that is added meanwhile is for each time that the innermost loop which holds this node starts.
    pub fn all_before_loop<T>(&mut self, encode: impl FnOnce(&mut Self) -> T) -> T {
        let in_loop = std::mem::take(&mut self.encoded.commands);
        let made = encode(self);
        let before = std::mem::replace(&mut self.encoded.commands, in_loop);
        self.encoded.prologue.extend(before);
        made
    }

    /// A command that makes something of a history from what `key` is a number of: outside loops it runs where that is another than when it ran last. Where the
    /// history [survives](Self::survives) changes of the scene, what they leave as it is stays.
    pub fn kept(&mut self, key: u64, command: Command) {
        self.encoded.keys.0.insert(self.encoded.commands.len(), key);
        self.command(command);
    }

    /// Makes the innermost loop that holds the node run so many rounds, even if no time is left for them.
    pub fn run_at_least(&mut self, rounds: u32) {
        self.encoded.at_least = rounds;
    }

    /// Sets all of a resource to 0.
    pub fn clear(&mut self, resource: Resource) {
        self.command(Command::Clear(resource));
    }

    /// Runs an entry point of a program in so many workgroups.
    pub fn compute(&mut self, program: Program, entry: &'static str, groups: Groups) {
        self.command(Command::Compute(Compute { program, entry, groups }));
    }

    /// One invocation a pixel of an image, in workgroups of 8×8.
    pub fn compute_pixels(&mut self, program: Program, entry: &'static str, [w, h]: [u32; 2]) {
        self.compute(program, entry, Groups::Fixed([w.div_ceil(8), h.div_ceil(8), 1]));
    }

    /// Runs a function on the host, once what it reads is there. `reads` come from the device where that has them, `writes` go there.
    pub fn host(
        &mut self,
        name: &'static str,
        reads: &[Read],
        writes: &[Resource],
        run: impl Fn(&mut dyn HostContext) -> Result<(), String> + Send + Sync + 'static,
    ) {
        self.command(Command::Host(Host::new(name, reads.to_vec(), writes.to_vec(), run)));
    }

    /// The same with dispatches that do what `run` does to `writes` and to variables, for loops that the device drives.
    pub fn twin(
        &mut self,
        name: &'static str,
        reads: &[Read],
        writes: &[Resource],
        run: impl Fn(&mut dyn HostContext) -> Result<(), String> + Send + Sync + 'static,
        twin: Vec<Compute>,
    ) {
        self.command(Command::Host(Host { twin: Some(twin), ..Host::new(name, reads.to_vec(), writes.to_vec(), run) }));
    }
}

impl Read {
    /// All of a buffer.
    pub fn whole(resource: Resource) -> Self {
        Self { resource, counted: None }
    }

    /// The first items of a buffer, so many bytes each.
    pub fn counted(resource: Resource, stride: u64, count: Variable) -> Self {
        Self { resource, counted: Some((stride, count)) }
    }
}

/// Typed access to inputs: the checker has made sure of the kinds.
macro_rules! typed_inputs {
    ($($function:ident: $variant:ident),*) => {
        impl<'a> Encoder<'a> {
            $(
                /// The port of this kind that an input is joined to; None for an optional one that is not there.
                pub fn $function(&self, name: &str) -> Option<&'a super::port::$variant> {
                match self.input(name) {
                    Some(Port::$variant(port)) => Some(port),
                    _ => None,
                }
            })*
        }
    };
}
typed_inputs!(g_buffer: GBuffer, shadow_maps: ShadowMaps, image_port: Image, splats: Splats, requests: Requests, tiles: Tiles, weighted_tiles: WeightedTiles, records: Records, record_cache: RecordCache, irradiance_field: IrradianceField, photon_map: PhotonMap, lightmap: Lightmap, shooters: Shooters, shooter_views: ShooterViews, direct_light: DirectLight, own: Own, lobes: Lobes, visible_lobes: VisibleLobes);

/// Specialises a program to what the scene has: textures, alpha masks, one-sided surfaces.
pub fn scene_constants(program: Program, needs: &Needs) -> Program {
    program
        .constant("TEXTURES", needs.textures as u8)
        .constant("MIPMAPS", needs.mipmaps as u8)
        .constant("NORMAL_MAPS", needs.normal_maps as u8)
        .constant("CHARTS", needs.charts as u8)
        .constant("TANGENTS", needs.tangents as u8)
        .constant("TINTS", needs.tints as u8)
        .constant("ALPHA_MASKS", needs.alpha_masks as u8)
        .constant("ONE_SIDED", needs.one_sided as u8)
        .constant("TWO_SIDES", needs.two_sides as u8)
        .constant("SMOOTH", needs.smooth as u8)
        .constant("EMPTY", (needs.triangles == 0) as u8)
        .constant("GLOSSY", needs.lobes as u8)
        .constant("ANISOTROPIC", needs.anisotropic as u8)
        .constant("SKY_IMAGE", needs.sky_image as u8)
}

/// The shaders' `LIGHTS` where the scene's parameters tell the number.
const ANY_NUMBER: u32 = u32::MAX;

/// The same for a program that computes direct light, with `[area, sky]` samples where the scene has such light.
pub fn light_constants(program: Program, needs: &Needs, samples: [u32; 2]) -> Program {
    scene_constants(program, needs)
        .constant("AREA_SAMPLES", if needs.emissive_triangles > 0 { samples[0] } else { 0 })
        .constant("LIGHTS", needs.punctual_lights.unwrap_or(ANY_NUMBER))
        .constant("LIGHT_KINDS", needs.light_kinds)
        .constant("SKY_SAMPLES", if needs.environment { samples[1] } else { 0 })
        .constant("SUN_SAMPLES", if needs.environment && needs.suns { rays_to_suns(samples[1]) } else { 0 })
}

/// Percentage-closer taps of a lookup, as a node's parameter `taps` says: a square number.
pub fn shadow_taps(arguments: &Arguments) -> Result<u32, Refusal> {
    match arguments.integer("taps") as u32 {
        taps @ (1 | 4 | 9 | 16 | 25) => Ok(taps),
        taps => Err(Refusal::of_parameter("taps", "plan::taps", format!("{taps} taps do not make a square"), "give 4, 9, 16 or 25")),
    }
}

/// Joins shadow maps to a program that looks lights up; shadow rays where there are none.
pub fn bind_visibility(program: Program, maps: Option<&super::port::ShadowMaps>) -> Program {
    let Some(maps) = maps else { return program.import("VISIBILITY", "lib/visibility/rays") };
    let program = program
        .import("VISIBILITY", "lib/visibility/shadow_maps")
        .constant("SHADOW_TAPS", (maps.taps as f64).sqrt())
        .constant("SHADOW_RESOLUTION", maps.resolution)
        .bind("shadow_depth", maps.depth);
    match maps.pitch {
        Some(pitch) => {
            program.import("SHADOW_TEXELS", "lib/visibility/texels_in_buffer").constant("SHADOW_ROWS", maps.resolution).constant("SHADOW_PITCH", pitch)
        }
        None => program.import("SHADOW_TEXELS", "lib/visibility/texels_in_texture"),
    }
}

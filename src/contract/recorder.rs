//! What a pass sees while it records: its arguments and inputs, the scene, and the recording that it adds to.

use super::{Arguments, Port};
use crate::recording::*;
use crate::scene::{Scene, needs::Needs};
use std::collections::BTreeMap;
use std::sync::Arc;

/// What a plan is made for.
#[derive(Clone, Copy)]
pub struct Setting<'a> {
    pub scene: &'a Scene,
    pub needs: &'a Needs,
    /// Width and height of the picture [pixels].
    pub size: [u32; 2],
}

/// Why a pass cannot be recorded with these arguments on this scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Refusal {
    /// `plan::…`
    pub code: &'static str,
    pub message: String,
    /// What to do about it.
    pub help: String,
}

/// Records one node.
pub struct Recorder<'a> {
    pub node: &'a str,
    pub arguments: &'a Arguments,
    pub setting: Setting<'a>,
    inputs: &'a BTreeMap<&'static str, Port>,
    recording: &'a mut Recording,
    recorded: Recorded,
}

/// What a node adds besides resources and variables.
#[derive(Default)]
pub struct Recorded {
    pub outputs: BTreeMap<&'static str, Port>,
    /// Run once a frame, before the loop that holds the node, if one does.
    pub prologue: Vec<Command>,
    pub commands: Vec<Command>,
    /// Remarks for `explain`: what was adapted and why.
    pub remarks: Vec<String>,
    /// Memory to show under a name with `--dump`, besides the ports.
    pub dumps: BTreeMap<&'static str, Resource>,
}

impl<'a> Recorder<'a> {
    pub fn new(node: &'a str, arguments: &'a Arguments, setting: Setting<'a>, inputs: &'a BTreeMap<&'static str, Port>, recording: &'a mut Recording) -> Self {
        Self { node, arguments, setting, inputs, recording, recorded: Recorded::default() }
    }

    pub fn finish(self) -> Recorded {
        self.recorded
    }

    /// The port that an input is joined to; None for an optional one that is not there.
    pub fn input(&self, name: &str) -> Option<&'a Port> {
        self.inputs.get(name)
    }

    pub fn output(&mut self, name: &'static str, port: Port) {
        self.recorded.outputs.insert(name, port);
    }

    pub fn remark(&mut self, remark: impl Into<String>) {
        self.recorded.remarks.push(remark.into());
    }

    fn resource(&mut self, member: &str, kind: ResourceKind, lifetime: Lifetime) -> Resource {
        self.recording.resources.push(ResourceDescription { name: format!("{}.{member}", self.node), kind, lifetime });
        Resource(self.recording.resources.len() as u32 - 1)
    }

    /// A buffer that lives within the frame.
    pub fn buffer(&mut self, member: &str, bytes: u64) -> Resource {
        self.resource(member, ResourceKind::Buffer { bytes: bytes.max(16) }, Lifetime::Transient)
    }

    /// A buffer that lives on into the next frame.
    pub fn history_buffer(&mut self, member: &str, bytes: u64) -> Resource {
        self.resource(member, ResourceKind::Buffer { bytes: bytes.max(16) }, Lifetime::History)
    }

    /// A buffer with contents known now.
    pub fn constant_buffer(&mut self, member: &str, contents: &[u8]) -> Resource {
        let mut contents = contents.to_vec();
        contents.resize(contents.len().next_multiple_of(16).max(16), 0);
        self.resource(member, ResourceKind::Buffer { bytes: contents.len() as u64 }, Lifetime::Constant(contents.into()))
    }

    /// A texture of the picture's size.
    pub fn image(&mut self, member: &str, format: Format) -> Resource {
        self.texture(member, self.setting.size, 1, format)
    }

    pub fn texture(&mut self, member: &str, size: [u32; 2], layers: u32, format: Format) -> Resource {
        self.resource(member, ResourceKind::Texture { size, layers, format }, Lifetime::Transient)
    }

    /// A list of draws for a host step to fill.
    pub fn draws(&mut self, member: &str) -> Resource {
        self.resource(member, ResourceKind::Draws, Lifetime::Transient)
    }

    /// Memory of a host step.
    pub fn state(&mut self, member: &str) -> Resource {
        self.resource(member, ResourceKind::State, Lifetime::Transient)
    }

    /// A number that starts every frame at 0, or lives on as a history.
    pub fn variable(&mut self, member: &str, history: bool) -> Variable {
        self.recording.variables.push(VariableDescription { name: format!("{}.{member}", self.node), history });
        Variable(self.recording.variables.len() as u32 - 1)
    }

    /// A part of the scene, for what is not bound by its name alone, such as vertices.
    pub fn scene_data(&mut self, data: SceneData) -> Resource {
        let found = self.recording.resources.iter().position(|r| matches!(r.lifetime, Lifetime::Scene(d) if d == data));
        found.map(|i| Resource(i as u32)).unwrap_or_else(|| unreachable!("{data:?} is declared before any pass records"))
    }

    pub fn kind(&self, resource: Resource) -> &ResourceKind {
        &self.recording.resource(resource).kind
    }

    pub fn command(&mut self, command: Command) {
        self.recorded.commands.push(command);
    }

    /// A command for the start of the frame, before the loop that holds this node.
    pub fn before_loop(&mut self, command: Command) {
        self.recorded.prologue.push(command);
    }

    pub fn clear(&mut self, resource: Resource) {
        self.command(Command::Clear(resource));
    }

    pub fn compute(&mut self, program: Program, entry: &'static str, groups: Groups) {
        self.command(Command::Compute(Compute { program, entry, groups }));
    }

    /// One invocation a pixel, in workgroups of 8×8.
    pub fn compute_pixels(&mut self, program: Program, entry: &'static str) {
        let [w, h] = self.setting.size;
        self.compute(program, entry, Groups::Fixed([w.div_ceil(8), h.div_ceil(8), 1]));
    }

    pub fn host(
        &mut self,
        name: &'static str,
        reads: &[Read],
        writes: &[Resource],
        run: impl Fn(&mut dyn HostContext) -> Result<(), String> + Send + Sync + 'static,
    ) {
        self.command(Command::Host(Host { name, reads: reads.to_vec(), writes: writes.to_vec(), run: Arc::new(run) }));
    }
}

impl Read {
    pub fn whole(resource: Resource) -> Self {
        Self { resource, counted: None }
    }

    pub fn counted(resource: Resource, stride: u64, count: Variable) -> Self {
        Self { resource, counted: Some((stride, count)) }
    }
}

/// Typed access to inputs: the checker has made sure of the kinds.
macro_rules! typed_inputs {
    ($($function:ident: $variant:ident),*) => {
        impl<'a> Recorder<'a> {
            $(pub fn $function(&self, name: &str) -> Option<&'a super::port::$variant> {
                match self.input(name) {
                    Some(Port::$variant(port)) => Some(port),
                    _ => None,
                }
            })*
        }
    };
}
typed_inputs!(g_buffer: GBuffer, shadow_maps: ShadowMaps, image_port: Image, splats: Splats, requests: Requests, tiles: Tiles, weighted_tiles: WeightedTiles, records: Records, record_cache: RecordCache);

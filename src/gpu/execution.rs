//! Runs a recording: allocates what it declares, builds every shader pipeline once, then executes frames.

use super::clock::{Clock, Rounds};
use super::copies::{Copies, HostCopy};
use super::device::{Gpu, GpuError};
use super::limits::{self, Granted};
use super::programs::{Ready, layer_views};
use super::shaders::Shaders;
use super::timing::Timing;
use super::{readback, scene as scene_data};
use crate::recording::*;
use crate::scene::{Camera, Scene, bvh::Bvh};
use glam::Vec4;
use serde::Serialize;
use std::any::Any;
use std::collections::{HashMap, HashSet};
use std::time::{Duration, Instant};

/// A recording made ready on a device. History resources live as long as the session.
pub struct Session<'a> {
    pub(super) gpu: &'a Gpu,
    scene: &'a Scene,
    extent: f32,
    bvh: &'a Bvh,
    pub(super) recording: &'a Recording,
    physical: Vec<Physical>,
    /// Commands of each node, in the order of [`Recording::nodes`].
    pub(super) programs: Vec<Vec<Ready>>,
    pub(super) variables: Vec<u32>,
    /// What each variable was before it became 0, or is.
    pub(super) latest: Vec<u32>,
    lists: HashMap<Resource, Vec<Draw>>,
    states: HashMap<Resource, Option<Box<dyn Any + Send>>>,
    staging: HashMap<Resource, wgpu::Buffer>,
    copies: Copies,
    /// What host steps hand to each other, or to their next round.
    shared: HashSet<Resource>,
    pub(super) timing: Option<Timing>,
    pub(super) nodes: Vec<NodeTimes>,
    camera: (Camera, [u32; 2]),
    frames: u32,
    clock: Clock,
    /// Whether the time of the frame is limited.
    is_timed: bool,
    /// Whether a loop of the frame has ended early, as its time was up or its rounds led nowhere.
    is_cut: bool,
    /// Whether the innermost loop ends with the round that it is in.
    pub(super) is_last_round: bool,
    /// Why loops end that have work left, by the variables that end them.
    pub(super) cut_short: HashMap<Variable, Shortfall>,
    /// Rounds of loops that the device drove, when they ran last, by the variables that count them.
    pub(super) rounds_before: HashMap<Variable, u32>,
    /// How often the host waited in this frame for what the device made.
    pub(super) waits: u32,
    /// Bytes of all buffers and textures.
    pub gpu_bytes: u64,
}

/// What a frame took.
#[derive(Debug, Clone)]
pub struct Frame {
    pub seconds: f64,
    pub nodes: Vec<NodeTimes>,
    /// Rounds of the loops that run until they are done.
    pub fill_rounds: Option<u32>,
    /// How often the host waited, before the frame's end, for what the device made.
    pub waits: u32,
    /// Loops that ended before they were done.
    pub unfinished: Vec<Unfinished>,
}

/// A loop that ended before it was done.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Unfinished {
    #[serde(rename = "loop")]
    pub name: String,
    pub because: Shortfall,
    /// Whether work is left for sure. If not, the loop could do no more and did not look whether it had to.
    #[serde(skip)]
    pub is_certain: bool,
}

#[derive(Debug, Clone, Default, PartialEq)]
pub struct NodeTimes {
    pub node: String,
    pub pass: &'static str,
    /// None where the adapter has no timestamps.
    pub gpu_ms: Option<f64>,
    /// Time in host steps, waiting for what they read included.
    pub cpu_ms: f64,
    pub runs: u32,
}

enum Physical {
    Buffer(wgpu::Buffer),
    Texture {
        texture: wgpu::Texture,
        format: Format,
    },
    Host,
    /// Declared but touched by no command.
    Unused,
}

/// Commands recorded but not yet submitted.
pub(super) struct Pending {
    pub encoder: wgpu::CommandEncoder,
    pub empty: bool,
}

impl<'a> Session<'a> {
    /// Allocates, uploads the scene and builds all shader pipelines. What the placement keeps alive to the end can be
    /// read after a frame.
    pub fn new(
        gpu: &'a Gpu,
        scene: &'a Scene,
        bvh: &'a Bvh,
        recording: &'a Recording,
        placement: &Placement,
        camera: &Camera,
        size: [u32; 2],
    ) -> Result<Self, GpuError> {
        let shaders = Shaders::load(recording)?;
        limits::hold_shaders(recording, &shaders, &Granted { limits: &gpu.limits, features: gpu.features, adapter: &gpu.adapter.name })?;
        let mut session = Self {
            gpu,
            scene,
            extent: scene.extent(),
            bvh,
            recording,
            physical: Vec::new(),
            programs: Vec::new(),
            variables: vec![0; recording.variables.len()],
            latest: vec![0; recording.variables.len()],
            lists: HashMap::new(),
            states: HashMap::new(),
            staging: HashMap::new(),
            copies: Copies::new(placement),
            shared: shared(recording),
            timing: Timing::new(gpu, recording.nodes().len()),
            nodes: Vec::new(),
            camera: (camera.clone(), size),
            frames: 0,
            clock: Clock::new(),
            is_timed: false,
            is_cut: false,
            is_last_round: false,
            cut_short: HashMap::new(),
            rounds_before: HashMap::new(),
            waits: 0,
            gpu_bytes: 0,
        };
        session.allocate(placement)?;
        session.programs = session.prepare_all(&shaders)?;
        session.nodes = recording.nodes().into_iter().map(|node| NodeTimes { node: node.name.clone(), pass: node.pass, ..Default::default() }).collect();
        Ok(session)
    }

    fn allocate(&mut self, placement: &Placement) -> Result<(), GpuError> {
        let name = |slot: usize| placement.slots.iter().zip(&self.recording.resources).find(|(of, _)| **of == Some(slot as u32)).map_or("", |(_, r)| &r.name);
        let names: Vec<&str> = (0..placement.allocations.len()).map(name).collect();
        let shared = placement.allocations.iter().zip(names).map(|(kind, name)| self.create(name, kind)).collect::<Result<Vec<_>, _>>()?;
        for (index, description) in self.recording.resources.iter().enumerate() {
            let physical = match (&description.lifetime, &description.kind) {
                (_, ResourceKind::Draws | ResourceKind::State) => Physical::Host,
                (Lifetime::Scene(data), kind) => self.upload(&description.name, kind, &scene_data::bytes(self.scene, self.bvh, *data))?,
                (Lifetime::Constant(contents), kind) => self.upload(&description.name, kind, contents)?,
                (Lifetime::History | Lifetime::Frame | Lifetime::Variables, kind) => self.create(&description.name, kind)?,
                (Lifetime::Transient, _) => match placement.slots[index] {
                    Some(slot) => shared[slot as usize].share(),
                    None => Physical::Unused,
                },
            };
            self.physical.push(physical);
        }
        self.gpu.check("uploading the scene")
    }

    fn create(&mut self, label: &str, kind: &ResourceKind) -> Result<Physical, GpuError> {
        self.gpu_bytes += kind.bytes();
        let physical = match kind {
            ResourceKind::Buffer { bytes } => {
                let usage = wgpu::BufferUsages::STORAGE
                    | wgpu::BufferUsages::UNIFORM
                    | wgpu::BufferUsages::VERTEX
                    | wgpu::BufferUsages::INDEX
                    | wgpu::BufferUsages::INDIRECT
                    | wgpu::BufferUsages::COPY_DST
                    | wgpu::BufferUsages::COPY_SRC;
                Physical::Buffer(self.gpu.device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size: *bytes, usage, mapped_at_creation: false }))
            }
            ResourceKind::Texture { size, layers, format } => {
                Physical::Texture { texture: self.create_texture(label, *size, *layers, *format), format: *format }
            }
            ResourceKind::Draws | ResourceKind::State => Physical::Host,
        };
        self.gpu.check(&format!("allocating `{label}`"))?;
        Ok(physical)
    }

    fn create_texture(&self, label: &str, size: [u32; 2], layers: u32, format: Format) -> wgpu::Texture {
        let mut usage =
            wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC | wgpu::TextureUsages::COPY_DST;
        if format != Format::Depth32Float {
            usage |= wgpu::TextureUsages::STORAGE_BINDING;
        }
        self.gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: texture_format(format),
            usage,
            view_formats: &[],
        })
    }

    fn upload(&mut self, label: &str, kind: &ResourceKind, bytes: &[u8]) -> Result<Physical, GpuError> {
        let physical = self.create(label, kind)?;
        match &physical {
            Physical::Buffer(buffer) => self.gpu.queue.write_buffer(buffer, 0, bytes),
            Physical::Texture { texture, format } => self.write_texture(texture, *format, &bytes[..kind.bytes() as usize]),
            Physical::Host | Physical::Unused => {}
        }
        Ok(physical)
    }

    pub(super) fn buffer(&self, resource: Resource) -> &wgpu::Buffer {
        match &self.physical[resource.0 as usize] {
            Physical::Buffer(buffer) => buffer,
            _ => unreachable!("{} is not a buffer", self.recording.resource(resource).name),
        }
    }

    pub(super) fn texture(&self, resource: Resource) -> (&wgpu::Texture, Format) {
        match &self.physical[resource.0 as usize] {
            Physical::Texture { texture, format } => (texture, *format),
            _ => unreachable!("{} is not a texture", self.recording.resource(resource).name),
        }
    }
}

/// What becomes of a frame that is under way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pace {
    GoOn,
    /// So much time is left to the frame: its loops end in time for what comes after them.
    Within(Duration),
    /// The frame is given up.
    Stop,
}

/// Asked as each round of a loop starts.
pub type AskPace<'k> = &'k dyn Fn() -> Pace;

impl<'a> Session<'a> {
    /// Changes the camera for the frames to come; the size stays.
    pub fn set_camera(&mut self, camera: &Camera) {
        self.camera.0 = camera.clone();
    }

    /// Runs another recording from the next frame on, with the histories as they are: one that differs in contents of constants,
    /// host functions and bounds of loops at most.
    pub fn follow(&mut self, recording: &'a Recording) -> Result<(), GpuError> {
        if let Some(what) = self.recording.difference(recording) {
            return Err(GpuError::OtherRecording { what });
        }
        for (index, (before, after)) in self.recording.resources.iter().zip(&recording.resources).enumerate() {
            if let (Lifetime::Constant(before), Lifetime::Constant(after)) = (&before.lifetime, &after.lifetime)
                && before != after
            {
                self.write(Resource(index as u32), after);
            }
        }
        self.recording = recording;
        Ok(())
    }

    /// As before the first frame: histories are zero, frames count from 0 again. Returns once the device has done it.
    pub fn forget(&mut self) -> Result<(), GpuError> {
        let recording = self.recording;
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        for (physical, description) in self.physical.iter().zip(&recording.resources) {
            match physical {
                _ if !matches!(description.lifetime, Lifetime::History) => {}
                Physical::Buffer(buffer) => encoder.clear_buffer(buffer, 0, None),
                Physical::Texture { texture, format } => layer_views(texture).iter().for_each(|layer| clear_texture(&mut encoder, layer, *format)),
                Physical::Host | Physical::Unused => {}
            }
        }
        self.gpu.queue.submit([encoder.finish()]);
        self.copies.forget(|resource| matches!(recording.resource(resource).lifetime, Lifetime::History));
        self.variables.fill(0);
        self.frames = 0;
        self.gpu.wait("emptying histories")
    }

    /// Value of a variable after the last frame.
    pub fn variable(&self, variable: Variable) -> u32 {
        self.variables[variable.0 as usize]
    }

    /// The last value of a variable in the last frame that was not 0, if there was one: how many items the last round left that
    /// worked on any.
    pub fn latest(&self, variable: Variable) -> u32 {
        self.latest[variable.0 as usize]
    }

    pub fn set_variable(&mut self, variable: Variable, value: u32) {
        self.variables[variable.0 as usize] = value;
    }

    /// Contents of a buffer, or of a texture as rows without padding.
    pub fn read(&self, resource: Resource) -> Result<Vec<u8>, GpuError> {
        self.reader().look(resource, <[u8]>::to_vec)
    }

    /// To read one resource after the other.
    pub fn reader(&self) -> Reader<'_> {
        Reader { session: self, staging: None, contents: Vec::new() }
    }

    /// Overwrites the start of a buffer.
    pub fn write(&mut self, resource: Resource, bytes: &[u8]) {
        self.upload_ahead(resource);
        self.copies.forget(|other| other == resource);
        self.gpu.queue.write_buffer(self.buffer(resource), 0, bytes);
    }

    /// Runs the recording once.
    pub fn frame(&mut self, pace: AskPace) -> Result<Frame, GpuError> {
        let start = Instant::now();
        self.start_frame();
        let recording = self.recording;
        let mut pending = self.pending();
        let mut frame = Frame { seconds: 0.0, nodes: Vec::new(), fill_rounds: None, waits: 0, unfinished: Vec::new() };
        let result = self.run(&recording.steps, 0, &mut pending, &mut frame, pace);
        // Also of a frame that is given up: what its variables count must be there.
        self.submit(&mut pending);
        result?;
        self.gpu.wait("finishing the frame")?;
        self.collect_times(&mut frame)?;
        frame.seconds = start.elapsed().as_secs_f64();
        frame.waits = self.waits;
        self.frames += 1;
        Ok(frame)
    }

    fn start_frame(&mut self) {
        for (variable, description) in self.variables.iter_mut().zip(&self.recording.variables) {
            if !description.history {
                *variable = 0;
            }
        }
        (self.clock, self.is_timed, self.waits) = (Clock::new(), false, 0);
        (self.is_cut, self.is_last_round) = (false, false);
        self.latest.clone_from(&self.variables);
        self.lists.clear();
        self.states.clear();
        let recording = self.recording;
        self.copies.forget(|resource| matches!(recording.resource(resource).lifetime, Lifetime::Transient));
        for node in &mut self.nodes {
            (node.gpu_ms, node.cpu_ms, node.runs) = (None, 0.0, 0);
        }
        let camera = scene_data::camera(&self.camera.0, self.camera.1, self.extent, self.frames);
        for (index, resource) in self.recording.resources.iter().enumerate() {
            if matches!(resource.lifetime, Lifetime::Frame) {
                self.write(Resource(index as u32), bytemuck::bytes_of(&camera));
            }
        }
    }

    fn collect_times(&mut self, frame: &mut Frame) -> Result<(), GpuError> {
        frame.nodes = self.nodes.clone();
        if let Some(timing) = &mut self.timing {
            timing.collect(self.gpu)?;
            for (node, ms) in frame.nodes.iter_mut().zip(timing.take()) {
                node.gpu_ms = Some(ms);
            }
        }
        frame.nodes = merge(std::mem::take(&mut frame.nodes));
        Ok(())
    }

    /// Runs steps whose first node has the index `first`; returns the index after the last.
    fn run(&mut self, steps: &[Step], first: usize, pending: &mut Pending, frame: &mut Frame, pace: AskPace) -> Result<usize, GpuError> {
        let mut index = first;
        for step in steps {
            match step {
                Step::Node(node) => {
                    self.run_node(node, index, pending)?;
                    index += 1;
                }
                Step::Repeat(repeat) => index = self.run_loop(repeat, index, pending, frame, pace)?,
            }
        }
        Ok(index)
    }

    fn run_loop(&mut self, repeat: &Repeat, first: usize, pending: &mut Pending, frame: &mut Frame, pace: AskPace) -> Result<usize, GpuError> {
        if let (Driver::Device { sizes }, Pace::GoOn) = (repeat.driver, pace()) {
            return self.run_ahead(repeat, sizes, first, pending, frame, pace);
        }
        // A node for the device alone.
        let skipped = usize::from(repeat.driver != Driver::Host);
        let (steps, first) = (&repeat.steps[skipped..], first + skipped);
        let mut next = first;
        let (mut rounds, mut pacing) = (0, Rounds::default());
        let outer = self.is_last_round;
        let is_done = |session: &Self, rounds| repeat.until.map_or(rounds == repeat.at_most, |until| session.variable(until) != 0);
        if let Some(until) = repeat.until {
            self.set_variable(until, 0);
            self.cut_short.remove(&until);
        }
        while !is_done(self, rounds) && rounds < repeat.at_most {
            let is_over = match pace() {
                Pace::GoOn => false,
                Pace::Within(left) => {
                    self.is_timed = true;
                    pacing.are_over(&mut self.clock, left, &repeat.time) && self.may_end(&repeat.time, rounds)
                }
                Pace::Stop => return Err(GpuError::Interrupted),
            };
            self.is_cut |= is_over;
            self.set_variable(repeat.round, rounds);
            // A loop of so many rounds has nothing to leave for later ones; one with an end to reach must not.
            self.is_last_round = is_over || (repeat.until.is_some() && rounds + 1 == repeat.at_most);
            next = self.run(steps, first, pending, frame, pace)?;
            rounds += 1;
            if is_over {
                break;
            }
        }
        self.end_loop(repeat, rounds, is_done(self, rounds), frame);
        self.is_last_round = outer;
        Ok(next)
    }

    /// Tells of a loop that ended after so many rounds.
    pub(super) fn end_loop(&mut self, repeat: &Repeat, rounds: u32, is_done: bool, frame: &mut Frame) {
        let shortfall = self.shortfall(repeat, rounds, is_done);
        self.is_cut |= shortfall.as_ref().is_some_and(|short| short.because == Shortfall::NoProgress);
        frame.unfinished.extend(shortfall);
        if repeat.until.is_some() {
            *frame.fill_rounds.get_or_insert(0) += rounds;
        }
    }

    /// Whether a loop has made enough for the picture to be made of it, after so many rounds.
    fn may_end(&self, time: &TimeShare, rounds: u32) -> bool {
        rounds >= time.at_least && time.records.is_none_or(|records| self.variable(records) > 0)
    }

    /// Why a loop ended that was not done after so many rounds, or may not have been.
    fn shortfall(&self, repeat: &Repeat, rounds: u32, is_done: bool) -> Option<Unfinished> {
        let bound = if rounds < repeat.at_most { Shortfall::Time } else { Shortfall::Rounds };
        let told = repeat.until.and_then(|until| self.cut_short.get(&until).copied());
        let because = told.or_else(|| (!is_done || self.is_last_round).then_some(bound))?;
        Some(Unfinished { name: repeat.name.clone(), because, is_certain: !is_done || because == Shortfall::NoProgress })
    }

    fn run_node(&mut self, node: &Node, index: usize, pending: &mut Pending) -> Result<(), GpuError> {
        self.nodes[index].runs += 1;
        let mut open = false;
        for (position, command) in node.commands.iter().enumerate() {
            if matches!(command, Command::Late(_)) && !self.is_cut {
                continue;
            }
            if let Command::Host(host) | Command::Late(host) = command {
                self.end_timing(&mut open, pending)?;
                let start = Instant::now();
                self.run_host(host, node, pending)?;
                self.nodes[index].cpu_ms += start.elapsed().as_secs_f64() * 1e3;
            } else {
                self.catch_up_all(command, pending);
                self.begin_timing(&mut open, index, pending)?;
                self.encode(command, index, position, pending);
                pending.empty = false;
            }
        }
        self.end_timing(&mut open, pending)?;
        Ok(())
    }

    pub(super) fn begin_timing(&mut self, open: &mut bool, index: usize, pending: &mut Pending) -> Result<(), GpuError> {
        if *open {
            return Ok(());
        }
        if self.timing.as_ref().is_some_and(Timing::is_full) {
            self.submit(pending);
        }
        if let Some(timing) = &mut self.timing {
            if timing.is_full() {
                timing.collect(self.gpu)?;
            }
            timing.begin(&mut pending.encoder, index);
            *open = true;
        }
        Ok(())
    }

    pub(super) fn end_timing(&mut self, open: &mut bool, pending: &mut Pending) -> Result<(), GpuError> {
        if !std::mem::replace(open, false) {
            return Ok(());
        }
        if self.timing.as_ref().is_some_and(Timing::waits) {
            self.submit(pending);
            self.gpu.wait("running a node")?;
        }
        if let Some(timing) = &mut self.timing {
            timing.end(&mut pending.encoder);
        }
        Ok(())
    }

    fn pending(&self) -> Pending {
        Pending { encoder: self.gpu.device.create_command_encoder(&Default::default()), empty: true }
    }

    pub(super) fn submit(&self, pending: &mut Pending) {
        let encoder = std::mem::replace(pending, self.pending()).encoder;
        self.gpu.queue.submit([encoder.finish()]);
    }

    fn encode(&self, command: &Command, index: usize, position: usize, pending: &mut Pending) {
        let encoder = &mut pending.encoder;
        match (command, &self.programs[index][position]) {
            (Command::Clear(resource), Ready::Plain) => encoder.clear_buffer(self.buffer(*resource), 0, None),
            (Command::Clear(_), Ready::Clear { layers, format }) => layers.iter().for_each(|layer| clear_texture(encoder, layer, *format)),
            (Command::Copy { from, to }, Ready::Plain) => self.encode_copy(*from, *to, encoder),
            (Command::Unroll { from, to, offset }, Ready::Plain) => {
                let (texture, format) = self.texture(*from);
                readback::copy_texture(encoder, texture, format, self.buffer(*to), *offset);
            }
            (Command::Compute(compute), Ready::Compute(dispatches)) => {
                let [x, y, z] = self.workgroups(compute.groups);
                if x * y * z > 0 {
                    dispatches.iter().for_each(|dispatch| dispatch.begin(encoder).dispatch_workgroups(x, y, z));
                }
            }
            (Command::Raster(raster), ready) => self.encode_raster(raster, ready, None, encoder),
            _ => unreachable!("commands are prepared as what they are"),
        }
    }

    fn encode_copy(&self, from: Resource, to: Resource, encoder: &mut wgpu::CommandEncoder) {
        match self.recording.resource(to).kind {
            ResourceKind::Texture { .. } => {
                let (from, to) = (self.texture(from).0, self.texture(to).0);
                encoder.copy_texture_to_texture(from.as_image_copy(), to.as_image_copy(), to.size());
            }
            // An allocation may be larger than the resource that it is lent to.
            _ => encoder.copy_buffer_to_buffer(self.buffer(from), 0, self.buffer(to), 0, self.recording.resource(to).kind.bytes()),
        }
    }

    fn workgroups(&self, groups: Groups) -> [u32; 3] {
        match groups {
            Groups::Fixed(groups) => groups,
            Groups::Counted { count, divisor, per } => {
                let total = self.variable(count).div_ceil(divisor) * per;
                let limit = self.gpu.limits.max_compute_workgroups_per_dimension;
                [total.min(limit), total.div_ceil(limit), 1]
            }
        }
    }

    /// Draws what the command says, or what a buffer says from an offset on.
    pub(super) fn encode_raster(&self, raster: &Raster, ready: &Ready, sized: Option<(&wgpu::Buffer, u64)>, encoder: &mut wgpu::CommandEncoder) {
        let Ready::Raster { pipeline, groups, colours, depth } = ready else { unreachable!("commands are prepared as what they are") };
        let attachments: Vec<_> = raster
            .colours
            .iter()
            .zip(colours)
            .map(|(target, view)| {
                let load = target.clear.map_or(wgpu::LoadOp::Load, |[r, g, b, a]| wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a }));
                Some(wgpu::RenderPassColorAttachment {
                    view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations { load, store: wgpu::StoreOp::Store },
                })
            })
            .collect();
        let depth = depth.as_ref().map(|view| wgpu::RenderPassDepthStencilAttachment {
            view,
            depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Store }),
            stencil_ops: None,
        });
        let mut pass =
            encoder.begin_render_pass(&wgpu::RenderPassDescriptor { color_attachments: &attachments, depth_stencil_attachment: depth, ..Default::default() });
        pass.set_pipeline(pipeline);
        groups.iter().for_each(|(group, bound)| pass.set_bind_group(*group, bound, &[]));
        if let Some(vertices) = raster.vertices {
            pass.set_vertex_buffer(0, self.buffer(vertices).slice(..));
        }
        if let Some(instances) = raster.instances {
            pass.set_vertex_buffer(1, self.buffer(instances).slice(..));
        }
        if let Some(indices) = raster.indices {
            pass.set_index_buffer(self.buffer(indices).slice(..), wgpu::IndexFormat::Uint32);
        }
        if let Some((sizes, offset)) = sized {
            return pass.draw_indirect(sizes, offset);
        }
        match &raster.draws {
            Draws::Fixed(draws) => encode_draws(&mut pass, draws),
            Draws::Listed(list) => encode_draws(&mut pass, self.lists.get(list).map_or(&[], Vec::as_slice)),
            Draws::Instances { vertices, count } => {
                let count = self.variable(*count);
                if count > 0 {
                    pass.draw(0..*vertices, 0..count);
                }
            }
        }
    }

    fn run_host(&mut self, host: &Host, node: &Node, pending: &mut Pending) -> Result<(), GpuError> {
        let failed = |reason: String| GpuError::HostStep { node: node.name.clone(), reason };
        let contents = self.read_back(host, pending)?;
        // What is written must reach the device after the commands before this step and before those after it.
        if !host.writes.is_empty() && !pending.empty {
            self.submit(pending);
        }
        let (mut lists, mut states, mut variables) = (std::mem::take(&mut self.lists), std::mem::take(&mut self.states), std::mem::take(&mut self.variables));
        let (mut latest, mut copies) = (std::mem::take(&mut self.latest), std::mem::take(&mut self.copies));
        let mut cut_short = std::mem::take(&mut self.cut_short);
        let mut view = HostView {
            session: self,
            contents,
            copies: &mut copies,
            lists: &mut lists,
            states: &mut states,
            variables: &mut variables,
            latest: &mut latest,
            cut_short: &mut cut_short,
        };
        let result = (host.run)(&mut view);
        (self.lists, self.states, self.variables) = (lists, states, variables);
        (self.latest, self.copies, self.cut_short) = (latest, copies, cut_short);
        result.map_err(failed)
    }

    /// What a host step reads: bytes of each resource, and the contents of those that it shares with no other.
    fn read_back(&mut self, host: &Host, pending: &mut Pending) -> Result<HashMap<Resource, Contents>, GpuError> {
        let mut contents = HashMap::new();
        let mut copies = Vec::new();
        for read in &host.reads {
            let wanted = self.wanted_bytes(*read);
            let is_known = self.copies.get(read.resource).is_some_and(|copy| copy.known(wanted).is_some());
            let is_shared = is_known || self.shared.contains(&read.resource);
            contents.insert(read.resource, Contents { bytes: wanted, own: (!is_shared).then(HostCopy::default) });
            if !is_known && wanted > 0 {
                self.catch_up(read.resource, pending);
                let staging = self.kept_staging(read.resource);
                copies.push((*read, self.copy_out(pending, *read, &staging), staging));
            }
        }
        if !copies.is_empty() {
            self.waits += 1;
            self.submit(pending);
        }
        for (read, bytes, staging) in copies {
            let own = contents.get_mut(&read.resource).and_then(|contents| contents.own.as_mut());
            let mut copies = std::mem::take(&mut self.copies);
            let copy = own.unwrap_or_else(|| copies.entry(read.resource));
            let result = copy.look(self.wanted_bytes(read), |into| self.finish_read(read, &staging, bytes, into));
            self.copies = copies;
            result?;
        }
        Ok(contents)
    }

    /// Brings to the device what a command may look at; the host takes it for changed by the command.
    pub(super) fn catch_up_all(&mut self, command: &Command, pending: &mut Pending) {
        for resource in command.resources() {
            self.catch_up(resource, pending);
            self.copies.forget(|other| other == resource);
        }
    }

    /// Brings to the device what the host alone has of a resource, after the commands so far: they may look at another that has the same memory.
    fn catch_up(&mut self, resource: Resource, pending: &mut Pending) {
        if self.copies.get(resource).is_some_and(|copy| copy.ahead().is_some()) {
            if !pending.empty {
                self.submit(pending);
            }
            self.upload_ahead(resource);
            self.copies.entry(resource).caught_up();
        }
    }

    fn upload_ahead(&self, resource: Resource) {
        let Some((offset, bytes)) = self.copies.get(resource).and_then(HostCopy::ahead) else { return };
        match &self.physical[resource.0 as usize] {
            Physical::Buffer(buffer) => self.gpu.queue.write_buffer(buffer, offset as u64, &padded(bytes)),
            Physical::Texture { texture, format } => self.write_texture(texture, *format, bytes),
            Physical::Host | Physical::Unused => {}
        }
    }

    fn write_texture(&self, texture: &wgpu::Texture, format: Format, rows: &[u8]) {
        let row = (texture.width() as u64 * format.bytes()) as u32;
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: Some(texture.height()) };
        self.gpu.queue.write_texture(texture.as_image_copy(), rows, layout, texture.size());
    }

    /// Bytes of a resource, rows of a texture without padding.
    fn unpadded_bytes(&self, resource: Resource) -> usize {
        self.recording.resource(resource).kind.bytes() as usize
    }

    fn wanted_bytes(&self, read: Read) -> usize {
        let whole = self.unpadded_bytes(read.resource);
        read.counted.map_or(whole, |(stride, count)| (stride as usize * self.variable(count) as usize).min(whole))
    }

    /// Bytes of a resource read back whole, rows of a texture padded.
    fn whole_bytes(&self, resource: Resource) -> u64 {
        match &self.physical[resource.0 as usize] {
            Physical::Texture { texture, format } => format.row_bytes(texture.width()) * texture.height() as u64 * texture.depth_or_array_layers() as u64,
            _ => self.buffer(resource).size(),
        }
    }

    /// The staging buffer that host steps read a resource through, made once.
    pub(super) fn kept_staging(&mut self, resource: Resource) -> wgpu::Buffer {
        let whole = self.whole_bytes(resource);
        let gpu = self.gpu;
        self.staging.entry(resource).or_insert_with(|| readback::staging(gpu, whole)).clone()
    }

    /// Encodes the copy of what is read; its bytes.
    pub(super) fn copy_out(&self, pending: &mut Pending, read: Read, staging: &wgpu::Buffer) -> u64 {
        let whole = self.whole_bytes(read.resource);
        let bytes = read.counted.map_or(whole, |(stride, count)| (stride * self.variable(count) as u64).min(whole)).next_multiple_of(4);
        match &self.physical[read.resource.0 as usize] {
            Physical::Texture { texture, format } => readback::copy_texture(&mut pending.encoder, texture, *format, staging, 0),
            _ if bytes > 0 => pending.encoder.copy_buffer_to_buffer(self.buffer(read.resource), 0, staging, 0, bytes),
            _ => {}
        }
        bytes
    }

    fn finish_read(&self, read: Read, staging: &wgpu::Buffer, bytes: u64, into: &mut [u8]) -> Result<(), GpuError> {
        if bytes == 0 {
            return Ok(());
        }
        readback::look(self.gpu, staging, bytes, |contents| match &self.physical[read.resource.0 as usize] {
            Physical::Texture { texture, format } => readback::unpad(contents, texture.width(), *format, into),
            _ => into.copy_from_slice(&contents[..into.len()]),
        })
    }
}

/// Reads resources between frames, all through the same memory.
pub struct Reader<'s> {
    session: &'s Session<'s>,
    staging: Option<wgpu::Buffer>,
    contents: Vec<u8>,
}

impl Reader<'_> {
    /// Looks at the contents of a buffer, or of a texture as rows without padding: where they lie, if they have none there.
    pub fn look<T>(&mut self, resource: Resource, look: impl FnOnce(&[u8]) -> T) -> Result<T, GpuError> {
        let (session, unpadded) = (self.session, self.session.unpadded_bytes(resource));
        if let Some(known) = session.copies.get(resource).and_then(|copy| copy.known(unpadded)) {
            return Ok(look(known));
        }
        session.upload_ahead(resource);
        let whole = session.whole_bytes(resource);
        let kept = self.staging.take().filter(|staging| staging.size() >= whole);
        let staging = kept.unwrap_or_else(|| readback::staging(session.gpu, whole));
        let (mut pending, read) = (session.pending(), Read::whole(resource));
        let bytes = session.copy_out(&mut pending, read, &staging);
        session.submit(&mut pending);
        let seen = if bytes == unpadded as u64 && bytes > 0 {
            readback::look(session.gpu, &staging, bytes, look)?
        } else {
            self.contents.resize(unpadded, 0);
            session.finish_read(read, &staging, bytes, &mut self.contents)?;
            look(&self.contents)
        };
        self.staging = Some(staging);
        Ok(seen)
    }
}

/// Writes to buffers come in fours of bytes.
fn padded(bytes: &[u8]) -> std::borrow::Cow<'_, [u8]> {
    if bytes.len().is_multiple_of(4) {
        return bytes.into();
    }
    let mut padded = bytes.to_vec();
    padded.resize(bytes.len().next_multiple_of(4), 0);
    padded.into()
}

/// What host steps hand to each other or to their next round: what more than one of them touches, one in a loop, or one that changes it in place.
fn shared(recording: &Recording) -> HashSet<Resource> {
    let (mut once, mut shared) = (HashSet::new(), HashSet::new());
    share(&recording.steps, false, &mut once, &mut shared);
    shared
}

fn share(steps: &[Step], in_loop: bool, once: &mut HashSet<Resource>, shared: &mut HashSet<Resource>) {
    for step in steps {
        let node = match step {
            Step::Repeat(repeat) => {
                share(&repeat.steps, true, once, shared);
                continue;
            }
            Step::Node(node) => node,
        };
        for command in &node.commands {
            if let Command::Host(host) = command {
                let touched = host.reads.iter().map(|read| read.resource).chain(host.writes.iter().copied());
                shared.extend(touched.filter(|resource| !once.insert(*resource) || in_loop));
            }
        }
    }
}

/// Of a resource that a host step reads.
struct Contents {
    bytes: usize,
    /// None where they are among the session's copies.
    own: Option<HostCopy>,
}

fn encode_draws(pass: &mut wgpu::RenderPass<'_>, draws: &[Draw]) {
    let mut current = None;
    for draw in draws {
        if let (Some([x, y, w, h]), true) = (draw.rectangle, draw.rectangle != current) {
            pass.set_viewport(x as f32, y as f32, w as f32, h as f32, 0.0, 1.0);
            pass.set_scissor_rect(x, y, w, h);
            current = draw.rectangle;
        }
        let ([first, end], [first_instance, end_instance]) = (draw.vertices, draw.instances);
        if draw.is_indexed {
            pass.draw_indexed(first..end, 0, first_instance..end_instance);
        } else {
            pass.draw(first..end, first_instance..end_instance);
        }
    }
}

fn clear_texture(encoder: &mut wgpu::CommandEncoder, layer: &wgpu::TextureView, format: Format) {
    let is_depth = format == Format::Depth32Float;
    let ops = wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT), store: wgpu::StoreOp::Store };
    let colours = [Some(wgpu::RenderPassColorAttachment { view: layer, depth_slice: None, resolve_target: None, ops })];
    let depth_ops = Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Store });
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        color_attachments: if is_depth { &[] } else { &colours },
        depth_stencil_attachment: is_depth.then_some(wgpu::RenderPassDepthStencilAttachment { view: layer, depth_ops, stencil_ops: None }),
        ..Default::default()
    });
}

/// A node in a loop may have a part before the loop: one entry for both.
fn merge(nodes: Vec<NodeTimes>) -> Vec<NodeTimes> {
    let mut merged: Vec<NodeTimes> = Vec::new();
    for node in nodes {
        match merged.iter_mut().find(|m| m.node == node.node) {
            Some(into) => {
                into.gpu_ms = into.gpu_ms.zip(node.gpu_ms).map(|(a, b)| a + b);
                into.cpu_ms += node.cpu_ms;
                into.runs = into.runs.max(node.runs);
            }
            None => merged.push(node),
        }
    }
    merged
}

/// What a host step sees.
struct HostView<'s, 'a> {
    session: &'s Session<'a>,
    contents: HashMap<Resource, Contents>,
    copies: &'s mut Copies,
    lists: &'s mut HashMap<Resource, Vec<Draw>>,
    states: &'s mut HashMap<Resource, Option<Box<dyn Any + Send>>>,
    variables: &'s mut Vec<u32>,
    latest: &'s mut Vec<u32>,
    cut_short: &'s mut HashMap<Variable, Shortfall>,
}

impl HostContext for HostView<'_, '_> {
    fn read(&self, resource: Resource) -> &[u8] {
        let nothing: &[Vec4] = &[];
        let Some(contents) = self.contents.get(&resource) else { return bytemuck::cast_slice(nothing) };
        let copy = contents.own.as_ref().or_else(|| self.copies.get(resource));
        copy.and_then(|copy| copy.known(contents.bytes)).unwrap_or(bytemuck::cast_slice(nothing))
    }

    fn write(&mut self, resource: Resource, offset: u64, bytes: &[u8]) {
        let is_kept = self.session.shared.contains(&resource) || self.copies.get(resource).is_some();
        if !is_kept || !self.copies.entry(resource).write(offset as usize, bytes) {
            self.session.gpu.queue.write_buffer(self.session.buffer(resource), offset, bytes);
        }
    }

    fn take(&mut self, resource: Resource) -> Vec<Vec4> {
        self.copies.entry(resource).take(self.session.unpadded_bytes(resource))
    }

    fn put(&mut self, resource: Resource, contents: Vec<Vec4>, bytes: u64) {
        self.copies.entry(resource).put(contents, (bytes as usize).min(self.session.unpadded_bytes(resource)));
    }

    fn variable(&self, variable: Variable) -> u32 {
        self.variables[variable.0 as usize]
    }

    fn set(&mut self, variable: Variable, value: u32) {
        self.variables[variable.0 as usize] = value;
        if value != 0 {
            self.latest[variable.0 as usize] = value;
        }
    }

    fn draws(&mut self, resource: Resource) -> &mut Vec<Draw> {
        self.lists.entry(resource).or_default()
    }

    fn state(&mut self, resource: Resource) -> &mut Option<Box<dyn Any + Send>> {
        self.states.entry(resource).or_default()
    }

    fn is_last_round(&self) -> bool {
        self.session.is_last_round
    }

    fn is_timed(&self) -> bool {
        self.session.is_timed
    }

    fn cut_short(&mut self, until: Variable, because: Shortfall) {
        self.cut_short.insert(until, because);
    }

    fn scene(&self) -> &Scene {
        self.session.scene
    }

    fn bvh(&self) -> &Bvh {
        self.session.bvh
    }

    fn extent(&self) -> f32 {
        self.session.extent
    }

    fn camera(&self) -> (&Camera, [u32; 2]) {
        (&self.session.camera.0, self.session.camera.1)
    }
}

impl Physical {
    fn share(&self) -> Self {
        match self {
            Self::Buffer(buffer) => Self::Buffer(buffer.clone()),
            Self::Texture { texture, format } => Self::Texture { texture: texture.clone(), format: *format },
            Self::Host => Self::Host,
            Self::Unused => Self::Unused,
        }
    }
}

pub(super) fn texture_format(format: Format) -> wgpu::TextureFormat {
    match format {
        Format::R32Float => wgpu::TextureFormat::R32Float,
        Format::R32Uint => wgpu::TextureFormat::R32Uint,
        Format::Rgba16Float => wgpu::TextureFormat::Rgba16Float,
        Format::Rgba32Float => wgpu::TextureFormat::Rgba32Float,
        Format::Depth32Float => wgpu::TextureFormat::Depth32Float,
    }
}

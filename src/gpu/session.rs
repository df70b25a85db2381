//! A schedule made ready on a device: its memory, its shader pipelines, and where it stands.

use super::clock::Clock;
use super::copies::Copies;
use super::device::{Gpu, GpuError};
use super::encode::clear_texture;
use super::frame::NodeTimes;
use super::host::shared;
use super::limits::{self, Granted};
use super::memory::Physical;
use super::programs::{Ready, layer_views};
use super::scene::{self, Upload};
use super::shaders::Shaders;
use super::speculation::{self, Speculation};
use super::timing::Timing;
use super::views::{View, Views};
use crate::scene::{
    Camera,
    stage::{Change, Changed, Motion, Pose, Stage, Unchangeable},
};
use crate::schedule::*;
use std::any::Any;
use std::collections::{HashMap, HashSet};
use std::iter;
use std::sync::{Arc, OnceLock};

/// A schedule made ready on a device. History resources live as long as the session.
pub struct Session {
    pub(super) gpu: Arc<Gpu>,
    pub(super) stage: Arc<Stage>,
    /// Of the scene, and of each of its parts.
    pub(super) uploads: Vec<Upload>,
    pub(super) schedule: Arc<Schedule>,
    pub(super) physical: Vec<Physical>,
    /// Commands of each node, in the order of [`Schedule::nodes`].
    pub(super) programs: Vec<Vec<Ready>>,
    pub(super) variables: Vec<u32>,
    /// What each variable was before it became 0, or is.
    pub(super) latest: Vec<u32>,
    pub(super) lists: HashMap<Resource, Vec<Draw>>,
    pub(super) states: HashMap<Resource, Option<Box<dyn Any + Send + Sync>>>,
    pub(super) staging: HashMap<Resource, wgpu::Buffer>,
    /// For looks at the variables, as many as were under way at once.
    pub(super) idle_staging: Vec<wgpu::Buffer>,
    pub(super) copies: Copies,
    /// What host steps hand to each other, or to their next round.
    pub(super) shared: HashSet<Resource>,
    pub(super) timing: Option<Timing>,
    pub(super) nodes: Vec<NodeTimes>,
    /// What commands made last whose outcome lives on, by the places of nodes and commands.
    pub(super) made: HashMap<(usize, usize), u64>,
    pub(super) camera: (Camera, [u32; 2]),
    pub(super) views: Views,
    /// How the movers were in the frame that ran before, and what they have done since: looked up where it is asked for.
    before: Vec<Pose>,
    motions: OnceLock<Vec<Motion>>,
    /// Of the frame that is under way, or comes next.
    pub(super) lapse: Lapse,
    pub(super) frames: u32,
    pub(super) clock: Clock,
    /// Whether the time of the frame is limited.
    pub(super) is_timed: bool,
    /// Whether a loop of the frame has ended early, as its time was up or its rounds led nowhere.
    pub(super) is_cut: bool,
    /// Whether the innermost loop ends with the round that it is in.
    pub(super) is_last_round: bool,
    /// Why loops end that have work left, by the variables that end them.
    pub(super) cut_short: HashMap<Variable, Shortfall>,
    /// Rounds of loops that the device drove, when they ran last, by the variables that count them.
    pub(super) rounds_before: HashMap<Variable, u32>,
    /// How often the host waited in this frame for what the device made.
    pub(super) waits: u32,
    /// Whether a frame like the one before may be taken to be like it.
    pub(super) may_speculate: bool,
    /// Whether the last frame's loops came to their ends, and nothing was changed from outside since.
    pub(super) is_still: bool,
    /// Constants that plans have changed since the scene has changed last.
    overwritten: Vec<Resource>,
    pub(super) speculation: Option<Speculation>,
    /// Whether a frame has begun that has not come to an end.
    pub(super) is_under_way: bool,
    /// Bytes of all buffers and textures.
    pub gpu_bytes: u64,
}

/// A stage, and those of its parts.
fn stages(stage: &Stage) -> impl Iterator<Item = &Stage> {
    iter::once(stage).chain(stage.scene.parts.iter().map(|part| &*part.stage))
}

/// The place of a part's among them.
fn number(part: ScenePart) -> usize {
    match part {
        ScenePart::Main => 0,
        ScenePart::Other(number) => number + 1,
    }
}

impl Session {
    /// Allocates, uploads the scene and builds all shader pipelines. What the placement keeps alive to the end can be
    /// read after a frame.
    pub async fn new(
        gpu: &Arc<Gpu>,
        stage: &Arc<Stage>,
        schedule: &Arc<Schedule>,
        placement: &Placement,
        camera: &Camera,
        size: [u32; 2],
    ) -> Result<Self, GpuError> {
        gpu.told("making a pipeline ready", async { Self::made_ready((gpu, stage), schedule, placement, camera, size) }).await
    }

    fn made_ready(
        (gpu, stage): (&Arc<Gpu>, &Arc<Stage>),
        schedule: &Arc<Schedule>,
        placement: &Placement,
        camera: &Camera,
        size: [u32; 2],
    ) -> Result<Self, GpuError> {
        let shaders = Shaders::load(schedule)?;
        limits::hold_shaders(schedule, &shaders, &Granted { limits: &gpu.limits, features: gpu.features, adapter: &gpu.adapter.name })?;
        let mut session = Self {
            gpu: gpu.clone(),
            stage: stage.clone(),
            uploads: stages(stage).map(Upload::new).collect(),
            schedule: schedule.clone(),
            physical: Vec::new(),
            programs: Vec::new(),
            variables: vec![0; schedule.variables.len()],
            latest: vec![0; schedule.variables.len()],
            lists: HashMap::new(),
            states: HashMap::new(),
            staging: HashMap::new(),
            idle_staging: Vec::new(),
            copies: Copies::new(placement),
            shared: shared(schedule),
            timing: Timing::new(gpu, schedule.nodes().len()),
            nodes: Vec::new(),
            made: HashMap::new(),
            camera: (camera.clone(), size),
            views: Views::default(),
            before: Vec::new(),
            motions: OnceLock::new(),
            lapse: Lapse::NEXT,
            frames: 0,
            clock: Clock::new(),
            is_timed: false,
            is_cut: false,
            is_last_round: false,
            cut_short: HashMap::new(),
            rounds_before: HashMap::new(),
            waits: 0,
            may_speculate: speculation::is_possible(schedule, &shaders),
            is_still: false,
            overwritten: Vec::new(),
            speculation: None,
            is_under_way: false,
            gpu_bytes: 0,
        };
        session.allocate(placement)?;
        session.programs = session.prepare_all(&shaders)?;
        session.nodes = schedule.nodes().into_iter().map(|node| NodeTimes { node: node.name.clone(), pass: node.pass, ..Default::default() }).collect();
        Ok(session)
    }

    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    pub fn camera(&self) -> &Camera {
        &self.camera.0
    }

    /// Takes over what the picture before was a view of, and how the next lies to it.
    pub fn remember_views(&mut self, of: &Self) {
        (self.views, self.lapse) = (of.views.untold(), of.lapse);
    }

    /// Changes the camera for the frames to come; the size stays.
    pub fn set_camera(&mut self, camera: &Camera) {
        self.is_still &= self.camera.0 == *camera;
        self.camera.0 = camera.clone();
    }

    /// Has the next frame take for granted that nothing has changed since the last, which it makes sure of at its end: for tests of that.
    pub fn assume_still(&mut self) {
        self.is_still = true;
    }

    /// Runs another schedule from the next frame on, with the histories as they are: one that differs in contents of constants,
    /// host functions and bounds of loops at most.
    pub fn switch_to(&mut self, schedule: &Arc<Schedule>) -> Result<(), GpuError> {
        if let Some(what) = self.schedule.difference(schedule) {
            return Err(GpuError::OtherRecording { what });
        }
        let before = std::mem::replace(&mut self.schedule, schedule.clone());
        for (index, (before, after)) in before.resources.iter().zip(&schedule.resources).enumerate() {
            if let (Lifetime::Constant(before), Lifetime::Constant(after)) = (&before.lifetime, &after.lifetime)
                && before != after
            {
                self.overwrite(Resource(index as u32), after);
                self.overwritten.push(Resource(index as u32));
            }
        }
        self.is_still = false;
        Ok(())
    }

    pub fn stage(&self) -> &Arc<Stage> {
        &self.stage
    }

    fn stage_of(&self, part: ScenePart) -> &Stage {
        stages(&self.stage).nth(number(part)).unwrap_or(&self.stage)
    }

    pub(super) fn scene_bytes(&self, part: ScenePart, data: SceneData) -> Vec<u8> {
        self.uploads[number(part)].bytes(self.stage_of(part), data)
    }

    /// Tells the device where the camera and the movers are, and were in the picture before.
    pub(super) fn tell_views(&mut self) {
        let (schedule, stage) = (self.schedule.clone(), self.stage.clone());
        let poses = stage.poses();
        (self.before, self.motions) = (self.views.pass(poses.clone()), OnceLock::new());
        let (before, moves) = self.views.begin(View { camera: self.camera.0.clone(), poses });
        let camera = scene::camera((&self.camera.0, &before.camera), self.camera.1, &stage, self.frames);
        for (resource, description) in (0..).map(Resource).zip(&schedule.resources) {
            match description.lifetime {
                Lifetime::Frame => self.overwrite(resource, bytemuck::bytes_of(&camera)),
                Lifetime::Scene(part, SceneData::Movers) if moves => self.overwrite(resource, &scene::movers(self.stage_of(part), &before.poses)),
                _ => {}
            }
        }
    }

    /// What movers have done since the frame that ran before.
    pub(super) fn motions(&self) -> &[Motion] {
        self.motions.get_or_init(|| self.stage.motions(&self.before))
    }

    /// Changes the scene on the host. Another that has the stage keeps it as it was.
    pub fn change(&mut self, changes: &[Change]) -> Result<Changed, Unchangeable> {
        Arc::make_mut(&mut self.stage).change(changes)
    }

    /// Tells the device what has changed of a scene whose parts are as large as they were, and starts anew: what was gathered was of another scene.
    pub async fn follow(&mut self, changed: &Changed) -> Result<(), GpuError> {
        let gpu = self.gpu.clone();
        let changing = async {
            let packs_anew: Vec<bool> = self.uploads.iter_mut().zip(stages(&self.stage)).map(|(upload, stage)| upload.follow(stage, changed)).collect();
            let schedule = self.schedule.clone();
            for (resource, description) in (0..).map(Resource).zip(&schedule.resources) {
                let Lifetime::Scene(part, data) = description.lifetime else { continue };
                let patches = match data {
                    SceneData::Tables | SceneData::AlbedoTables if packs_anew[number(part)] => vec![(0, self.scene_bytes(part, data))],
                    _ => self.uploads[number(part)].patches(self.stage_of(part), changed, data),
                };
                self.copies.invalidate(|other| other == resource);
                patches.iter().for_each(|(offset, bytes)| self.put(&self.physical[resource.0 as usize], *offset, bytes));
            }
            self.forget().await
        };
        gpu.told("changing the scene", changing).await
    }

    /// Takes the first bytes of a buffer over from another session of the same device.
    pub fn copy_from(&mut self, to: Resource, from: (&mut Self, Resource), bytes: u64) {
        let (other, from) = from;
        other.upload_ahead(from);
        self.upload_ahead(to);
        self.copies.invalidate(|resource| resource == to);
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(other.buffer(from), 0, self.buffer(to), 0, bytes);
        self.gpu.queue.submit([encoder.finish()]);
        self.is_still = false;
    }

    /// As before the first frame: histories are zero, frames count from 0 again. Returns once the device has done it.
    pub async fn reset(&mut self) -> Result<(), GpuError> {
        self.made.clear();
        self.lapse = Lapse::NEXT;
        self.empty(&Histories::default()).await
    }

    /// The same but for what survives a change of the scene.
    async fn forget(&mut self) -> Result<(), GpuError> {
        let overwritten = std::mem::take(&mut self.overwritten);
        self.empty(&self.schedule.survivors_of(&overwritten)).await
    }

    async fn empty(&mut self, kept: &Histories) -> Result<(), GpuError> {
        let schedule = self.schedule.clone();
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        for ((physical, description), number) in self.physical.iter().zip(&schedule.resources).zip(0..) {
            match physical {
                _ if !matches!(description.lifetime, Lifetime::History) || kept.resources.contains(&Resource(number)) => {}
                Physical::Buffer(buffer) => encoder.clear_buffer(buffer, 0, None),
                Physical::Texture { texture, format } => layer_views(texture).iter().for_each(|layer| clear_texture(&mut encoder, layer, *format)),
                Physical::Host | Physical::Unused => {}
            }
        }
        self.gpu.queue.submit([encoder.finish()]);
        self.copies.invalidate(|resource| matches!(schedule.resource(resource).lifetime, Lifetime::History) && !kept.resources.contains(&resource));
        (0..).map(Variable).zip(&mut self.variables).filter(|(variable, _)| !kept.variables.contains(variable)).for_each(|(_, value)| *value = 0);
        self.rounds_before.clear();
        self.is_still = false;
        self.frames = 0;
        self.gpu.wait("emptying histories").await
    }

    /// Value of a variable after the last frame.
    pub fn variable(&self, variable: Variable) -> u32 {
        let value = self.variables[variable.0 as usize];
        self.speculation.iter().for_each(|speculation| speculation.note_read(variable, value));
        value
    }

    /// The last value of a variable in the last frame that was not 0, if there was one: how many items the last round left that
    /// worked on any.
    pub fn latest(&self, variable: Variable) -> u32 {
        self.latest[variable.0 as usize]
    }

    pub fn set_variable(&mut self, variable: Variable, value: u32) {
        self.is_still = false;
        self.assign(variable, value);
    }

    pub(super) fn assign(&mut self, variable: Variable, value: u32) {
        self.variables[variable.0 as usize] = value;
        self.speculation.iter().for_each(|speculation| speculation.note_set(variable));
    }

    /// An image as it lies on the device. What the host alone has of it is brought there first.
    pub fn image(&mut self, resource: Resource) -> &wgpu::Texture {
        self.upload_ahead(resource);
        self.texture(resource).0
    }

    /// Overwrites the start of a buffer.
    pub fn write(&mut self, resource: Resource, bytes: &[u8]) {
        self.is_still = false;
        self.overwrite(resource, bytes);
    }

    pub(super) fn overwrite(&mut self, resource: Resource, bytes: &[u8]) {
        self.upload_ahead(resource);
        self.copies.invalidate(|other| other == resource);
        self.gpu.queue.write_buffer(self.buffer(resource), 0, bytes);
    }
}

//! hemisplat inside other programs: on a device of their own, with pictures that stay there, and with passes of theirs beside those that ship.

use crate::contract::{Pass, encoder::Setting, tables::Remembered};
use crate::gpu::{Gpu, GpuError, device::faster, scene::kinds};
use crate::measure::run::Run;
pub use crate::measure::run::{ChangeError, Renewed, RunError};
use crate::passes::REGISTRY;
use crate::pipeline::{Pipeline, Plan, Problems, ReadFile, load, plan};
use crate::scene::{
    Camera,
    stage::{Change, Stage},
};
use std::sync::Arc;

/// A device, and the passes that pipelines may name.
///
/// Stages, plans and runs are handles of their own: they live as long as anyone has them, and a run keeps what it was made from.
pub struct Engine {
    gpu: Arc<Gpu>,
    passes: Vec<&'static dyn Pass>,
    /// What planning takes long to make, for plans to come.
    tables: Remembered,
}

impl Engine {
    /// On a device that the engine opens: the adapter that `WGPU_ADAPTER_NAME` names, otherwise the fastest kind there is.
    ///
    /// # Errors
    /// Where there is none.
    pub async fn open() -> Result<Self, GpuError> {
        Ok(Self::of(Gpu::open().await?))
    }

    /// The features of wgpu that make frames faster, as far as an adapter has them: a program opens its device with these.
    pub fn features(adapter: &wgpu::Adapter) -> wgpu::Features {
        faster(adapter)
    }

    /// On a device of the caller's, whatever else that does. What the driver complains about while the engine works is told by the engine; the handlers of the
    /// device stay the caller's.
    ///
    /// # Errors
    /// Where it has less than WebGPU promises.
    pub fn on(adapter: &wgpu::Adapter, device: wgpu::Device, queue: wgpu::Queue) -> Result<Self, GpuError> {
        Ok(Self::of(Gpu::lent(adapter, device, queue)?))
    }

    fn of(gpu: Arc<Gpu>) -> Self {
        Self { gpu, passes: REGISTRY.to_vec(), tables: Remembered::default() }
    }

    /// With a pass of the caller's beside those that ship; one of the same name takes its place.
    #[must_use]
    pub fn with(mut self, pass: &'static dyn Pass) -> Self {
        self.passes.retain(|other| other.description().name != pass.description().name);
        self.passes.push(pass);
        self
    }

    /// The device.
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// Reads a pipeline: `name` is one that ships or what `read_file` reads; each of `sets` is `NODE.PARAM=VALUE`.
    ///
    /// # Errors
    /// All root causes at once.
    pub fn pipeline(&self, name: &str, sets: &[String], read_file: &mut ReadFile<'_>) -> Result<Pipeline, Problems> {
        load(name, sets, &self.passes, read_file)
    }

    /// Plans a pipeline for a scene and a picture of so many pixels.
    ///
    /// # Errors
    /// What the passes refuse, all at once.
    pub fn plan(&self, pipeline: &Pipeline, stage: &Stage, size: [u32; 2]) -> Result<Arc<Plan>, Problems> {
        let (scene, needs) = (&stage.scene, stage.needs());
        let setting = Setting { scene, needs, device: self.gpu.adapter.device(), size, tables: Some(&self.tables) };
        plan(pipeline, setting, &[], &kinds(stage))
    }

    /// Makes a plan ready: allocates, uploads the scene and builds the shaders. Frames of a run share its records.
    ///
    /// # Errors
    /// What the device says.
    pub async fn run(&self, stage: &Arc<Stage>, plan: &Arc<Plan>, camera: &Camera, size: [u32; 2]) -> Result<Run, RunError> {
        Run::new(&self.gpu, stage, plan, camera, size).await
    }

    /// Changes the scene of a run of a pipeline, for the frames to come. Records are forgotten, as they are of another scene; memory and shaders stay where they
    /// do for the scene as it is now. Where they do not, all is made anew, and that is what is told.
    ///
    /// A run has a scene to itself from its first change on: others that share the stage keep it as it was.
    ///
    /// # Errors
    /// What cannot change so, and what the passes refuse: then all is as it was. What the device says.
    pub async fn change(&self, run: &mut Run, pipeline: &Pipeline, changes: &[Change]) -> Result<Renewed, ChangeError> {
        run.renew(changes, |run| self.plan(pipeline, run.stage(), run.size())).await
    }

    /// Goes on with pictures of another size. Records stay.
    ///
    /// # Errors
    /// What the passes refuse, and what the device says: then all is as it was.
    pub async fn resize(&self, run: &mut Run, pipeline: &Pipeline, size: [u32; 2]) -> Result<(), ChangeError> {
        let plan = self.plan(pipeline, run.stage(), size)?;
        Ok(run.resize(size, &plan).await?)
    }
}

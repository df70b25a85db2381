//! Adapters and devices.

use crate::schedule::Device;
use miette::Diagnostic;
use std::sync::{Arc, Mutex, OnceLock};
use thiserror::Error;

/// What helps where memory or a limit does not suffice.
const SMALLER: &str = "make the picture, the shadow maps, the batch of the fill or the scene smaller; lights need no maps where a pipeline has no ShadowMap";

/// What can go wrong between the program and the driver.
#[derive(Debug, Error, Diagnostic)]
pub enum GpuError {
    #[error("no usable GPU adapter was found")]
    #[diagnostic(
        code(gpu::no_adapter),
        help(
            "install a Vulkan driver; without a GPU, Debian's packages mesa-vulkan-drivers and libvulkan1 bring a software one. A driver that is there may not load under `ulimit -v`"
        )
    )]
    NoAdapter,
    #[error("no adapter is called `{name}`, which WGPU_ADAPTER_NAME asks for")]
    #[diagnostic(code(gpu::unknown_adapter), help("the adapters: {known}"))]
    UnknownAdapter { name: String, known: String },
    #[error("the adapter {adapter} lacks {feature}")]
    #[diagnostic(code(gpu::missing_feature), help("choose another adapter with WGPU_ADAPTER_NAME (see `hemisplat adapters`), or {way}"))]
    MissingFeature { adapter: String, feature: String, way: String },
    #[error("the adapter {adapter} refused to open a device: {reason}")]
    #[diagnostic(code(gpu::no_device))]
    NoDevice { adapter: String, reason: String },
    #[error("`{what}` needs {wanted} {unit}; the adapter's limit is {limit}")]
    #[diagnostic(code(gpu::limit), help("{SMALLER}"))]
    Limit { what: String, unit: &'static str, wanted: u64, limit: u64 },
    #[error("the driver ran out of memory while {doing}")]
    #[diagnostic(code(gpu::out_of_memory), help("{SMALLER}"))]
    OutOfMemory { doing: String },
    #[error("the device was lost while {doing}: {reason}")]
    #[diagnostic(code(gpu::lost))]
    Lost { doing: String, reason: String },
    #[error("the driver reported an error while {doing}: {reason}")]
    #[diagnostic(code(gpu::driver))]
    Driver { doing: String, reason: String },
    #[error("the shader {shader} is not valid: {reason}")]
    #[diagnostic(code(gpu::shader))]
    Shader { shader: String, reason: String },
    #[error("{node}: {reason}")]
    #[diagnostic(code(gpu::host_step))]
    HostStep { node: String, reason: String },
    #[error("the session cannot go on with another schedule: {what}")]
    #[diagnostic(code(gpu::other_recording))]
    OtherRecording { what: String },
    #[error("interrupted")]
    #[diagnostic(code(gpu::interrupted))]
    Interrupted,
}

/// An adapter as `hemisplat adapters` lists it.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Adapter {
    pub name: String,
    pub backend: String,
    pub driver: String,
    /// "discrete", "integrated", "virtual", "software" or "other".
    pub kind: &'static str,
    /// What pipelines need and it lacks; empty for a usable one.
    pub lacks: Vec<String>,
    /// Whether it blends into images of 32-bit floats.
    #[serde(skip)]
    pub blends: bool,
    #[serde(skip)]
    pub limits: wgpu::Limits,
    #[serde(skip)]
    pub features: wgpu::Features,
}

/// An open device.
pub struct Gpu {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    pub adapter: Adapter,
    pub limits: wgpu::Limits,
    pub features: wgpu::Features,
    /// Nanoseconds a timestamp tick; None where the adapter has no timestamps.
    pub tick: Option<f32>,
    errors: Arc<Mutex<Vec<wgpu::Error>>>,
    lost: Arc<Mutex<Option<String>>>,
}

/// What is made use of where it is there; no pipeline needs it but one that says `by: RasterBlend`.
const WANTED: wgpu::Features = wgpu::Features::FLOAT32_BLENDABLE
    .union(wgpu::Features::TIMESTAMP_QUERY)
    .union(wgpu::Features::TIMESTAMP_QUERY_INSIDE_ENCODERS)
    .union(wgpu::Features::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES);

/// All adapters that the machine shows, the one that [`Gpu::open`] takes first.
pub fn adapters() -> Vec<Adapter> {
    let instance = instance();
    let mut adapters: Vec<_> = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY)).iter().map(describe).collect();
    adapters.sort_by_key(rank);
    adapters
}

/// What [`Gpu::open`] would open; None where there is nothing.
pub fn expected_adapter() -> Option<&'static Adapter> {
    static FOUND: OnceLock<Option<Adapter>> = OnceLock::new();
    let wanted = wanted();
    FOUND.get_or_init(|| adapters().into_iter().find(|adapter| is_wanted(&adapter.name, wanted.as_deref()))).as_ref()
}

/// What [`Gpu::open`] would run shaders on, without opening it; hardware where there is nothing.
pub fn expected_device() -> Device {
    expected_adapter().map_or(Device::ABLE, Adapter::device)
}

/// What `WGPU_ADAPTER_NAME` asks for.
fn wanted() -> Option<String> {
    std::env::var("WGPU_ADAPTER_NAME").ok()
}

fn is_wanted(name: &str, wanted: Option<&str>) -> bool {
    wanted.is_none_or(|wanted| name.to_lowercase().contains(&wanted.to_lowercase()))
}

impl Adapter {
    pub fn device(&self) -> Device {
        Device { is_software: self.kind == "software", blends: self.blends }
    }
}

/// Usable ones first, then the faster kinds.
fn rank(adapter: &Adapter) -> (bool, Option<usize>) {
    let kind = ["discrete", "integrated", "virtual", "software", "other"].iter().position(|k| *k == adapter.kind);
    (!adapter.lacks.is_empty(), kind)
}

/// The program's only one, for as long as it runs: where a driver's library is unloaded, threads that have used it crash as they end.
fn instance() -> &'static wgpu::Instance {
    static INSTANCE: OnceLock<wgpu::Instance> = OnceLock::new();
    INSTANCE.get_or_init(new_instance)
}

fn new_instance() -> wgpu::Instance {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
    descriptor.backends &= wgpu::Backends::PRIMARY;
    descriptor.flags = wgpu::InstanceFlags::from_env_or_default() & !wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL;
    wgpu::Instance::new(descriptor)
}

fn describe(adapter: &wgpu::Adapter) -> Adapter {
    let info = adapter.get_info();
    let kind = match info.device_type {
        wgpu::DeviceType::DiscreteGpu => "discrete",
        wgpu::DeviceType::IntegratedGpu => "integrated",
        wgpu::DeviceType::VirtualGpu => "virtual",
        wgpu::DeviceType::Cpu => "software",
        wgpu::DeviceType::Other => "other",
    };
    let limits = adapter.limits();
    let mut lacks = Vec::new();
    if !adapter.get_downlevel_capabilities().is_webgpu_compliant() {
        lacks.push("WebGPU compliance".to_string());
    }
    wgpu::Limits::default().check_limits_with_fail_fn(&limits, false, |name, promised, granted| {
        lacks.push(format!("{name} of {promised}, which WebGPU promises (it has {granted})"));
    });
    Adapter {
        name: info.name,
        backend: info.backend.to_string(),
        driver: format!("{} {}", info.driver, info.driver_info).trim().into(),
        kind,
        lacks,
        limits,
        features: adapter.features(),
        blends: adapter.features().contains(wgpu::Features::FLOAT32_BLENDABLE),
    }
}

impl Gpu {
    /// Opens the adapter that `WGPU_ADAPTER_NAME` names, otherwise the fastest kind there is.
    pub fn open() -> Result<Self, GpuError> {
        pollster::block_on(Self::open_async())
    }

    async fn open_async() -> Result<Self, GpuError> {
        let instance = instance();
        let all = instance.enumerate_adapters(wgpu::Backends::PRIMARY).await;
        let known: Vec<String> = all.iter().map(|adapter| adapter.get_info().name).collect();
        let wanted = wanted();
        let found = all.into_iter().filter(|adapter| is_wanted(&adapter.get_info().name, wanted.as_deref()));
        let mut found: Vec<_> = found.map(|adapter| (describe(&adapter), adapter)).collect();
        found.sort_by_key(|(description, _)| rank(description));
        let Some((description, adapter)) = found.into_iter().next() else {
            return Err(wanted.filter(|_| !known.is_empty()).map_or(GpuError::NoAdapter, |name| GpuError::UnknownAdapter { name, known: known.join(", ") }));
        };
        if let Some(feature) = description.lacks.first() {
            return Err(GpuError::MissingFeature { adapter: description.name, feature: feature.clone(), way: "update its driver".into() });
        }
        Self::open_adapter(adapter, description).await
    }

    async fn open_adapter(adapter: wgpu::Adapter, description: Adapter) -> Result<Self, GpuError> {
        let features = adapter.features() & WANTED;
        let limits = adapter.limits();
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("hemisplat"),
            required_features: features,
            required_limits: limits.clone(),
            experimental_features: wgpu::ExperimentalFeatures::disabled(),
            memory_hints: wgpu::MemoryHints::MemoryUsage,
            trace: wgpu::Trace::Off,
        };
        let refused = |e: wgpu::RequestDeviceError| GpuError::NoDevice { adapter: description.name.clone(), reason: e.to_string() };
        let (device, queue) = adapter.request_device(&descriptor).await.map_err(refused)?;
        let (errors, lost) = (Arc::new(Mutex::new(Vec::new())), Arc::new(Mutex::new(None)));
        let sink = errors.clone();
        device.on_uncaptured_error(Arc::new(move |error| {
            if let Ok(mut errors) = sink.lock() {
                errors.push(error);
            }
        }));
        let sink = lost.clone();
        device.set_device_lost_callback(move |_, reason| {
            if let Ok(mut lost) = sink.lock() {
                *lost = Some(reason);
            }
        });
        let timed = features.contains(wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::TIMESTAMP_QUERY_INSIDE_ENCODERS);
        let tick = timed.then(|| queue.get_timestamp_period());
        Ok(Self { device, queue, adapter: description, limits, features, tick, errors, lost })
    }

    /// Reports what the driver complained about since the last call.
    pub fn check(&self, doing: &str) -> Result<(), GpuError> {
        if let Some(reason) = self.lost.lock().ok().and_then(|mut l| l.take()) {
            return Err(GpuError::Lost { doing: doing.into(), reason });
        }
        let first = self.errors.lock().ok().and_then(|mut e| (!e.is_empty()).then(|| e.remove(0)));
        match first {
            None => Ok(()),
            Some(wgpu::Error::OutOfMemory { .. }) => Err(GpuError::OutOfMemory { doing: doing.into() }),
            Some(error) => Err(GpuError::Driver { doing: doing.into(), reason: error.to_string() }),
        }
    }

    /// Waits until the device has done all that was submitted.
    pub fn wait(&self, doing: &str) -> Result<(), GpuError> {
        self.wait_for(doing, None)
    }

    /// Waits until the device has done what was submitted up to a submission; all of it where none is given.
    pub fn wait_for(&self, doing: &str, submission: Option<wgpu::SubmissionIndex>) -> Result<(), GpuError> {
        let polled = self.device.poll(wgpu::PollType::Wait { submission_index: submission, timeout: None });
        self.check(doing)?;
        polled.map(|_| ()).map_err(|e| GpuError::Driver { doing: doing.into(), reason: e.to_string() })
    }
}

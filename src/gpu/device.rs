//! Adapters and devices.

use super::pipelines::Earlier;
use crate::schedule::Device;
use futures_channel::oneshot;
use miette::Diagnostic;
use std::future::poll_fn;
use std::pin::pin;
use std::sync::{
    Arc, Mutex,
    atomic::{AtomicU64, Ordering},
};
use thiserror::Error;

/// What helps where memory or a limit does not suffice.
const SMALLER: &str = "make the picture, the shadow maps, the batch of the fill or the scene smaller; lights need no maps where a pipeline has no ShadowMap";

/// What can go wrong between the program and the driver.
#[derive(Debug, Error, Diagnostic)]
#[expect(missing_docs, reason = "the messages say it")]
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
    /// As its driver calls it.
    pub name: String,
    /// Such as "vulkan".
    pub backend: String,
    /// Its name and version.
    pub driver: String,
    /// "discrete", "integrated", "virtual", "software" or "other".
    pub kind: &'static str,
    /// What pipelines need and it lacks; empty for a usable one.
    pub lacks: Vec<String>,
    /// Whether it blends into images of 32-bit floats.
    #[serde(skip)]
    pub blends: bool,
    /// What it grants.
    #[serde(skip)]
    pub limits: wgpu::Limits,
    /// What it can do.
    #[serde(skip)]
    pub features: wgpu::Features,
}

/// An open device.
pub struct Gpu {
    /// That of wgpu.
    pub device: wgpu::Device,
    /// That of wgpu.
    pub queue: wgpu::Queue,
    /// What it was opened on.
    pub adapter: Adapter,
    /// Those that it was opened with.
    pub limits: wgpu::Limits,
    /// Those that it was opened with.
    pub features: wgpu::Features,
    /// Nanoseconds a timestamp tick; None where the adapter has no timestamps.
    pub tick: Option<f32>,
    complaints: Arc<Mutex<Vec<Complaint>>>,
    lost: Arc<Mutex<Option<String>>>,
    /// Whether errors are told by scopes: where the device is another program's, which looks after errors of its own, and in a browser, which tells them late.
    has_scopes: bool,
    pub(super) to_host: AtomicU64,
    pub(super) earlier: Earlier,
}

/// What a driver said, as a value that any thread may have.
enum Complaint {
    OutOfMemory,
    Other(String),
}

/// With what records are splatted by blending, which is faster; no pipeline needs it but one that says `by: RasterBlend`.
const FASTER: wgpu::Features = wgpu::Features::FLOAT32_BLENDABLE.union(wgpu::Features::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES);

/// What is made use of where it is there, to measure times, too.
const WANTED: wgpu::Features = FASTER.union(wgpu::Features::TIMESTAMP_QUERY).union(wgpu::Features::TIMESTAMP_QUERY_INSIDE_ENCODERS);

/// What makes frames faster on an adapter that has it.
pub fn faster(adapter: &wgpu::Adapter) -> wgpu::Features {
    adapter.features() & FASTER
}

/// All adapters that the machine shows, the one that [`Gpu::open`] takes first.
pub async fn adapters() -> Vec<Adapter> {
    let mut adapters: Vec<_> = instance().enumerate_adapters(wgpu::Backends::PRIMARY).await.iter().map(describe).collect();
    adapters.sort_by_key(rank);
    adapters
}

/// What [`Gpu::open`] would open; None where there is nothing.
#[cfg(not(target_arch = "wasm32"))]
pub fn expected_adapter() -> Option<&'static Adapter> {
    static FOUND: std::sync::OnceLock<Option<Adapter>> = std::sync::OnceLock::new();
    let wanted = wanted();
    FOUND.get_or_init(|| super::block_on(adapters()).into_iter().find(|adapter| is_wanted(&adapter.name, wanted.as_deref()))).as_ref()
}

/// What [`Gpu::open`] would run shaders on, without opening it; hardware where there is nothing.
#[cfg(not(target_arch = "wasm32"))]
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
    /// What plans have to know of it.
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
#[cfg(not(target_arch = "wasm32"))]
fn instance() -> wgpu::Instance {
    static INSTANCE: std::sync::OnceLock<wgpu::Instance> = std::sync::OnceLock::new();
    INSTANCE.get_or_init(new_instance).clone()
}

/// Of a browser, where nothing is loaded.
#[cfg(target_arch = "wasm32")]
fn instance() -> wgpu::Instance {
    new_instance()
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
    lacks.extend(lacking(&limits));
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

/// Limits below those that WebGPU promises.
fn lacking(limits: &wgpu::Limits) -> Vec<String> {
    let mut lacks = Vec::new();
    wgpu::Limits::default().check_limits_with_fail_fn(limits, false, |name, promised, granted| {
        lacks.push(format!("{name} of {promised}, which WebGPU promises (it has {granted})"));
    });
    lacks
}

/// Nanoseconds a timestamp tick, where there are timestamps.
fn tick(features: wgpu::Features, queue: &wgpu::Queue) -> Option<f32> {
    let timed = features.contains(wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::TIMESTAMP_QUERY_INSIDE_ENCODERS);
    timed.then(|| queue.get_timestamp_period())
}

impl Complaint {
    fn of(error: &wgpu::Error) -> Self {
        match error {
            wgpu::Error::OutOfMemory { .. } => Self::OutOfMemory,
            error => Self::Other(error.to_string()),
        }
    }

    fn while_doing(self, doing: &str) -> GpuError {
        match self {
            Self::OutOfMemory => GpuError::OutOfMemory { doing: doing.into() },
            Self::Other(reason) => GpuError::Driver { doing: doing.into(), reason },
        }
    }
}

impl Gpu {
    /// Opens the adapter that `WGPU_ADAPTER_NAME` names, otherwise the fastest kind there is.
    pub async fn open() -> Result<Arc<Self>, GpuError> {
        let all = instance().enumerate_adapters(wgpu::Backends::PRIMARY).await;
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
        Self::open_adapter(adapter, description).await.map(Arc::new)
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
        let (complaints, lost) = (Arc::new(Mutex::new(Vec::new())), Arc::new(Mutex::new(None)));
        let sink = complaints.clone();
        device.on_uncaptured_error(Arc::new(move |error| {
            if let Ok(mut complaints) = sink.lock() {
                complaints.push(Complaint::of(&error));
            }
        }));
        let sink = lost.clone();
        device.set_device_lost_callback(move |_, reason| {
            if let Ok(mut lost) = sink.lock() {
                *lost = Some(reason);
            }
        });
        let tick = tick(features, &queue);
        let has_scopes = cfg!(target_arch = "wasm32");
        Ok(Self {
            device,
            queue,
            adapter: description,
            limits,
            features,
            tick,
            complaints,
            lost,
            has_scopes,
            to_host: AtomicU64::new(0),
            earlier: Earlier::default(),
        })
    }

    /// On a device that another program has opened, with whatever features and limits it asked for.
    ///
    /// # Errors
    /// Where it has less than WebGPU promises.
    pub fn lent(adapter: &wgpu::Adapter, device: wgpu::Device, queue: wgpu::Queue) -> Result<Arc<Self>, GpuError> {
        let (limits, features) = (device.limits(), device.features());
        let adapter = Adapter { blends: features.contains(wgpu::Features::FLOAT32_BLENDABLE), ..describe(adapter) };
        if let Some(feature) = adapter.lacks.first().cloned().or_else(|| lacking(&limits).into_iter().next()) {
            let way = "open the device with `wgpu::Limits::default()` or more".into();
            return Err(GpuError::MissingFeature { adapter: adapter.name, feature, way });
        }
        let tick = tick(features, &queue);
        Ok(Arc::new(Self {
            device,
            queue,
            adapter,
            limits,
            features,
            tick,
            complaints: Arc::default(),
            lost: Arc::default(),
            has_scopes: true,
            to_host: AtomicU64::new(0),
            earlier: Earlier::default(),
        }))
    }

    /// Work on the device whose errors are told here, whoever looks after those of a device that is lent.
    ///
    /// Scopes belong to a thread, in a browser to a device that others use too: they are there while the work runs, and gone while it waits.
    pub async fn told<T>(&self, doing: &str, work: impl Future<Output = Result<T, GpuError>>) -> Result<T, GpuError> {
        if !self.has_scopes {
            return work.await;
        }
        let (mut work, mut found) = (pin!(work), Vec::new());
        let filters = [wgpu::ErrorFilter::Internal, wgpu::ErrorFilter::OutOfMemory, wgpu::ErrorFilter::Validation];
        let result = poll_fn(|context| {
            let scopes = filters.map(|filter| self.device.push_error_scope(filter));
            let polled = work.as_mut().poll(context);
            found.extend(scopes.into_iter().rev().map(wgpu::ErrorScopeGuard::pop));
            polled
        })
        .await;
        for error in found {
            // What the driver says first is the cause.
            if let Some(error) = error.await {
                return Err(Complaint::of(&error).while_doing(doing));
            }
        }
        result
    }

    /// Reports what the driver complained about since the last call.
    pub fn check(&self, doing: &str) -> Result<(), GpuError> {
        if let Some(reason) = self.lost.lock().ok().and_then(|mut l| l.take()) {
            return Err(GpuError::Lost { doing: doing.into(), reason });
        }
        let first = self.complaints.lock().ok().and_then(|mut all| (!all.is_empty()).then(|| all.remove(0)));
        first.map_or(Ok(()), |complaint| Err(complaint.while_doing(doing)))
    }

    /// Bytes that have been read back from the device, by whatever runs on it.
    pub fn bytes_to_host(&self) -> u64 {
        self.to_host.load(Ordering::Relaxed)
    }

    /// Waits until the device has done all that was submitted.
    pub async fn wait(&self, doing: &str) -> Result<(), GpuError> {
        if cfg!(target_arch = "wasm32") {
            let (done, is_done) = oneshot::channel();
            self.queue.on_submitted_work_done(move || {
                let _ = done.send(());
            });
            // Also told where the device is lost, which `poll` says.
            let _ = is_done.await;
        }
        self.poll(doing, None)
    }

    /// Has the device call back for what was submitted up to a submission, all of it where none is given. A browser does that by itself; elsewhere somebody
    /// has to wait for it, and does so here.
    pub(super) fn poll(&self, doing: &str, submission: Option<wgpu::SubmissionIndex>) -> Result<(), GpuError> {
        let polled = self.device.poll(wgpu::PollType::Wait { submission_index: submission, timeout: None });
        self.check(doing)?;
        polled.map(|_| ()).map_err(|e| GpuError::Driver { doing: doing.into(), reason: e.to_string() })
    }
}

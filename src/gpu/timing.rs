//! Time per node.

use super::device::{Gpu, GpuError};
use web_time::Instant;

/// How the device's time is told.
pub enum Timing {
    /// Timestamps around each node's commands.
    Stamps(Stamps),
    /// A software adapter's timestamps do not wait for compute work: each node is waited for instead.
    Waits { began: Option<(usize, Instant)>, totals: Vec<f64> },
}

/// Timestamps between collections; a node takes two.
const CAPACITY: u32 = 4096;

pub struct Stamps {
    set: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    staging: wgpu::Buffer,
    tick_ms: f64,
    /// Nodes of the pairs written since the last collection.
    pending: Vec<usize>,
    /// Milliseconds by node.
    totals: Vec<f64>,
}

impl Timing {
    /// None where a GPU has no timestamps.
    pub fn new(gpu: &Gpu, nodes: usize) -> Option<Self> {
        let totals = vec![0.0; nodes];
        if gpu.adapter.kind == "software" {
            return Some(Self::Waits { began: None, totals });
        }
        let tick_ms = gpu.tick? as f64 * 1e-6;
        let bytes = CAPACITY as u64 * 8;
        let buffer = |label, usage| gpu.device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size: bytes, usage, mapped_at_creation: false });
        Some(Self::Stamps(Stamps {
            set: gpu.device.create_query_set(&wgpu::QuerySetDescriptor { label: Some("timestamps"), ty: wgpu::QueryType::Timestamp, count: CAPACITY }),
            resolved: buffer("timestamps", wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
            staging: buffer("timestamps read back", wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST),
            tick_ms,
            pending: Vec::new(),
            totals,
        }))
    }

    /// Whether everything must be submitted and collected before another node begins.
    pub fn is_full(&self) -> bool {
        matches!(self, Self::Stamps(stamps) if stamps.pending.len() as u32 * 2 + 2 > CAPACITY)
    }

    /// Whether a node's commands must be submitted and waited for as it ends.
    pub fn waits(&self) -> bool {
        matches!(self, Self::Waits { .. })
    }

    pub fn begin(&mut self, encoder: &mut wgpu::CommandEncoder, node: usize) {
        match self {
            Self::Stamps(stamps) => {
                encoder.write_timestamp(&stamps.set, stamps.pending.len() as u32 * 2);
                stamps.pending.push(node);
            }
            Self::Waits { began, .. } => *began = Some((node, Instant::now())),
        }
    }

    /// Ends the node that began last.
    pub fn end(&mut self, encoder: &mut wgpu::CommandEncoder) {
        match self {
            Self::Stamps(stamps) => encoder.write_timestamp(&stamps.set, stamps.pending.len() as u32 * 2 - 1),
            Self::Waits { began, totals } => {
                if let Some((node, start)) = began.take() {
                    totals[node] += start.elapsed().as_secs_f64() * 1e3;
                }
            }
        }
    }

    /// Adds up what was written since the last time; everything must have been submitted.
    pub async fn collect(&mut self, gpu: &Gpu) -> Result<(), GpuError> {
        match self {
            Self::Stamps(stamps) => stamps.collect(gpu).await,
            Self::Waits { .. } => Ok(()),
        }
    }

    /// Milliseconds by node since the last call.
    pub fn take(&mut self) -> Vec<f64> {
        let (Self::Stamps(Stamps { totals, .. }) | Self::Waits { totals, .. }) = self;
        let zeros = vec![0.0; totals.len()];
        std::mem::replace(totals, zeros)
    }
}

impl Stamps {
    async fn collect(&mut self, gpu: &Gpu) -> Result<(), GpuError> {
        if self.pending.is_empty() {
            return Ok(());
        }
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let count = self.pending.len() as u32 * 2;
        encoder.resolve_query_set(&self.set, 0..count, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.staging, 0, count as u64 * 8);
        gpu.queue.submit([encoder.finish()]);
        let stamps: Vec<u64> = super::readback::arrive(gpu, &self.staging, count as u64 * 8).await?.see(gpu, bytemuck::pod_collect_to_vec)?;
        for (pair, node) in stamps.chunks_exact(2).zip(self.pending.drain(..)) {
            self.totals[node] += pair[1].saturating_sub(pair[0]) as f64 * self.tick_ms;
        }
        Ok(())
    }
}

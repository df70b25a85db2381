//! Timestamps per node.

use super::device::{Gpu, GpuError};

/// Timestamps between flushes; a node takes two.
const CAPACITY: u32 = 4096;

/// Writes a timestamp before and after each node and adds up what passes between them.
pub struct Timing {
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
    /// None where the adapter has no timestamps.
    pub fn new(gpu: &Gpu, nodes: usize) -> Option<Self> {
        let tick_ms = gpu.tick? as f64 * 1e-6;
        let bytes = CAPACITY as u64 * 8;
        let buffer = |label, usage| gpu.device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size: bytes, usage, mapped_at_creation: false });
        Some(Self {
            set: gpu.device.create_query_set(&wgpu::QuerySetDescriptor { label: Some("timestamps"), ty: wgpu::QueryType::Timestamp, count: CAPACITY }),
            resolved: buffer("timestamps", wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
            staging: buffer("timestamps read back", wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST),
            tick_ms,
            pending: Vec::new(),
            totals: vec![0.0; nodes],
        })
    }

    pub fn is_full(&self) -> bool {
        self.pending.len() as u32 * 2 + 2 > CAPACITY
    }

    pub fn begin(&mut self, encoder: &mut wgpu::CommandEncoder, node: usize) {
        encoder.write_timestamp(&self.set, self.pending.len() as u32 * 2);
        self.pending.push(node);
    }

    /// Ends the node that began last.
    pub fn end(&mut self, encoder: &mut wgpu::CommandEncoder) {
        encoder.write_timestamp(&self.set, self.pending.len() as u32 * 2 - 1);
    }

    /// Adds up what was written since the last time; everything must have been submitted.
    pub fn collect(&mut self, gpu: &Gpu) -> Result<(), GpuError> {
        if self.pending.is_empty() {
            return Ok(());
        }
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let count = self.pending.len() as u32 * 2;
        encoder.resolve_query_set(&self.set, 0..count, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.staging, 0, count as u64 * 8);
        gpu.queue.submit([encoder.finish()]);
        let bytes = super::readback::map(gpu, &self.staging, count as u64 * 8)?;
        let stamps: Vec<u64> = bytes.chunks_exact(8).map(|b| u64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]])).collect();
        for (pair, node) in stamps.chunks_exact(2).zip(self.pending.drain(..)) {
            self.totals[node] += pair[1].saturating_sub(pair[0]) as f64 * self.tick_ms;
        }
        Ok(())
    }

    /// Milliseconds by node since the last call.
    pub fn take(&mut self) -> Vec<f64> {
        let nodes = self.totals.len();
        std::mem::replace(&mut self.totals, vec![0.0; nodes])
    }
}

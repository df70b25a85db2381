//! Commands as the device takes them.

use super::programs::Ready;
use super::readback;
use super::session::Session;
use crate::schedule::*;

/// Commands encoded but not yet submitted.
pub(super) struct Pending {
    pub encoder: wgpu::CommandEncoder,
    pub empty: bool,
}

impl Session {
    pub(super) fn pending(&self) -> Pending {
        Pending { encoder: self.gpu.device.create_command_encoder(&Default::default()), empty: true }
    }

    pub(super) fn submit(&self, pending: &mut Pending) -> wgpu::SubmissionIndex {
        let encoder = std::mem::replace(pending, self.pending()).encoder;
        self.gpu.queue.submit([encoder.finish()])
    }

    pub(super) fn encode(&self, command: &Command, index: usize, position: usize, pending: &mut Pending) {
        let encoder = &mut pending.encoder;
        match (command, &self.programs[index][position]) {
            (Command::Clear(resource), Ready::Plain) => encoder.clear_buffer(self.buffer(*resource), 0, None),
            (Command::Clear(_), Ready::Clear { layers, format }) => layers.iter().for_each(|layer| clear_texture(encoder, layer, *format)),
            (Command::Copy { from, to }, Ready::Plain) => self.encode_copy(*from, *to, encoder),
            (Command::CopyToBuffer { from, to, offset }, Ready::Plain) => {
                let (texture, format) = self.texture(*from);
                readback::copy_texture(encoder, texture, format, self.buffer(*to), *offset);
            }
            (Command::CopyLayer { from, layer, to }, Ready::Plain) => {
                let (from, to) = (self.texture(*from).0, self.texture(*to).0);
                let origin = wgpu::Origin3d { z: *layer, ..wgpu::Origin3d::ZERO };
                encoder.copy_texture_to_texture(wgpu::TexelCopyTextureInfo { origin, ..from.as_image_copy() }, to.as_image_copy(), to.size());
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
        match self.schedule.resource(to).kind {
            ResourceKind::Texture { .. } => {
                let (from, to) = (self.texture(from).0, self.texture(to).0);
                encoder.copy_texture_to_texture(from.as_image_copy(), to.as_image_copy(), to.size());
            }
            // An allocation may be larger than the resource that it is lent to.
            _ => encoder.copy_buffer_to_buffer(self.buffer(from), 0, self.buffer(to), 0, self.schedule.resource(to).kind.bytes()),
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
        let depth = raster.depth.zip(depth.as_ref()).map(|(target, view)| wgpu::RenderPassDepthStencilAttachment {
            view,
            depth_ops: Some(wgpu::Operations { load: if target.clears { wgpu::LoadOp::Clear(0.0) } else { wgpu::LoadOp::Load }, store: wgpu::StoreOp::Store }),
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

pub(super) fn clear_texture(encoder: &mut wgpu::CommandEncoder, layer: &wgpu::TextureView, format: Format) {
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

//! Records added to the pixels by plain code on the host: what the ways on the device are compared with.

use super::{Work, at_start};
use crate::contract::Recorder;
use crate::math::weight::{Record, Rule};
use crate::passes::record::{Fresh, pinhole, texels};
use crate::recording::*;
use glam::{Vec3, Vec4};
use std::sync::Arc;

/// What the host keeps of a frame.
struct Pictures {
    /// Position and width of a pixel, normal and depth: one texel a pixel.
    position: Vec<[f32; 4]>,
    normal: Vec<[f32; 4]>,
    sums: Vec<Vec4>,
    counts: Vec<Vec4>,
}

pub(super) fn record(r: &mut Recorder<'_>, work: &Work) {
    let [width, height] = r.setting.size;
    let bytes = width as u64 * height as u64 * 16;
    let pictures = r.state("pictures");
    let gbuffer = work.gbuffer;
    at_start(
        r,
        Command::Host(Host {
            name: "read_surfaces",
            reads: vec![Read::whole(gbuffer.position), Read::whole(gbuffer.normal)],
            writes: vec![],
            only_writes: false,
            run: Arc::new(move |host| {
                let (position, normal) = (texels(host, gbuffer.position), texels(host, gbuffer.normal));
                let empty = vec![Vec4::ZERO; position.len()];
                *host.state(pictures) = Some(Box::new(Pictures { position, normal, sums: empty.clone(), counts: empty }));
                Ok(())
            }),
        }),
    );
    let fresh = Fresh::record(r, &work.cache, work.first, work.cache.capacity);
    let rule = work.cache.rule;
    let uploads: Vec<_> =
        [Some(work.sums), work.counts].into_iter().flatten().zip(["sums_bytes", "counts_bytes"]).map(|(image, name)| (image, r.buffer(name, bytes))).collect();
    let buffers: Vec<_> = uploads.iter().map(|u| u.1).collect();
    let written = buffers.clone();
    r.host("splat", &[fresh.read()], &buffers, move |host| {
        let records = fresh.records(host);
        let camera = pinhole(host);
        let Some(pictures) = host.state(pictures).as_mut().and_then(|s| s.downcast_mut::<Pictures>()) else {
            return Err("the surfaces were not read before the splat".into());
        };
        for record in &records {
            if let Some(bounds) = camera.bounds(record.position, rule.longest_reach(record) * 1.0001) {
                for row in bounds.min[1]..bounds.max[1] {
                    for column in bounds.min[0]..bounds.max[0] {
                        pictures.add(record, &rule, (row * width + column) as usize);
                    }
                }
            }
        }
        let images = [pictures.sums.clone(), pictures.counts.clone()];
        for (buffer, image) in written.iter().zip(&images) {
            host.write(*buffer, 0, bytemuck::cast_slice(image));
        }
        Ok(())
    });
    for (image, buffer) in uploads {
        r.compute_pixels(Program::new("splat/host").bind("values", buffer).bind("image", image), "store");
    }
}

impl Pictures {
    fn add(&mut self, record: &Record, rule: &Rule, pixel: usize) {
        let [x, y, z, footprint] = self.position[pixel];
        let [a, b, c, _] = self.normal[pixel];
        let (position, normal) = (Vec3::new(x, y, z), Vec3::new(a, b, c));
        let weight = if footprint > 0.0 { rule.weight(record, position, normal) } else { 0.0 };
        if weight > 0.0 {
            self.sums[pixel] += rule.estimate(record, position, normal).extend(1.0) * weight;
            self.counts[pixel] += Vec4::ONE;
        }
    }
}

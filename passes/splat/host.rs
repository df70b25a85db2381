//! Records added to the pixels on the host: by bands of rows side by side, in the records' order.

use super::Work;
use crate::contract::Recorder;
use crate::math::projection::PixelRectangle;
use crate::math::weight::{Record, Rule};
use crate::passes::record::{RECORD_BYTES, Record as HostRecord, pinhole};
use crate::recording::*;
use glam::{Vec4, Vec4Swizzles};
use rayon::prelude::*;
use std::sync::Arc;

/// Rows of pixels that are summed as one.
const ROWS: u32 = 8;

/// A record that covers some of the picture.
struct Placed {
    record: Record,
    bounds: PixelRectangle,
}

/// The visible surfaces: position and width of a pixel, normal and depth.
struct Surfaces<'a> {
    position: &'a [Vec4],
    normal: &'a [Vec4],
    width: u32,
}

pub(super) fn record(r: &mut Recorder<'_>, work: &Work) {
    let images: Vec<Resource> = [Some(work.sums), work.counts].into_iter().flatten().collect();
    let cleared = images.clone();
    let clear = move |host: &mut dyn HostContext| {
        for &image in &cleared {
            let mut contents = host.take(image);
            contents.fill(Vec4::ZERO);
            host.put(image, contents, u64::MAX);
        }
        Ok(())
    };
    super::at_start(r, Command::Host(Host { name: "clear", reads: Vec::new(), writes: images.clone(), run: Arc::new(clear) }));
    let (gbuffer, cache, first, width) = (work.gbuffer, work.cache, work.first, r.setting.size[0]);
    let mut reads = vec![Read::whole(gbuffer.position), Read::whole(gbuffer.normal), Read::counted(cache.records, RECORD_BYTES, cache.count)];
    reads.extend(images.iter().copied().map(Read::whole));
    let written = images.clone();
    let splat = move |host: &mut dyn HostContext| {
        let mut images: Vec<Vec<Vec4>> = written.iter().map(|image| host.take(*image)).collect();
        let camera = pinhole(host);
        let records: &[HostRecord] = bytemuck::cast_slice(host.read(cache.records));
        let new = records.get(host.variable(first) as usize..).unwrap_or_default().iter().map(Record::from);
        let placed: Vec<Placed> =
            new.filter_map(|record| Some(Placed { bounds: camera.bounds(record.position, cache.rule.longest_reach(&record) * 1.0001)?, record })).collect();
        let surfaces = Surfaces { position: bytemuck::cast_slice(host.read(gbuffer.position)), normal: bytemuck::cast_slice(host.read(gbuffer.normal)), width };
        surfaces.splat(&placed, &cache.rule, &mut images);
        for (image, contents) in written.iter().zip(images) {
            host.put(*image, contents, u64::MAX);
        }
        Ok(())
    };
    r.command(Command::Host(Host { name: "splat", reads, writes: images, run: Arc::new(splat) }));
}

impl Surfaces<'_> {
    /// Adds records to the sums and, if it is there, the image of counts.
    fn splat(&self, placed: &[Placed], rule: &Rule, images: &mut [Vec<Vec4>]) {
        let band = (ROWS * self.width) as usize;
        let mut images = images.iter_mut();
        let sums = images.next().into_iter().flat_map(|sums| sums.chunks_mut(band));
        let mut counts = images.next().map(|counts| counts.chunks_mut(band));
        let bands: Vec<_> = sums.map(|sums| (sums, counts.as_mut().and_then(Iterator::next))).collect();
        bands.into_par_iter().enumerate().for_each(|(index, (sums, counts))| self.splat_band(index as u32 * ROWS, placed, rule, sums, counts));
    }

    fn splat_band(&self, first: u32, placed: &[Placed], rule: &Rule, sums: &mut [Vec4], mut counts: Option<&mut [Vec4]>) {
        for Placed { record, bounds } in placed.iter().filter(|p| p.bounds.min[1] < first + ROWS && p.bounds.max[1] > first) {
            let reaching = rule.reaching(record);
            for row in bounds.min[1].max(first)..bounds.max[1].min(first + ROWS) {
                for column in bounds.min[0]..bounds.max[0] {
                    let pixel = (row * self.width + column) as usize;
                    let (place, normal) = (self.position[pixel], self.normal[pixel].xyz());
                    let weight = reaching.weight(place.xyz(), normal);
                    if weight <= 0.0 || place.w <= 0.0 {
                        continue;
                    }
                    let at = pixel - (first * self.width) as usize;
                    sums[at] += reaching.estimate(place.xyz(), normal).extend(1.0) * weight;
                    if let Some(counts) = &mut counts {
                        counts[at] += Vec4::ONE;
                    }
                }
            }
        }
    }
}

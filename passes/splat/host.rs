//! Irradiance added to the pixels on the host.

use super::Work;
use crate::contract::Encoder;
use crate::math::projection::PixelRectangle;
use crate::math::weight::{Reaching, Record};
use crate::passes::contribution::{bands, irradiance::Seen};
use crate::passes::record::{RECORD_BYTES, Record as HostRecord, pinhole};
use crate::schedule::*;
use glam::{Vec3, Vec4};

pub(super) fn encode(e: &mut Encoder<'_>, work: &Work) {
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
    super::at_start(e, Command::Host(Host::new("clear", Vec::new(), images.clone(), clear)));
    let (gbuffer, cache, first, width, in_fill) = (work.gbuffer, work.cache, work.first, work.gbuffer.size[0], e.batch.is_some());
    let mut reads = vec![Read::whole(gbuffer.position), Read::whole(gbuffer.normal), Read::counted(cache.records, RECORD_BYTES, cache.count)];
    reads.extend(images.iter().copied().map(Read::whole));
    let (written, of_errors) = (images.clone(), work.of_errors);
    let splat = move |host: &mut dyn HostContext| {
        let mut images: Vec<Vec<Vec4>> = written.iter().map(|image| host.take(*image)).collect();
        let camera = pinhole(host);
        let records: &[HostRecord] = bytemuck::cast_slice(host.read(cache.records));
        let from = if in_fill { host.variable(first) as usize } else { 0 };
        let new: Vec<Record> = records.get(from..).unwrap_or_default().iter().map(|record| if of_errors { error_of(record) } else { record.into() }).collect();
        let placed: Vec<(PixelRectangle, Reaching<'_>)> = new
            .iter()
            .filter_map(|record| Some((camera.bounds(record.position, cache.rule.longest_validity_radius(record) * 1.0001)?, cache.rule.reaching(record))))
            .collect();
        let positions = bytemuck::cast_slice(host.read(gbuffer.position));
        let seen = Seen { positions, normals: bytemuck::cast_slice(host.read(gbuffer.normal)) };
        bands::add(width, &placed, &mut images, &seen);
        for (image, contents) in written.iter().zip(images) {
            host.put(*image, contents, u64::MAX);
        }
        host.set(first, host.variable(cache.count));
        Ok(())
    };
    e.command(Command::Host(Host::new("splat", reads, images, splat)));
}

/// A record that estimates another's standard error, and counts where that does.
fn error_of(record: &HostRecord) -> Record {
    let record = Record::from(record);
    Record { irradiance: record.error, rotation: [Vec3::ZERO; 3], translation: [Vec3::ZERO; 3], ..record }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contract::{Arguments, encoder::Setting, port};
    use crate::passes::mock::{self, MockHost};
    use crate::scene::needs::Needs;
    use glam::Vec4Swizzles;
    use std::collections::BTreeMap;

    #[test]
    fn new_records_are_added_to_what_there_is() {
        let size = [12, 10];
        let [position, normal, reflectance, triangles, sums, counts] = [2, 3, 4, 5, 6, 7].map(Resource);
        let (mut host, needs, inputs, arguments) = (MockHost::new(Vec::new(), size), Needs::default(), BTreeMap::new(), Arguments::defaults(&[]));
        let mut schedule = Schedule::default();
        let encoded = {
            let setting = Setting { scene: host.scene(), needs: &needs, device: Device::SOFTWARE, size, tables: None };
            let mut e = Encoder::new("splat", &arguments, setting, &inputs, &mut schedule).in_loop(10, false);
            let gbuffer = port::GBuffer { size, position, normal, reflectance, triangles };
            encode(&mut e, &Work { gbuffer, cache: mock::cache(100), sums, counts: Some(counts), first: Variable(1), of_errors: false, radiance: None });
            e.finish()
        };
        let record = |x: f32, light: f32| Record {
            position: Vec3::new(x, 0.5, -4.0),
            radius: 3.0,
            irradiance: Vec3::new(light, 2.0, 3.0),
            translation: [Vec3::X; 3],
            relative_gradient: 0.1,
            ..mock::record()
        };
        // The first one has been splatted before; the last one is behind the camera.
        let records = [record(0.0, 9.0), record(-2.0, 1.0), record(1.0, 4.0), Record { position: Vec3::new(0.0, 0.0, 9.0), ..record(0.0, 9.0) }];
        host.variables.extend([(Variable(0), 4), (Variable(1), 1)]);
        let of_host: Vec<HostRecord> = records.iter().map(HostRecord::from).collect();
        host.write(Resource(0), 0, bytemuck::cast_slice(&of_host));
        let place = |pixel: u32| {
            let [x, y] = [pixel % 12, pixel / 12].map(|at| at as f32);
            Vec4::new((x + 0.5) / 6.0 - 1.0, 10.0 / 12.0 - (y + 0.5) / 6.0, -1.0, 0.0) * 4.0 + Vec4::W * f32::from(pixel != 66)
        };
        let positions: Vec<Vec4> = (0..120).map(place).collect();
        host.contents.extend([(position, positions.clone()), (normal, vec![Vec4::Z; 120]), (sums, vec![Vec4::ONE; 120]), (counts, vec![Vec4::ONE; 120])]);
        let [Command::Host(step)] = &encoded.commands[..] else { panic!("a step") };
        (step.run)(&mut host).unwrap();
        let rule = mock::rule();
        let mut some = 0;
        for (pixel, place) in positions.iter().enumerate() {
            let weighted = |record: &Record| {
                let weight = if place.w > 0.0 { rule.weight(record, place.xyz(), Vec3::Z) } else { 0.0 };
                (weight > 0.0).then(|| rule.estimate(record, place.xyz(), Vec3::Z).extend(1.0) * weight)
            };
            let added: Vec<Vec4> = records[1..].iter().filter_map(weighted).collect();
            let difference = host.contents[&sums][pixel] - Vec4::ONE - added.iter().sum::<Vec4>();
            assert!(difference.abs().max_element() < 1e-4, "{pixel} {difference}");
            assert_eq!(host.contents[&counts][pixel], Vec4::splat(1.0 + added.len() as f32));
            some += usize::from(!added.is_empty());
        }
        assert!((20..110).contains(&some));
        // As a loop starts all is black.
        let [Command::Host(clear)] = &encoded.prologue[..] else { panic!("a step") };
        (clear.run)(&mut host).unwrap();
        assert_eq!([sums, counts].map(|image| host.contents[&image].clone()), [(); 2].map(|()| vec![Vec4::ZERO; 120]));
    }
}

//! What `--dump` writes: images and atlases as EXR, records and requests as CSV and PLY. Of what a fill makes in batches, the last
//! batch that held anything.

use super::failure::{CommandError, Failure};
use super::output::Target;
use crate::contract::{Port, port};
use crate::gpu::block_on;
use crate::math::{
    harmonics::reflection::{PARTS, quads, table_fours},
    weight,
};
use crate::measure::run::{Run, image};
use crate::measure::{Layer, Layers};
use crate::passes::photons::{Photon, SLOTS_BEFORE, unpacked_ways};
use crate::passes::record::{Record, Request, indexed};
use crate::passes::texels::Shot;
use crate::pipeline::Plan;
use crate::schedule::{Resource, ResourceKind};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Distances beyond this are sky.
const SKY: f32 = 1e29;

/// Writes the ports of a node, or one port, to files named after `beside`: `out.exr` gives `out.records.csv`.
pub fn write(name: &str, plan: &Plan, run: &Run, beside: &Path) -> Result<(), Failure> {
    let ports: Vec<_> = plan.ports_of(name).chain(plan.ports.get_key_value(name)).collect();
    if ports.is_empty() {
        let known = plan.ports.keys().cloned().collect::<Vec<_>>().join(", ");
        return Err(Failure::input(CommandError::UnknownDump { name: name.into(), known }));
    }
    ports.into_iter().try_for_each(|(name, port)| write_port(name, port, plan, run, beside))
}

fn write_port(name: &str, port: &Port, plan: &Plan, run: &Run, beside: &Path) -> Result<(), Failure> {
    match port {
        Port::Requests(requests) => {
            let items: Vec<Request> = items(run, requests.places, run.latest(requests.count))?;
            file(beside, name, "csv")?.write(requests_csv(&items).as_bytes())
        }
        Port::Records(records) => write_records(&items(run, records.records, run.latest(records.count))?, None, name, beside),
        Port::RecordCache(cache) => write_records(&items(run, cache.records, run.variable(cache.count))?, Some(cache.rule), name, beside),
        Port::IrradianceField(port::IrradianceField::Records(index)) => {
            write_records(&indexed(index, &block_on(run.bytes(index.data)).map_err(Failure::work)?), Some(index.rule), name, beside)
        }
        Port::PhotonMap(map) | Port::IrradianceField(port::IrradianceField::Photons(port::PhotonDensity { map, .. })) => {
            write_photons(&items(run, map.data, run.variable(map.slots))?[SLOTS_BEFORE as usize..], name, beside)
        }
        Port::Tiles(tiles) => write_layers(tiles_picture(tiles, run)?, name, beside),
        Port::Lightmap(lightmap) => super::lightmap::write(lightmap, run, name, beside),
        Port::IrradianceField(port::IrradianceField::Lightmap(field)) => write_layers(lookups_picture(field, run)?, name, beside),
        Port::Shooters(shooters) => {
            let count = run.latest(shooters.requests.count);
            file(beside, name, "csv")?.write(shots_csv(&items(run, shooters.shots, count)?).as_bytes())
        }
        Port::ShooterViews(views) => write_layers(views_picture(views, run)?, name, beside),
        Port::WeightedTiles(weighted) => write_layers(tiles_picture(&weighted.tiles, run)?, name, beside),
        Port::ShadowMaps(maps) => write_layers(maps_picture(maps, run)?, name, beside),
        Port::Flag(flag) => file(beside, name, "csv")?.write(format!("value\n{}\n", run.variable(*flag)).as_bytes()),
        Port::GBuffer(surfaces) => write_layers(surfaces_picture(surfaces, plan, run)?, name, beside),
        Port::Lobes(lobes) => write_layers(lobes_picture(lobes, run)?, name, beside),
        Port::VisibleLobes(_) | Port::Image(_) | Port::DirectLight(_) | Port::Splats(_) | Port::Own(_) => {
            let Some(image) = image(port) else { return Ok(()) };
            let layer = block_on(run.layer(name, image)).map_err(Failure::work)?;
            let ResourceKind::Texture { size, .. } = plan.schedule.resource(image.texture).kind else { return Ok(()) };
            write_layers(Layers::new(size[0], size[1]).with("dump", layer), name, beside)
        }
    }
}

pub(super) fn file(beside: &Path, name: &str, ending: &str) -> Result<Target, Failure> {
    Target::new(&path(beside, name, ending))
}

fn path(beside: &Path, name: &str, ending: &str) -> PathBuf {
    beside.with_extension(format!("{name}.{ending}"))
}

pub(super) fn write_layers(picture: Layers, name: &str, beside: &Path) -> Result<(), Failure> {
    super::output::PictureTarget::new(&path(beside, name, "exr"))?.write(&picture, 0.0)
}

/// What a lightmap is looked up in, the backs of surfaces below their fronts.
fn lookups_picture(field: &port::LightmapField, run: &Run) -> Result<Layers, Failure> {
    let (sides, texels) = (field.sides as usize, field.edge * field.edge * field.sides);
    let data: Vec<[f32; 4]> = items(run, field.data, field.first + texels)?;
    let light = &data[field.first as usize..];
    let at = |side: usize| light.iter().skip(side).step_by(sides).copied();
    Ok(Layers::new(field.edge, field.edge * field.sides).with("irradiance", colour((0..sides).flat_map(at))))
}

/// The first three of four.
fn colour(texels: impl Iterator<Item = [f32; 4]>) -> Layer {
    Layer::interleaved(&["R", "G", "B"], &texels.flatten().collect::<Vec<_>>(), 4)
}

/// The numbers of the triangles that shooters see + 1, a tile below the other.
fn views_picture(views: &port::ShooterViews, run: &Run) -> Result<Layers, Failure> {
    let seen: Vec<u32> = bytemuck::pod_collect_to_vec(&block_on(run.bytes(views.seen)).map_err(Failure::work)?);
    let [width, height] = views.size;
    let rows = seen.len() as u32 / views.pitch;
    let tiles = rows / height * views.tiles_per_row;
    let sample = |tile: u32, at: u32| seen[views.place(tile, [at % width, at / width])] as f32;
    let numbers = (0..tiles).flat_map(|tile| (0..width * height).map(move |at| (tile, at))).map(|(tile, at)| sample(tile, at)).collect();
    Ok(Layers::new(width, height * tiles).with("triangle", Layer::value(numbers)))
}

fn shots_csv(shots: &[Shot]) -> String {
    let mut text = String::from("x,y,z,normal_x,normal_y,normal_z,flux_r,flux_g,flux_b\n");
    for Shot { position: [x, y, z], normal: [a, b, c], flux: [red, green, blue], .. } in shots {
        let _ = writeln!(text, "{x},{y},{z},{a},{b},{c},{red},{green},{blue}");
    }
    text
}

/// A layer a table: a row for each outgoing direction, a column for each coefficient of both parts, 0 beyond the table's own order.
fn lobes_picture(lobes: &port::Lobes, run: &Run) -> Result<Layers, Failure> {
    let values: Vec<f32> = bytemuck::pod_collect_to_vec(&block_on(run.bytes(lobes.values)).map_err(Failure::work)?);
    let (edge, widest) = (lobes.edge as usize, 4 * quads(lobes.order() as usize));
    let mut picture = Layers::new((PARTS * widest) as u32, (edge * edge) as u32);
    let mut rest = &values[..];
    for (at, order) in lobes.orders.iter().map(|order| *order as usize).enumerate() {
        let (table, behind) = rest.split_at(4 * table_fours(order, edge));
        let parts = table.chunks_exact(4 * quads(order));
        let padded = parts.flat_map(|part| part.iter().copied().chain(std::iter::repeat_n(0.0, widest - part.len())));
        picture = picture.with(&format!("table{at}"), Layer::value(padded.collect()));
        rest = behind;
    }
    Ok(picture)
}

/// So many items of a buffer.
pub(super) fn items<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(run: &Run, buffer: Resource, count: u32) -> Result<Vec<T>, Failure> {
    let mut items: Vec<T> = bytemuck::pod_collect_to_vec(&block_on(run.bytes(buffer)).map_err(Failure::work)?);
    items.truncate(count as usize);
    Ok(items)
}

fn requests_csv(requests: &[Request]) -> String {
    let mut text = String::from("x,y,z,normal_x,normal_y,normal_z,footprint,turn_radians\n");
    for r in requests {
        let ([x, y, z], [a, b, c]) = (r.position, r.normal);
        let _ = writeln!(text, "{x},{y},{z},{a},{b},{c},{},{}", r.footprint, r.turn);
    }
    text
}

fn write_photons(photons: &[Photon], name: &str, beside: &Path) -> Result<(), Failure> {
    let mut text = String::from("x,y,z,normal_x,normal_y,normal_z,from_x,from_y,from_z,flux_r,flux_g,flux_b,leg\n");
    for photon in photons {
        let ([x, y, z], [r, g, b], [normal, from]) = (photon.position, photon.flux, unpacked_ways(photon.ways));
        let _ = writeln!(text, "{x},{y},{z},{},{},{},{},{},{},{r},{g},{b},{}", normal.x, normal.y, normal.z, from.x, from.y, from.z, photon.leg);
    }
    file(beside, name, "csv")?.write(text.as_bytes())
}

fn write_records(records: &[Record], rule: Option<port::Rule>, name: &str, beside: &Path) -> Result<(), Failure> {
    let mut csv = String::from(
        "x,y,z,normal_x,normal_y,normal_z,irradiance_r,irradiance_g,irradiance_b,error_r,error_g,error_b,radius,minimum_distance,footprint,validity_radius,limited_by\n",
    );
    let mut ply = format!("ply\nformat ascii 1.0\nelement vertex {}\n", records.len());
    for property in ["x", "y", "z", "nx", "ny", "nz", "red", "green", "blue", "error_red", "error_green", "error_blue", "radius", "validity_radius"] {
        let _ = writeln!(ply, "property float {property}");
    }
    ply.push_str("end_header\n");
    for record in records {
        let ([x, y, z], [a, b, c], [r, g, h], [e, f, i]) = (record.position, record.normal, record.irradiance, record.error);
        let twin = weight::Record::from(record);
        let (validity_radius, limited_by) = rule.map_or((record.radius, ""), |rule| (rule.validity_radius(&twin), rule.limited_by(&twin)));
        let (radius, footprint) = (record.radius, record.footprint);
        let _ =
            writeln!(csv, "{x},{y},{z},{a},{b},{c},{r},{g},{h},{e},{f},{i},{radius},{},{footprint},{validity_radius},{limited_by}", record.minimum_distance);
        let _ = writeln!(ply, "{x} {y} {z} {a} {b} {c} {r} {g} {h} {e} {f} {i} {radius} {validity_radius}");
    }
    file(beside, name, "csv")?.write(csv.as_bytes())?;
    file(beside, name, "ply")?.write(ply.as_bytes())
}

/// The batch's tiles as they lie in the atlas: radiance as the picture, distance (0 for sky) as a layer.
fn tiles_picture(tiles: &port::Tiles, run: &Run) -> Result<Layers, Failure> {
    let samples: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&block_on(run.bytes(tiles.samples)).map_err(Failure::work)?);
    let count = run.latest(tiles.requests.count);
    let (tile_width, tile_height) = (tiles.table.width, tiles.table.height);
    let (width, height) = (tiles.tiles_per_row.min(count.max(1)) * tile_width, count.div_ceil(tiles.tiles_per_row).max(1) * tile_height);
    let at = |x: u32, y: u32| {
        let tile = y / tile_height * tiles.tiles_per_row + x / tile_width;
        let sample = y % tile_height * tile_width + x % tile_width;
        if tile < count { samples[(tile * tile_width * tile_height + sample) as usize] } else { [0.0; 4] }
    };
    let pixels: Vec<[f32; 4]> = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| at(x, y)).collect();
    let radiance = Layer::interleaved(&["R", "G", "B"], bytemuck::cast_slice(&pixels), 4);
    let distance = Layer::value(pixels.iter().map(|p| if p[3] > SKY { 0.0 } else { p[3] }).collect());
    Ok(Layers::new(width, height).with(crate::measure::PICTURE, radiance).with("distance", distance))
}

/// What is seen, one layer each.
fn surfaces_picture(surfaces: &port::GBuffer, plan: &Plan, run: &Run) -> Result<Layers, Failure> {
    use port::Channels::{Colour, Vector};
    let ResourceKind::Texture { size: [width, height], .. } = plan.schedule.resource(surfaces.position).kind else {
        return Ok(Layers::new(1, 1));
    };
    let images = [("position", surfaces.position, Vector), ("normal", surfaces.normal, Vector), ("reflectance", surfaces.reflectance, Colour)];
    images.into_iter().try_fold(Layers::new(width, height), |picture, (name, texture, channels)| {
        Ok(picture.with(name, block_on(run.layer(name, port::Image { texture, channels })).map_err(Failure::work)?))
    })
}

/// All maps below each other, reverse Z.
fn maps_picture(maps: &port::ShadowMaps, run: &Run) -> Result<Layers, Failure> {
    let texels: Vec<f32> = bytemuck::pod_collect_to_vec(&block_on(run.bytes(maps.depth)).map_err(Failure::work)?);
    let rows = texels.chunks_exact(maps.pitch.unwrap_or(maps.resolution) as usize);
    let height = rows.len() as u32;
    let values = rows.flat_map(|row| &row[..maps.resolution as usize]).copied().collect();
    Ok(Layers::new(maps.resolution, height).with("depth", Layer::value(values)))
}

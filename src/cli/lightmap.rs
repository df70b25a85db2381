//! What `--dump` writes of a lightmap: its layers as EXR, and the scene with the light on it for other programs, as OBJ and GLB.

use super::dump::{file, items, write_layers};
use super::failure::Failure;
use crate::contract::port;
use crate::gpu::block_on;
use crate::math::colour::luminance;
use crate::measure::{Layer, Layers, PICTURE, exposure::automatic_exposure, run::Run};
use crate::passes::texels::{TexelSurface, radiance};
use glam::{Vec3, Vec4};
use serde_json::json;
use std::fmt::Write;
use std::path::Path;

/// The layers, and both meshes if there is any surface.
pub fn write(lightmap: &port::Lightmap, run: &Run, name: &str, beside: &Path) -> Result<(), Failure> {
    let texture = Texture::of(lightmap, run)?;
    write_layers(texture.layers(), name, beside)?;
    let mesh = Mesh::of(lightmap, run)?;
    if mesh.positions.is_empty() {
        return Ok(());
    }
    file(beside, name, "obj")?.write(mesh.obj().as_bytes())?;
    file(beside, name, "glb")?.write(&mesh.glb(&texture)?)
}

/// Every cell at its place, the backs of surfaces below their fronts; of several texels the one with the most light is shown.
struct Texture {
    edge: u32,
    sides: u32,
    /// Indirect irradiance [W/m²].
    irradiance: Vec<Vec4>,
    /// Direct light that is reflected [W m⁻² sr⁻¹].
    direct: Vec<Vec4>,
    /// All that is reflected and emitted [W m⁻² sr⁻¹].
    radiance: Vec<Vec3>,
    /// [scene units²]; 0 where there is no surface.
    areas: Vec<f32>,
}

impl Texture {
    fn of(lightmap: &port::Lightmap, run: &Run) -> Result<Self, Failure> {
        let (edge, sides) = (lightmap.edge, lightmap.sides);
        let cells: Vec<[u32; 4]> = items(run, lightmap.cells, edge * edge)?;
        let surfaces: Vec<TexelSurface> = items(run, lightmap.surfaces, lightmap.texels)?;
        let [mean, direct]: [Vec<Vec4>; 2] = [items(run, lightmap.mean, lightmap.places())?, items(run, lightmap.direct, lightmap.places())?];
        let lit = |place: &usize| luminance(mean[*place].truncate().as_dvec3());
        let shown = |[number, parts @ ..]: &[u32; 4], side: u32| {
            let texels = (0..parts.iter().filter(|part| **part != 0).count().max(1) as u32).map(|part| (number - 1 + part) * sides + side);
            texels.map(|place| place as usize).max_by(|a, b| lit(a).total_cmp(&lit(b)))
        };
        let at = |cell: &[u32; 4], side| if cell[0] == 0 { None } else { shown(cell, side) };
        let texels: Vec<Option<(usize, usize)>> =
            (0..sides).flat_map(|side| cells.iter().map(move |cell| at(cell, side).map(|place| (place / sides as usize, place)))).collect();
        let scene = &run.stage().scene;
        let sent = |(number, place): (usize, usize)| {
            let material = &scene.materials[scene.triangles[surfaces[number].triangle as usize].material as usize];
            let is_lamp = material.two_sided || (place as u32).is_multiple_of(sides);
            radiance(direct[place], mean[place]) + if is_lamp { material.emission } else { Vec3::ZERO }
        };
        let each = |of: &[Vec4]| texels.iter().map(|texel| texel.map_or(Vec4::ZERO, |(_, place)| of[place])).collect();
        Ok(Self {
            edge,
            sides,
            irradiance: each(&mean),
            direct: each(&direct),
            radiance: texels.iter().map(|texel| texel.map_or(Vec3::ZERO, sent)).collect(),
            areas: texels.iter().map(|texel| texel.map_or(0.0, |(number, _)| surfaces[number].area)).collect(),
        })
    }

    fn layers(&self) -> Layers {
        let colours = |of: &[Vec4]| Layer::interleaved(&["R", "G", "B"], bytemuck::cast_slice(of), 4);
        let picture = Layers::new(self.edge, self.edge * self.sides);
        picture.with("irradiance", colours(&self.irradiance)).with("direct", colours(&self.direct)).with("area", Layer::value(self.areas.clone()))
    }

    /// As a picture is shown, texels without a surface filled from those beside them: programs mix neighbours, and make smaller pictures of it.
    fn png(&self) -> Result<Vec<u8>, Failure> {
        let picture =
            |light: &[Vec3]| Layers::new(self.edge, self.edge * self.sides).with(PICTURE, Layer::interleaved(&["R", "G", "B"], bytemuck::cast_slice(light), 3));
        let exposure = automatic_exposure(&picture(&self.radiance)).map_err(Failure::work)?;
        picture(&self.filled()).to_png(PICTURE, exposure).map_err(Failure::work)
    }

    fn filled(&self) -> Vec<Vec3> {
        let (edge, rows) = (self.edge as i32, (self.edge * self.sides) as i32);
        let mut light: Vec<Vec4> = self.radiance.iter().zip(&self.areas).map(|(light, area)| light.extend(f32::from(*area > 0.0))).collect();
        for _ in 0..GUTTER {
            let before = light.clone();
            for (place, texel) in light.iter_mut().enumerate().filter(|(_, texel)| texel.w == 0.0) {
                let (x, y) = (place as i32 % edge, place as i32 / edge);
                let beside = (-1..=1).flat_map(|down| (-1..=1).map(move |right| (x + right, y + down)));
                let beside = beside.filter(|(x, y)| (0..edge).contains(x) && (0..rows).contains(y) && y.div_euclid(edge) == place as i32 / edge / edge);
                let sum: Vec4 = beside.map(|(x, y)| before[(y * edge + x) as usize]).sum();
                *texel = if sum.w > 0.0 { sum / sum.w } else { Vec4::ZERO };
            }
        }
        light.iter().map(|light| light.truncate()).collect()
    }
}

/// Texels that surfaces are continued by.
const GUTTER: usize = 8;

/// The scene's triangles, each with its places in the fronts' texture: to the right and down, in parts of its edge.
struct Mesh {
    positions: Vec<[f32; 3]>,
    places: Vec<[f32; 2]>,
    sides: u32,
}

impl Mesh {
    fn of(lightmap: &port::Lightmap, run: &Run) -> Result<Self, Failure> {
        let corners: Vec<[f32; 8]> = bytemuck::pod_collect_to_vec(&block_on(run.bytes(lightmap.corners)).map_err(Failure::work)?);
        let edge = lightmap.edge as f32;
        let triangles = &run.stage().scene.triangles;
        let places =
            corners.iter().take(triangles.len()).flat_map(|[a, b, c, d, e, f, ..]| [[a, b], [c, d], [e, f]].map(|place| place.map(|side| side / edge)));
        Ok(Self {
            positions: triangles.iter().flat_map(|triangle| triangle.positions.map(|corner| corner.to_array())).collect(),
            places: places.collect(),
            sides: lightmap.sides,
        })
    }

    fn obj(&self) -> String {
        let mut text = String::from("# Each triangle with its place in the lightmap: u to the right, v up, in parts of the front's texture.\n");
        for [x, y, z] in &self.positions {
            let _ = writeln!(text, "v {x} {y} {z}");
        }
        for [u, v] in &self.places {
            let _ = writeln!(text, "vt {u} {}", 1.0 - v);
        }
        for first in (1..=self.positions.len()).step_by(3) {
            let _ = writeln!(text, "f {first}/{first} {0}/{0} {1}/{1}", first + 1, first + 2);
        }
        text
    }

    /// All in one file: the scene as the lightmap has it lit, by no light but its own. Backs are triangles of their own, turned around.
    fn glb(&self, texture: &Texture) -> Result<Vec<u8>, Failure> {
        let of_side = |side: u32| {
            let order = if side == 0 { [0, 1, 2] } else { [0, 2, 1] };
            (0..self.positions.len()).step_by(3).flat_map(move |first| order.map(|corner| (first + corner, side as f32)))
        };
        let corners: Vec<(usize, f32)> = (0..self.sides).flat_map(of_side).collect();
        let positions: Vec<[f32; 3]> = corners.iter().map(|(corner, _)| self.positions[*corner]).collect();
        let place = |(corner, side): &(usize, f32)| [self.places[*corner][0], (self.places[*corner][1] + side) / self.sides as f32];
        let places: Vec<[f32; 2]> = corners.iter().map(place).collect();
        let parts = [bytemuck::cast_slice(&positions), bytemuck::cast_slice(&places), &texture.png()?];
        Ok(container(&description(&positions, parts.map(<[u8]>::len)), &parts.concat()))
    }
}

/// What a file has, of parts so long after each other: corners, their places, a picture.
fn description(positions: &[[f32; 3]], lengths: [usize; 3]) -> String {
    let [low, high] = positions.iter().fold([Vec3::MAX, Vec3::MIN], |[low, high], at| [low.min(Vec3::from(*at)), high.max(Vec3::from(*at))]);
    let view = |part: usize| json!({ "buffer": 0, "byteOffset": lengths[..part].iter().sum::<usize>(), "byteLength": lengths[part] });
    let count = positions.len();
    let float = 5126;
    let meshes = json!([{ "primitives": [{ "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "material": 0 }] }]);
    json!({
        "asset": { "version": "2.0", "generator": "hemisplat" },
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": meshes,
        "materials": [{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 }, "metallicFactor": 0 }, "extensions": { "KHR_materials_unlit": {} } }],
        "textures": [{ "source": 0, "sampler": 0 }],
        "samplers": [{ "wrapS": 33071, "wrapT": 33071 }],
        "images": [{ "bufferView": 2, "mimeType": "image/png" }],
        "accessors": [
            { "bufferView": 0, "componentType": float, "count": count, "type": "VEC3", "min": low.to_array(), "max": high.to_array() },
            { "bufferView": 1, "componentType": float, "count": count, "type": "VEC2" },
        ],
        "bufferViews": [view(0), view(1), view(2)],
        "buffers": [{ "byteLength": lengths.iter().sum::<usize>() }],
    })
    .to_string()
}

/// A binary glTF file (glTF 2.0, section 4.4): both chunks end at a multiple of four bytes.
fn container(description: &str, bytes: &[u8]) -> Vec<u8> {
    let chunk = |kind: &[u8; 4], content: &[u8], filler: u8| {
        let length = content.len().next_multiple_of(4);
        let mut chunk = [&(length as u32).to_le_bytes(), &kind[..], content].concat();
        chunk.resize(8 + length, filler);
        chunk
    };
    let chunks = [chunk(b"JSON", description.as_bytes(), b' '), chunk(b"BIN\0", bytes, 0)].concat();
    [b"glTF", &2u32.to_le_bytes(), &(12 + chunks.len() as u32).to_le_bytes(), &chunks[..]].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two sides of two by two texels, of which the first of the front and the last of the back are surfaces.
    fn texture() -> Texture {
        let one = |at: usize| (0..8).map(move |place| place == at);
        let lit: Vec<bool> = one(0).zip(one(7)).map(|(front, back)| front || back).collect();
        let radiance = (0..).zip(&lit).map(|(place, lit)| Vec3::splat(if *lit { 1.0 + place as f32 } else { 0.0 })).collect();
        let areas = lit.iter().map(|lit| f32::from(*lit)).collect();
        Texture { edge: 2, sides: 2, irradiance: vec![Vec4::ZERO; 8], direct: vec![Vec4::ZERO; 8], radiance, areas }
    }

    #[test]
    fn surfaces_are_continued_on_their_own_side() {
        let filled: Vec<f32> = texture().filled().iter().map(|light| light.x).collect();
        assert_eq!(filled, [1.0, 1.0, 1.0, 1.0, 8.0, 8.0, 8.0, 8.0]);
    }

    #[test]
    fn other_programs_read_the_mesh() {
        let positions = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]].into();
        let mesh = Mesh { positions, places: vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], sides: 2 };
        let gltf::Gltf { document, blob } = gltf::Gltf::from_slice(&mesh.glb(&texture()).ok().unwrap()).unwrap();
        let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
        assert!(primitive.material().unlit());
        let reader = primitive.reader(|_| blob.as_deref());
        let positions: Vec<[f32; 3]> = reader.read_positions().unwrap().collect();
        let places: Vec<[f32; 2]> = reader.read_tex_coords(0).unwrap().into_f32().collect();
        assert_eq!((positions[2], positions[4]), ([0.0, 2.0, 0.0], [0.0, 2.0, 0.0]));
        assert_eq!(places, [[0.0, 0.0], [1.0, 0.0], [0.0, 0.5], [0.0, 0.5], [0.0, 1.0], [1.0, 0.5]]);
        let gltf::image::Source::View { view, .. } = document.images().next().unwrap().source() else { panic!("no picture") };
        let picture = image::load_from_memory(&blob.unwrap()[view.offset()..][..view.length()]).unwrap();
        assert_eq!((picture.width(), picture.height()), (2, 4));
    }
}

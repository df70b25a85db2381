//! What extensions hold in a compressed form: buffers by EXT_meshopt_compression, geometry by KHR_draco_mesh_compression.

use super::{Bytes, MAX_TRIANGLES, Mode, SceneError, broken};
use ::gltf::{Accessor, Document, Primitive, Semantic, accessor::DataType, buffer};
use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};
use meshoptimizer_rs::{
    Workspace,
    codec::{BufferView, Filter, Mode as Coding},
};
use serde_json::Value;
use std::{collections::HashMap, path::Path};

pub(super) const MESHOPT: &str = "EXT_meshopt_compression";
pub(super) const DRACO: &str = "KHR_draco_mesh_compression";

/// The most that one part may unfold to [bytes].
const MAX_BYTES: usize = 1 << 30;

/// What took the place of something compressed.
#[derive(Default)]
pub(super) struct Unpacked {
    /// The bytes of buffer views, by their numbers.
    pub views: HashMap<usize, Bytes>,
    /// The numbers of accessors' elements, by the accessors' own.
    pub numbers: HashMap<usize, Vec<f32>>,
    /// Corners of triangles, by the accessors of their positions.
    pub triangles: HashMap<usize, Vec<u32>>,
}

impl Unpacked {
    /// # Errors
    /// Compressed parts that break the rules, or would be too large.
    pub fn of(document: &Document, buffers: &[Bytes], path: &Path) -> Result<Self, SceneError> {
        let mut unpacked = Self::default();
        for view in document.views() {
            if let Some(extension) = view.extension_value(MESHOPT) {
                let bytes = meshopt(&view, extension, buffers);
                let bytes = bytes.map_err(|why| broken(path, &format!("buffer view {} cannot be decoded by {MESHOPT}: {why}", view.index())))?;
                unpacked.views.insert(view.index(), bytes.into());
            }
        }
        for mesh in document.meshes() {
            for primitive in mesh.primitives() {
                unpacked
                    .add_draco(document, &primitive, buffers)
                    .map_err(|why| broken(path, &format!("mesh {} cannot be decoded by {DRACO}: {why}", mesh.index())))?;
            }
        }
        Ok(unpacked)
    }

    /// Of a primitive whose positions are nowhere else.
    fn add_draco(&mut self, document: &Document, primitive: &Primitive, buffers: &[Bytes]) -> Result<(), String> {
        let (Some(extension), Some(positions)) = (primitive.extension_value(DRACO), primitive.get(&Semantic::Positions)) else { return Ok(()) };
        if positions.view().is_some() || positions.sparse().is_some() {
            return Ok(());
        }
        let view = number(extension, "bufferView").and_then(|view| document.views().nth(view)).ok_or("it names no buffer view")?;
        let bytes = part(buffers, view.buffer().index(), view.offset(), view.length()).ok_or("it reaches past its buffer")?;
        let limits = DecodeLimits::default().with_max_faces(MAX_TRIANGLES as u64).with_max_decoded_bytes(MAX_BYTES as u64);
        let mut mesh = Mesh::new();
        MeshDecoder::new().decode(&mut DecoderBuffer::new(bytes).with_limits(limits), &mut mesh).map_err(|error| error.to_string())?;
        for (semantic, accessor) in primitive.attributes() {
            let attribute = number(&extension["attributes"], &semantic.to_string()).and_then(|id| mesh.attribute_by_unique_id(id as u32));
            if let Some(attribute) = attribute {
                let (mut numbers, most) = (attribute.read_f32s(mesh.num_points(), accessor.dimensions().multiplicity()), most(&accessor));
                numbers.iter_mut().for_each(|number| *number = (*number / most).max(if most == 1.0 { f32::MIN } else { -1.0 }));
                self.numbers.insert(accessor.index(), numbers);
            }
        }
        if !matches!(primitive.mode(), Mode::Triangles | Mode::TriangleStrip) {
            return Err("it is no list or strip of triangles".to_owned());
        }
        self.triangles.insert(positions.index(), mesh.faces().iter().flatten().map(|corner| corner.0).collect());
        Ok(())
    }
}

/// What 1 is in the numbers of an accessor.
fn most(accessor: &Accessor) -> f32 {
    match accessor.data_type() {
        _ if !accessor.normalized() => 1.0,
        DataType::U8 => 255.0,
        DataType::I8 => 127.0,
        DataType::U16 => 65535.0,
        DataType::I16 => 32767.0,
        DataType::U32 | DataType::F32 => 1.0,
    }
}

/// The bytes of a buffer view.
fn meshopt(view: &buffer::View, extension: &Value, buffers: &[Bytes]) -> Result<Vec<u8>, String> {
    let told = |error: meshoptimizer_rs::Error| error.to_string();
    let text = |key: &str, default: &'static str| extension.get(key).map_or(Some(default), Value::as_str).ok_or(format!("its {key} is no text"));
    let [buffer, length, stride, count] = ["buffer", "byteLength", "byteStride", "count"].map(|key| number(extension, key).ok_or(format!("it has no {key}")));
    let (coding, filter) = (Coding::parse(text("mode", "")?).map_err(told)?, Filter::parse(text("filter", "NONE")?).map_err(told)?);
    let layout = BufferView::new(coding, filter, count?, stride?).map_err(told)?;
    layout.validate_parent(view.length(), view.stride()).map_err(told)?;
    if layout.byte_length() > MAX_BYTES {
        return Err("it would take more than 1 GiB".to_owned());
    }
    let bytes = part(buffers, buffer?, number(extension, "byteOffset").unwrap_or(0), length?).ok_or("it reaches past its buffer")?;
    layout.decode(bytes, &mut Workspace::default()).map_err(told)
}

fn number(of: &Value, key: &str) -> Option<usize> {
    of.get(key)?.as_u64().and_then(|number| usize::try_from(number).ok())
}

fn part(buffers: &[Bytes], buffer: usize, offset: usize, length: usize) -> Option<&[u8]> {
    buffers.get(buffer)?.get(offset..offset.checked_add(length)?)
}

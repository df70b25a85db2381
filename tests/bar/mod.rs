//! A bar that bends: a glTF file of two joints.

use serde_json::json;
use std::{fs, io, path::Path};

/// Writes `bar.gltf` and its buffer into a folder: two unit squares, one over the other from the origin, that face +z. The upper edge is carried by an elbow at
/// (0, 1, 0), the one between by that and by the root alike. The elbow turns by 90 degrees around x from 0 to 1 s: the upper square comes to lie along +z, and the
/// lower one stays where it is.
pub fn write(folder: &Path) -> io::Result<()> {
    let (mut bytes, mut views, mut accessors) = (Vec::new(), Vec::new(), Vec::new());
    let mut add = |part: &[u8], component: u32, count: usize, kind: &str| {
        views.push(json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": part.len()}));
        accessors.push(json!({"bufferView": views.len() - 1, "componentType": component, "count": count, "type": kind, "min": [0, 0, 0], "max": [1, 2, 0]}));
        bytes.extend_from_slice(part);
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        accessors.len() - 1
    };
    let floats = |numbers: &[f32]| numbers.iter().flat_map(|number| number.to_le_bytes()).collect::<Vec<u8>>();
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let corners = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 2.0, 0.0, 1.0, 2.0, 0.0];
    let [root, both, elbow] = [[1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]];
    let identity = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let mut down = identity;
    down[13] = -1.0;
    let positions = add(&floats(&corners), 5126, 6, "VEC3");
    let joints = add(&[[0, 1, 0, 0]; 6].concat(), 5121, 6, "VEC4");
    let weights = add(&floats(&[root, root, both, both, elbow, elbow].concat()), 5126, 6, "VEC4");
    let indices = add(&[0, 1, 3, 0, 3, 2, 2, 3, 5, 2, 5, 4], 5121, 12, "SCALAR");
    let binds = add(&floats(&[identity, down].concat()), 5126, 2, "MAT4");
    let times = add(&floats(&[0.0, 1.0]), 5126, 2, "SCALAR");
    let turns = add(&floats(&[0.0, 0.0, 0.0, 1.0, half, 0.0, 0.0, half]), 5126, 2, "VEC4");
    let file = json!({
        "asset": {"version": "2.0"},
        "nodes": [{"name": "bar", "mesh": 0, "skin": 0}, {"name": "root", "children": [2]}, {"name": "elbow", "translation": [0, 1, 0]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": positions, "JOINTS_0": joints, "WEIGHTS_0": weights}, "indices": indices}]}],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": binds}],
        "animations": [{
            "channels": [{"sampler": 0, "target": {"node": 2, "path": "rotation"}}],
            "samplers": [{"input": times, "output": turns}],
        }],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": bytes.len(), "uri": "bar.bin"}],
    });
    fs::write(folder.join("bar.bin"), bytes)?;
    fs::write(folder.join("bar.gltf"), file.to_string())
}

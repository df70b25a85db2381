//! Where a node has its mesh: once, or as often as EXT_mesh_gpu_instancing says.

use super::{Reader, broken, composed};
use crate::scene::load::error::SceneError;
use ::gltf::{Accessor, Document, Node};
use glam::DMat4;

const INSTANCES: &str = "EXT_mesh_gpu_instancing";

/// Whether a node says so.
pub(super) fn is_instanced(node: &Node) -> bool {
    node.extension_value(INSTANCES).is_some()
}

impl Reader<'_> {
    /// The maps from the mesh's coordinates to the world's, of a node whose own is `map`.
    ///
    /// # Errors
    /// Attributes of different lengths, or that are not there.
    pub(super) fn places(&self, document: &Document, node: &Node, map: &DMat4) -> Result<Vec<DMat4>, SceneError> {
        let Some(extension) = node.extension_value(INSTANCES) else { return Ok(vec![*map]) };
        let wrong = |why: &str| broken(self.path, &format!("{INSTANCES} of node {} {why}", node.index()));
        let accessor = |name: &str| -> Result<Option<Accessor>, SceneError> {
            let Some(number) = extension["attributes"].get(name) else { return Ok(None) };
            let found = number.as_u64().and_then(|number| document.accessors().nth(usize::try_from(number).ok()?));
            found.map(Some).ok_or_else(|| wrong(&format!("names an accessor for {name} that is not there")))
        };
        let translations = accessor("TRANSLATION")?.map(|accessor| self.read_vectors::<3>(&accessor)).transpose()?;
        let rotations = accessor("ROTATION")?.map(|accessor| self.read_vectors::<4>(&accessor)).transpose()?;
        let scales = accessor("SCALE")?.map(|accessor| self.read_vectors::<3>(&accessor)).transpose()?;
        let counts = [translations.as_ref().map(Vec::len), rotations.as_ref().map(Vec::len), scales.as_ref().map(Vec::len)];
        let Some(count) = counts.into_iter().flatten().max() else { return Ok(vec![*map]) };
        if counts.into_iter().flatten().any(|other| other != count) {
            return Err(wrong("has attributes of different lengths"));
        }
        let place = |number: usize| {
            let translation = translations.as_ref().map_or([0.0; 3], |all| all[number]);
            let rotation = rotations.as_ref().map_or([0.0, 0.0, 0.0, 1.0], |all| all[number]);
            let scale = scales.as_ref().map_or([1.0; 3], |all| all[number]);
            *map * composed(translation, rotation, scale)
        };
        Ok((0..count).map(place).collect())
    }
}

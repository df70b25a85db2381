//! The project's own scene documents.
//!
//! Values stay as slices of the source until they are asked for ([`Raw`]), so that every error, also one about
//! meaning, can underline the place that it is about. Entries are read one by one, so that all that is wrong is told.

mod document;
mod geometry;
mod materials;
mod values;
mod view;

use super::{
    LoadOptions, Normals, PLAIN,
    draft::Draft,
    error::{Faults, Problem, SceneError, SourceText, suggestion},
    files::Files,
    refuse_overrides,
};
use crate::scene::{animation::EmissionTrack, model::Material};
use document::{Document, Entries, Geometry, Raw, Surface};
use glam::{DMat4, Vec3};
use std::{
    collections::{BTreeSet, HashMap, HashSet},
    path::Path,
};
use values::Source;

/// The version of documents that this program reads.
const VERSION: u32 = 1;
/// The name that stands for every material without an entry of its own.
const ANY: &str = "*";

/// What a scene document says about itself.
pub fn about(text: &str) -> Option<String> {
    let text = SourceText::new(Path::new(""), text);
    Source { text: &text }.parse::<Document>(text.text).ok()?.about
}

/// Reads a document; `folder` is what its files are relative to, besides the search folders.
///
/// # Errors
/// All root causes at once, as far as the document can be taken apart.
pub(super) fn read(path: &Path, text: &str, folder: Option<&Path>, files: &Files, options: &LoadOptions) -> Result<(Draft, Normals), SceneError> {
    let text = SourceText::new(path, text);
    let source = Source { text: &text };
    let document: Document = source.parse(text.text)?;
    let version = source.get(document.version)?;
    if version != VERSION {
        return Err(source
            .error(Problem::Version, document.version, format!("scene documents of version {version} are not known"), "this program reads version 1")
            .help("write `version: 1`, or use a program as new as the document"));
    }
    let mut reader = Reader {
        source,
        folder,
        files,
        options,
        draft: Draft::default(),
        palette: Vec::new(),
        entries: HashMap::new(),
        missing: HashSet::new(),
        parameters: BTreeSet::new(),
    };
    let mut faults = Faults::default();
    reader.read_materials(&document.materials, &mut faults);
    reader.read_geometry(&document.geometry, &mut faults);
    for &light in &document.lights {
        faults.take(reader.add_light(light));
    }
    for &(name, camera) in &document.cameras.0 {
        faults.take(reader.add_camera(name, camera));
    }
    reader.draft.environment = document.environment.and_then(|sky| faults.take(reader.read_sky(sky)));
    let normals = document.normals.map_or(Some(Normals::File), |choice| faults.take(source.normals(choice)));
    faults.expect_none()?;
    Ok((reader.draft, normals.unwrap_or(Normals::File)))
}

/// An entry of `materials`.
struct PaletteEntry<'a> {
    name: String,
    place: Raw<'a, String>,
    surface: Raw<'a, Surface<'a>>,
    /// None for one that changes materials of files.
    material: Option<u32>,
    used: bool,
}

struct Reader<'a> {
    source: Source<'a>,
    folder: Option<&'a Path>,
    files: &'a Files<'a>,
    options: &'a LoadOptions,
    draft: Draft,
    palette: Vec<PaletteEntry<'a>>,
    /// Where in the palette each name stands.
    entries: HashMap<String, usize>,
    /// Names that shapes have and the palette lacks.
    missing: HashSet<String>,
    /// The parameters of all generators met.
    parameters: BTreeSet<&'static str>,
}

impl<'a> Reader<'a> {
    fn read_materials(&mut self, entries: &Entries<'a, Surface<'a>>, faults: &mut Faults) {
        for &(place, surface) in &entries.0 {
            let Some(name) = faults.take(self.source.get(place)) else { continue };
            if self.entries.contains_key(&name) {
                faults.add(self.twice(place, "material"));
                continue;
            }
            // For one that is wrong another stands in, so that nobody misses it.
            let whole = faults.take(self.source.surface(&name, surface)).unwrap_or_else(|| Some(Material::diffuse(&name, Vec3::splat(PLAIN))));
            let material = whole.map(|whole| self.add_changing(whole, surface));
            self.entries.insert(name.clone(), self.palette.len());
            self.palette.push(PaletteEntry { name, place, surface, material, used: false });
        }
    }

    /// Where geometry is wrong, nobody knows which materials it would have had, nor which parameters.
    fn read_geometry(&mut self, geometry: &[Raw<'a, Geometry<'a>>], faults: &mut Faults) {
        let read = geometry.iter().map(|&geometry| faults.take(self.add_geometry(geometry, &DMat4::IDENTITY))).filter(Option::is_some).count();
        if read == geometry.len() {
            faults.take(refuse_overrides(self.options, &self.parameters.iter().copied().collect::<Vec<_>>()));
            self.unused().into_iter().for_each(|fault| faults.add(fault));
        }
    }

    fn twice(&self, place: Raw<'a, String>, what: &str) -> SceneError {
        self.source.error(Problem::Format, place, format!("the {what} {} is given twice", place.text), "the second one").help("give it another name")
    }

    fn add_material(&mut self, material: Material) -> u32 {
        self.draft.materials.push(material);
        self.draft.materials.len() as u32 - 1
    }

    /// Adds a material of an entry, whose radiance may change in time. What is wrong with the entry is told elsewhere.
    fn add_changing(&mut self, material: Material, surface: Raw<'a, Surface<'a>>) -> u32 {
        let material = self.add_material(material);
        if let Ok(Some(radiance)) = self.source.changing_glow(surface) {
            self.draft.animation.emissions.push(EmissionTrack { material, radiance });
        }
        material
    }

    /// The entry of a name, or that of all others.
    fn find_entry(&mut self, name: &str) -> Option<&PaletteEntry<'a>> {
        let entry = &mut self.palette[*self.entries.get(name).or_else(|| self.entries.get(ANY))?];
        entry.used = true;
        Some(entry)
    }

    /// The whole material of a name.
    fn find_material(&mut self, name: &str) -> Option<u32> {
        self.find_entry(name)?.material
    }

    /// What stands for a file's material: the entry's, the file's own with its changes, or the file's own.
    fn material_of_file(&mut self, material: Material) -> Result<u32, SceneError> {
        let material = match self.find_entry(&material.name) {
            Some(PaletteEntry { material: Some(whole), .. }) => return Ok(*whole),
            Some(&PaletteEntry { surface, .. }) => {
                let changed = self.source.changed(material, surface)?;
                return Ok(self.add_changing(changed, surface));
            }
            None => material,
        };
        Ok(self.add_material(material))
    }

    /// The material that a primitive names; without a name, the one for all that are not named.
    fn primitive_material<T>(&mut self, raw: Option<Raw<'a, String>>, primitive: Raw<'a, T>) -> Result<u32, SceneError> {
        let name = raw.map_or(Ok(ANY.to_owned()), |raw| self.source.get(raw))?;
        let known = self.entries.contains_key(&name);
        if let (true, Some(material)) = (known, self.find_material(&name)) {
            return Ok(material);
        }
        let help = suggestion(&name, self.palette.iter().map(|entry| entry.name.as_str()));
        if known {
            let message = format!("the entry `{name}` changes materials of files: a shape of the document needs a whole one");
            let place = raw.map_or(primitive.text, |raw| raw.text);
            let error = SceneError::new(Problem::UnknownMaterial, message).at(self.source.text, self.source.span(place), "has no file");
            return Err(error.help("give the shape a material of its own, such as Diffuse(reflectance: (0.7, 0.7, 0.7))"));
        }
        // What is missing is told once, for all shapes that are to have it.
        if !self.missing.insert(name.clone()) {
            return Ok(self.add_material(Material::diffuse(&name, Vec3::splat(PLAIN))));
        }
        Err(match raw {
            Some(raw) => self.source.error(Problem::UnknownMaterial, raw, format!("there is no material `{name}`"), "not among `materials`").help(help),
            None => self
                .source
                .error(Problem::UnknownMaterial, primitive, "this shape names no material, and there is none for all", "needs a `material`")
                .help("add `material: …` here, or an entry `\"*\"` to `materials`"),
        })
    }

    /// Names in `materials` that nothing in the scene has: most likely they are misspelt.
    fn unused(&self) -> Vec<SceneError> {
        let fault = |unused: &PaletteEntry<'a>| {
            let names = self.draft.materials.iter().map(|material| material.name.as_str()).filter(|&name| name != unused.name && name != ANY);
            self.source
                .error(Problem::UnknownMaterial, unused.place, format!("nothing in the scene has the material `{}`", unused.name), "not used")
                .help(suggestion(&unused.name, names))
        };
        self.palette.iter().filter(|entry| !entry.used && entry.name != ANY).map(fault).collect()
    }
}

//! Shaders: import of shared text, validation by naga, and the bindings that an entry point uses, by name.

use super::device::GpuError;
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use std::{borrow::Cow, collections::BTreeMap, path::PathBuf};

/// Every shader file that ships: path under `shaders/` without its ending, and its text.
pub const SOURCES: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/shaders.rs"));

/// What shaders may use beside the core of the language: packing of half floats, which every adapter but the oldest has.
const CAPABILITIES: Capabilities = Capabilities::SHADER_FLOAT16_IN_FLOAT32;

/// A shader with its imports resolved, parsed and validated.
pub struct Shader {
    pub text: String,
    pub module: naga::Module,
    pub info: ModuleInfo,
}

/// A binding that an entry point uses.
#[derive(Debug, Clone, PartialEq)]
pub struct Slot {
    pub name: String,
    pub group: u32,
    pub binding: u32,
    pub kind: SlotKind,
}

/// What an entry point does with a global variable.
#[derive(Debug, Clone, PartialEq)]
pub struct Use {
    pub name: String,
    pub reads: bool,
    pub writes: bool,
}

/// What one workgroup of an entry point asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Workgroup {
    /// Invocations along x, y and z.
    pub size: [u32; 3],
    /// Memory that its invocations share [bytes].
    pub bytes: u64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SlotKind {
    Uniform,
    Storage { writable: bool },
    Texture { sample: wgpu::TextureSampleType, dimension: wgpu::TextureViewDimension },
    StorageTexture { format: wgpu::TextureFormat, access: wgpu::StorageTextureAccess, dimension: wgpu::TextureViewDimension },
}

/// The text of a shader: the one that ships, or while developing the one of the same name in a folder that `HEMISPLAT_SHADERS` names, so that a shader
/// can be tried without compiling anew. A release reads no such folder.
fn source(name: &str) -> Option<Cow<'static, str>> {
    let ships = SOURCES.iter().find(|(n, _)| *n == name).map(|s| Cow::Borrowed(s.1))?;
    let tried = folder().and_then(|folder| std::fs::read_to_string(folder.join(format!("{name}.wgsl"))).ok());
    Some(tried.map_or(ships, Cow::Owned))
}

fn folder() -> Option<PathBuf> {
    let reads = cfg!(all(debug_assertions, feature = "cli"));
    reads.then(|| std::env::var_os("HEMISPLAT_SHADERS")).flatten().map(PathBuf::from)
}

/// Whether shaders may be others the next time that they are loaded.
pub(super) fn may_change() -> bool {
    folder().is_some()
}

/// The text of a shader in which every line `#import PATH` is replaced by that file, once. A path in capitals stands
/// for what `imports` says: `#import VISIBILITY` with `("VISIBILITY", "lib/visibility/rays")`.
pub fn assemble(name: &str, imports: &[(&str, &str)]) -> Result<String, GpuError> {
    assemble_own(name, None, imports)
}

/// The same of a text that does not ship, if there is one.
fn assemble_own(name: &str, own: Option<&str>, imports: &[(&str, &str)]) -> Result<String, GpuError> {
    let (mut seen, mut text) = (Vec::new(), String::new());
    match own {
        Some(own) => append_lines(own, imports, &mut seen, &mut text)?,
        None => append(name, imports, &mut seen, &mut text)?,
    }
    Ok(text)
}

fn append(name: &str, imports: &[(&str, &str)], seen: &mut Vec<String>, text: &mut String) -> Result<(), GpuError> {
    let name = imports.iter().find(|(alias, _)| *alias == name).map_or(name, |i| i.1);
    if seen.iter().any(|s| s == name) {
        return Ok(());
    }
    seen.push(name.to_string());
    let source = source(name).ok_or_else(|| GpuError::Shader { shader: name.into(), reason: "there is no such file".into() })?;
    append_lines(&source, imports, seen, text)
}

fn append_lines(source: &str, imports: &[(&str, &str)], seen: &mut Vec<String>, text: &mut String) -> Result<(), GpuError> {
    for line in source.lines() {
        match line.strip_prefix("#import ") {
            Some(import) => append(import.trim(), imports, seen, text)?,
            None => {
                text.push_str(line);
                text.push('\n');
            }
        }
    }
    Ok(())
}

impl Shader {
    pub fn load(name: &str, imports: &[(&str, &str)]) -> Result<Self, GpuError> {
        Self::load_own(name, None, imports)
    }

    /// The same of a text that does not ship, if there is one.
    pub fn load_own(name: &str, own: Option<&str>, imports: &[(&str, &str)]) -> Result<Self, GpuError> {
        let text = assemble_own(name, own, imports)?;
        let invalid = |reason: String| GpuError::Shader { shader: name.into(), reason };
        let module = naga::front::wgsl::parse_str(&text).map_err(|e| invalid(e.emit_to_string_with_path(&text, name)))?;
        let info = Validator::new(ValidationFlags::all(), CAPABILITIES).validate(&module).map_err(|e| invalid(e.emit_to_string_with_path(&text, name)))?;
        Ok(Self { text, module, info })
    }

    /// Bindings of the entry points, merged.
    pub fn slots(&self, entries: &[&str]) -> Result<Vec<Slot>, String> {
        let mut slots = BTreeMap::new();
        for entry in entries {
            let index = self.module.entry_points.iter().position(|e| e.name == *entry).ok_or_else(|| format!("there is no entry point {entry}"))?;
            let uses = self.info.get_entry_point(index);
            for (handle, global) in self.module.global_variables.iter() {
                if let (Some(binding), false) = (&global.binding, uses[handle].is_empty()) {
                    let slot = Slot { name: global.name.clone().unwrap_or_default(), group: binding.group, binding: binding.binding, kind: self.kind(global)? };
                    slots.insert((slot.group, slot.binding), slot);
                }
            }
        }
        Ok(slots.into_values().collect())
    }

    /// How large the workgroups of a compute entry point are; None where there is no such entry point.
    pub fn workgroup(&self, entry: &str) -> Option<Workgroup> {
        let index = self.module.entry_points.iter().position(|found| found.name == entry)?;
        let uses = self.info.get_entry_point(index);
        let shared = |(handle, global): &(naga::Handle<naga::GlobalVariable>, &naga::GlobalVariable)| {
            global.space == naga::AddressSpace::WorkGroup && !uses[*handle].is_empty()
        };
        let size = |(_, global): (_, &naga::GlobalVariable)| u64::from(self.module.types[global.ty].inner.size(self.module.to_ctx()));
        Some(Workgroup { size: self.module.entry_points[index].workgroup_size, bytes: self.module.global_variables.iter().filter(shared).map(size).sum() })
    }

    /// Which global variables an entry point reads, and which it writes; none where there is no such entry point.
    pub fn uses(&self, entry: &str) -> Vec<Use> {
        let Some(index) = self.module.entry_points.iter().position(|found| found.name == entry) else { return Vec::new() };
        let uses = self.info.get_entry_point(index);
        let of = |(handle, global): (naga::Handle<naga::GlobalVariable>, &naga::GlobalVariable)| Use {
            name: global.name.clone().unwrap_or_default(),
            reads: uses[handle].contains(naga::valid::GlobalUse::READ),
            writes: uses[handle].contains(naga::valid::GlobalUse::WRITE),
        };
        self.module.global_variables.iter().map(of).collect()
    }

    fn kind(&self, global: &naga::GlobalVariable) -> Result<SlotKind, String> {
        match (global.space, &self.module.types[global.ty].inner) {
            (naga::AddressSpace::Uniform, _) => Ok(SlotKind::Uniform),
            (naga::AddressSpace::Storage { access }, _) => Ok(SlotKind::Storage { writable: access.contains(naga::StorageAccess::STORE) }),
            (naga::AddressSpace::Handle, naga::TypeInner::Image { dim: naga::ImageDimension::D2, arrayed, class }) => {
                let dimension = if *arrayed { wgpu::TextureViewDimension::D2Array } else { wgpu::TextureViewDimension::D2 };
                image_kind(*class, dimension).ok_or_else(|| format!("the image {:?} is of a kind that passes do not use", global.name))
            }
            _ => Err(format!("the binding {:?} is of a kind that passes do not use", global.name)),
        }
    }
}

fn image_kind(class: naga::ImageClass, dimension: wgpu::TextureViewDimension) -> Option<SlotKind> {
    Some(match class {
        naga::ImageClass::Sampled { kind: naga::ScalarKind::Float, .. } => {
            SlotKind::Texture { sample: wgpu::TextureSampleType::Float { filterable: false }, dimension }
        }
        naga::ImageClass::Sampled { kind: naga::ScalarKind::Uint, .. } => SlotKind::Texture { sample: wgpu::TextureSampleType::Uint, dimension },
        naga::ImageClass::Depth { .. } => SlotKind::Texture { sample: wgpu::TextureSampleType::Depth, dimension },
        naga::ImageClass::Storage { format, access } => SlotKind::StorageTexture { format: storage_format(format)?, access: storage_access(access), dimension },
        _ => return None,
    })
}

fn storage_format(format: naga::StorageFormat) -> Option<wgpu::TextureFormat> {
    Some(match format {
        naga::StorageFormat::R32Uint => wgpu::TextureFormat::R32Uint,
        naga::StorageFormat::R32Float => wgpu::TextureFormat::R32Float,
        naga::StorageFormat::Rgba16Float => wgpu::TextureFormat::Rgba16Float,
        naga::StorageFormat::Rgba32Float => wgpu::TextureFormat::Rgba32Float,
        _ => return None,
    })
}

fn storage_access(access: naga::StorageAccess) -> wgpu::StorageTextureAccess {
    match (access.contains(naga::StorageAccess::LOAD), access.contains(naga::StorageAccess::STORE)) {
        (true, true) => wgpu::StorageTextureAccess::ReadWrite,
        (true, false) => wgpu::StorageTextureAccess::ReadOnly,
        _ => wgpu::StorageTextureAccess::WriteOnly,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the imports in capitals can stand for.
    const IMPORTS: [&[(&str, &str)]; 3] = [
        &[
            ("VISIBILITY", "lib/visibility/rays"),
            ("EMITTERS", "lib/emitters/traced"),
            ("CONTRIBUTION", "lib/contribution/irradiance"),
            ("IRRADIANCE_FIELD", "lib/irradiance_field/records"),
            ("SEEN", "lib/seen/strata"),
        ],
        &[
            ("VISIBILITY", "lib/visibility/shadow_maps"),
            ("SHADOW_TEXELS", "lib/visibility/texels_in_buffer"),
            ("EMITTERS", "lib/emitters/traced"),
            ("CONTRIBUTION", "lib/contribution/radiance"),
            ("COEFFICIENTS", "lib/coefficients/single"),
            ("IRRADIANCE_FIELD", "lib/irradiance_field/photons"),
            ("SEEN", "lib/seen/more"),
        ],
        &[
            ("VISIBILITY", "lib/visibility/shadow_maps"),
            ("SHADOW_TEXELS", "lib/visibility/texels_in_texture"),
            ("EMITTERS", "lib/emitters/given"),
            ("CONTRIBUTION", "lib/contribution/radiance"),
            ("COEFFICIENTS", "lib/coefficients/half"),
            ("IRRADIANCE_FIELD", "lib/irradiance_field/lightmap"),
            ("SEEN", "lib/seen/more"),
        ],
    ];

    #[test]
    fn every_shader_is_valid_with_every_import() {
        for (name, _) in SOURCES.iter().filter(|(name, _)| !name.starts_with("lib/")) {
            for imports in IMPORTS {
                if let Err(error) = Shader::load(name, imports) {
                    panic!("{name} with {imports:?}: {error}");
                }
            }
        }
    }
}

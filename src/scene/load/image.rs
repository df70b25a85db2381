//! Images of scenes: base colour textures and latitude-longitude skies.

use super::{
    error::{Problem, SceneError},
    files::{Bytes, Files},
    guard, list,
};
use crate::scene::model::{Environment, Material, Reading, Rgb, Texture};
use ::image::{DynamicImage, ImageReader};
use glam::Vec3;
use std::{
    borrow::Cow,
    io::Cursor,
    path::{Path, PathBuf},
};

/// The longest side of an image [pixels].
const MAX_SIDE: u32 = 16384;
/// What all textures of a scene may take [bytes].
const MAX_BYTES: u64 = 1 << 30;

/// The most pixels of a sky: 8192×8192, 1 GiB on the device.
const MAX_TEXELS: u64 = 1 << 26;

/// A texture that is decoded only if a surface uses it.
#[derive(Debug, Clone)]
pub(super) struct TextureSource {
    pub name: String,
    pub content: Content,
    pub reading: Reading,
}

#[derive(Debug, Clone)]
pub(super) enum Content {
    File(PathBuf),
    Bytes(Bytes),
    /// Known to be out of reach, and why.
    Missing(String),
}

/// Decodes the textures; a material whose texture is missing or broken goes on without it, and a note says so.
///
/// # Errors
/// Images beyond the limits, found before their pixels are allocated.
pub(super) fn decode_all(sources: &[TextureSource], files: &Files, materials: &mut [Material], notes: &mut Vec<String>) -> Result<Vec<Texture>, SceneError> {
    let (mut textures, mut failures, mut budget) = (Vec::new(), Vec::new(), MAX_BYTES);
    let mut numbers = vec![None; sources.len()];
    for (source, number) in sources.iter().zip(&mut numbers) {
        match decode(source, files, &mut budget)? {
            Ok(texture) => {
                *number = Some(textures.len() as u32);
                textures.push(texture);
            }
            Err(why) => failures.push(format!("{} ({why})", source.name)),
        }
    }
    for material in materials {
        let emits_by_map = material.maps.emission.is_some();
        for texture in material.textures_mut() {
            *texture = texture.and_then(|texture| numbers[texture as usize]);
        }
        if emits_by_map && material.maps.emission.is_none() {
            // Which parts shine is not known: all of them would be a lamp.
            material.emission = Vec3::ZERO;
        }
        material.alpha_cutoff = material.alpha_cutoff.filter(|_| material.texture.is_some());
    }
    if !failures.is_empty() {
        notes.push(format!("textures that could not be read, their surfaces go without: {}", list(&failures)));
    }
    Ok(textures)
}

/// Outer error: over the limits. Inner error: unreadable, which a scene survives.
fn decode(source: &TextureSource, files: &Files, budget: &mut u64) -> Result<Result<Texture, String>, SceneError> {
    let bytes = match &source.content {
        Content::File(path) => match files.read(path) {
            Ok(bytes) => bytes,
            Err(error) => match error.problem() {
                Problem::TooLarge => return Err(error),
                Problem::NotFound => return Ok(Err("missing".to_owned())),
                _ => return Ok(Err(error.to_string())),
            },
        },
        Content::Bytes(bytes) => bytes.clone(),
        Content::Missing(why) => return Ok(Err(why.clone())),
    };
    let Some((width, height)) = dimensions(&bytes) else { return Ok(Err("not an image of a known format".to_owned())) };
    expect_side(&source.name, width, height)?;
    let size = 4 * u64::from(width) * u64::from(height);
    *budget = budget.checked_sub(size).ok_or_else(|| {
        SceneError::new(Problem::TooLarge, format!("the scene's textures take more than 1 GiB; `{}` was one too many", source.name))
            .help("use smaller textures")
    })?;
    let Some(image) = decode_pixels(&bytes) else { return Ok(Err("its pixels are broken".to_owned())) };
    let image = image.into_rgba8();
    let texels = image.pixels().map(|pixel| pixel.0).collect();
    Ok(Ok(Texture { name: source.name.clone(), width: image.width(), height: image.height(), texels, reading: source.reading }))
}

fn dimensions(bytes: &[u8]) -> Option<(u32, u32)> {
    guard(|| reader(bytes)?.into_dimensions().ok()).flatten().filter(|&(width, height)| width > 0 && height > 0)
}

fn decode_pixels(bytes: &[u8]) -> Option<DynamicImage> {
    guard(|| reader(bytes)?.decode().ok()).flatten()
}

fn reader(bytes: &[u8]) -> Option<ImageReader<Cursor<&[u8]>>> {
    ImageReader::new(Cursor::new(bytes)).with_guessed_format().ok()
}

fn expect_side(name: &str, width: u32, height: u32) -> Result<(), SceneError> {
    if width.max(height) <= MAX_SIDE {
        return Ok(());
    }
    Err(SceneError::new(Problem::TooLarge, format!("image `{name}` is {width}×{height}; the limit is {MAX_SIDE} pixels a side")).help("scale the image down"))
}

/// Refuses a sky before memory is taken for it: a small file may state any size.
fn expect_sky(name: &str, width: u32, height: u32) -> Result<(), SceneError> {
    expect_side(name, width, height)?;
    if u64::from(width) * u64::from(height) <= MAX_TEXELS {
        return Ok(());
    }
    Err(SceneError::new(Problem::TooLarge, format!("sky `{name}` is {width}×{height}; the limit is {MAX_TEXELS} pixels")).help("scale the image down"))
}

/// Reads a latitude-longitude sky from EXR or Radiance HDR, turns it by `rotation` [radians] from −z towards +x and
/// multiplies it by `scale`.
///
/// # Errors
/// A file that is unreadable, too large, or holds a negative or non-finite radiance.
pub(super) fn load_sky(path: &Path, files: &Files, scale: f32, rotation: f64) -> Result<Environment, SceneError> {
    let name = path.display().to_string();
    let is_exr = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr"));
    let bytes = files.read(path)?;
    let (width, height, texels) = if is_exr { decode_exr(&bytes, &name)? } else { decode_hdr(&bytes, &name)? };
    if texels.is_empty() {
        return Err(undecodable(&name));
    }
    let texels: Vec<Rgb> = texels.into_iter().map(|texel| texel * scale).collect();
    if !texels.iter().all(|texel| texel.is_finite() && texel.cmpge(Vec3::ZERO).all()) {
        return Err(SceneError::new(Problem::Range, format!("sky `{name}` holds a radiance that is negative or no finite number")).help("mend the image"));
    }
    Ok(Environment::LatLong { width, height, texels: turn(&texels, width as usize, rotation) })
}

type Radiance = (u32, u32, Vec<Rgb>);

fn decode_hdr(bytes: &[u8], name: &str) -> Result<Radiance, SceneError> {
    let bytes = &signed(bytes);
    let (width, height) = dimensions(bytes).ok_or_else(|| undecodable(name))?;
    expect_sky(name, width, height)?;
    let image = decode_pixels(bytes).ok_or_else(|| undecodable(name))?.into_rgb32f();
    Ok((width, height, image.pixels().map(|pixel| Vec3::from(pixel.0)).collect()))
}

/// A Radiance file under the name that its decoder knows: each program may sign with its own, such as `#?RGBE`.
fn signed(bytes: &[u8]) -> Cow<'_, [u8]> {
    const KNOWN: &[u8] = b"#?RADIANCE";
    match bytes.iter().position(|&byte| byte == b'\n') {
        Some(end) if bytes.starts_with(b"#?") && !bytes.starts_with(KNOWN) => Cow::Owned([KNOWN, &bytes[end..]].concat()),
        _ => Cow::Borrowed(bytes),
    }
}

fn decode_exr(bytes: &[u8], name: &str) -> Result<Radiance, SceneError> {
    use exr::prelude::*;
    let meta = guard(|| MetaData::read_from_buffered(Cursor::new(bytes), false).ok()).flatten().ok_or_else(|| undecodable(name))?;
    for header in &meta.headers {
        let side = |pixels: usize| u32::try_from(pixels).unwrap_or(u32::MAX);
        expect_sky(name, side(header.layer_size.width()), side(header.layer_size.height()))?;
    }
    let decode = || {
        let reader = read().no_deep_data().largest_resolution_level().rgb_channels(
            |size, _| (size.width(), vec![Vec3::ZERO; size.area()]),
            |(width, texels): &mut (usize, Vec<Rgb>), at, (r, g, b): (f32, f32, f32)| texels[at.y() * *width + at.x()] = Vec3::new(r, g, b),
        );
        reader.first_valid_layer().all_attributes().from_buffered(Cursor::new(bytes)).ok()
    };
    let image = guard(decode).flatten().ok_or_else(|| undecodable(name))?;
    let size = image.layer_data.size;
    Ok((size.width() as u32, size.height() as u32, image.layer_data.channel_data.pixels.1))
}

fn undecodable(name: &str) -> SceneError {
    SceneError::new(Problem::Format, format!("sky `{name}` cannot be decoded"))
        .help("latitude-longitude skies are read from OpenEXR (.exr) and Radiance (.hdr) files")
}

/// Moves the columns of every row; between whole columns the two nearest are mixed.
fn turn(texels: &[Rgb], width: usize, rotation: f64) -> Vec<Rgb> {
    let shift = (rotation / std::f64::consts::TAU).rem_euclid(1.0) * width as f64;
    let (whole, part) = (shift.floor() as usize % width, shift.fract() as f32);
    let row = |row: &[Rgb]| -> Vec<Rgb> {
        let column = |x: usize| row[(x + 2 * width - whole) % width];
        (0..width).map(|x| column(x).lerp(column(x + width - 1), part)).collect()
    };
    texels.chunks_exact(width).flat_map(row).collect()
}

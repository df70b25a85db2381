//! Textures that are made out of other images at loading: masks, roughness with metallic, normals of heights.

use super::{error::SceneError, files::file_name, image::Decoder};
use crate::scene::model::Wrap;
use ::image::{
    DynamicImage, ImageBuffer, Luma, Pixel, Rgba, RgbaImage,
    imageops::{FilterType, resize},
};
use std::path::PathBuf;

/// Numbers of 0 to 1 in 16 bits.
type Numbers = ImageBuffer<Luma<u16>, Vec<u16>>;

/// What a texture is made of.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) enum Composition {
    Image(PathBuf),
    /// Colours, white where there are none, with a mask for their alpha.
    Masked {
        colours: Option<PathBuf>,
        mask: Scalar,
    },
    /// Roughness in green, metallic in blue, each 1 where there is no image of it.
    Facets {
        roughness: Option<Scalar>,
        metallic: Option<Scalar>,
    },
    /// Normals of a surface that is so high above its plane.
    Heights(Scalar),
}

/// An image that stands for a number at each place.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct Scalar {
    pub file: PathBuf,
    /// Which of its channels; None for its alpha, of a mask that has any, or else its luminance.
    pub channel: Option<Channel>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Channel {
    Red,
    Green,
    Blue,
    Alpha,
    Luminance,
}

impl Channel {
    /// Of an image that is a mask: its alpha where that is not 1 all over.
    fn of_mask(image: &DynamicImage) -> Self {
        let is_clear = image.color().has_alpha() && image.to_rgba8().pixels().any(|pixel| pixel.0[3] < u8::MAX);
        if is_clear { Self::Alpha } else { Self::Luminance }
    }

    /// As MTL names them.
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "r" => Some(Self::Red),
            "g" => Some(Self::Green),
            "b" => Some(Self::Blue),
            "m" => Some(Self::Alpha),
            "l" => Some(Self::Luminance),
            _ => None,
        }
    }
}

/// A texture as surfaces read it.
pub(super) struct Composed {
    pub image: RgbaImage,
    /// How far normals lean where red or green is 1 or 0: their slope.
    pub lean: f32,
}

impl Composed {
    pub fn plain(image: impl Into<DynamicImage>) -> Self {
        Self { image: image.into().into_rgba8(), lean: 1.0 }
    }
}

impl Composition {
    /// The name of its first image.
    pub fn name(&self) -> String {
        let Scalar { file, .. } = match self {
            Self::Image(file) | Self::Masked { colours: Some(file), .. } => return file_name(file),
            Self::Masked { mask: scalar, .. } | Self::Heights(scalar) => scalar,
            Self::Facets { roughness, metallic } => match roughness.as_ref().or(metallic.as_ref()) {
                Some(scalar) => scalar,
                None => return String::new(),
            },
        };
        file_name(file)
    }

    /// The texture of a name, beyond whose edges it goes on as `wrap` says; none where nothing can be read that says something.
    ///
    /// # Errors
    /// Images beyond the limits.
    pub fn compose(&self, name: &str, wrap: [Wrap; 2], decoder: &mut Decoder) -> Result<Option<Composed>, SceneError> {
        match self {
            Self::Image(file) => Ok(decoder.open(name, file)?.map(Composed::plain)),
            Self::Masked { colours, mask } => {
                let colours = colours.as_ref().map(|file| decoder.open(name, file)).transpose()?.flatten().map(DynamicImage::into_rgba8);
                layered(colours, [(3, mask.read(Channel::of_mask, decoder)?)], name, decoder)
            }
            Self::Facets { roughness, metallic } => {
                let mut read = |scalar: &Option<Scalar>| scalar.as_ref().map_or(Ok(None), |scalar| scalar.read(|_| Channel::Luminance, decoder));
                let layers = [(1, read(roughness)?), (2, read(metallic)?)];
                layered(None, layers, name, decoder)
            }
            Self::Heights(heights) => {
                let Some(image) = decoder.open(name, &heights.file)? else { return Ok(None) };
                if heights.channel.is_none() && has_colours_of_normals(&image) {
                    decoder.normals.push(file_name(&heights.file));
                    return Ok(Some(Composed::plain(image)));
                }
                Ok(normals(&numbers_of(&image, heights.channel.unwrap_or(Channel::Luminance)), wrap))
            }
        }
    }
}

impl Scalar {
    /// Its channel, or where none is said that of the image that `usual` tells.
    fn read(&self, usual: impl Fn(&DynamicImage) -> Channel, decoder: &mut Decoder) -> Result<Option<Numbers>, SceneError> {
        let image = decoder.open(&file_name(&self.file), &self.file)?;
        Ok(image.map(|image| numbers_of(&image, self.channel.unwrap_or_else(|| usual(&image)))))
    }
}

fn numbers_of(image: &DynamicImage, channel: Channel) -> Numbers {
    let of = |channel: usize| {
        let all = image.to_rgba16();
        Numbers::from_fn(all.width(), all.height(), |x, y| Luma([all.get_pixel(x, y).0[channel]]))
    };
    match channel {
        Channel::Red => of(0),
        Channel::Green => of(1),
        Channel::Blue => of(2),
        Channel::Alpha => of(3),
        Channel::Luminance => image.to_luma16(),
    }
}

/// An image, white where there is none, with channels of their own: all as large as the largest. A channel without numbers is 1.
fn layered<const N: usize>(
    image: Option<RgbaImage>,
    channels: [(usize, Option<Numbers>); N],
    name: &str,
    decoder: &Decoder,
) -> Result<Option<Composed>, SceneError> {
    let sizes = || image.iter().map(RgbaImage::dimensions).chain(channels.iter().filter_map(|(_, numbers)| numbers.as_ref().map(Numbers::dimensions)));
    let Some(size) = sizes().reduce(|(a, b), (c, d)| (a.max(c), b.max(d))) else { return Ok(None) };
    decoder.expect_room(name, size.0, size.1)?;
    let white = || RgbaImage::from_pixel(size.0, size.1, Rgba([u8::MAX; 4]));
    let mut image = image.map_or_else(white, |image| fitted(image, size));
    for (channel, numbers) in channels {
        let numbers = numbers.unwrap_or_else(|| Numbers::from_pixel(1, 1, Luma([u16::MAX])));
        let bytes = fitted(numbers, size);
        image.pixels_mut().zip(bytes.pixels()).for_each(|(pixel, number)| pixel.0[channel] = (f32::from(number.0[0]) / 257.0).round() as u8);
    }
    Ok(Some(Composed { image, lean: 1.0 }))
}

fn fitted<P: Pixel + 'static>(image: ImageBuffer<P, Vec<P::Subpixel>>, size: (u32, u32)) -> ImageBuffer<P, Vec<P::Subpixel>> {
    if image.dimensions() == size { image } else { resize(&image, size.0, size.1, FilterType::Triangle) }
}

/// Whether an image is bluish as maps of normals are, whose red and green are a half on the whole; heights are grey.
fn has_colours_of_normals(image: &DynamicImage) -> bool {
    let image = image.to_rgb8();
    let mean = |channel: usize| {
        image.pixels().map(|pixel| u64::from(pixel.0[channel])).sum::<u64>() as f64 / (255.0 * f64::from(image.width()) * f64::from(image.height()))
    };
    let [red, green, blue] = [0, 1, 2].map(mean);
    [red, green].iter().all(|mean| (mean - 0.5).abs() < 0.15 && blue - mean > 0.2)
}

/// Normals of heights in texels, by what is higher on the right than on the left and above than below. Red and green span the steepest slope, so that gentle
/// ones keep their digits. None where all is flat.
fn normals(heights: &Numbers, wrap: [Wrap; 2]) -> Option<Composed> {
    let [width, height] = [heights.width(), heights.height()].map(|side| side as i32);
    let at = |x: i32, y: i32| f32::from(heights.get_pixel(wrap[0].texel(x, width), wrap[1].texel(y, height)).0[0]) / f32::from(u16::MAX);
    let leaning = |x: u32, y: u32| {
        let (x, y) = (x as i32, y as i32);
        [at(x - 1, y) - at(x + 1, y), at(x, y + 1) - at(x, y - 1)].map(|rise| 0.5 * rise)
    };
    let all = (0..heights.height()).flat_map(|y| (0..heights.width()).map(move |x| (x, y)));
    let steepest = all.flat_map(|(x, y)| leaning(x, y)).fold(0.0, |most: f32, slope| most.max(slope.abs()));
    let byte = |slope: f32| (127.5 + 127.5 * slope / steepest).round() as u8;
    let image = || {
        RgbaImage::from_fn(heights.width(), heights.height(), |x, y| {
            let [across, up] = leaning(x, y).map(byte);
            Rgba([across, up, u8::MAX, u8::MAX])
        })
    };
    (steepest > 0.0).then(|| Composed { image: image(), lean: steepest })
}

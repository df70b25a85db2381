//! MTL: what the materials of OBJ files are.

use super::{list, split_word, statement};
use crate::scene::{
    load::{
        PLAIN,
        compose::{Channel, Composition, Scalar},
        draft::{Draft, HALF},
        error::{Problem, SceneError},
        files::Files,
    },
    model::{DIELECTRIC, Glossy, Material, Reading, Wrap},
};
use glam::{Vec2, Vec3};
use std::{
    collections::{BTreeSet, HashMap},
    path::{Path, PathBuf},
};

/// Words that change how a surface looks, and are not read.
const UNREAD: [&str; 10] = ["disp", "decal", "refl", "map_Tr", "map_Ns", "map_Ps", "Ps", "Pc", "aniso", "Tf"];
/// Those of them that say nothing with a value of 0, and with one of 1.
const NEUTRAL: ([&str; 3], [&str; 1]) = (["Ps", "Pc", "aniso"], ["Tf"]);
/// The largest `-bm` that is read: what leans farther lies flat.
const MOST_STRENGTH: f32 = 1e6;
const TRANSPARENCY: &str = "transparency (`d` or `Tr`)";
const BLENDING: &str = "alpha blending (`map_d`): what hides less than half is a hole";

/// A material as its library describes it.
pub(super) struct Described {
    pub material: Material,
    maps: Maps,
    specular: Option<Vec3>,
    exponent: f32,
    emission: Option<Vec3>,
    roughness: Option<f32>,
    metallic: Option<f32>,
    illumination: i32,
    opacity: Option<f32>,
    transparency: f32,
    /// What it says that is left out.
    pub unread: BTreeSet<String>,
}

/// The images of a material, by what they are for.
#[derive(Default)]
struct Maps {
    colours: Option<Map>,
    mask: Option<Map>,
    specular: Option<Map>,
    roughness: Option<Map>,
    metallic: Option<Map>,
    emission: Option<Map>,
    normals: Option<Map>,
    heights: Option<Map>,
}

/// An image, and what its options say.
#[derive(Debug, PartialEq)]
struct Map {
    file: PathBuf,
    wrap: Wrap,
    /// Of an image that stands for numbers.
    channel: Option<Channel>,
    /// What multiplies heights, or how far normals lean.
    strength: f32,
    place: Place,
}

/// Where a surface lies on an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    scale: Vec2,
    offset: Vec2,
}

impl Default for Place {
    fn default() -> Self {
        Self { scale: Vec2::ONE, offset: Vec2::ZERO }
    }
}

impl Place {
    /// Of texture coordinates whose second points down, as options are about one that points up.
    pub fn of(self, uv: Vec2) -> Vec2 {
        let up = |uv: Vec2| Vec2::new(uv.x, 1.0 - uv.y);
        let placed = up(up(uv) * self.scale + self.offset);
        if placed.is_finite() { placed } else { Vec2::ZERO }
    }
}

/// A texture of a material.
pub(super) struct Textured {
    pub made_of: Composition,
    pub reading: Reading,
    pub place: Place,
}

/// Whether a word of a library comes before the name of a file.
pub(super) fn names_file(word: &str) -> bool {
    word.starts_with("map_") || matches!(word, "bump" | "norm" | "disp" | "decal" | "refl")
}

/// All materials of the libraries that are there. The one beside the OBJ file steps in for one that is not.
pub(super) fn read_libraries(path: &Path, files: &Files, names: &[&str], file: &str, draft: &mut Draft) -> Result<HashMap<String, Described>, SceneError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let beside = path.with_extension("mtl");
    let mut described = HashMap::new();
    for name in names.iter().flat_map(|names| library_names(folder, names, files)) {
        let named = folder.join(name.replace('\\', "/"));
        let found = if files.is_there(&named) {
            named
        } else if files.is_there(&beside) {
            draft.notes.push(format!("{file}: material library `{name}` is missing; the one beside the file was used"));
            beside.clone()
        } else {
            draft.notes.push(format!("{file}: material library `{name}` is missing"));
            continue;
        };
        match files.read_text(&found) {
            Ok(text) => read_library(&text, found.parent().unwrap_or(folder), &mut described, &mut draft.notes),
            Err(error) if error.problem() == Problem::TooLarge => return Err(error),
            Err(error) => draft.notes.push(format!("{file}: {error}")),
        }
    }
    Ok(described)
}

/// A statement names one library, with blanks or without, or several.
fn library_names<'n>(folder: &Path, names: &'n str, files: &Files) -> Vec<&'n str> {
    let is_there = |name: &&str| files.is_there(&folder.join(name.replace('\\', "/")));
    let parts: Vec<&str> = names.split_ascii_whitespace().collect();
    if is_there(&names) || !parts.iter().any(is_there) { vec![names] } else { parts }
}

fn read_library(text: &str, folder: &Path, described: &mut HashMap<String, Described>, notes: &mut Vec<String>) {
    let mut current: Option<Described> = None;
    let mut odd = Vec::new();
    let mut store = |entry: Option<Described>| {
        if let Some(entry) = entry {
            described.insert(entry.material.name.clone(), entry.settled());
        }
    };
    for line in text.lines() {
        let (word, rest) = statement(line);
        if word == "newmtl" {
            store(current.replace(Described::new(rest)));
        } else if let Some(entry) = &mut current
            && !entry.set(word, rest, folder)
        {
            odd.push(format!("`{word} {rest}`"));
        }
    }
    store(current);
    if !odd.is_empty() {
        notes.push(format!("lines of the material library that were not understood or are out of range: {}", list(&odd)));
    }
}

impl Described {
    fn new(name: &str) -> Self {
        Self {
            material: Material::diffuse(name, Vec3::splat(PLAIN)),
            maps: Maps::default(),
            specular: None,
            exponent: 0.0,
            emission: None,
            roughness: None,
            metallic: None,
            illumination: 2,
            opacity: None,
            transparency: 0.0,
            unread: BTreeSet::new(),
        }
    }

    /// Takes in one line; false where its value makes no sense.
    fn set(&mut self, word: &str, rest: &str, folder: &Path) -> bool {
        let in_unit = |c: &Vec3| c.cmple(Vec3::ONE).all();
        match word.to_ascii_lowercase().as_str() {
            "kd" => colour(rest).filter(in_unit).map(|c| self.material.reflectance = c).is_some(),
            "ks" => colour(rest).filter(in_unit).map(|c| self.specular = Some(c)).is_some(),
            "ke" => colour(rest).map(|c| self.emission = Some(c)).is_some(),
            "ns" => rest.parse().ok().filter(|n: &f32| n.is_finite() && *n >= 0.0).map(|n| self.exponent = n).is_some(),
            "illum" => rest.parse().map(|model| self.illumination = model).is_ok(),
            // An option may stand before the number.
            "d" => rest.split_ascii_whitespace().last().unwrap_or_default().parse().map(|opacity| self.opacity = Some(opacity)).is_ok(),
            "tr" => rest.parse().map(|transparency| self.transparency = transparency).is_ok(),
            "pr" => share(rest).map(|roughness| self.roughness = Some(roughness)).is_some(),
            "pm" => share(rest).map(|metallic| self.metallic = Some(metallic)).is_some(),
            name => {
                match self.maps.named(name) {
                    Some((place, word)) => *place = read_map(word, rest, folder, &mut self.unread),
                    None => self.unread.extend(unread_word(word, rest)),
                }
                true
            }
        }
    }

    /// Where roughness or metallic are given, they make the lobe. A highlight counts where the illumination model has one.
    fn settled(mut self) -> Self {
        self.material.glossy = self.lobe();
        if !matches!(self.material.glossy, Some(Glossy::Phong { .. })) && self.maps.specular.take().is_some() {
            self.unread.insert("`map_Ks` of surfaces without a highlight by `Ks`".to_owned());
        }
        let Maps { colours, mask, roughness, metallic, .. } = &self.maps;
        for (first, second, names) in [(colours, mask, "`map_d` that `map_Kd`"), (roughness, metallic, "`map_Pm` that `map_Pr`")] {
            if let (Some(first), Some(second)) = (first, second)
                && (first.place, first.wrap) != (second.place, second.wrap)
            {
                self.unread.insert(format!("options `-s`, `-o` and `-clamp` of {names} does not have"));
            }
        }
        // A map says how much by itself.
        let by_map = if self.maps.emission.is_some() { Vec3::ONE } else { Vec3::ZERO };
        self.material.emission = self.emission.unwrap_or(by_map);
        if self.maps.mask.is_some() {
            self.unread.insert(BLENDING.to_owned());
            self.material.alpha_cutoff = Some((HALF / of_map(self.opacity)).min(2.0));
        } else if self.opacity.map_or(self.transparency > 0.0, |opacity| opacity < 1.0) {
            self.unread.insert(TRANSPARENCY.to_owned());
        }
        self
    }

    fn lobe(&self) -> Option<Glossy> {
        let Self { roughness, metallic, maps, .. } = self;
        let has_map = maps.roughness.is_some() || maps.metallic.is_some();
        if has_map || roughness.is_some() || metallic.is_some_and(|metallic| metallic > 0.0) {
            let metallic = if maps.metallic.is_some() { of_map(*metallic) } else { metallic.unwrap_or(0.0) };
            let roughness = if maps.roughness.is_some() { of_map(*roughness) } else { roughness.unwrap_or(1.0) };
            let glossy = Glossy::MetallicRoughness { metallic, roughness, dielectric: Vec3::splat(DIELECTRIC) };
            return Some(glossy).filter(|glossy| has_map || !glossy.is_plain());
        }
        // A map alone may take what the diffuse part leaves.
        let by_map = if maps.specular.is_some() { Vec3::ONE - self.material.reflectance } else { Vec3::ZERO };
        let reflectance = self.specular.unwrap_or(by_map);
        (self.illumination >= 2 && reflectance != Vec3::ZERO).then_some(Glossy::Phong { reflectance, exponent: self.exponent })
    }

    /// Of the base colour, the lobe, normals and emission.
    pub fn textures(&self) -> [Option<Textured>; 4] {
        let Maps { colours, mask, specular, roughness, metallic, emission, normals, heights } = &self.maps;
        let image = |map: &Map| Composition::Image(map.file.clone());
        let base = match mask {
            Some(mask) => Some(Composition::Masked { colours: colours.as_ref().map(|map| map.file.clone()), mask: mask.scalar() }),
            None => colours.as_ref().map(image),
        };
        let facets = if roughness.is_some() || metallic.is_some() {
            Some(Composition::Facets { roughness: roughness.as_ref().map(Map::scalar), metallic: metallic.as_ref().map(Map::scalar) })
        } else {
            specular.as_ref().map(image)
        };
        let bent = normals.as_ref().map(image).or_else(|| heights.as_ref().map(|map| Composition::Heights(map.scalar())));
        let textured = |made_of: Option<Composition>, maps: &[&Option<Map>], is_linear: bool| {
            let first = maps.iter().find_map(|map| map.as_ref())?;
            Some(Textured { made_of: made_of?, reading: Reading { is_linear, is_fine: false, wrap: [first.wrap; 2] }, place: first.place })
        };
        [
            textured(base, &[colours, mask], false),
            textured(facets, &[roughness, metallic, specular], specular.is_none()),
            textured(bent, &[normals, heights], true),
            textured(emission.as_ref().map(image), &[emission], false),
        ]
    }

    /// Of its map of normals, or of heights.
    pub fn normal_scale(&self) -> f32 {
        self.maps.normals.as_ref().or(self.maps.heights.as_ref()).map_or(0.0, |map| map.strength)
    }
}

impl Maps {
    /// The place of a map by its word in small letters, and how the word is written.
    fn named(&mut self, word: &str) -> Option<(&mut Option<Map>, &'static str)> {
        Some(match word {
            "map_kd" => (&mut self.colours, "map_Kd"),
            "map_d" => (&mut self.mask, "map_d"),
            "map_ks" => (&mut self.specular, "map_Ks"),
            "map_pr" => (&mut self.roughness, "map_Pr"),
            "map_pm" => (&mut self.metallic, "map_Pm"),
            "map_ke" => (&mut self.emission, "map_Ke"),
            "norm" => (&mut self.normals, "norm"),
            "bump" | "map_bump" => (&mut self.heights, "bump"),
            _ => return None,
        })
    }
}

impl Map {
    fn scalar(&self) -> Scalar {
        Scalar { file: self.file.clone(), channel: self.channel }
    }
}

/// An option of a map.
enum MapOption {
    /// Known, and how it is left out where its value is not this.
    Neutral(&'static [&'static str]),
    Strength,
    Clamp,
    Channel,
    Offset,
    Scale,
}

/// The option of a name without its sign, and the most values that it has, numbers where they may be fewer.
fn map_option(name: &str) -> Option<(MapOption, usize)> {
    use MapOption::*;
    Some(match name {
        "blendu" | "blendv" => (Neutral(&["on"]), 1),
        "cc" => (Neutral(&["off"]), 1),
        "boost" => (Neutral(&["0"]), 1),
        "texres" => (Neutral(&[]), 1),
        "type" => (Neutral(&[]), 1),
        "mm" => (Neutral(&["0", "1"]), 2),
        "t" => (Neutral(&["0", "0", "0"]), 3),
        "o" => (Offset, 3),
        "s" => (Scale, 3),
        "bm" => (Strength, 1),
        "clamp" => (Clamp, 1),
        "imfchan" => (Channel, 1),
        _ => return None,
    })
}

/// The file of a map and its options, which stand before its name or behind it; names may hold blanks. What is left out is told.
fn read_map(word: &str, rest: &str, folder: &Path, unread: &mut BTreeSet<String>) -> Option<Map> {
    let mut map = Map { file: PathBuf::new(), wrap: Wrap::Repeat, channel: None, strength: 1.0, place: Place::default() };
    let mut name: Option<&str> = None;
    let mut rest = rest;
    while !rest.is_empty() {
        let (first, behind) = split_word(rest);
        let option = first.strip_prefix('-').and_then(|name| map_option(&name.to_ascii_lowercase()));
        if let Some((option, most)) = option {
            let (values, behind) = split_values(behind, most);
            if !map.apply(&option, &values) {
                unread.insert(format!("option `{}` of `{word}`", first.to_ascii_lowercase()));
            }
            rest = behind;
        } else if first.starts_with('-') && name.is_none() && !behind.is_empty() {
            // How many values it has is not known: what stands last is the name.
            unread.insert(format!("option `{first}` of `{word}`"));
            name = behind.split_ascii_whitespace().last();
            rest = "";
        } else {
            let (found, behind) = split_name(rest);
            name = name.or(Some(found));
            rest = behind;
        }
    }
    let means_nothing = [
        ("-bm", map.strength != 1.0 && !matches!(word, "bump" | "norm")),
        ("-imfchan", map.channel.is_some() && matches!(word, "map_Kd" | "map_Ks" | "map_Ke" | "norm")),
    ];
    unread.extend(means_nothing.iter().filter(|(_, there)| *there).map(|(option, _)| format!("option `{option}` of `{word}`")));
    map.file = folder.join(name?.replace('\\', "/"));
    Some(map)
}

/// The first values of an option: a single one of any kind, or numbers.
fn split_values(text: &str, most: usize) -> (Vec<&str>, &str) {
    let (mut values, mut rest) = (Vec::new(), text);
    while values.len() < most {
        let (value, behind) = split_word(rest);
        let is_value = if most == 1 { !value.starts_with('-') || value.parse::<f32>().is_ok() } else { value.parse::<f32>().is_ok() };
        if value.is_empty() || !is_value {
            break;
        }
        values.push(value);
        rest = behind;
    }
    (values, rest)
}

/// A name with its blanks, up to an option behind it.
fn split_name(text: &str) -> (&str, &str) {
    let is_option = |at: &usize| map_option(&split_word(&text[at + 2..]).0.to_ascii_lowercase()).is_some();
    let end = text.match_indices(" -").map(|(at, _)| at).find(is_option).unwrap_or(text.len());
    (text[..end].trim(), text[end..].trim())
}

impl Map {
    /// Takes in an option; false where it says what is not read.
    fn apply(&mut self, option: &MapOption, values: &[&str]) -> bool {
        let number = |text: &str| text.parse::<f32>().ok().filter(|number| number.is_finite());
        match (option, values) {
            (MapOption::Neutral(neutral), values) => {
                let alike =
                    |(value, neutral): (&&str, &&str)| number(value).map_or(value.eq_ignore_ascii_case(neutral), |value| number(neutral) == Some(value));
                neutral.is_empty() || values.iter().zip(*neutral).all(alike)
            }
            (MapOption::Strength, [value]) => {
                number(value).filter(|strength| strength.abs() <= MOST_STRENGTH).map(|strength| self.strength = strength).is_some()
            }
            (MapOption::Clamp, [value]) => {
                self.wrap = if value.eq_ignore_ascii_case("on") { Wrap::Clamp } else { Wrap::Repeat };
                true
            }
            (MapOption::Channel, [value]) => {
                self.channel = Channel::named(value);
                self.channel.is_some()
            }
            (MapOption::Offset, values) => numbers_over(&mut self.place.offset, values),
            (MapOption::Scale, values) => numbers_over(&mut self.place.scale, values),
            _ => false,
        }
    }
}

/// Puts the first two of some numbers in the place of a pair's; false where there are none. Images have no third coordinate.
fn numbers_over(pair: &mut Vec2, values: &[&str]) -> bool {
    let numbers: Vec<f32> = values.iter().filter_map(|value| value.parse().ok()).filter(|number: &f32| number.is_finite()).collect();
    pair.x = numbers.first().copied().unwrap_or(pair.x);
    pair.y = numbers.get(1).copied().unwrap_or(pair.y);
    !numbers.is_empty()
}

/// A factor beside its map. Many programs write 0 where there is a map.
fn of_map(factor: Option<f32>) -> f32 {
    factor.filter(|factor| *factor > 0.0).unwrap_or(1.0)
}

/// A word of a library that is not read, unless its value means that there is nothing to read.
fn unread_word(word: &str, rest: &str) -> Option<String> {
    let name = UNREAD.into_iter().find(|name| name.eq_ignore_ascii_case(word))?;
    let is_all = |value: f32| rest.split_ascii_whitespace().all(|word| word.parse() == Ok(value));
    let says_nothing = NEUTRAL.0.contains(&name) && is_all(0.0) || NEUTRAL.1.contains(&name) && is_all(1.0);
    (!says_nothing).then(|| format!("`{name}`"))
}

/// A number of 0 to 1.
fn share(rest: &str) -> Option<f32> {
    rest.parse().ok().filter(|share| (0.0..=1.0).contains(share))
}

/// Three numbers, or one for all channels; none negative.
fn colour(rest: &str) -> Option<Vec3> {
    let numbers: Vec<f32> = rest.split_ascii_whitespace().map(str::parse).collect::<Result<_, _>>().ok()?;
    let colour = match numbers[..] {
        [grey] => Vec3::splat(grey),
        [r, g, b, ..] => Vec3::new(r, g, b),
        _ => return None,
    };
    (colour.is_finite() && colour.cmpge(Vec3::ZERO).all()).then_some(colour)
}

//! One pipeline, ready to be run on scenes of the extremes.

use super::Trouble;
use super::rooms::{Built, Room};
use crate::contract::Value;
use crate::contract::{encoder::Setting, tables::Remembered};
use crate::gpu::{Gpu, Pace, block_on, scene::kind};
use crate::math::lobe::Lobe;
use crate::measure::layers::Layers;
use crate::measure::run::Run;
use crate::pipeline::plan::Saved;
use crate::pipeline::{Node, Pipeline, Plan, Problems, plan};
use glam::Vec3;
use std::cell::OnceCell;
use std::f64::consts::PI;
use std::sync::Arc;

/// Loads the pipeline with these parameters changed, each `NODE.PARAM=VALUE`.
pub type LoadPipeline<'a> = dyn Fn(&[String]) -> Result<Pipeline, Problems> + 'a;

/// Width and height of the pictures [pixels].
pub(super) const SIZE: [u32; 2] = [16, 12];

/// What keeps a run short: few samples a record, small shadow maps, few outgoing directions, few records of a second cache, few texels of a lightmap.
const SMALL: [Change; 7] = [
    ("HemisphereTiles", "resolution", "16"),
    ("ShadowMap", "resolution", "256"),
    ("LobeCoefficients", "grid", "24"),
    ("PathVertices", "paths", "2048"),
    ("PathVertices", "records", "512"),
    ("Lightmap", "resolution", "32"),
    ("Lightmap", "iterations", "24"),
];

/// A pass, one of its parameters, and a value for all nodes that use the pass.
pub(super) type Change<'c> = (&'c str, &'c str, &'c str);

/// Every pixel asks for a record of its own, whose validity radius is a tenth of the pixel: what a pixel shows is one sum.
pub(super) const RECORD_A_PIXEL: [Change; 2] = [("RecordCache", "minimum_spacing", "0.1"), ("RecordCache", "maximum_spacing", "0.1")];

/// Records see the emitters and the sky, so that closed forms of their light are those of the irradiance.
pub(super) const RECORDS_SEE_LIGHT: [Change; 1] = [("DirectLight", "emitters", "Records")];

/// A pipeline and the device that it runs on.
pub struct Bench<'a> {
    gpu: &'a Arc<Gpu>,
    load: &'a LoadPipeline<'a>,
    pipeline: Pipeline,
    /// The corner as it stands, which several cases compare with.
    corner: OnceCell<Shot>,
    /// Cases share what depends on their parameters alone.
    tables: Remembered,
}

/// What a picture shows, checked to be finite, not negative, covered, and the same twice.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Shot {
    /// Irradiance of red, green and blue [W/m²].
    pub irradiance: [Vec<f32>; 3],
    /// The whole picture, red, green and blue in turn.
    pub picture: Vec<f32>,
    /// Pixels that see a surface.
    pub surfaces: Vec<bool>,
    pub records: u32,
}

/// What a lobe reflects, checked to be finite and not negative.
pub(super) struct Light {
    /// Red, green and blue in turn.
    pub values: Vec<f32>,
    /// Between each pixel's normal and the direction to the viewer; 0 where no surface is seen.
    pub cosines: Vec<f32>,
    pub lobe: Option<Lobe>,
}

impl Light {
    pub fn mean(&self) -> f64 {
        self.values.iter().map(|value| f64::from(*value)).sum::<f64>() / self.values.len() as f64
    }

    /// Root mean square of the differences from `factor` times another's, over the mean of these.
    pub fn distance(&self, other: &Self, factor: f64) -> f64 {
        let squares = self.values.iter().zip(&other.values).map(|(ours, theirs)| (f64::from(*ours) - factor * f64::from(*theirs)).powi(2));
        (squares.sum::<f64>() / self.values.len() as f64).sqrt() / (factor * other.mean())
    }

    /// The same from what is known for each cosine.
    pub fn mean_distance(&self, known: impl Fn(f32) -> Vec3) -> f64 {
        let known: Vec<[f32; 3]> = self.cosines.iter().map(|cosine| if *cosine > 0.0 { known(*cosine).into() } else { [0.0; 3] }).collect();
        let values = (0..3).flat_map(|channel| known.iter().map(move |known| known[channel])).collect();
        self.distance(&Self { values, cosines: Vec::new(), lobe: None }, 1.0)
    }
}

impl<'a> Bench<'a> {
    /// # Errors
    /// What is wrong with the pipeline as it stands.
    pub fn new(gpu: &'a Arc<Gpu>, load: &'a LoadPipeline<'a>) -> Result<Self, Problems> {
        Ok(Self { gpu, load, pipeline: load(&[])?, corner: OnceCell::new(), tables: Remembered::default() })
    }

    /// The pipeline's nodes, those of loops included.
    fn nodes(&self) -> Vec<&Node> {
        let mut nodes: Vec<&Node> = self.pipeline.nodes.iter().collect();
        let mut next = 0;
        while next < nodes.len() {
            nodes.extend(nodes[next].inner());
            next += 1;
        }
        nodes
    }

    fn nodes_of(&self, pass: &str) -> Vec<&Node> {
        self.nodes().into_iter().filter(|node| node.description().name == pass).collect()
    }

    /// The changes as `NODE.PARAM=VALUE`; those of passes that the pipeline does not use fall away.
    fn sets(&self, changes: &[Change]) -> Vec<String> {
        let of =
            |(pass, parameter, value): &Change| self.nodes_of(pass).into_iter().map(|node| format!("{}.{parameter}={value}", node.name)).collect::<Vec<_>>();
        changes.iter().flat_map(of).collect()
    }

    /// Refuses to go on with a case that is about a pass which the pipeline does not use.
    pub(super) fn expect_pass(&self, pass: &str) -> Result<(), Trouble> {
        if self.nodes_of(pass).is_empty() { Err(Trouble::Absent(format!("the pipeline has no {pass}"))) } else { Ok(()) }
    }

    /// The same with a case that does not hold where a pass is used; `because` says why.
    pub(super) fn expect_no_pass(&self, pass: &str, because: &str) -> Result<(), Trouble> {
        if self.nodes_of(pass).is_empty() { Ok(()) } else { Err(Trouble::Absent(because.into())) }
    }

    /// The same with a case that a lightmap's own texels would have to be finer for than the scene makes them.
    pub(super) fn expect_no_shown_lightmap(&self) -> Result<(), Trouble> {
        let is_shown = ["Lightmap", "IndirectLight"].iter().all(|pass| !self.nodes_of(pass).is_empty());
        if is_shown { Err(Trouble::Absent("all surfaces share the texels of a lightmap".into())) } else { Ok(()) }
    }

    /// The name of the way that a pass's nodes take, of those that have it as a choice.
    pub(super) fn way(&self, pass: &str, parameter: &str) -> Option<&'static str> {
        let value = |node: &&Node| node.arguments.iter().find(|(name, _)| *name == parameter).map(|(_, value)| value.clone());
        self.nodes_of(pass).first().and_then(value).and_then(|value| if let Value::Choice(name, _) = value { Some(name) } else { None })
    }

    /// The irradiance that records find in a furnace of radiance 1: π, or less where tiles leave out a part of the hemisphere.
    pub(super) fn furnace(&self) -> f64 {
        let open = self.way("Compensation", "method") == Some("None");
        let share = self.nodes_of("HemisphereTiles").first().and_then(|tiles| match tiles.arguments.choice("shape") {
            ("Plane", arguments) if open => Some((arguments.float("fov").to_radians() / 2.0).sin()),
            _ => None,
        });
        // The share of the cosine-weighted hemisphere in a square window whose mid-edges are at this sine.
        share.map_or(PI, |sine| 4.0 * sine * sine.atan())
    }

    /// The corner as it stands.
    pub(super) fn corner(&self) -> Result<&Shot, Trouble> {
        if let Some(corner) = self.corner.get() {
            return Ok(corner);
        }
        let corner = self.shot(&Room::corner(), &[])?;
        Ok(self.corner.get_or_init(|| corner))
    }

    /// Whether the loader and the plan accept a scene and parameters; needs no device.
    pub(super) fn accepts(&self, room: &Room, changes: &[Change]) -> Result<(), Trouble> {
        self.plan(&room.built()?, changes).map(drop)
    }

    fn plan(&self, built: &Built, changes: &[Change]) -> Result<Arc<Plan>, Trouble> {
        let pipeline = (self.load)(&self.sets(&[&SMALL, changes].concat()))?;
        let scene = &built.stage.scene;
        let setting = Setting { scene, needs: &built.needs, device: self.gpu.adapter.device(), size: SIZE, tables: Some(&self.tables) };
        Ok(plan(&pipeline, setting, &[], &kind)?)
    }

    /// Renders a room, twice from empty caches, and checks all that must hold of any picture.
    pub(super) fn shot(&self, room: &Room, changes: &[Change]) -> Result<Shot, Trouble> {
        let built = room.built()?;
        let plan = self.plan(&built, changes)?;
        let mut run = self.run(&built, &plan)?;
        let first = whole(&mut run)?;
        block_on(run.reset())?;
        if whole(&mut run)? == first { Ok(first) } else { Err(Trouble::Failed("two runs draw different pictures".into())) }
    }

    /// Renders a room of one material and tells what its lobe reflects: of the sky, if the pipeline computes that, or of what the records saw.
    pub(super) fn light(&self, room: &Room, changes: &[Change]) -> Result<Light, Trouble> {
        let built = room.built()?;
        let plan = self.plan(&built, changes)?;
        let mut run = self.run(&built, &plan)?;
        block_on(run.frame(&|| Pace::GoOn))?;
        let picture = block_on(run.picture())?;
        expect_no_negative_light(&picture)?;
        let layer = if self.nodes_of("EnvironmentLight").is_empty() { "glossy" } else { "sky" };
        let values = picture.rgb(layer).map_err(|_| Trouble::Absent(format!("the pipeline outputs no {layer}")))?;
        let normal = |axis: &str| picture.layers.get("normal").and_then(|normals| normals.channels.get(axis));
        let (Some(x), Some(y), Some(z)) = (normal("X"), normal("Y"), normal("Z")) else {
            return Err(Trouble::Absent("the pipeline outputs no normals".into()));
        };
        let material = &built.stage.scene.materials[built.stage.scene.triangles[0].material as usize];
        let toward = |at: usize| -built.stage.scene.cameras[0].pixel_ray(SIZE, [at as u32 % SIZE[0], at as u32 / SIZE[0]]).normalize();
        let cosines = (0..x.len()).map(|at| toward(at).dot(Vec3::new(x[at], y[at], z[at]))).collect();
        Ok(Light { values: values.concat(), cosines, lobe: material.reflection(material.reflectance).lobe })
    }

    fn run(&self, built: &Built, plan: &Arc<Plan>) -> Result<Run, Trouble> {
        Ok(block_on(Run::new(self.gpu, &built.stage, plan, &built.stage.scene.cameras[0], SIZE))?)
    }

    /// Renders a room, fills the cache with copies of the records that it made, `count` in all, and renders again.
    pub(super) fn shots_with_copies(&self, room: &Room, count: u32) -> Result<[Shot; 2], Trouble> {
        let built = room.built()?;
        let plan = self.plan(&built, &[("RecordCache", "capacity", &count.to_string())])?;
        let mut run = self.run(&built, &plan)?;
        let alone = whole(&mut run)?;
        let accumulated = &plan.schedule.accumulated.resources;
        let records: Vec<&Saved> = plan.persistent.iter().filter(|saved| !accumulated.contains(&saved.history.items)).collect();
        let [Saved { history, .. }] = records[..] else {
            return Err(Trouble::Absent("the pipeline keeps no records, or several caches".into()));
        };
        let mut records = block_on(run.bytes(history.items))?;
        records.truncate(run.variable(history.count) as usize * history.item_bytes as usize);
        let copies: Vec<u8> = records.iter().copied().cycle().take(count as usize * history.item_bytes as usize).collect();
        run.restore(history, &copies, count);
        Ok([alone, whole(&mut run)?])
    }
}

/// One frame; refuses what no frame may leave.
fn whole(run: &mut Run) -> Result<Shot, Trouble> {
    let report = block_on(run.frame(&|| Pace::GoOn))?;
    let picture = block_on(run.picture())?;
    if !report.complete {
        return Err(Trouble::Failed(format!("{} pixels are not covered", report.uncovered_pixels.unwrap_or(0))));
    }
    expect_no_negative_light(&picture)?;
    let planes =
        |name: &str| picture.rgb(name).map(|planes| planes.map(<[f32]>::to_vec)).map_err(|_| Trouble::Absent(format!("the pipeline outputs no {name}")));
    let depth = planes("depth")?;
    Ok(Shot {
        irradiance: planes("irradiance")?,
        picture: planes("picture")?.concat(),
        surfaces: depth[0].iter().map(|depth| *depth > 0.0).collect(),
        records: report.records.irradiance.unwrap_or(0),
    })
}

/// Of all layers but normals, whose components may point anywhere.
fn expect_no_negative_light(picture: &Layers) -> Result<(), Trouble> {
    let layers = picture.layers.iter().filter(|(name, _)| *name != "normal");
    let least = |(name, layer): (&String, &crate::measure::Layer)| Some((name.clone(), layer.channels.values().flatten().copied().reduce(f32::min)?));
    match layers.filter_map(least).find(|(_, least)| *least < 0.0) {
        Some((name, least)) => Err(Trouble::Failed(format!("{name} holds {least}"))),
        None => Ok(()),
    }
}

impl Shot {
    pub fn covered(&self) -> usize {
        self.surfaces.iter().filter(|seen| **seen).count()
    }

    /// Values of all channels where a surface is seen.
    pub fn values(&self) -> impl Iterator<Item = f64> {
        let of_plane = |plane| self.surfaces.iter().zip(plane).filter(|(seen, _)| **seen).map(|(_, value): (_, &f32)| f64::from(*value));
        self.irradiance.iter().flat_map(of_plane)
    }

    /// Root mean square of the differences from `factor` times another's irradiance, over that one's mean, where both see a surface.
    pub fn distance(&self, other: &Self, factor: f64) -> f64 {
        let both = || self.surfaces.iter().zip(&other.surfaces).map(|(ours, theirs)| *ours && *theirs);
        let pairs = self.irradiance.iter().zip(&other.irradiance).flat_map(|(ours, theirs)| ours.iter().zip(theirs).zip(both()));
        let pairs: Vec<[f64; 2]> = pairs.filter(|(_, both)| *both).map(|((ours, theirs), _)| [f64::from(*ours), factor * f64::from(*theirs)]).collect();
        let mean = |value: fn(&[f64; 2]) -> f64| pairs.iter().map(value).sum::<f64>() / pairs.len() as f64;
        mean(|[ours, theirs]| (ours - theirs).powi(2)).sqrt() / mean(|[_, theirs]| *theirs)
    }

    /// The largest relative distance of any value from `truth`.
    pub fn farthest(&self, truth: f64) -> f64 {
        self.values().map(|value| (value / truth - 1.0).abs()).fold(0.0, f64::max)
    }
}

//! One pipeline on one scene: frames, their report, their pictures, the records they leave.

use super::layers::{Layer, Layers, VALUE};
use crate::contract::{
    Port,
    encoder::{Persistent, Reported},
    port::{Channels, Image},
};
use crate::gpu::{AskPace, Frame, Gpu, GpuError, Reader, Session, State, Unfinished};
use crate::pipeline::{Plan, Problems, plan::Saved};
use crate::scene::{
    Camera,
    stage::{Change, Changed, Stage, Unchangeable},
};
use crate::schedule::{Format, Histories, Resource, ResourceKind, Schedule, Variable, Window};
use miette::Diagnostic;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;
use thiserror::Error;

/// A plan made ready on a device. Several frames share its histories.
pub struct Run {
    plan: Arc<Plan>,
    session: Session,
    size: [u32; 2],
    /// Of a frame that was run ahead of the next picture, which it counts for.
    ahead: Option<FrameReport>,
}

/// What a frame measured; a number that cannot be had is None, never 0.
#[derive(Debug, Clone, Serialize)]
pub struct FrameReport {
    /// From its start to its end [s].
    pub seconds: f64,
    /// In the caches afterwards.
    pub records: Records,
    /// Those that it has added.
    pub new_records: Option<u32>,
    /// Records that an earlier one of their batch would have covered.
    pub surplus_records: Option<u32>,
    /// Rounds of the loops that run until they are done.
    pub fill_rounds: Option<u32>,
    /// How often the host waited, before the frame's end, for what the device made.
    pub waits: u32,
    /// Pixels that no record reaches.
    pub uncovered_pixels: Option<u32>,
    /// Pixels that miss a record, as time was up, and have the light of farther ones.
    pub coarse_pixels: Option<u32>,
    /// How many times the stated accuracy the coarsest of them has; 0 where there is none.
    pub coarsest: Option<u32>,
    /// Pixels of its outputs that are NaN or infinite: a frame that has any is an error where its picture is read.
    pub non_finite_pixels: Option<u32>,
    /// What its nodes took.
    pub passes: Vec<PassReport>,
    /// Whether every loop came to its end and every pixel is covered at the stated accuracy.
    pub complete: bool,
    /// Loops that ended before they were done, and why.
    pub unfinished: Vec<Unfinished>,
}

/// Records in caches, by what they hold.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Records {
    /// Of diffuse light.
    pub irradiance: Option<u32>,
    /// Of what arrives from where.
    pub radiance: Option<u32>,
}

/// What a node took in a frame.
#[derive(Debug, Clone, Serialize)]
pub struct PassReport {
    /// Its name.
    pub node: String,
    /// That of its pass.
    pub pass: &'static str,
    /// On the device, where that has timestamps [ms].
    pub gpu_ms: Option<f64>,
    /// In host steps, waiting for what they read included [ms].
    pub cpu_ms: f64,
    /// How often it ran.
    pub runs: u32,
    /// What the node itself reports, by name.
    pub numbers: BTreeMap<&'static str, u32>,
}

/// A number that a node reports after a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Number<'p> {
    node: &'p str,
    name: &'static str,
    place: Reported,
    value: u32,
}

/// What goes wrong with a frame or with saved records.
#[derive(Debug, Error, Diagnostic)]
#[expect(missing_docs, reason = "the messages say it")]
pub enum RunError {
    #[error(transparent)]
    #[diagnostic(transparent)]
    Gpu(#[from] GpuError),
    #[error("{pixels} pixels of `{layer}` are not finite")]
    #[diagnostic(code(render::non_finite), help("light beyond single precision, or a fault of the pass that made the layer; nothing was written"))]
    NonFinite { layer: String, pixels: u32 },
    #[error("no picture for the texture: {reason}")]
    #[diagnostic(
        code(run::output),
        help("`Plan::outputs` has the names; a texture for an output is as large as the picture, of the format that `Run::texture` has")
    )]
    Output { reason: String },
    #[error("the file of records does not fit: {reason}")]
    #[diagnostic(code(render::cache), help("records are good for the scene and the layout of records that made them; name another file to start anew"))]
    Cache { reason: String },
}

/// What a change took.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Renewed {
    /// What changed was brought to the device.
    Changes,
    /// The scene needs other memory or other programs: all of it was brought to the device, and shaders were built.
    Whole,
}

/// Why a run does not go on with another scene or another size.
#[derive(Debug, Error, Diagnostic)]
pub enum ChangeError {
    /// The scene does not change so.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Scene(#[from] Unchangeable),
    /// The scene as it would be cannot be planned for.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Plan(#[from] Problems),
    /// The device does not go on.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Run(#[from] RunError),
}

impl RunError {
    /// Whether it is the adapter that does not take the pipeline.
    pub fn is_refusal(&self) -> bool {
        matches!(self, Self::Gpu(GpuError::Limit { .. } | GpuError::MissingFeature { .. }))
    }
}

impl Run {
    /// Brings a scene to the device, and makes all memory and shaders that the plan needs. `size` is the picture's width and height [pixels].
    pub async fn new(gpu: &Arc<Gpu>, stage: &Arc<Stage>, plan: &Arc<Plan>, camera: &Camera, size: [u32; 2]) -> Result<Self, RunError> {
        let session = Session::new(gpu, stage, &plan.schedule, &plan.placement, camera, size).await?;
        Ok(Self { plan: plan.clone(), session, size, ahead: None })
    }

    /// Width and height of the picture [pixels].
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Bytes on the device.
    pub fn gpu_bytes(&self) -> u64 {
        self.session.gpu_bytes
    }

    /// What it runs.
    pub fn plan(&self) -> &Arc<Plan> {
        &self.plan
    }

    /// Goes on with another plan of the same pipeline: histories stay, parameters change.
    ///
    /// # Errors
    /// Where the plan needs other memory or other programs.
    pub fn switch_to(&mut self, plan: &Arc<Plan>) -> Result<(), RunError> {
        self.session.switch_to(&plan.schedule)?;
        self.plan = plan.clone();
        Ok(())
    }

    /// What it renders.
    pub fn stage(&self) -> &Arc<Stage> {
        self.session.stage()
    }

    /// Changes the scene, and goes on with what `plan` makes of it then.
    ///
    /// # Errors
    /// What cannot change so, and what planning refuses: then all is as it was. What the device says.
    pub async fn renew(&mut self, changes: &[Change], plan: impl FnOnce(&Self) -> Result<Arc<Plan>, Problems>) -> Result<Renewed, ChangeError> {
        let undoing = self.stage().undoing(changes);
        let changed = self.session.change(changes)?;
        match plan(self) {
            Ok(plan) => Ok(if self.follow(&changed, &plan).await? { Renewed::Whole } else { Renewed::Changes }),
            Err(problems) => {
                self.session.change(&undoing)?;
                Err(problems.into())
            }
        }
    }

    /// Goes on with a plan for the scene as it was changed; whether that took other memory or other programs, so that all was made anew.
    async fn follow(&mut self, changed: &Changed, plan: &Arc<Plan>) -> Result<bool, RunError> {
        match self.switch_to(plan) {
            Ok(()) => Ok(self.session.follow(changed).await.map(|()| false)?),
            Err(RunError::Gpu(GpuError::OtherRecording { .. })) => {
                let mut anew = self.anew(plan, self.size).await?;
                anew.keep_records(self, |records| plan.schedule.survivors.resources.contains(&records.items));
                *self = anew;
                Ok(true)
            }
            Err(error) => Err(error),
        }
    }

    /// Goes on with pictures of another size, by a plan for that, with the records as they are.
    pub(crate) async fn resize(&mut self, size: [u32; 2], plan: &Arc<Plan>) -> Result<(), RunError> {
        let (gpu, mut resized) = (self.session.gpu().clone(), self.anew(plan, size).await?);
        let keeping = async {
            resized.keep_records(self, |_| true);
            resized.keep_accumulated(self);
            Ok(())
        };
        gpu.told("keeping the records", keeping).await?;
        *self = resized;
        Ok(())
    }

    /// A run of another plan, of the same scene seen from the same place.
    async fn anew(&self, plan: &Arc<Plan>, size: [u32; 2]) -> Result<Self, RunError> {
        let mut run = Self::new(self.session.gpu(), self.session.stage(), plan, self.session.camera(), size).await?;
        run.session.remember_views(&self.session);
        run.ahead.clone_from(&self.ahead);
        Ok(run)
    }

    /// Takes over the records of another run that were made in the same way, as many as there is room for.
    fn keep_records(&mut self, other: &mut Self, are_kept: impl Fn(&Persistent) -> bool) {
        let (plan, others) = (self.plan.clone(), other.plan.clone());
        for Saved { history, made_by, .. } in plan.persistent.iter().filter(|saved| are_kept(&saved.history)) {
            let same = |saved: &&Saved| (saved.history.name, saved.history.item_bytes, &saved.made_by) == (history.name, history.item_bytes, made_by);
            let Some(before) = others.persistent.iter().find(same) else { continue };
            let room = plan.schedule.resource(history.items).kind.bytes() / history.item_bytes;
            let count = u64::from(other.variable(before.history.count)).min(room);
            self.session.copy_from(history.items, (&mut other.session, before.history.items), count * history.item_bytes);
            self.session.set_variable(history.count, count as u32);
        }
    }

    /// Takes over what another run of the same pipeline has added to from frame to frame.
    fn keep_accumulated(&mut self, other: &mut Self) {
        let (own, others) = (self.plan.schedule.clone(), other.plan.schedule.clone());
        for resource in &own.accumulated.resources {
            let described = own.resource(*resource);
            let is_same = |other: &&Resource| others.resource(**other).name == described.name && others.resource(**other).kind == described.kind;
            let Some(before) = others.accumulated.resources.iter().find(is_same) else { return };
            self.session.copy_from(*resource, (&mut other.session, *before), described.kind.bytes());
        }
        for variable in &own.accumulated.variables {
            let name = |schedule: &Schedule, variable: Variable| schedule.variables[variable.0 as usize].name.clone();
            let before = others.accumulated.variables.iter().find(|other| name(&others, **other) == name(&own, *variable));
            before.into_iter().for_each(|before| self.session.set_variable(*variable, other.variable(*before)));
        }
    }

    /// See [`Session::assume_still`].
    pub fn assume_still(&mut self) {
        self.session.assume_still();
    }

    /// The next frame looks from there. Records stay.
    pub fn set_camera(&mut self, camera: &Camera) {
        self.session.set_camera(camera);
    }

    /// As before the first frame: no records, no histories.
    pub async fn reset(&mut self) -> Result<(), RunError> {
        self.ahead = None;
        Ok(self.session.reset().await?)
    }

    /// Renders one frame and reads its numbers.
    ///
    /// # Errors
    /// What the device says, and pixels that are not finite.
    pub async fn frame(&mut self, pace: AskPace<'_>) -> Result<FrameReport, RunError> {
        let frame = self.session.frame(pace).await?;
        let report = self.report(frame).await?;
        Ok(match self.ahead.take() {
            Some(ahead) => ahead.and(report),
            None => report,
        })
    }

    /// How many frames later than the last picture one is to be run ahead now, before the next. None where none is.
    pub fn window(&self) -> Option<u32> {
        let Window { frames, open } = self.plan.schedule.window?;
        let frames = Some(self.session.variable(frames)).filter(|frames| *frames > 1);
        frames.filter(|_| self.session.variable(open) == 0)
    }

    /// Runs a frame for the records alone, so many frames later than the last picture: what lives on has the light of then, and goes over to it until then. The scene and
    /// the camera are those of then; what it takes counts for the next picture, which is the one after the last.
    ///
    /// # Errors
    /// As those of a frame.
    pub async fn look_ahead(&mut self, frames: u32, pace: AskPace<'_>) -> Result<(), RunError> {
        let frame = self.session.frame_ahead(frames, pace).await?;
        self.ahead = Some(self.report(frame).await?);
        Ok(())
    }

    /// Reads a frame's numbers.
    async fn report(&mut self, frame: Frame) -> Result<FrameReport, RunError> {
        let plan = self.plan.clone();
        let mut numbers = Vec::new();
        for (node, name, place) in &plan.reports {
            numbers.push(Number { node, name, place: *place, value: self.number(*place).await? });
        }
        let report = report(frame, &numbers);
        match report.non_finite_pixels {
            Some(pixels) if pixels > 0 => Err(RunError::NonFinite { layer: "splats".into(), pixels }),
            _ => Ok(report),
        }
    }

    async fn number(&mut self, place: Reported) -> Result<u32, RunError> {
        match place {
            Reported::Variable(variable) => Ok(self.session.variable(variable)),
            Reported::Buffer(buffer, index) => {
                let numbers: Vec<u32> = bytemuck::pod_collect_to_vec(&self.session.read(buffer).await?);
                Ok(numbers.get(index as usize).copied().unwrap_or(0))
            }
        }
    }

    /// The layers that the pipeline outputs, checked to be finite.
    pub async fn picture(&self) -> Result<Layers, RunError> {
        let (mut picture, mut reader) = (Layers::new(self.size[0], self.size[1]), self.session.reader());
        for (layer, port) in &self.plan.outputs {
            if let Some(image) = image(port) {
                picture.layers.insert(layer.name.clone(), self.read_layer(&mut reader, &layer.name, image).await?);
            }
        }
        Ok(picture)
    }

    /// One image as a layer.
    pub async fn layer(&self, name: &str, image: Image) -> Result<Layer, RunError> {
        self.read_layer(&mut self.session.reader(), name, image).await
    }

    async fn read_layer(&self, reader: &mut Reader<'_>, name: &str, image: Image) -> Result<Layer, RunError> {
        let is_half = matches!(self.plan.schedule.resource(image.texture).kind, ResourceKind::Texture { format: Format::Rgba16Float, .. });
        let as_layer = |bytes: &[u8]| {
            let values = floats(bytes, is_half);
            match image.channels {
                Channels::Colour => Layer::interleaved(&["R", "G", "B"], &values, 4),
                Channels::Vector => Layer::interleaved(&["X", "Y", "Z"], &values, 4),
                Channels::Single => Layer::interleaved(&[VALUE], &values, 4),
                Channels::Fourth => Layer::value(values.chunks_exact(4).map(|pixel| pixel[3]).collect()),
            }
        };
        let layer = reader.look(image.texture, as_layer).await?;
        let bad = layer.channels.values().map(|plane| plane.iter().filter(|v| !v.is_finite()).count()).max().unwrap_or(0);
        if bad > 0 {
            return Err(RunError::NonFinite { layer: name.into(), pixels: bad as u32 });
        }
        Ok(layer)
    }

    /// The texture that an output is in, as it lies on the device, until the next frame: red, green and blue as linear floats. None where the pipeline has no
    /// such output.
    pub fn texture(&mut self, output: &str) -> Option<&wgpu::Texture> {
        let plan = self.plan.clone();
        let (_, port) = plan.outputs.iter().find(|(layer, _)| layer.name == output)?;
        Some(self.session.image(image(port)?.texture))
    }

    /// Copies an output to a texture of the same size and format, on the device.
    ///
    /// # Errors
    /// Where the pipeline has no such output, or the texture is another than it takes; what the driver says of the texture.
    pub async fn copy_to(&mut self, output: &str, to: &wgpu::Texture) -> Result<(), RunError> {
        let gpu = self.session.gpu().clone();
        let no_output = || RunError::Output { reason: format!("the pipeline has no output `{output}`") };
        let image = self.texture(output).ok_or_else(no_output)?;
        let [found, wanted] = [to, image].map(|texture| (texture.size(), texture.format()));
        if found != wanted {
            return Err(RunError::Output { reason: format!("`{output}` is {}, the texture {}", described(wanted), described(found)) });
        }
        let copying = async {
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            encoder.copy_texture_to_texture(image.as_image_copy(), to.as_image_copy(), image.size());
            gpu.queue.submit([encoder.finish()]);
            gpu.check(COPYING)
        };
        Ok(gpu.told(COPYING, copying).await?)
    }

    /// Contents of a resource.
    pub async fn bytes(&self, resource: Resource) -> Result<Vec<u8>, RunError> {
        Ok(self.session.read(resource).await?)
    }

    /// A number of the schedule, as the last frame left it.
    pub fn variable(&self, variable: crate::schedule::Variable) -> u32 {
        self.session.variable(variable)
    }

    /// The last value in the frame that was not 0.
    pub fn latest(&self, variable: crate::schedule::Variable) -> u32 {
        self.session.latest(variable)
    }

    /// The items of a history, and how many they are.
    pub(super) async fn items(&self, history: &Persistent) -> Result<(Vec<u8>, u32), RunError> {
        let count = self.variable(history.count);
        let bytes = (history.item_bytes * u64::from(count)).min(self.plan.schedule.resource(history.items).kind.bytes());
        Ok((self.session.reader().look_first(history.items, bytes as usize, <[u8]>::to_vec).await?, count))
    }

    /// What the next frame finds of those before it, beside the items of histories; see [`Session::state`].
    pub(super) async fn state(&self) -> Result<Option<State>, RunError> {
        Ok(self.session.state(&self.itemised()).await?)
    }

    /// Goes on from that; whether it fits.
    pub(super) fn go_on_from(&mut self, state: &State) -> bool {
        let itemised = self.itemised();
        self.session.go_on_from(state, &itemised)
    }

    /// Goes on with what is added to in any frame; whether it fits.
    pub(super) fn add_to(&mut self, state: &State) -> bool {
        let itemised = self.itemised();
        self.session.add_to(state, &itemised)
    }

    /// Histories of items.
    fn itemised(&self) -> Histories {
        let histories = || self.plan.persistent.iter().map(|saved| &saved.history);
        Histories { resources: histories().map(|history| history.items).collect(), variables: histories().map(|history| history.count).collect() }
    }

    /// Takes the scene as it is now, seen by a camera, for what the picture before showed: records that are [loaded](super::cache::Cache::give) are of that moment.
    pub fn see_before(&mut self, camera: &Camera) {
        self.session.set_camera(camera);
        self.session.see_before();
    }

    /// Puts saved items back into a history.
    pub(super) fn restore(&mut self, history: &Persistent, items: &[u8], count: u32) {
        self.session.write(history.items, items);
        self.session.set_variable(history.count, count);
    }
}

/// What a driver does that refuses the texture of another program.
const COPYING: &str = "copying a picture";

fn described((size, format): (wgpu::Extent3d, wgpu::TextureFormat)) -> String {
    format!("{}x{} pixels of {format:?}", size.width, size.height)
}

/// Texels as they lie in memory, four numbers a pixel, as floats.
fn floats(bytes: &[u8], are_half: bool) -> Cow<'_, [f32]> {
    if are_half {
        return bytemuck::pod_collect_to_vec::<u8, half::f16>(bytes).into_iter().map(half::f16::to_f32).collect();
    }
    bytemuck::try_cast_slice(bytes).map_or_else(|_| Cow::Owned(bytemuck::pod_collect_to_vec(bytes)), Cow::Borrowed)
}

/// The image that an output shows.
pub fn image(port: &Port) -> Option<Image> {
    match port {
        Port::Image(image) => Some(*image),
        Port::DirectLight(direct) => Some(Image { texture: direct.radiance, channels: Channels::Colour }),
        Port::VisibleLobes(lobes) => Some(Image { texture: lobes.seen, channels: Channels::Colour }),
        Port::Splats(splats) => Some(Image { texture: splats.sums, channels: Channels::Fourth }),
        _ => None,
    }
}

/// Several nodes may report one name: records of several caches add up, those of one cache count once.
fn total(numbers: &[Number<'_>], name: &str) -> Option<u32> {
    let mut named: Vec<&Number<'_>> = Vec::new();
    for number in numbers.iter().filter(|number| number.name == name) {
        if named.iter().all(|other| other.place != number.place) {
            named.push(number);
        }
    }
    named.iter().map(|number| number.value).reduce(u32::saturating_add)
}

/// The pixels of one picture, counted by several nodes, are told as the node has them that found the most.
fn most(numbers: &[Number<'_>], name: &str) -> Option<u32> {
    numbers.iter().filter(|number| number.name == name).map(|number| number.value).max()
}

fn report(frame: Frame, numbers: &[Number<'_>]) -> FrameReport {
    let of_node = |node: &str| numbers.iter().filter(|number| number.node == node).map(|number| (number.name, number.value)).collect();
    let [uncovered_pixels, coarse_pixels, coarsest] = ["uncovered_pixels", "coarse_pixels", "coarsest"].map(|name| most(numbers, name));
    let has_gap = [uncovered_pixels, coarse_pixels].into_iter().flatten().any(|pixels| pixels > 0);
    let unfinished: Vec<Unfinished> = frame.unfinished.into_iter().filter(|ended| ended.is_certain || has_gap).collect();
    FrameReport {
        seconds: frame.seconds,
        records: Records { irradiance: total(numbers, "records"), radiance: total(numbers, "radiance_records") },
        new_records: total(numbers, "new_records"),
        surplus_records: total(numbers, "surplus_records"),
        fill_rounds: frame.fill_rounds,
        waits: frame.waits,
        uncovered_pixels,
        coarse_pixels,
        coarsest,
        non_finite_pixels: most(numbers, "non_finite_pixels"),
        passes: frame
            .nodes
            .into_iter()
            .map(|n| PassReport { numbers: of_node(&n.node), node: n.node, pass: n.pass, gpu_ms: n.gpu_ms, cpu_ms: n.cpu_ms, runs: n.runs })
            .collect(),
        complete: unfinished.is_empty() && !has_gap,
        unfinished,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::NodeTimes;
    use crate::schedule::{Shortfall, Variable};

    fn number(node: &'static str, name: &'static str, place: u32, value: u32) -> Number<'static> {
        Number { node, name, place: Reported::Variable(Variable(place)), value }
    }

    /// Two nodes that find gaps, two that add to one cache, one that adds to another.
    #[test]
    fn nodes_that_report_one_name_do_not_hide_each_other() {
        let numbers = [
            number("near", "uncovered_pixels", 0, 7),
            number("far", "uncovered_pixels", 1, 0),
            number("first", "records", 2, 100),
            number("second", "records", 2, 100),
            number("third", "records", 3, 10),
        ];
        let node = |name: &str| NodeTimes { node: name.into(), ..NodeTimes::default() };
        let frame = Frame { seconds: 1.0, nodes: vec![node("near"), node("far")], fill_rounds: None, waits: 0, unfinished: Vec::new() };
        let report = report(frame, &numbers);
        assert_eq!((report.uncovered_pixels, report.complete), (Some(7), false));
        assert_eq!((report.records.irradiance, report.new_records), (Some(110), None));
        assert!(report.unfinished.is_empty());
        let own: Vec<_> = report.passes.iter().map(|pass| pass.numbers["uncovered_pixels"]).collect();
        assert_eq!(own, [7, 0]);
    }

    /// A loop that could do no more had to do no more where every pixel is covered.
    #[test]
    fn a_loop_without_room_is_unfinished_where_pixels_are_uncovered() {
        let ended = |is_certain| Unfinished { name: "fill".into(), because: Shortfall::CacheFull, is_certain };
        let unfinished = |pixels, is_certain| {
            let frame = Frame { seconds: 1.0, nodes: Vec::new(), fill_rounds: Some(1), waits: 0, unfinished: vec![ended(is_certain)] };
            let report = report(frame, &[number("light", "uncovered_pixels", 0, pixels)]);
            (report.unfinished.len(), report.complete)
        };
        assert_eq!([unfinished(0, false), unfinished(1, false), unfinished(0, true)], [(0, true), (1, false), (1, false)]);
    }
}

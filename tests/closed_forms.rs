//! Light whose closed form is known, through whole pipelines on the device: each shape of tile, each way of seeing, each
//! compensation and each sum, against formulas that this file works out by itself. Half of the pairs are long cases, which run with `--ignored` or `--include-ignored`.
//!
//! Every pixel asks for a record of its own, so that a picture of a few pixels holds records at as many places, turned
//! about their normals by as many angles. Needs a GPU adapter, a software one will do; without one each case is named
//! as skipped, which `HEMISPLAT_REQUIRE=gpu` makes a failure.

use glam::{DVec3, Vec3};
mod skips;

use hemisplat::{
    block_on,
    contract::{Port, encoder::Setting},
    gpu::{Gpu, Pace, scene::kind},
    measure::{Layers, run::Run},
    passes::{REGISTRY, record::Record},
    pipeline::{Plan, load, plan},
    reference::{self, Bounces, Pixels, Stop},
    scene::{Glossy, Maps, Reading, Scene, Texture, Tint, Wrap, load as scene_load, needs::Needs, stage::Stage},
};
use libtest_mimic::{Arguments, Failed};
use skips::Missing;
use std::{
    f64::consts::{PI, TAU},
    fs,
    path::Path,
    sync::Arc,
};

type Outcome = Result<(), Failed>;

fn main() {
    let gpu = block_on(Gpu::open()).map_err(|e| e.to_string());
    let missing = gpu.as_ref().err().map(|reason| Missing::new("gpu", reason));
    let long: (String, bool, Case) =
        ("photons_in_an_oven photon-gather-density".into(), true, Box::new(|gpu| photons_in_an_oven(gpu, "photon-gather-density", 0.02)));
    let of_views = of_views().into_iter().chain([long]).map(|(name, is_long, case)| {
        let gpu = gpu.clone();
        let run = move || case(&gpu?);
        skips::short_or_long(name, is_long, missing.as_ref(), run)
    });
    let others = cases().into_iter().map(|(name, case)| {
        let gpu = gpu.clone();
        skips::trial(name, missing.as_ref(), move || case(&gpu?))
    });
    libtest_mimic::run(&Arguments::from_args(), of_views.chain(others).collect()).exit();
}

type Case = Box<dyn FnOnce(&Arc<Gpu>) -> Outcome + Send>;

/// A form that every view is held against, or those views that it is known for.
struct Form {
    name: &'static str,
    /// Whether all of its pairs are long cases.
    is_long: bool,
    is_known_for: fn(&View) -> bool,
    check: fn(&Arc<Gpu>, &View) -> Outcome,
}

const FORMS: [Form; 6] = [
    Form { name: "a_cube_of_lamps", is_long: false, is_known_for: |_| true, check: cube_of_lamps },
    Form { name: "tiles_of_all_sizes", is_long: false, is_known_for: View::is_whole, check: tiles_of_all_sizes },
    Form { name: "the_largest_tiles", is_long: true, is_known_for: View::is_whole, check: largest_tiles },
    Form { name: "a_corner_of_coloured_walls", is_long: false, is_known_for: View::is_whole, check: coloured_corner },
    Form { name: "the_centre_of_a_sphere", is_long: false, is_known_for: View::is_whole, check: centre_of_a_sphere },
    Form { name: "a_wall_before_the_sky", is_long: false, is_known_for: |view| view.shape != "Plane", check: wall_before_the_sky },
];

/// Each view against each form, by name, and whether that is a long case: every other one is, so that every run has each form and each view.
fn of_views() -> Vec<(String, bool, Case)> {
    let mut all: Vec<(String, bool, Case)> = Vec::new();
    for (row, form) in FORMS.iter().enumerate() {
        for (column, view) in views().into_iter().enumerate().filter(|(_, view)| (form.is_known_for)(view)) {
            let name = format!("{} {}", form.name, view.name());
            all.push((name, form.is_long || (row + column) % 2 == 1, Box::new(move |gpu| (form.check)(gpu, &view))));
        }
    }
    all
}

fn cases() -> Vec<(String, Case)> {
    let mut cases: Vec<(String, Case)> = vec![
        ("lights_and_the_shadow_of_a_screen".into(), Box::new(shadow_of_a_screen)),
        ("a_sift_loses_no_triangle".into(), Box::new(sift_loses_nothing)),
        ("one_bounce_in_an_oven".into(), Box::new(one_bounce_in_an_oven)),
        ("all_bounces_in_an_oven".into(), Box::new(all_bounces_in_an_oven)),
    ];
    for place in ["Host", "Device"] {
        cases.push((format!("shots_in_an_oven {place}"), Box::new(move |gpu| shots_in_an_oven(gpu, place))));
    }
    cases.push(("all_ways_choose_the_same_texels".into(), Box::new(all_ways_choose_the_same_texels)));
    cases.push(("the_printed_formula_loses_light".into(), Box::new(the_printed_formula_loses_light)));
    for place in ["Host", "Device"] {
        cases.push((format!("walls_that_shine_and_reflect {place}"), Box::new(move |gpu| walls_that_shine_and_reflect(gpu, place))));
    }
    for (pipeline, limit) in [("photon", 0.02), ("photon-density", 0.02), ("photon-gather", 0.01)] {
        cases.push((format!("photons_in_an_oven {pipeline}"), Box::new(move |gpu| photons_in_an_oven(gpu, pipeline, limit))));
    }
    for pipeline in ["irradiance-bounces", "photon", "photon-gather"] {
        cases.push((format!("no_light_comes_through_a_wall {pipeline}"), Box::new(move |gpu| no_light_comes_through_a_wall(gpu, pipeline))));
    }
    for (pipeline, place) in [("irradiance-bounces", "Host"), ("irradiance-bounces", "Device"), ("photon", "Host"), ("photon-gather", "Host")] {
        let both = move |gpu: &Arc<Gpu>| no_light_comes_past_a_wall_that_both_sides_are_seen_of(gpu, pipeline, place);
        cases.push((format!("no_light_comes_past_a_wall_that_both_sides_are_seen_of {pipeline} {place}"), Box::new(both)));
    }
    for pipeline in ["radiance", "radiance-bounces"] {
        cases.push((format!("a_mirror_lights_a_floor {pipeline}"), Box::new(move |gpu| a_mirror_lights_a_floor(gpu, pipeline))));
    }
    cases.push(("a_mirror_is_as_good_as_the_image".into(), Box::new(a_mirror_is_as_good_as_the_image)));
    for place in ["Host", "Device"] {
        cases.push((format!("maps_of_one_value_are_factors {place}"), Box::new(move |gpu| maps_of_one_value_are_factors(gpu, place))));
        cases.push((format!("an_emission_map_makes_a_smaller_lamp {place}"), Box::new(move |gpu| an_emission_map_makes_a_smaller_lamp(gpu, place))));
    }
    cases.push(("squares_finer_than_pixels_are_grey".into(), Box::new(squares_finer_than_pixels_are_grey)));
    cases.push(("the_formulas_hold".into(), Box::new(formulas_hold)));
    cases.push(("small_pictures_are_whole".into(), Box::new(small_pictures_are_whole)));
    cases.push(("mistakes_are_refused".into(), Box::new(mistakes_are_refused)));
    cases
}

// Rooms and what is rendered of them

/// A scene, ready to be rendered.
struct Room {
    stage: Arc<Stage>,
    needs: Needs,
}

impl Room {
    fn new(document: &str) -> Result<Self, Failed> {
        let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
        let path = folder.path().join("room.ron");
        fs::write(&path, document).map_err(|e| e.to_string())?;
        let scene = scene_load::load(&path, &scene_load::LoadOptions::default()).map_err(|e| e.to_string())?;
        Ok(Self::of(scene))
    }

    fn of(scene: Scene) -> Self {
        let stage = Stage::new(scene);
        let needs = Needs::of(&stage.scene);
        Self { stage: Arc::new(stage), needs }
    }
}

/// Edge of the pictures [pixels].
const EDGE: u32 = 8;

/// What a pipeline's first frame of a room leaves, once every pixel is covered.
fn rendered<T>(
    gpu: &Arc<Gpu>,
    room: &Room,
    size: [u32; 2],
    (pipeline, sets): (&str, &[String]),
    look: impl Fn(&Run, &Plan) -> Result<T, Failed>,
) -> Result<T, Failed> {
    let Room { stage, needs } = room;
    let scene = &stage.scene;
    let told = |e| format!("{:?}", miette::Report::new(e));
    let pipeline = load(pipeline, sets, REGISTRY, &mut |path| fs::read_to_string(path)).map_err(told)?;
    let plan = plan(&pipeline, Setting { scene, needs, device: gpu.adapter.device(), size, tables: None }, &[], &kind).map_err(told)?;
    let mut run = block_on(Run::new(gpu, stage, &plan, &scene.cameras[0], size)).map_err(|e| e.to_string())?;
    let report = block_on(run.frame(&|| Pace::GoOn)).map_err(|e| e.to_string())?;
    check(report.complete && report.uncovered_pixels.unwrap_or(0) == 0, || format!("{report:?}"))?;
    look(&run, &plan)
}

/// The records that a pipeline makes of a room, one a pixel: each reaches a tenth of a pixel.
fn lit(gpu: &Arc<Gpu>, room: &Room, edge: u32, sets: &[String]) -> Result<Vec<Record>, Failed> {
    let reach = ["cache.minimum_spacing=0.1", "cache.maximum_spacing=0.1"].map(String::from);
    rendered(gpu, room, [edge, edge], ("irradiance-one-rate", &[&reach, sets].concat()), |run, plan| {
        let Some(Port::RecordCache(cache)) = plan.ports.get("cache.cache") else { return Err("no cache".into()) };
        let count = run.variable(cache.count);
        check(count == edge * edge, || format!("{count} records"))?;
        let bytes = block_on(run.bytes(cache.records)).map_err(|e| e.to_string())?;
        let records: Vec<Record> = bytemuck::pod_collect_to_vec(&bytes[..count as usize * size_of::<Record>()]);
        pixels_show(&block_on(run.picture()).map_err(|e| e.to_string())?, &records)?;
        Ok(records)
    })
}

/// A pixel shows its own record at the record's own place, so that both add to the same.
fn pixels_show(picture: &Layers, records: &[Record]) -> Outcome {
    let planes = picture.rgb("irradiance").map_err(|e| e.to_string())?;
    planes.into_iter().enumerate().try_for_each(|(channel, plane)| {
        let [shown, held] = [plane.iter().sum::<f32>(), records.iter().map(|record| record.irradiance[channel]).sum()];
        check((shown - held).abs() <= 1e-5 * held, || format!("pixels show {shown} of the {held} that records hold"))
    })
}

fn check(holds: bool, what: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(what().into()) }
}

// Ways of seeing and summing

/// Records are the same to the bit, whether triangles between their samples are dropped before they are drawn or not: where a few of
/// them are seen, and where so many that a view draws them all the same.
fn sift_loses_nothing(gpu: &Arc<Gpu>) -> Outcome {
    for (scale, offset, resolutions) in [(1.0, 0.0, &[4, 16, 40][..]), (1e-3, 0.0, &[16]), (1e4, 0.0, &[16]), (1.0, 3e4, &[16])] {
        let room = Room::new(&balls(scale, offset))?;
        for shape in ["Plane(fov: 126.87)", "Hemicube"] {
            for resolution in resolutions {
                sift_changes_nothing(gpu, &room, shape, *resolution)
                    .map_err(|e| format!("{scale} times the size at {offset}: {}", e.message().unwrap_or_default()))?;
            }
        }
    }
    // Every sample is before hundreds of triangles: more than the sift has room for.
    sift_changes_nothing(gpu, &Room::new(&shells())?, "Plane(fov: 126.87)", 8)
}

fn sift_changes_nothing(gpu: &Arc<Gpu>, room: &Room, shape: &str, resolution: u32) -> Outcome {
    let records = |by: &str| {
        let sets = [format!("tiles.shape={shape}"), format!("tiles.by={by}"), format!("tiles.resolution={resolution}")];
        lit(gpu, room, EDGE, &sets)
    };
    let (sifted, all) = (records("Raster")?, records("Raster(sift: false)")?);
    let differ = sifted.iter().zip(&all).filter(|(a, b)| a != b).count();
    check(differ == 0, || format!("{differ} of {} records by a {shape} of {resolution}² samples", all.len()))
}

/// Spheres of many triangles in a box, where nothing coincides, so that no order decides what is seen.
fn balls(scale: f64, offset: f64) -> String {
    let at = |[x, y, z]: [f64; 3]| format!("({}, {}, {})", x * scale + offset, y * scale + offset, z * scale + offset);
    let ball = |centre, radius: f64, subdivisions| format!("Sphere(centre: {}, radius: {}, subdivisions: {subdivisions})", at(centre), radius * scale);
    let geometry = [
        format!("Box(min: {}, max: {}, material: \"walls\")", at([-3.0; 3]), at([3.0; 3])),
        ball([0.0, 0.0, 0.0], 0.6, 4),
        ball([1.7, -0.4, 0.9], 1.1, 4),
        ball([-1.0, 0.8, -2.0], 0.3, 5),
    ];
    colourful(&geometry.join(", "), at)
}

/// Boxes around boxes, seen from within the innermost.
fn shells() -> String {
    let shell = |number: u32| {
        let half = 3.0 + 0.01 * number as f64;
        format!("Box(min: (-{half}, -{half}, -{half}), max: ({half}, {half}, {half}), material: \"walls\")")
    };
    colourful(&(0..700).map(shell).collect::<Vec<_>>().join(", "), |[x, y, z]| format!("({x}, {y}, {z})"))
}

/// A lit scene of this geometry, about the origin and 3 in each direction before `at` places it.
fn colourful(geometry: &str, at: impl Fn([f64; 3]) -> String) -> String {
    format!(
        r#"Scene(version: 1, geometry: [{geometry}], normals: Face,
        materials: {{ "walls": Diffuse(reflectance: (0.8, 0.5, 0.4)), "*": Diffuse(reflectance: (0.3, 0.5, 0.8)) }},
        lights: [Point(position: {}, intensity: (60, 56, 50))],
        cameras: {{ "main": (eye: {}, target: {}, fov: 80) }})"#,
        at([-2.0, 2.0, 0.4]),
        at([-2.8, 0.2, 1.6]),
        at([0.0; 3])
    )
}

/// A way to see a hemisphere.
#[derive(Debug, Clone, Copy)]
struct View {
    shape: &'static str,
    /// Who casts rays, or that no rays are cast.
    way: &'static str,
    method: &'static str,
}

/// Samples along a side, where nothing else is said.
const RESOLUTION: u32 = 64;
const SUMS: [&str; 5] = ["Device", "MipmapChain", "PingPong", "CpuReadback", "Host"];
/// Half width of the sampling plane at distance 1, as RCS has it.
const HALF_WIDTH: f64 = 2.0;

/// Every shape by every way that it can be seen, the incomplete one with every compensation.
fn views() -> Vec<View> {
    let shapes = [
        ("Plane", "Raster"),
        ("Plane", "Device"),
        ("Plane", "Host"),
        ("Hemicube", "Raster"),
        ("Hemicube", "Device"),
        ("Hemicube", "Host"),
        ("Hemispherical", "Raster"),
        ("Hemispherical", "Device"),
        ("Hemispherical", "Host"),
        ("Cosine", "Device"),
        ("Cosine", "Host"),
        ("Concentric", "Device"),
        ("Concentric", "Host"),
    ];
    let methods = |shape| if shape == "Plane" { &["BorderExtension", "CoverageRatio", "None"][..] } else { &["None"] };
    shapes.into_iter().flat_map(|(shape, way)| methods(shape).iter().map(move |method| View { shape, way, method })).collect()
}

impl View {
    fn name(&self) -> String {
        format!("{} {} {}", self.shape, self.way, self.method)
    }

    fn sets(&self, resolution: u32, sum: &str) -> Vec<String> {
        let shape = if self.shape == "Plane" { format!("Plane(fov: {})", 2.0 * HALF_WIDTH.atan().to_degrees()) } else { self.shape.into() };
        let Self { method, .. } = self;
        vec![
            format!("tiles.shape={shape}"),
            format!("tiles.by={}", if self.way == "Raster" { "Raster" } else { "Rays" }),
            format!("tiles.place={}", if self.way == "Raster" { "Auto" } else { self.way }),
            format!("tiles.resolution={resolution}"),
            format!("closed.method={method}"),
            if sum == "Host" || sum == "Device" { format!("records.place={sum}") } else { format!("records.by={sum}") },
            // What fits into a batch of the largest tiles.
            "fill.order=Batched(at_most: 8)".into(),
        ]
    }

    /// Whether the samples stand for the whole hemisphere wherever the surroundings stand upright.
    fn is_whole(&self) -> bool {
        self.shape != "Plane" || self.method == "BorderExtension"
    }
}

// How near a tile of samples can come

impl View {
    /// Width of a sample: on the plane around the normal, on a hemicube's faces, in the disc under the hemisphere, in
    /// azimuth for strata.
    fn width(&self, resolution: u32) -> f64 {
        let width = match self.shape {
            "Plane" => 2.0 * HALF_WIDTH,
            "Cosine" => TAU,
            _ => 2.0,
        };
        width / f64::from(resolution)
    }

    /// Share of the cosine-weighted hemisphere that the samples see: the window's integral of `1/(1+u²+v²)²`.
    fn share(&self) -> f64 {
        let t = HALF_WIDTH / HALF_WIDTH.hypot(1.0);
        if self.shape == "Plane" { 4.0 / PI * t * t.atan() } else { 1.0 }
    }

    /// Irradiance in a furnace of radiance 1.
    fn furnace(&self) -> f64 {
        if self.is_bare() { PI * self.share() } else { PI }
    }

    fn is_bare(&self) -> bool {
        self.shape == "Plane" && self.method == "None"
    }

    /// What the irradiance and the translation gradient of a lamp that the samples see whole are multiplied by.
    fn gain(&self) -> f64 {
        if self.method == "CoverageRatio" { 1.0 / self.share() } else { 1.0 }
    }

    /// Root mean square error of the irradiance from a lamp of radiance 1. A sample that the lamp's outline cuts counts
    /// whole or not at all: off by 1/√12 of its weight, which is the square of its width at most. The outline is no
    /// longer than the horizon, τ. Where columns of samples run along upright edges, all of a column errs alike: two
    /// edges, each off by 1/√12 of a column, which is half as wide in the mean as at the horizon.
    fn lamp_error(&self, resolution: u32) -> f64 {
        let width = self.width(resolution);
        let upright = matches!(self.shape, "Hemicube" | "Cosine");
        let error = if upright { 2f64.sqrt() * width / 2.0 } else { (TAU / width).sqrt() * width.powi(2) };
        error / 12f64.sqrt()
    }

    /// The same of the rotation gradient: its moduli add to π²/2 where the irradiance adds to π.
    fn rotation_error(&self, resolution: u32) -> f64 {
        PI / 2.0 * self.lamp_error(resolution)
    }

    /// Root mean square error of the translation gradient in proportion to its walls' lengths, which may cancel. To the
    /// first order: a wall stands half a sample beside its edge at most, where its weight differs by twice as much at
    /// most (`d ln(1+u²)⁻²/du ≥ −2`); and the nearer of the surfaces beside it is met a sample away, where the distance
    /// of an upright one differs by 1/u as much, one and a half in the mean over the edges of the cube.
    fn wall_error(&self, resolution: u32) -> f64 {
        (0.5 * 2.0 + 1.5) * self.width(resolution)
    }

    /// Relative error of the harmonic mean distance, below and above: of the second order for samples in the middle of
    /// what they stand for, and what the quadrature of the truth leaves. What a border sample stands for below the plane
    /// it sees in the distance of the border; an upright wall there is nearer, by the sine of the border's polar angle.
    fn distance_error(&self, resolution: u32) -> [f64; 2] {
        let order = self.width(resolution).powi(2) + 1e-4;
        let border = HALF_WIDTH / HALF_WIDTH.hypot(1.0);
        [-order, order + (1.0 - self.share()) * (1.0 / border - 1.0)]
    }

    /// Rounding of a furnace's sum in single precision: four times what errors of half a unit add up to at random.
    fn rounding(&self, resolution: u32) -> f64 {
        let samples = f64::from(resolution).powi(2) * if self.shape == "Hemicube" { 3.0 } else { 1.0 };
        4.0 * f64::from(f32::EPSILON) / 2.0 * samples.sqrt()
    }
}

/// Differences between what was found and what is true, and what they are measured by.
#[derive(Default)]
struct Comparison {
    errors: f64,
    scales: f64,
    count: f64,
}

impl Comparison {
    fn add(&mut self, found: DVec3, truth: DVec3, scale: f64) {
        self.errors += (found - truth).length_squared();
        self.scales += scale * scale;
        self.count += 1.0;
    }

    /// Root mean square of the differences.
    fn absolute(&self) -> f64 {
        (self.errors / self.count).sqrt()
    }

    /// In proportion to the root mean square of the scales.
    fn relative(&self) -> f64 {
        (self.errors / self.scales).sqrt()
    }
}

fn at_most(what: &str, error: f64, limit: f64) -> Outcome {
    check(error <= limit, || format!("{what} is {error:.2e} off, more than {limit:.2e}"))
}

// Lambert's formula and the walls

type Polygon = [DVec3; 4];

/// `∫ ω dω` over what a point sees of a polygon; its component along a normal is the irradiance of radiance 1 (Lambert 1760).
fn moment(point: DVec3, polygon: &Polygon) -> DVec3 {
    let edge = |i: usize| {
        let (a, b) = (polygon[i] - point, polygon[(i + 1) % 4] - point);
        a.cross(b).normalize_or_zero() * a.angle_between(b) / 2.0
    };
    let sum: DVec3 = (0..4).map(edge).sum();
    sum * sum.dot(polygon[0] + polygon[2] - 2.0 * point).signum()
}

/// The derivatives of a polygon's irradiance on a surface of this normal, from differences.
fn translation(point: DVec3, normal: DVec3, polygon: &Polygon) -> DVec3 {
    const STEP: f64 = 1e-5;
    let difference = |axis: DVec3| (moment(point + axis * STEP, polygon) - moment(point - axis * STEP, polygon)).dot(normal) / (2.0 * STEP);
    DVec3::new(difference(DVec3::X), difference(DVec3::Y), difference(DVec3::Z))
}

/// `∫ cosθ n/r dℓ` along each edge, n the tangent of the sphere across it: what the walls of a tile add up to.
fn walls(point: DVec3, normal: DVec3, polygon: &Polygon) -> [DVec3; 4] {
    const STEPS: usize = 256;
    std::array::from_fn(|i| {
        let (from, along) = (polygon[i] - point, polygon[(i + 1) % 4] - polygon[i]);
        let across = from.cross(along);
        let at = |step: usize| from + along * ((step as f64 + 0.5) / STEPS as f64);
        let integral: f64 = (0..STEPS).map(|step| at(step).dot(normal) / at(step).length_squared().powi(2)).sum();
        across * (integral / STEPS as f64)
    })
}

fn position(record: &Record) -> DVec3 {
    Vec3::from(record.position).as_dvec3()
}

fn vector([x, y, z, _]: [f32; 4]) -> DVec3 {
    DVec3::new(x.into(), y.into(), z.into())
}

// A cube of lamps

/// A unit cube that reflects nothing: all of it emits red, the ceiling green too, the wall at x = 1 blue.
const LAMPS: &str = r#"Scene(version: 1, geometry: [
    Quad(corners: ((0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)), material: "red"),
    Quad(corners: ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)), material: "red"),
    Quad(corners: ((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)), material: "red"),
    Quad(corners: ((0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0)), material: "red"),
    Quad(corners: ((0, 1, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1)), material: "yellow"),
    Quad(corners: ((1, 0, 0), (1, 0, 1), (1, 1, 1), (1, 1, 0)), material: "magenta")],
    materials: { "red": Emitter(radiance: (1, 0, 0)), "yellow": Emitter(radiance: (1, 1, 0)), "magenta": Emitter(radiance: (1, 0, 1)) },
    normals: Face, cameras: { "main": (eye: (0.5, 0.9, 0.5), direction: (0, -1, 0), up: (0, 0, 1), fov: 53) })"#;

const CEILING: Polygon = [DVec3::new(0.0, 1.0, 0.0), DVec3::new(1.0, 1.0, 0.0), DVec3::new(1.0, 1.0, 1.0), DVec3::new(0.0, 1.0, 1.0)];
const WALL: Polygon = [DVec3::new(1.0, 0.0, 0.0), DVec3::new(1.0, 0.0, 1.0), DVec3::new(1.0, 1.0, 1.0), DVec3::new(1.0, 1.0, 0.0)];

/// Channels of the three lamps.
const RED: usize = 0;
const GREEN: usize = 1;
const BLUE: usize = 2;

/// The furnace is claimed by all; the ceiling, which lies within the plane's window whatever its turn, by all; the wall,
/// which reaches below the window, by those who see or stand for the whole hemisphere.
fn cube_of_lamps(gpu: &Arc<Gpu>, view: &View) -> Outcome {
    let room = Room::new(LAMPS)?;
    for sum in SUMS {
        let records = lit(gpu, &room, EDGE, &see_lamps(view.sets(RESOLUTION, sum)))?;
        cube_forms(view, RESOLUTION, &records).map_err(|e| format!("{sum}: {}", e.message().unwrap_or_default()))?;
    }
    Ok(())
}

/// The same for all sizes of tiles: limits shrink with the samples.
fn tiles_of_all_sizes(gpu: &Arc<Gpu>, view: &View) -> Outcome {
    let room = Room::new(LAMPS)?;
    [4, 8, 16, 32, 128].into_iter().try_for_each(|resolution| tiles_of(gpu, view, &room, EDGE, resolution))
}

fn largest_tiles(gpu: &Arc<Gpu>, view: &View) -> Outcome {
    tiles_of(gpu, view, &Room::new(LAMPS)?, EDGE / 2, 512)
}

fn tiles_of(gpu: &Arc<Gpu>, view: &View, room: &Room, edge: u32, resolution: u32) -> Outcome {
    let records = lit(gpu, room, edge, &see_lamps(view.sets(resolution, SUMS[0])))?;
    cube_forms(view, resolution, &records).map_err(|e| format!("{resolution}²: {}", e.message().unwrap_or_default()).into())
}

/// Records see the lamps; the direct pass leaves them out.
fn see_lamps(mut sets: Vec<String>) -> Vec<String> {
    sets.push("direct.emitters=Records".into());
    sets
}

fn cube_forms(view: &View, resolution: u32, records: &[Record]) -> Outcome {
    furnace(view, resolution, records)?;
    lamp(view, resolution, records, &CEILING, GREEN)?;
    if view.is_whole() {
        lamp(view, resolution, records, &WALL, BLUE)?;
        distances(view, resolution, records)?;
    }
    Ok(())
}

/// Radiance 1 from everywhere: π, or what the window holds of it, and no gradients.
fn furnace(view: &View, resolution: u32, records: &[Record]) -> Outcome {
    let limit = view.rounding(resolution);
    for record in records {
        at_most("the furnace", (f64::from(record.irradiance[RED]) / view.furnace() - 1.0).abs(), limit)?;
        at_most("a furnace's rotation gradient", vector(record.rotation[RED]).length() / PI, PI / 2.0 * limit)?;
        at_most("a furnace's translation gradient", vector(record.translation[RED]).length() / PI, limit / nearest(record))?;
    }
    Ok(())
}

/// The distance of the nearest thing that a record sees.
fn nearest(record: &Record) -> f64 {
    f64::from(record.minimum_distance)
}

/// Irradiance and gradients of one face of the cube, seen from its floor.
fn lamp(view: &View, resolution: u32, records: &[Record], face: &Polygon, channel: usize) -> Outcome {
    let [mut irradiance, mut rotation, mut along, mut upwards]: [Comparison; 4] = Default::default();
    let (floor, normal) = (DVec3::new(1.0, 0.0, 1.0), DVec3::Y);
    for record in records {
        let point = position(record);
        let (seen, walls) = (moment(point, face), walls(point, normal, face));
        let (moved, found) = (translation(point, normal, face), vector(record.translation[channel]) / view.gain());
        irradiance.add(normal * (f64::from(record.irradiance[channel]) / view.gain()), normal * seen.y, 1.0);
        rotation.add(vector(record.rotation[channel]), normal.cross(seen), 1.0);
        along.add(found * floor, moved * floor, walls.iter().map(|wall| (*wall * floor).length()).sum());
        upwards.add(found * normal, moved * normal, walls.iter().map(|wall| wall.y.abs()).sum());
    }
    at_most("a face's irradiance", irradiance.absolute(), view.lamp_error(resolution))?;
    at_most("a face's rotation gradient", rotation.absolute(), view.rotation_error(resolution))?;
    // Of coarser tiles the first order does not tell.
    if resolution >= 16 {
        at_most("a face's translation gradient", along.relative(), view.wall_error(resolution))?;
        at_most("a face's gradient along the normal", upwards.relative(), view.wall_error(resolution))?;
    }
    Ok(())
}

fn distances(view: &View, resolution: u32, records: &[Record]) -> Outcome {
    let [low, high] = view.distance_error(resolution);
    for record in records {
        let off = f64::from(record.radius) / harmonic_mean(position(record)) - 1.0;
        check((low..=high).contains(&off), || format!("a harmonic mean distance is off by {off:.2e}, not by {low:.2e} to {high:.2e}"))?;
    }
    Ok(())
}

/// The cosine-weighted harmonic mean distance of the unit cube from a point on its floor, by quadrature over strata.
fn harmonic_mean(point: DVec3) -> f64 {
    const STEPS: usize = 200;
    let exit = |d: DVec3| (0..3).map(|i| (if d[i] > 0.0 { 1.0 - point[i] } else { -point[i] }) / d[i]).fold(f64::INFINITY, f64::min);
    let share = |i: usize| (i as f64 + 0.5) / STEPS as f64;
    let direction = |i: usize| {
        let (square, (sine, cosine)) = (share(i / STEPS), (TAU * share(i % STEPS)).sin_cos());
        DVec3::new(square.sqrt() * cosine, (1.0 - square).sqrt(), square.sqrt() * sine)
    };
    let inverse: f64 = (0..STEPS * STEPS).map(|i| 1.0 / exit(direction(i))).sum();
    (STEPS * STEPS) as f64 / inverse
}

// Other rooms

/// Floor, left and right wall of a corner, open to a light that reaches each of them under the same angle.
const CORNER: &str = r#"Scene(version: 1, geometry: [
    Quad(corners: ((0, 0, 0), (0, 0, 1), (1, 0, 1), (1, 0, 0)), material: "floor"),
    Quad(corners: ((0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)), material: "left"),
    Quad(corners: ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)), material: "right")],
    materials: { "floor": Diffuse(reflectance: (1, 1, 1)), "left": Diffuse(reflectance: (0.8, 0.4, 0)), "right": Diffuse(reflectance: (0, 0.4, 0.6)) },
    normals: Face, lights: [Directional(direction: (-1, -1, -1), irradiance: (3, 3, 3))],
    cameras: { "main": (eye: (0.5, 0.9, 0.5), direction: (0, -1, 0), up: (0, 0, 1), fov: 53) })"#;
const LEFT: Polygon = [DVec3::ZERO, DVec3::Y, DVec3::new(0.0, 1.0, 1.0), DVec3::Z];
const RIGHT: Polygon = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];

/// A wall of reflectance ρ under the irradiance E_d sends ρ E_d / π: the floor receives that times the wall's moment, in
/// one bounce, and nothing of its own.
fn coloured_corner(gpu: &Arc<Gpu>, view: &View) -> Outcome {
    let records = lit(gpu, &Room::new(CORNER)?, EDGE, &view.sets(RESOLUTION, SUMS[0]))?;
    let direct = 3.0 / 3f64.sqrt();
    let radiance = [DVec3::new(0.8, 0.4, 0.0), DVec3::new(0.0, 0.4, 0.6)].map(|reflectance| reflectance * direct / PI);
    let mut colour = Comparison::default();
    for record in &records {
        let [left, right] = [LEFT, RIGHT].map(|wall| moment(position(record), &wall).y);
        colour.add(Vec3::from(record.irradiance).as_dvec3(), radiance[0] * left + radiance[1] * right, 1.0);
    }
    at_most("light from two walls", colour.absolute(), (radiance[0].length() + radiance[1].length()) * view.lamp_error(RESOLUTION))
}

/// A ball of light around a small plate.
const BALL: &str = r#"Scene(version: 1, geometry: [Sphere(centre: (0, 0, 0), radius: 1, subdivisions: 5),
    Quad(corners: ((-0.001, 0, -0.001), (0.001, 0, -0.001), (0.001, 0, 0.001), (-0.001, 0, 0.001)))],
    materials: { "*": Emitter(radiance: (1, 1, 1)) }, normals: Face,
    cameras: { "main": (eye: (0, 0.9, 0), direction: (0, -1, 0), up: (0, 0, 1), fov: 0.05) })"#;

/// All is at the distance of the radius, less a face's depth (its corners are 1.5° from its middle at most) and the
/// way to the centre.
fn centre_of_a_sphere(gpu: &Arc<Gpu>, view: &View) -> Outcome {
    let records = lit(gpu, &Room::new(BALL)?, EDGE, &see_lamps(view.sets(RESOLUTION, SUMS[0])))?;
    furnace(view, RESOLUTION, &records)?;
    for record in &records {
        let limit = 1.0 - 1.5f64.to_radians().cos() + position(record).length();
        at_most("the harmonic mean distance", (f64::from(record.radius) - 1.0).abs(), limit)?;
        at_most("the least distance", (f64::from(record.minimum_distance) - 1.0).abs(), limit)?;
    }
    Ok(())
}

/// A floor under the sky and a black wall at its side.
const FENCE: &str = r#"Scene(version: 1, geometry: [
    Quad(corners: ((0, 0, 0), (0, 0, 1), (1, 0, 1), (1, 0, 0)), material: "white"),
    Quad(corners: ((1, 0, -1), (1, 0, 2), (1, 0.8, 2), (1, 0.8, -1)), material: "black")],
    materials: { "white": Diffuse(reflectance: (1, 1, 1)), "black": Diffuse(reflectance: (0, 0, 0)) },
    normals: Face, environment: Constant((1, 1, 1)),
    cameras: { "main": (eye: (0.5, 0.9, 0.5), direction: (0, -1, 0), up: (0, 0, 1), fov: 53) })"#;
const BLACK: Polygon = [DVec3::new(1.0, 0.0, -1.0), DVec3::new(1.0, 0.0, 2.0), DVec3::new(1.0, 0.8, 2.0), DVec3::new(1.0, 0.8, -1.0)];

/// π less what the wall hides. A plane takes what lies low for sky where its window ends above the wall, and claims nothing.
fn wall_before_the_sky(gpu: &Arc<Gpu>, view: &View) -> Outcome {
    let records = lit(gpu, &Room::new(FENCE)?, EDGE, &see_lamps(view.sets(RESOLUTION, SUMS[0])))?;
    let mut sky = Comparison::default();
    for record in &records {
        sky.add(Vec3::from(record.irradiance).as_dvec3(), DVec3::splat(PI - moment(position(record), &BLACK).y), 1.0);
    }
    at_most("the sky beside a wall", sky.absolute(), 3f64.sqrt() * view.lamp_error(RESOLUTION))
}

/// A closed box whose walls emit 1 − ρ and reflect ρ.
const OVEN: &str = r#"Scene(version: 1, geometry: [Box(min: (0, 0, 0), max: (1, 1, 1))],
    materials: { "*": Emitter(radiance: (0.5, 0.5, 0.5), reflectance: (0.5, 0.5, 0.5)) }, normals: Face,
    cameras: { "main": (eye: (0.5, 0.9, 0.5), direction: (0, -1, 0), up: (0, 0, 1), fov: 53) })"#;

/// Every wall receives π (1 − ρ) and sends on ρ (1 − ρ): one bounce is π ρ (1 − ρ), and would be π in the end. The direct
/// light of what records see is sampled by single rays: the mean must lie within four of its own standard errors, which
/// must be small.
fn one_bounce_in_an_oven(gpu: &Arc<Gpu>) -> Outcome {
    let records = lit(gpu, &Room::new(OVEN)?, EDGE, &[])?;
    let count = records.len() as f64;
    let mean = records.iter().map(|record| f64::from(record.irradiance[0])).sum::<f64>() / count;
    let variance = records.iter().map(|record| (f64::from(record.irradiance[0]) - mean).powi(2)).sum::<f64>() / (count - 1.0);
    let standard_error = (variance / count).sqrt();
    let truth = PI * 0.5 * 0.5;
    at_most("the standard error of one bounce", standard_error / truth, 0.02)?;
    at_most("one bounce", (mean - truth).abs(), 4.0 * standard_error)
}

/// Walls that emit 1 − ρ and reflect ρ receive π of each other, of which π ρ have been reflected, and π ρ (1 − ρ^b) by b bounces at most.
fn all_bounces_in_an_oven(gpu: &Arc<Gpu>) -> Outcome {
    let all = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines/irradiance-bounces.ron")).map_err(|e| e.to_string())?;
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let counted = |rounds: u32| -> Result<String, Failed> {
        let path = folder.path().join("counted.ron");
        fs::write(&path, all.replace("rounds: 64, until: \"deep_index.settled\"", &format!("rounds: {rounds}"))).map_err(|e| e.to_string())?;
        Ok(path.display().to_string())
    };
    // What a record sees is lit by single rays to walls that may be near: one is off by some 16 %, the mean of as many as here by 0.4 %.
    let (edge, many) = (40, ["cache.minimum_spacing=0.1", "cache.maximum_spacing=0.1", "deep_tiles.resolution=12"].map(String::from));
    for (reflectance, counts) in [(0.2, &[][..]), (0.5, &[]), (0.8, &[1, 2, 5])] {
        let room = oven(reflectance)?;
        let off = |pipeline: &str, truth: f64| Ok::<_, Failed>((mean_irradiance(gpu, &room, edge, (pipeline, &many))? / truth - 1.0).abs());
        at_most("all bounces", off("irradiance-bounces", PI * reflectance)?, 0.01)?;
        for rounds in counts {
            at_most("some bounces", off(&counted(*rounds)?, PI * reflectance * (1.0 - reflectance.powi(*rounds as i32 + 1)))?, 0.01)?;
        }
    }
    Ok(())
}

/// The oven with walls of another reflectance.
fn oven(reflectance: f64) -> Result<Room, Failed> {
    let [reflected, emitted] = [reflectance, 1.0 - reflectance].map(|of| format!("({of}, {of}, {of})"));
    Room::new(&OVEN.replacen("(0.5, 0.5, 0.5)", &emitted, 1).replacen("(0.5, 0.5, 0.5)", &reflected, 1))
}

/// Of a square picture, in red.
fn mean_irradiance(gpu: &Arc<Gpu>, room: &Room, edge: u32, pipeline: (&str, &[String])) -> Result<f64, Failed> {
    rendered(gpu, room, [edge, edge], pipeline, |run, _| {
        let picture = block_on(run.picture()).map_err(|e| e.to_string())?;
        let [red, ..] = picture.rgb("irradiance").map_err(|e| e.to_string())?;
        Ok(red.iter().map(|value| f64::from(*value)).sum::<f64>() / red.len() as f64)
    })
}

/// Walls that emit 1 and reflect half light each other directly by a half, wherever: lamps that touch what they light. Of one bounce more there is π/2.
fn walls_that_shine_and_reflect(gpu: &Arc<Gpu>, place: &str) -> Outcome {
    let room = Room::new(
        r#"Scene(version: 1, geometry: [Box(min: (-1, -1, -1), max: (1, 1, 1))], materials: { "*": Emitter(radiance: (1, 1, 1), reflectance: (0.5, 0.5, 0.5)) },
        cameras: { "main": (eye: (-0.6, 0.3, 0.9), target: (0.2, -0.2, -0.4), fov: 75) })"#,
    )?;
    let sets = ["direct", "tiles", "detail_tiles"].map(|node| format!("{node}.place={place}"));
    rendered(gpu, &room, [48, 48], ("irradiance", &sets), |run, _| {
        let picture = block_on(run.picture()).map_err(|e| e.to_string())?;
        let [direct, irradiance] = ["direct", "irradiance"].map(|layer| picture.rgb(layer).map(|[red, ..]| red.to_vec()));
        for (layer, found, known) in [("direct", direct, 0.5), ("irradiance", irradiance, PI / 2.0)] {
            let found: Vec<f64> = found.map_err(|e| e.to_string())?.into_iter().map(f64::from).collect();
            let mean = found.iter().sum::<f64>() / found.len() as f64;
            at_most(&format!("{layer} {mean}, of {known},"), (mean / known - 1.0).abs(), 0.02)?;
            at_most(&format!("{layer} at its brightest"), found.iter().fold(0.0, |most: f64, light| most.max(*light)) / known, 4.0)?;
        }
        Ok(())
    })
}

/// Where all of a node of a radiosity is done.
fn placed(place: &str) -> Vec<String> {
    ["lightmap", "shooters", "shot", "near", "averaged", "field", "indirect"].map(|node| format!("{node}.place={place}")).into()
}

/// Shots between walls that emit 1 − ρ and reflect ρ bring all bounces: π ρ. The floor that is seen has what shots have brought it by chance.
fn shots_in_an_oven(gpu: &Arc<Gpu>, place: &str) -> Outcome {
    let (edge, shooters, iterations, limit) = if place == "Host" { (128, 256, 100, 0.01) } else { (96, 64, 60, 0.06) };
    for reflectance in [0.2, 0.8] {
        let room = oven(reflectance)?;
        let counts = [("lightmap.resolution", edge), ("lightmap.area_samples", 64), ("shooters.shooters", shooters), ("lightmap.iterations", iterations)];
        let sets = [placed(place), counts.map(|(name, count)| format!("{name}={count}")).into()].concat();
        let mean = mean_irradiance(gpu, &room, 40, ("radiosity", &sets))?;
        at_most(&format!("{mean} of {}: all bounces", PI * reflectance), (mean / (PI * reflectance) - 1.0).abs(), limit)?;
    }
    Ok(())
}

/// A running sum, a descent through sums of four and a search among sums of all before find the same texel by the same number: their pictures have the same bits.
fn all_ways_choose_the_same_texels(gpu: &Arc<Gpu>) -> Outcome {
    let room = oven(0.5)?;
    let picture = |by: &str| {
        let sets = [
            &placed("Device")[..],
            &["lightmap.resolution=40", "lightmap.iterations=6", "shooters.shooters=7", &format!("shooters.by={by}")].map(String::from),
        ]
        .concat();
        rendered(gpu, &room, [24, 24], ("radiosity", &sets), |run, _| {
            let picture = block_on(run.picture()).map_err(|e| e.to_string())?;
            Ok(picture.rgb("irradiance").map_err(|e| e.to_string())?[0].to_vec())
        })
    };
    let (sum, mipmap, search) = (picture("RunningSum")?, picture("Mipmap")?, picture("PrefixSum")?);
    check(sum.iter().any(|light| *light > 0.0), || "there is no light".into())?;
    check(sum == mipmap && mipmap == search, || "the ways choose different texels".into())
}

/// Formula (2) sends out the mean of all iterations. What it lacks then of light of many bounces after m of them is Π (1 − (1 − ρ) / k), over k to m: 39 % after 50, where the
/// last iteration sent out lacks nothing.
fn the_printed_formula_loses_light(gpu: &Arc<Gpu>) -> Outcome {
    let (reflectance, iterations) = (0.8, 50);
    let room = oven(reflectance)?;
    let sets =
        ["lightmap.resolution=48", "shooters.shooters=64", "shooters.sends=Mean", "averaged.warm_up=0", "averaged.weights=Alike", "lightmap.iterations=50"]
            .map(String::from);
    let mean = mean_irradiance(gpu, &room, 40, ("radiosity", &sets))?;
    let lacking: f64 = (1..=iterations).map(|k| 1.0 - (1.0 - reflectance) / f64::from(k)).product();
    at_most(&format!("{mean}, lacking {lacking},"), (mean / (PI * reflectance) - (1.0 - lacking)).abs(), 0.03)
}

/// The same by photons, of which a white wall keeps many: where there is no room for all, fewer are sent out.
fn photons_in_an_oven(gpu: &Arc<Gpu>, pipeline: &str, limit: f64) -> Outcome {
    let many = ["cache.minimum_spacing=0.1", "cache.maximum_spacing=0.1"].map(String::from);
    let sets: &[String] = if pipeline.starts_with("photon-gather") { &many } else { &[] };
    [0.2, 0.5, 0.8].into_iter().try_for_each(|reflectance| {
        let found = mean_irradiance(gpu, &oven(reflectance)?, 40, (pipeline, sets))?;
        at_most("all bounces", (found / (PI * reflectance) - 1.0).abs(), limit)
    })
}

/// Two rooms with a wall of 2 cm between them, of which one is lit. The camera looks along the wall from its middle, in one of the rooms.
const ROOMS: &str = r#"Scene(version: 1, geometry: [Box(min: (0, 0, 0), max: (8, 3, 4)), Box(min: (3.99, 0, 0), max: (4.01, 3, 4))],
    materials: { "*": Diffuse(reflectance: (0.7, 0.7, 0.7)) }, normals: Face,
    lights: [Point(position: (1.5, 2.5, 1), intensity: (30, 30, 30))],
    cameras: { "main": (eye: (EYE, 1.7, 3.6), target: (4, 1.2, 1), fov: 80) })"#;

/// In the room without a light there is none, however often light is reflected.
fn no_light_comes_through_a_wall(gpu: &Arc<Gpu>, pipeline: &str) -> Outcome {
    let light = |eye: &str| mean_irradiance(gpu, &Room::new(&ROOMS.replace("EYE", eye))?, 48, (pipeline, &[]));
    let [lit, dark] = [light("3")?, light("5")?];
    check(lit > 0.0, || "the lit room is dark".into())?;
    at_most("light behind a wall", dark / lit, 1e-3)
}

/// Two rooms without a ceiling, seen from above: no light comes back over the wall between them.
const COURTS: &str = r#"Scene(version: 1, geometry: [
    Quad(corners: ((0, 0, 0), (0, 0, 4), (8, 0, 4), (8, 0, 0))), Box(min: (3.99, 0, 0), max: (4.01, 3, 4)),
    Quad(corners: ((0, 0, 0), (8, 0, 0), (8, 3, 0), (0, 3, 0))), Quad(corners: ((8, 0, 4), (0, 0, 4), (0, 3, 4), (8, 3, 4))),
    Quad(corners: ((0, 0, 4), (0, 0, 0), (0, 3, 0), (0, 3, 4))), Quad(corners: ((8, 0, 0), (8, 0, 4), (8, 3, 4), (8, 3, 0))),
], materials: { "*": Diffuse(reflectance: (0.7, 0.7, 0.7)) }, normals: Face, lights: [Point(position: (1.5, 2.5, 1), intensity: (30, 30, 30))],
    cameras: { "main": (eye: (4, 9, 2), direction: (0, -1, 0), up: (0, 0, 1), fov: 55) })"#;

/// Nor is there any where paths from the camera come into both rooms, but for three pixels beside the wall: so far do the picture's own records reach.
fn no_light_comes_past_a_wall_that_both_sides_are_seen_of(gpu: &Arc<Gpu>, pipeline: &str, place: &str) -> Outcome {
    // Where fewer records stand, each reaches farther.
    let places = ["tiles", "detail_tiles", "deep_tiles"].map(|tiles| format!("{tiles}.place={place}"));
    let fewer: Vec<String> = places.into_iter().chain(["deep_places.records=2048".into()]).collect();
    let sets = if pipeline == "irradiance-bounces" { &fewer[..] } else { &[] };
    let halves = rendered(gpu, &Room::new(COURTS)?, [64, 64], (pipeline, sets), |run, _| {
        let picture = block_on(run.picture()).map_err(|e| e.to_string())?;
        let [red, ..] = picture.rgb("irradiance").map_err(|e| e.to_string())?;
        let within =
            |columns: std::ops::Range<usize>| (0..).zip(red).filter(|(at, _)| columns.contains(&(at % 64))).map(|(_, light)| f64::from(*light)).sum::<f64>();
        Ok([within(0..29), within(35..64)])
    })?;
    let [dark, lit] = [halves[0].min(halves[1]), halves[0].max(halves[1])];
    check(lit > 0.0, || "the lit room is dark".into())?;
    at_most("light past a wall", dark / lit, 1e-3)
}

// A floor before a mirror

/// A floor, seen from above, a screen over it, and nearly a mirror on the other side; or what stands there in the mirror.
const MIRROR: &str = r#"Scene(version: 1, geometry: [Quad(corners: ((-3, 0, BEHIND), (-3, 0, 3), (3, 0, 3), (3, 0, BEHIND)), material: "floor"), THINGS],
    materials: { "floor": Diffuse(reflectance: (0.01, 0.01, 0.01)), MATERIALS },
    normals: Face, lights: [Point(position: (0.3, 1, 0.5), intensity: (3, 3, 3)), LIGHTS],
    cameras: { "main": (eye: (0, 2, 0.5), direction: (0, -1, 0), up: (0, 0, 1), fov: 30) })"#;

const MIRRORING: &str = r#"Quad(corners: ((-30, 0, -1), (30, 0, -1), (30, 30, -1), (-30, 30, -1)), material: "mirror")"#;
const SCREEN: &str = r#"Quad(corners: ((-2, 0, 3), (2, 0, 3), (2, 2, 3), (-2, 2, 3)), material: "screen")"#;
const ITS_IMAGE: &str = r#"Quad(corners: ((-2, 0, -5), (2, 0, -5), (2, 2, -5), (-2, 2, -5)), material: "screen")"#;

/// A scene of [`MIRROR`] with a mirror of this share, or the image of what is before it.
fn mirror(share: Option<f64>, things: &[&str]) -> Result<Room, Failed> {
    let (behind, light) = if share.is_some() { ("-1", "") } else { ("-5", "Point(position: (0.3, 1, -2.5), intensity: (3, 3, 3))") };
    let share = share.unwrap_or_default();
    let screen = r#""screen": Diffuse(reflectance: (0.7, 0.7, 0.7))"#;
    let metal = format!(r#""mirror": MetallicRoughness(base: ({share}, {share}, {share}), metallic: 1, roughness: 0.05)"#);
    let has = |name: &str| things.iter().any(|thing| thing.contains(name));
    let materials = [("screen", screen), ("mirror", metal.as_str())].into_iter().filter(|(name, _)| has(name)).map(|(_, material)| material);
    let written = MIRROR.replace("BEHIND", behind).replace("THINGS", &things.join(", ")).replace("LIGHTS", light);
    Room::new(&written.replace("MATERIALS", &materials.collect::<Vec<_>>().join(", ")))
}

/// Mean irradiance of the floor that is seen by what the light is in a mirror that reflects such a share along its normal.
fn by_image_of_light(share: f64) -> f64 {
    let (image, half) = (DVec3::new(0.3, 1.0, -2.5), 2.0 * 15.0f64.to_radians().tan());
    let at = |pixel: u32| ((f64::from(pixel) + 0.5) / 12.0 - 1.0) * half;
    let light = |pixel: u32| {
        let way = image - DVec3::new(at(pixel % 24), 0.0, 0.5 + at(pixel / 24));
        // Schlick's rise at the angle of incidence, as nearly all facets stand along the mirror.
        let fresnel = share + (1.0 - share) * (1.0 - way.z.abs() / way.length()).powi(5);
        3.0 * fresnel * way.y / way.length().powi(3)
    };
    (0..24 * 24).map(light).sum::<f64>() / (24.0 * 24.0)
}

/// Where the light is in a mirror, it lights the floor as much as the mirror does.
fn a_mirror_lights_a_floor(gpu: &Arc<Gpu>, pipeline: &str) -> Outcome {
    let found = mean_irradiance(gpu, &mirror(Some(0.8), &[MIRRORING])?, 24, (pipeline, &[]))?;
    at_most("light by the mirror", (found / by_image_of_light(0.8) - 1.0).abs(), 0.02)
}

/// With a mirror that reflects all there is as much light, of any number of bounces, as with the image of all that is before it.
fn a_mirror_is_as_good_as_the_image(gpu: &Arc<Gpu>) -> Outcome {
    let light = |room: Room| mean_irradiance(gpu, &room, 24, ("radiance-bounces", &[]));
    let found = light(mirror(Some(1.0), &[MIRRORING, SCREEN])?)? - by_image_of_light(1.0);
    let image = light(mirror(None, &[SCREEN, ITS_IMAGE])?)?;
    let direct_view = light(mirror(Some(1.0), &[SCREEN])?)?;
    check(image > 1.3 * direct_view, || format!("the mirror brings little: {image} and {direct_view}"))?;
    at_most("light by the mirror", (found / image - 1.0).abs(), 0.03)
}

// Textures

/// A metal box on a floor, under a lamp and a point light.
const METAL: &str = r#"Scene(version: 1, geometry: [
    Quad(corners: ((-3, 0, -3), (-3, 0, 3), (3, 0, 3), (3, 0, -3)), material: "floor"),
    Box(min: (-0.5, 0, -0.5), max: (0.5, 0.6, 0.5), material: "metal"),
    Quad(corners: ((-1, 2, -1), (1, 2, -1), (1, 2, 0), (-1, 2, 0)), material: "lamp")],
    materials: { "floor": Diffuse(reflectance: (0.5, 0.4, 0.3)), "metal": MetallicRoughness(base: (0.9, 0.6, 0.3), metallic: 0.8, roughness: 0.6),
        "lamp": Emitter(radiance: (4, 5, 6)) },
    normals: Face, lights: [Point(position: (2, 2, 2), intensity: (3, 3, 3))],
    cameras: { "main": (eye: (0, 1.6, 2.2), target: (0, 0.2, 0), fov: 60) })"#;

/// An image without colour whose texels are a number, as it stands.
fn grey(width: u32, texel: impl Fn(u32) -> [u8; 3]) -> Texture {
    let texels = (0..width).map(texel).map(|[r, g, b]| [r, g, b, 255]).collect();
    let reading = Reading { is_linear: true, wrap: [Wrap::Clamp; 2], ..Default::default() };
    Texture { width, height: 1, texels, reading, ..Default::default() }
}

/// The mean of a layer over the picture.
fn means_of<const N: usize>(gpu: &Arc<Gpu>, room: &Room, (pipeline, sets): (&str, &[String]), layers: [&str; N]) -> Result<[f64; N], Failed> {
    rendered(gpu, room, [16, 16], (pipeline, sets), |run, _| {
        let picture = block_on(run.picture()).map_err(|e| e.to_string())?;
        let mut means = [0.0; N];
        for (mean, layer) in means.iter_mut().zip(layers) {
            let values = picture.rgb(layer).map_err(|e| e.to_string())?.concat();
            *mean = values.iter().map(|value| f64::from(*value)).sum::<f64>() / values.len() as f64;
        }
        Ok(means)
    })
}

/// A texture or a tint that is the same all over does what the factor does, in direct light, in lobes and in what records see.
fn maps_of_one_value_are_factors(gpu: &Arc<Gpu>, place: &str) -> Outcome {
    let sets = [format!("direct.place={place}"), format!("tiles.place={place}"), format!("detail_tiles.place={place}"), format!("glossy_tiles.place={place}")];
    let plain = Room::new(METAL)?;
    let mut scene = plain.stage.scene.clone();
    scene.textures = vec![grey(1, |_| [0, 153, 204]), grey(1, |_| [51, 51, 51]), grey(1, |_| [128, 128, 255])];
    let [floor, metal, lamp] = ["floor", "metal", "lamp"].map(|name| scene.materials.iter().position(|m| m.name == name).unwrap_or_default());
    scene.materials[metal].maps = Maps { facets: Some(0), ..Maps::default() };
    scene.materials[metal].glossy = Glossy::metallic_roughness(1.0, 1.0);
    scene.materials[lamp].maps = Maps { emission: Some(1), ..Maps::default() };
    scene.materials[lamp].emission *= 5.0;
    scene.materials[floor].reflectance = Vec3::ONE;
    // Half a step off straight, along no axis in particular.
    scene.materials[floor].maps = Maps { normal: Some(2), normal_scale: 1.0, ..Maps::default() };
    for triangle in scene.triangles.iter_mut().filter(|triangle| triangle.material as usize == floor) {
        triangle.tints = [Tint::new(Vec3::new(0.5, 0.4, 0.3)); 3];
        triangle.uvs = triangle.positions.map(|p| glam::Vec2::new(p.x, p.z));
    }
    let mapped = Room::of(scene);
    let layers = ["direct", "glossy", "irradiance", "picture"];
    let [by_factors, by_maps] = [&plain, &mapped].map(|room| means_of(gpu, room, ("radiance", &sets), layers));
    for (layer, (by_factors, by_maps)) in layers.into_iter().zip(by_factors?.into_iter().zip(by_maps?)) {
        check(by_factors > 0.0, || format!("{layer}: dark"))?;
        at_most(&format!("{layer} by maps"), (by_maps / by_factors - 1.0).abs(), 0.03)?;
    }
    Ok(())
}

/// A lamp whose right half is black lights as the left half alone, in direct light and as records see it.
fn an_emission_map_makes_a_smaller_lamp(gpu: &Arc<Gpu>, place: &str) -> Outcome {
    let half = Room::new(&METAL.replace("(1, 2, -1), (1, 2, 0)", "(0, 2, -1), (0, 2, 0)"))?;
    let mut scene = Room::new(METAL)?.stage.scene.clone();
    scene.textures = vec![grey(64, |x| if x < 32 { [255; 3] } else { [0; 3] })];
    let lamp = scene.materials.iter().position(|material| material.name == "lamp").unwrap_or_default();
    scene.materials[lamp].maps = Maps { emission: Some(0), ..Maps::default() };
    for triangle in scene.triangles.iter_mut().filter(|triangle| triangle.material as usize == lamp) {
        triangle.uvs = triangle.positions.map(|p| glam::Vec2::new(0.5 * (p.x + 1.0), 0.5));
    }
    let mapped = Room::of(scene);
    let tiles = [format!("tiles.place={place}"), "direct.emitters=Records".into(), "tiles.resolution=64".into()];
    for (pipeline, sets, layer) in [
        ("irradiance", vec![format!("direct.place={place}"), "direct.emitters.area_samples=256".into()], "direct"),
        ("irradiance-one-rate", tiles.to_vec(), "irradiance"),
        ("photon-density", Vec::new(), "irradiance"),
    ] {
        let [found, expected] = [&mapped, &half].map(|room| means_of(gpu, room, (pipeline, &sets), [layer]));
        let ([found], [expected]) = (found?, expected?);
        check(expected > 0.0, || format!("{pipeline}: dark"))?;
        at_most(&format!("{layer} of {pipeline}"), (found / expected - 1.0).abs(), 0.03)?;
    }
    Ok(())
}

/// A floor of black and white squares, each a texel, under parallel light that makes white ones 1.
fn squares() -> Result<Room, Failed> {
    let mut scene = Room::new(
        r#"Scene(version: 1, geometry: [Quad(corners: ((-400, 0, -400), (-400, 0, 400), (400, 0, 400), (400, 0, -400)))], materials: { "*": Diffuse(reflectance: (1, 1, 1)) },
            normals: Face, lights: [Directional(direction: (0, -1, 0), irradiance: (3.1415927, 3.1415927, 3.1415927), shadows: false)], environment: Constant((0, 0, 0)),
            cameras: { "main": (eye: (0.3, 1.5, 0.2), target: (1.3, 0.7, -10), fov: 60) })"#,
    )?
    .stage
    .scene
    .clone();
    let texels = (0..64u32).map(|at| [if (at + at / 8) % 2 == 0 { 0 } else { 255 }; 4]).collect();
    scene.textures = vec![Texture { width: 8, height: 8, texels, ..Default::default() }.with_levels(None)];
    scene.materials.iter_mut().for_each(|material| material.texture = Some(0));
    scene.triangles.iter_mut().for_each(|triangle| triangle.uvs = triangle.positions.map(|p| glam::Vec2::new(p.x, p.z) * 0.5));
    Ok(Room::of(scene))
}

/// Pixels that many squares fall into are half of white, as the host, the device and the reference have it; the mean of all is, too.
fn squares_finer_than_pixels_are_grey(gpu: &Arc<Gpu>) -> Outcome {
    let (room, size) = (squares()?, [96, 64]);
    let settings = reference::Settings { size, pixels: Pixels::Every(1), bounces: Bounces::Count(1), stop: Stop::Samples(2), seed: 1 };
    let truth = reference::render(&room.stage.scene, &room.stage.bvh, &room.stage.scene.cameras[0], &settings, &|_| true).map_err(|e| e.to_string())?;
    for place in ["Host", "Device"] {
        let sets = [format!("direct.place={place}")];
        let found = rendered(gpu, &room, size, ("irradiance", &sets), |run, _| {
            Ok(block_on(run.picture()).map_err(|e| e.to_string())?.rgb("direct").map_err(|e| e.to_string())?[0].to_vec())
        })?;
        let floor: Vec<usize> = (0..found.len()).filter(|pixel| truth.depth[*pixel] > 0.0).collect();
        let mean = floor.iter().map(|pixel| f64::from(found[*pixel])).sum::<f64>() / floor.len() as f64;
        at_most(&format!("mean by {place}"), (mean / 0.5 - 1.0).abs(), 0.005)?;
        for pixel in floor {
            at_most(&format!("pixel {pixel} by {place}, off the reference"), f64::from((found[pixel] - truth.direct[pixel].x).abs()), 2e-3)?;
            // From there on a pixel is four squares wide or more.
            if truth.depth[pixel] > 80.0 {
                at_most(&format!("pixel {pixel} by {place}, off grey"), f64::from((found[pixel] - 0.5).abs()), 0.01)?;
            }
        }
    }
    Ok(())
}

// A floor below a screen

/// The camera is between both, so that it sees the floor alone.
const STAGE: &str = r#"Scene(version: 1, geometry: [
    Quad(corners: ((-3, 0, -3), (-3, 0, 3), (3, 0, 3), (3, 0, -3))),
    Quad(corners: ((0, 1, 0.1), (0, 1, 0.5), (0.4, 1, 0.5), (0.4, 1, 0.1)))],
    materials: { "*": Diffuse(reflectance: (0.5, 0.5, 0.5)) }, normals: Face, lights: [LIGHTS],
    cameras: { "main": (eye: (0, 0.9, 0), direction: (0, -1, 0), up: (0, 0, 1), fov: 90) })"#;

/// A light in a scene file with what it is.
enum Lamp {
    Point(DVec3),
    /// Place and the half-angle of its cone [degrees].
    Spot(DVec3, f64),
    Directional(DVec3),
}

impl Lamp {
    fn written(&self) -> String {
        let vector = |v: &DVec3| format!("({}, {}, {})", v.x, v.y, v.z);
        match self {
            Self::Point(at) => format!("Point(position: {}, intensity: (3, 3, 3)),", vector(at)),
            Self::Spot(at, outer) => format!("Spot(position: {}, direction: (0, -1, 0), intensity: (3, 3, 3), outer: {outer}),", vector(at)),
            Self::Directional(along) => format!("Directional(direction: {}, irradiance: (3, 3, 3)),", vector(along)),
        }
    }

    /// Irradiance of a place on the floor, were there no screen; and the way from there to the light.
    fn irradiance(&self, place: DVec3) -> (f64, DVec3) {
        let way = match self {
            Self::Point(at) | Self::Spot(at, _) => *at - place,
            Self::Directional(along) => return (-3.0 * along.normalize().y, -along * 100.0),
        };
        let cosine = way.y / way.length();
        let cone = match self {
            Self::Spot(_, outer) => ((cosine - outer.to_radians().cos()) / (1.0 - outer.to_radians().cos())).clamp(0.0, 1.0).powi(2),
            _ => 1.0,
        };
        (3.0 * cosine / way.length_squared() * cone, way)
    }
}

/// Share of the light that passes the screen around a place; `None` near an edge of its shadow.
fn passes_screen(place: DVec3, way: DVec3) -> Option<bool> {
    let crossing = place + way / way.y;
    let outside = |margin: f64| crossing.x < -margin || crossing.x > 0.4 + margin || crossing.z < 0.1 - margin || crossing.z > 0.5 + margin;
    (outside(0.02) == outside(-0.02)).then(|| outside(0.0))
}

/// Each kind of light on the floor, through the shadow maps: spot lights with a map of their own, with a cube, and where one
/// becomes the other; alone and all together, with maps whose rows are padded, and with maps too large for a buffer.
fn shadow_of_a_screen(gpu: &Arc<Gpu>) -> Outcome {
    let high = DVec3::new(0.1, 2.0, 0.2);
    let lamps = [
        Lamp::Point(high),
        Lamp::Spot(high, 35.0),
        Lamp::Spot(DVec3::new(-0.2, 1.8, 0.1), 60.0),
        Lamp::Spot(DVec3::new(0.5, 2.0, 0.6), 75.0),
        Lamp::Directional(DVec3::new(0.2, -1.0, 0.1)),
        Lamp::Point(DVec3::new(-1.0, 3.0, 0.5)),
    ];
    let cases = lamps.chunks(1).map(|lamp| (lamp, 1024)).chain([1024, 1000, 1400].map(|resolution| (&lamps[..], resolution)));
    cases.into_iter().try_for_each(|(lamps, resolution)| {
        let lights: String = lamps.iter().map(Lamp::written).collect();
        let room = Room::new(&STAGE.replace("LIGHTS", &lights))?;
        let (size, sets) = ([64, 64], ["cache.accuracy=5".to_owned(), format!("shadow.resolution={resolution}")]);
        let picture = rendered(gpu, &room, size, ("irradiance-one-rate", &sets), |run, _| block_on(run.picture()).map_err(|e| e.to_string().into()))?;
        let red = &picture.rgb("direct").map_err(|e| e.to_string())?[0];
        let mut shadowed = 0;
        for (pixel, found) in red.iter().enumerate() {
            let [x, y] = [pixel % 64, pixel / 64].map(|at| (at as f64 + 0.5) / 32.0 - 1.0);
            let place = DVec3::new(-0.9 * x, 0.0, -0.9 * y);
            let shares = lamps.iter().map(|lamp| lamp.irradiance(place)).map(|(light, way)| passes_screen(place, way).map(|passes| (light, passes)));
            let Some(shares) = shares.collect::<Option<Vec<_>>>() else { continue };
            shadowed += shares.iter().any(|(_, passes)| !passes) as u32;
            let truth: f64 = shares.iter().filter(|(_, passes)| *passes).map(|(light, _)| light * 0.5 / PI).sum();
            check((f64::from(*found) - truth).abs() <= 1e-3 * truth + 1e-6, || format!("{lights} light {place} with {found}, not {truth}"))?;
        }
        check(shadowed > 100, || format!("{lights} leave only {shadowed} pixels in the shadow"))
    })
}

// What proves the rest

/// This file's own formulas, against published numbers and against each other.
fn formulas_hold(_: &Arc<Gpu>) -> Outcome {
    let near = |found: f64, truth: f64, tolerance: f64| check((found - truth).abs() <= tolerance, || format!("{found}, not {truth}"));
    let (middle, corner) = (DVec3::new(0.5, 0.0, 0.5), DVec3::new(1e-9, 0.0, 1e-9));
    for (point, face, factor) in [(middle, &CEILING, 0.23946), (middle, &WALL, 0.1901), (corner, &CEILING, 0.13853), (corner, &WALL, 0.05573)] {
        near(moment(point, face).y / PI, factor, 5e-5)?;
    }
    let point = DVec3::new(0.3, 0.0, 0.8);
    for face in [CEILING, WALL] {
        let outline: DVec3 = walls(point, DVec3::Y, &face).iter().sum();
        let moved = translation(point, DVec3::Y, &face);
        check(outline.abs_diff_eq(moved, 1e-4) || outline.abs_diff_eq(-moved, 1e-4), || format!("{outline}, not {moved}"))?;
    }
    // Between the nearest wall and the farthest corner.
    near(harmonic_mean(DVec3::new(0.5, 0.0, 0.5)), (0.5 + 1.5f64.sqrt()) / 2.0, (1.5f64.sqrt() - 0.5) / 2.0)
}

/// Searches that find nothing at first end no fill, however few the pixels are.
fn small_pictures_are_whole(gpu: &Arc<Gpu>) -> Outcome {
    let room = Room::new(LAMPS)?;
    (1..=4).try_for_each(|edge| lit(gpu, &room, edge, &see_lamps(views()[0].sets(8, SUMS[0]))).map(drop))
}

/// What a small mistake makes of a record.
type Mistake = fn(&mut Record);

/// Small mistakes, each made in all records: one that the forms let pass would prove nothing.
fn mistakes_are_refused(gpu: &Arc<Gpu>) -> Outcome {
    let view = View { shape: "Hemicube", way: "Device", method: "None" };
    let records = lit(gpu, &Room::new(LAMPS)?, EDGE, &see_lamps(view.sets(RESOLUTION, SUMS[0])))?;
    cube_forms(&view, RESOLUTION, &records)?;
    let mistakes: [(&str, Mistake); 8] = [
        ("a furnace a thousandth too bright", |record| record.irradiance[RED] *= 1.001),
        ("a lamp 2 % too bright", |record| record.irradiance[GREEN] *= 1.02),
        ("two colours swapped", |record| record.irradiance.swap(GREEN, BLUE)),
        ("a rotation turned round", |record| record.rotation[BLUE] = record.rotation[BLUE].map(|x| -x)),
        ("a rotation in the cosine measure", |record| record.rotation[GREEN] = record.rotation[GREEN].map(|x| x * 0.9)),
        ("a translation a quarter too long", |record| record.translation[BLUE] = record.translation[BLUE].map(|x| x * 1.25)),
        ("no gradient along the normal", |record| record.translation[BLUE][1] = 0.0),
        ("a mean distance 2 % too long", |record| record.radius *= 1.02),
    ];
    for (name, mistake) in mistakes {
        let mut wrong = records.clone();
        wrong.iter_mut().for_each(mistake);
        check(cube_forms(&view, RESOLUTION, &wrong).is_err(), || format!("{name} passes"))?;
    }
    Ok(())
}

//! Scenes that change while a run goes on: objects, materials, lights, the environment, the size of the picture.
//!
//! What a change leaves is held against a scene that was loaded so.

use glam::{DAffine3, DVec3, Vec3};
use hemisplat::{
    Change, ChangeError, Engine, Pace, Renewed, Run, Stage, block_on,
    gpu::Gpu,
    measure::Layers,
    pipeline::Pipeline,
    scene::{
        Environment, LightKind, Material, Scene,
        load::{LoadOptions, load},
    },
};
use libtest_mimic::Arguments;
use skips::Missing;
use std::{error::Error, io, path::Path, sync::Arc, time::Instant};

mod skips;

type Outcome = Result<(), Box<dyn Error>>;
type Test = fn() -> Outcome;

const SIZE: [u32; 2] = [96, 64];

fn main() {
    let missing = block_on(Gpu::open()).err().map(|error| Missing::new("gpu", error.to_string()));
    let tests: [(&str, Test); 8] = [
        ("objects_that_move_are_seen_where_they_are", objects),
        ("objects_that_leave_the_scene_are_seen", far_objects),
        ("lights_and_materials_change", light),
        ("what_needs_other_programs_is_made_anew", other_programs),
        ("what_cannot_change_leaves_all_as_it_was", refusals),
        ("a_picture_of_another_size_keeps_the_records", sizes),
        ("a_lightmap_forgets_light_by_and_by", forgetting),
        ("records_that_live_on_take_no_more_memory_after_300_frames", || lasting_memory(300, 200)),
    ];
    // Of a release build: `cargo test --release --test changes -- --ignored --nocapture`.
    let long: [(&str, Test); 3] = [
        ("a_thousand_changes_take_no_more_memory_than_a_few", memory),
        ("one_of_a_thousand_objects_moves", one_of_many),
        ("records_that_live_on_take_no_more_memory_after_10000_frames", || lasting_memory(10_000, 1000)),
    ];
    let trial = |(name, test): (&str, Test)| skips::fallible(name, missing.as_ref(), test);
    let mut trials: Vec<_> = tests.map(trial).into();
    trials.extend(long.map(|test| trial(test).with_ignored_flag(true)));
    libtest_mimic::run(&Arguments::from_args(), trials).exit();
}

fn check(holds: bool, otherwise: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(otherwise().into()) }
}

/// A room with a lamp, a light with shadows, a ball and a box that can be moved; each is moved by the file already.
fn room(ball: DVec3, crate_: DVec3) -> Result<Scene, Box<dyn Error>> {
    let place = |at: DVec3| format!("translate: ({}, {}, {})", at.x, at.y, at.z);
    let text = format!(
        r#"Scene(
    version: 1,
    geometry: [
        Box(min: (-4, 0, -4), max: (4, 4, 4), material: "wall"),
        Quad(corners: ((-1, 3.9, -1), (1, 3.9, -1), (1, 3.9, 1), (-1, 3.9, 1)), material: "lamp"),
        Place(name: "ball", of: [Sphere(centre: (0, 0, 0), radius: 0.7, subdivisions: 3, material: "ball")], {}),
        Place(name: "crate", of: [Box(min: (0, 0, 0), max: (1, 1, 1), material: "crate")], rotate: (axis: (0, 1, 0), degrees: 30), {}),
    ],
    materials: {{
        "wall": Diffuse(reflectance: (0.7, 0.6, 0.5)),
        "ball": Diffuse(reflectance: (0.2, 0.3, 0.8)),
        "crate": Diffuse(reflectance: (0.8, 0.7, 0.2)),
        "lamp": Emitter(radiance: (6, 6, 5)),
    }},
    lights: [Point(position: (2, 3, 2), intensity: (6, 6, 6))],
    cameras: {{ "main": (eye: (-2.5, 2.2, 3.6), target: (0, 1, 0), fov: 70) }},
)"#,
        place(ball),
        place(crate_)
    );
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("room.ron");
    std::fs::write(&file, text)?;
    Ok(load(&file, &LoadOptions::default())?)
}

const BALL: DVec3 = DVec3::new(-1.0, 0.8, -1.0);
const CRATE: DVec3 = DVec3::new(0.5, 0.01, -1.5);

struct Moving {
    engine: Engine,
    name: &'static str,
    pipeline: Pipeline,
    run: Run,
}

impl Moving {
    fn new(name: &'static str, sets: &[&str], scene: Scene) -> Result<Self, Box<dyn Error>> {
        let engine = block_on(Engine::open())?;
        let objects: Vec<usize> = (0..scene.objects.len()).collect();
        let stage = Arc::new(Stage::moving(scene, &objects)?);
        let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
        let pipeline = engine.pipeline(name, &sets, &mut |_| Err(io::ErrorKind::NotFound.into()))?;
        let plan = engine.plan(&pipeline, &stage, SIZE)?;
        let run = block_on(engine.run(&stage, &plan, &stage.scene.cameras[0], SIZE))?;
        Ok(Self { engine, name, pipeline, run })
    }

    fn change(&mut self, changes: &[Change]) -> Result<Renewed, ChangeError> {
        block_on(self.engine.change(&mut self.run, &self.pipeline, changes))
    }

    fn drawn(&mut self) -> Result<Layers, Box<dyn Error>> {
        block_on(self.run.frame(&|| Pace::GoOn))?;
        Ok(block_on(self.run.picture())?)
    }

    /// The picture beside that of a scene which was loaded so, where lamps have the same order and so the same samples.
    fn same_as(&mut self, sets: &[&str], scene: Scene) -> Outcome {
        let objects: Vec<usize> = (0..scene.objects.len()).collect();
        self.like(sets, Stage::moving(scene, &objects)?, 0.005)
    }

    /// The picture beside that of a stage.
    fn like(&mut self, sets: &[&str], stage: Stage, tolerance: f64) -> Outcome {
        let found = self.drawn()?;
        let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
        let stage = Arc::new(stage);
        let pipeline = self.engine.pipeline(self.name, &sets, &mut |_| Err(io::ErrorKind::NotFound.into()))?;
        let plan = self.engine.plan(&pipeline, &stage, SIZE)?;
        let mut run = block_on(self.engine.run(&stage, &plan, &stage.scene.cameras[0], SIZE))?;
        block_on(run.frame(&|| Pace::GoOn))?;
        alike(&found, &block_on(run.picture())?, tolerance)
    }
}

/// By the root mean square difference over the mean, and the share of pixels that differ by more than a tenth of the mean.
fn alike(found: &Layers, expected: &Layers, tolerance: f64) -> Outcome {
    for (name, layer) in &expected.layers {
        for (channel, expected) in &layer.channels {
            let found = &found.layers[name].channels[channel];
            let mean = expected.iter().map(|v| f64::from(v.abs())).sum::<f64>() / expected.len() as f64;
            let differences: Vec<f64> = found.iter().zip(expected).map(|(a, b)| f64::from((a - b).abs())).collect();
            let rms = (differences.iter().map(|d| d * d).sum::<f64>() / expected.len() as f64).sqrt() / mean;
            let apart = differences.iter().filter(|d| **d > 0.1 * mean).count() as f64 / expected.len() as f64;
            check(rms < tolerance && apart < tolerance, || format!("{name}.{channel}: {:.3} % rms, {:.3} % of the pixels", 100.0 * rms, 100.0 * apart))?;
        }
    }
    Ok(())
}

fn place(mover: usize, map: DAffine3) -> Change {
    Change::Place { mover, map }
}

/// On the host and on the device, rays and shadow maps; and by raster, which draws what each view may see.
fn objects() -> Outcome {
    let [ball, crate_] = [DVec3::new(1.3, 1.9, 0.2), DVec3::new(-1.2, 0.02, 0.3)];
    for (name, sets) in
        [("irradiance", &[][..]), ("irradiance", &["tiles.place=Device", "direct.place=Device"]), ("irradiance-hemicube", &["tiles.resolution=16"])]
    {
        let mut moving = Moving::new(name, sets, room(BALL, CRATE)?)?;
        moving.drawn()?;
        for [ball, crate_] in [[ball, CRATE], [BALL, crate_], [ball, crate_], [BALL, CRATE]] {
            // The second change of a place replaces the first.
            let told = moving.change(&[
                place(0, DAffine3::from_translation(DVec3::Y)),
                place(0, DAffine3::from_translation(ball - BALL)),
                place(1, DAffine3::from_translation(crate_ - CRATE)),
            ])?;
            check(told == Renewed::Changes, || "all was made anew".into())?;
            moving.same_as(sets, room(ball, crate_)?)?;
        }
        // In one level, whose lamps are sampled otherwise.
        moving.like(sets, Stage::new(room(BALL, CRATE)?), 0.04)?;
    }
    Ok(())
}

fn far_objects() -> Outcome {
    let mut moving = Moving::new("irradiance", &[], room(BALL, CRATE)?)?;
    moving.drawn()?;
    let far = DVec3::new(60.0, 0.8, 0.0);
    moving.change(&[place(0, DAffine3::from_translation(far - BALL))])?;
    moving.same_as(&[], room(far, CRATE)?)?;
    moving.change(&[place(0, DAffine3::IDENTITY)])?;
    moving.same_as(&[], room(BALL, CRATE)?)
}

fn light() -> Outcome {
    let scene = room(BALL, CRATE)?;
    let mut moving = Moving::new("irradiance", &[], scene.clone())?;
    moving.drawn()?;
    let number = |name: &str| scene.materials.iter().position(|material| material.name == name).ok_or("no such material");
    let mut expected = scene.clone();
    let (wall, lamp) = (number("wall")?, number("lamp")?);
    expected.materials[wall].reflectance = Vec3::new(0.2, 0.7, 0.3);
    expected.materials[lamp].emission = Vec3::new(1.0, 3.0, 9.0);
    expected.lights[0].kind = LightKind::Point { position: Vec3::new(-2.0, 1.0, 2.0), intensity: Vec3::new(9.0, 2.0, 1.0) };
    let told = moving.change(&[
        Change::Material { number: wall, material: expected.materials[wall].clone() },
        Change::Material { number: lamp, material: expected.materials[lamp].clone() },
        Change::Light { number: 0, light: expected.lights[0].clone() },
    ])?;
    check(told == Renewed::Changes, || "all was made anew".into())?;
    moving.same_as(&[], expected)
}

/// All light goes down to a thousandth. Of 24 iterations that count, four are remembered, whose light is r (r + 1) / ((r + n) (r + n + 1)) of the mean after n more, beside what
/// these have reflected of it and what is near: 9 % after twenty, a little more than 1 % after eighty. A ball that moves makes no difference.
fn forgetting() -> Outcome {
    for side in ["Host", "Device"] {
        let nodes = ["lightmap", "points", "shooters", "shot", "near", "averaged", "field", "indirect"].map(|node| format!("{node}.place={side}"));
        let sets = ["lightmap.resolution=48", "lightmap.iterations=32", "shooters.shooters=64", "lightmap.remembers=4"].map(String::from);
        let sets: Vec<&str> = nodes.iter().chain(&sets).map(String::as_str).collect();
        let scene = room(BALL, CRATE)?;
        let lamp = scene.materials.iter().position(|material| material.name == "lamp").ok_or("no lamp")?;
        let mut dark = scene.clone();
        dark.materials[lamp].emission *= 1e-3;
        dark.lights[0].kind = LightKind::Point { position: Vec3::new(2.0, 3.0, 2.0), intensity: Vec3::splat(6e-3) };
        let mut moving = Moving::new("radiosity", &sets, scene.clone())?;
        let mean = |picture: &Layers| -> Result<f64, Box<dyn Error>> {
            let [_, green, _] = picture.rgb("irradiance")?;
            Ok(green.iter().map(|value| f64::from(*value)).sum::<f64>() / green.len() as f64)
        };
        let before = mean(&moving.drawn()?)?;
        let lit_as = |scene: &Scene| {
            let material = scene.materials[lamp].clone();
            [Change::Material { number: lamp, material }, Change::Light { number: 0, light: scene.lights[0].clone() }]
        };
        check(moving.change(&lit_as(&dark))? == Renewed::Changes, || "all was made anew".into())?;
        // Twenty iterations, and then one a frame.
        let shares = (0..60).map(|_| Ok(mean(&moving.drawn()?)? / before)).collect::<Result<Vec<_>, Box<dyn Error>>>()?;
        check((0.03..0.12).contains(&shares[0]) && shares[59] < 0.02, || format!("{side}: of the light is left {shares:?}"))?;
        moving.change(&lit_as(&scene))?;
        moving.drawn()?;
        let moves = [place(0, DAffine3::from_translation(DVec3::Y))].into_iter().chain(lit_as(&dark)).collect::<Vec<_>>();
        moving.change(&moves)?;
        let left = mean(&moving.drawn()?)? / before;
        check((0.03..0.12).contains(&left), || format!("{side}: {left} of the light is left where a ball has moved"))?;
    }
    Ok(())
}

/// A sky where there was none, a lobe where there was none, a lamp that goes out.
fn other_programs() -> Outcome {
    let scene = room(BALL, CRATE)?;
    let lamp = scene.materials.iter().position(|material| material.name == "lamp").ok_or("no lamp")?;
    let mut moving = Moving::new("irradiance", &[], scene.clone())?;
    moving.drawn()?;
    let mut expected = scene;
    expected.materials[lamp].emission = Vec3::ZERO;
    let told = moving.change(&[Change::Material { number: lamp, material: expected.materials[lamp].clone() }])?;
    check(told == Renewed::Whole, || "a lamp that goes out leaves all as it was".into())?;
    moving.same_as(&[], expected.clone())?;
    expected.environment = Environment::Constant(Vec3::new(0.3, 0.4, 0.5));
    moving.change(&[Change::Environment(expected.environment.clone())])?;
    moving.same_as(&[], expected)
}

fn refusals() -> Outcome {
    let mut moving = Moving::new("irradiance", &[], room(BALL, CRATE)?)?;
    let before = moving.drawn()?;
    let (material, light) = (moving.run.stage().scene.materials[0].clone(), moving.run.stage().scene.lights[0].clone());
    let mut lamp = light.clone();
    lamp.kind = LightKind::Point { position: Vec3::NAN, intensity: Vec3::ONE };
    let refused = [
        place(2, DAffine3::IDENTITY),
        place(0, DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0))),
        place(0, DAffine3::from_translation(DVec3::splat(f64::NAN))),
        place(0, DAffine3::from_translation(DVec3::splat(1e12))),
        Change::Material { number: 99, material: material.clone() },
        Change::Material { number: 0, material: Material { reflectance: Vec3::splat(2.0), ..material.clone() } },
        Change::Material { number: 0, material: Material { texture: Some(7), ..material } },
        Change::Light { number: 1, light },
        Change::Light { number: 0, light: lamp },
        Change::Environment(Environment::Constant(Vec3::splat(-1.0))),
        Change::Environment(Environment::LatLong { width: 2, height: 2, texels: vec![Vec3::ONE] }),
    ];
    for change in refused {
        // What comes before it is not done either.
        let told = moving.change(&[place(1, DAffine3::from_translation(DVec3::Y)), change.clone()]);
        check(matches!(told, Err(ChangeError::Scene(_))), || format!("{change:?} is not refused"))?;
    }
    block_on(moving.run.reset())?;
    let after = moving.drawn()?;
    check(before.layers == after.layers, || "what was refused left something".into())
}

fn sizes() -> Outcome {
    let mut moving = Moving::new("irradiance", &[], room(BALL, CRATE)?)?;
    let first = block_on(moving.run.frame(&|| Pace::GoOn))?;
    let made = first.new_records.unwrap_or(0);
    block_on(moving.engine.resize(&mut moving.run, &moving.pipeline, [48, 32]))?;
    let second = block_on(moving.run.frame(&|| Pace::GoOn))?;
    let picture = block_on(moving.run.picture())?;
    check([picture.width, picture.height] == [48, 32], || "another size".into())?;
    let (kept, added) = (second.records.irradiance.unwrap_or(0), second.new_records.unwrap_or(0));
    check(made > 50 && kept == made + added && added < made / 5, || format!("{made} records, then {added} more, {kept} in all"))
}

/// Bytes of this process that are in memory.
fn resident() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/statm").ok()?;
    Some(text.split(' ').nth(1)?.parse::<u64>().ok()? * 4096)
}

fn memory() -> Outcome {
    let sets = ["tiles.resolution=4"];
    let mut moving = Moving::new("irradiance", &sets, room(BALL, CRATE)?)?;
    let (mut bytes, mut after_some) = (Vec::new(), None);
    for frame in 0..1000_u32 {
        let angle = f64::from(frame) * 0.1;
        let light = |was: &hemisplat::scene::Light| {
            let position = Vec3::new(2.0 * angle.cos() as f32, 3.0, 2.0 * angle.sin() as f32);
            hemisplat::scene::Light { kind: LightKind::Point { position, intensity: Vec3::splat(6.0) }, ..was.clone() }
        };
        let light = light(&moving.run.stage().scene.lights[0]);
        moving.change(&[place(0, DAffine3::from_rotation_y(angle)), Change::Light { number: 0, light }])?;
        if frame % 50 == 0 {
            block_on(moving.engine.resize(&mut moving.run, &moving.pipeline, [24 + frame / 50 % 2 * 8, 16]))?;
        }
        block_on(moving.run.frame(&|| Pace::GoOn))?;
        bytes.push(moving.run.gpu_bytes());
        // Of the same size as the last, and as long after it was taken.
        if frame == 299 {
            after_some = resident();
        }
    }
    check(bytes[990] == bytes[390] && bytes[940] == bytes[340], || "the run takes more memory on the device".into())?;
    let grown = after_some.zip(resident()).map_or(0, |(before, after)| after.saturating_sub(before));
    println!("{} MiB more in the process after 700 changes", grown >> 20);
    check(grown < 8 << 20, || format!("the process takes {} MiB more after 700 changes", grown >> 20))
}

/// Most bytes that this process has had in memory so far.
fn peak() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? << 10)
}

/// Frames in which the cube of the scene that ships comes back to where it was.
const ROUND: u32 = 100;

/// The scene `cube`, whose cube goes round for so many frames, 24 a second, while the camera looks to the side and back.
fn rounds(frames: u32) -> Result<Scene, Box<dyn Error>> {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cube.ron"))?;
    let (count, seconds) = (frames.div_ceil(ROUND), f64::from(ROUND) / 24.0);
    let places = [(0.0, "(1, 0.8, 1.2)"), (0.3, "(3, 0.8, 1.6)"), (0.6, "(2.6, 1.8, 2.4)")];
    let keys: Vec<String> = (0..count)
        .flat_map(|round| places.map(|(share, place)| format!("({}, {place})", seconds * (f64::from(round) + share))))
        .chain([format!("({}, {})", seconds * f64::from(count), places[0].1)])
        .collect();
    let (turns, was) = (format!("Linear([(0, 0), ({}, {})])", seconds * f64::from(count), 360 * count), "Linear([(0, 0), (16, 360)])");
    let from = text.find("Smooth([").ok_or("no keys")?;
    let to = from + text[from..].find("])").ok_or("no end")? + 2;
    let text = format!("{}Smooth([{}]){}", &text[..from], keys.join(", "), &text[to..]);
    check(text.contains(was), || "the cube turns otherwise".into())?;
    let target = "target: (2, 1.3, 0)";
    check(text.contains(target), || "the camera looks elsewhere".into())?;
    let looks: Vec<String> =
        (0..=2 * count).map(|half| format!("({}, {})", 0.5 * seconds * f64::from(half), if half % 2 == 0 { "(2, 1.3, 0)" } else { "(6, 1.3, 3.9)" })).collect();
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("rounds.ron");
    std::fs::write(&file, text.replace(was, &turns).replace(target, &format!("target: Smooth([{}])", looks.join(", "))))?;
    Ok(load(&file, &LoadOptions::default())?)
}

/// Records are made and dropped as long as the scene moves. After a beginning, neither they nor the device's memory nor the process grow.
fn lasting_memory(frames: u32, beginning: u32) -> Outcome {
    let engine = block_on(Engine::open())?;
    let stage = Arc::new(Stage::animated(rounds(frames)?)?);
    let (name, size) = ("irradiance-temporal", [64, 48]);
    let sets = ["tiles.resolution=8", "due_tiles.resolution=8", "cache.accuracy=0.3"].map(str::to_owned);
    let pipeline = engine.pipeline(name, &sets, &mut |_| Err(io::ErrorKind::NotFound.into()))?;
    let plan = engine.plan(&pipeline, &stage, size)?;
    let mut run = block_on(engine.run(&stage, &plan, &stage.scene.cameras[0], size))?;
    let (mut records, mut made, mut at_beginning) = (Vec::new(), 0, None);
    for frame in 0..frames {
        let (changes, camera) = {
            let stage = run.stage();
            let moment = stage.scene.animation.at(f64::from(frame) / 24.0);
            (stage.changes_to(&moment), moment.camera(&stage.scene, &stage.scene.cameras[0]))
        };
        block_on(engine.change(&mut run, &pipeline, &changes))?;
        run.set_camera(&camera);
        let report = block_on(run.frame(&|| Pace::GoOn))?;
        records.push(report.records.irradiance.unwrap_or(0));
        made += report.new_records.unwrap_or(0);
        if frame + 1 == beginning {
            at_beginning = Some((run.gpu_bytes(), resident(), peak()));
        }
    }
    let (first, later) = records.split_at(beginning as usize);
    let most = |records: &[u32]| records.iter().max().copied().unwrap_or(0);
    let mean = |records: &[u32]| records.iter().sum::<u32>() / records.len().max(1) as u32;
    let last = &later[later.len().saturating_sub(first.len())..];
    let (device, before, peak_before) = at_beginning.ok_or("no beginning")?;
    let grown = |before: Option<u64>, now: Option<u64>| before.zip(now).map_or(0, |(before, now)| now.saturating_sub(before));
    let [process, peak] = [grown(before, resident()), grown(peak_before, peak())];
    println!(
        "{made} records made; alive {} in the mean up to frame {beginning}, {} in the last as many, {} and {} at most; {} MiB on the device; {} KiB more in the process, its peak {} KiB higher",
        mean(first),
        mean(last),
        most(first),
        most(later),
        device >> 20,
        process >> 10,
        peak >> 10
    );
    check(made > most(&records), || format!("no more than {made} records were made"))?;
    // Chance has it that of more rounds one has more.
    check(4 * most(later) <= 5 * most(first), || format!("{} records, where there were {}", most(later), most(first)))?;
    check(run.gpu_bytes() == device, || "the run takes more memory on the device".into())?;
    check(process < 8 << 20 && peak < 8 << 20, || format!("{} KiB more in the process, its peak {} KiB higher", process >> 10, peak >> 10))
}

/// A thousand balls of a thousand triangles each, strewn over a floor.
fn many() -> Result<Scene, Box<dyn Error>> {
    let mut balls = String::new();
    for k in 0..1000_u32 {
        let [x, y, z] = [k % 10, k / 10 % 10, k / 100].map(f64::from);
        let jitter = f64::from(k * 7919 % 100) / 100.0;
        balls += &format!(
            "Place(name: \"{k}\", of: [Sphere(centre: (0, 0, 0), radius: {}, subdivisions: 3, material: \"ball\")], translate: ({}, {}, {})),\n",
            0.2 + 0.4 * jitter,
            x + jitter,
            y - jitter,
            z + 0.5 * jitter
        );
    }
    let text = format!(
        r#"Scene(version: 1, geometry: [Quad(corners: ((-2, -2, -2), (-2, -2, 12), (12, -2, 12), (12, -2, -2)), material: "ball"), {balls}],
        materials: {{ "ball": Diffuse(reflectance: (0.5, 0.5, 0.5)) }}, environment: Constant((1, 1, 1)), cameras: {{ "main": (eye: (-6, 6, -6), target: (5, 4, 5), fov: 60) }})"#
    );
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("many.ron");
    std::fs::write(&file, text)?;
    Ok(load(&file, &LoadOptions::default())?)
}

fn timed<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let start = Instant::now();
    let done = work();
    (start.elapsed().as_secs_f64(), done)
}

fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers[numbers.len() / 2]
}

/// What single rays from all over the scene take [s].
fn cast(stage: &Stage) -> f64 {
    let number = |key: u32| hemisplat::math::random::unit(hemisplat::math::random::hash(key));
    let rays: Vec<(Vec3, Vec3)> = (0..200_000)
        .map(|k| {
            let at = Vec3::new(number(6 * k), number(6 * k + 1), number(6 * k + 2)) * 12.0 - 1.0;
            let to = Vec3::new(number(6 * k + 3), number(6 * k + 4), number(6 * k + 5)) - 0.5;
            (at, to.normalize_or(Vec3::X))
        })
        .collect();
    timed(|| rays.iter().filter(|(at, to)| stage.bvh.closest_hit(&stage.scene, *at, *to, f32::INFINITY).is_some()).count()).0
}

/// Costs of a change beside those of building the hierarchy, and of rays beside those through one level.
fn one_of_many() -> Outcome {
    let scene = many()?;
    check(scene.triangles.len() > 1_000_000 && scene.objects.len() == 1000, || format!("{} triangles", scene.triangles.len()))?;
    let objects: Vec<usize> = (0..1000).collect();
    let build = median((0..3).map(|_| timed(|| Stage::new(scene.clone())).0).collect());
    let still = Stage::new(scene.clone());
    let mut moving = Stage::moving(scene.clone(), &objects)?;
    let [one_level, two_levels] = [0, 1].map(|_| Vec::new());
    let mut rays = [one_level, two_levels];
    cast(&still);
    cast(&moving);
    for _ in 0..7 {
        rays[0].push(cast(&still));
        rays[1].push(cast(&moving));
    }
    let [one_level, two_levels] = rays.map(median);
    let mut number = 0;
    let mut step = || {
        number += 1;
        place(
            number * 37 % 1000,
            DAffine3::from_axis_angle(DVec3::Y, f64::from(number as u32)) * DAffine3::from_translation(DVec3::splat(0.01 * number as f64)),
        )
    };
    let on_host = median(
        (0..21)
            .map(|_| {
                let change = step();
                timed(|| moving.change(&[change])).0
            })
            .collect(),
    );
    println!(
        "{} triangles: hierarchy {:.0} ms, a change {:.2} ms ({:.2} %); rays {:.3} times one level",
        scene.triangles.len(),
        1e3 * build,
        1e3 * on_host,
        100.0 * on_host / build,
        two_levels / one_level
    );
    let mut whole = Moving::new("irradiance", &[], scene)?;
    let mut step = || {
        number += 1;
        place(number * 37 % 1000, DAffine3::from_translation(DVec3::splat(0.01 * number as f64)))
    };
    whole.drawn()?;
    let mut times = Vec::new();
    for _ in 0..9 {
        let change = step();
        let (time, told) = timed(|| whole.change(&[change]));
        check(told? == Renewed::Changes, || "made anew".into())?;
        times.push(time);
        block_on(whole.run.frame(&|| Pace::GoOn))?;
    }
    let all = median(times);
    println!("a change of a run, planned and brought to the device: {:.1} ms ({:.2} %)", 1e3 * all, 100.0 * all / build);
    check(on_host < 0.05 * build && two_levels < 1.1 * one_level, || "more than a twentieth of building, or slower rays".into())
}

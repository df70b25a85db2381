//! How far the picture has moved since the one before, beside what the positions of cameras and objects say.

use glam::{DAffine3, DVec3, Vec2, Vec3};
use hemisplat::{
    Camera, Change, Engine, Pace, Run, Scene, Stage, Unchangeable, block_on,
    gpu::Gpu,
    measure::Layers,
    pipeline::Pipeline,
    scene::{
        Sample,
        load::{LoadOptions, load},
    },
};
use libtest_mimic::Arguments;
use skips::Missing;
use std::{error::Error, fs, io, path::Path, sync::Arc};

mod bar;
mod skips;

type Outcome = Result<(), Box<dyn Error>>;

const SIZE: [u32; 2] = [96, 64];

/// A ball that can be moved, over a floor under a sky.
const SCENE: &str = r#"Scene(version: 1,
    geometry: [
        Quad(corners: ((-9, 0, 9), (9, 0, 9), (9, 0, -9), (-9, 0, -9)), material: "grey"),
        Place(name: "crate", of: [Box(min: (-2, 0.5, -3), max: (-1, 1.5, -2), material: "grey")]),
        Place(name: "ball", of: [Sphere(centre: (0, 0, 0), radius: 0.8, subdivisions: 4, material: "grey")], translate: (0.5, 0.9, 0)),
    ],
    materials: { "grey": Diffuse(reflectance: (0.5, 0.5, 0.5)) },
    environment: Constant((1, 1, 1)),
    cameras: { "main": (eye: (0, 1.5, 4), target: (0, 1, 0), fov: 70) })"#;

/// A bar that bends, seen from above.
const BAR: &str = r#"Scene(version: 1, geometry: [File("bar.gltf")], materials: { "*": Diffuse(reflectance: (0.5, 0.5, 0.5)) },
    environment: Constant((1, 1, 1)), cameras: { "main": (eye: (0.8, 2, 2.5), target: (0.5, 0.8, 0), fov: 50) })"#;

const PIPELINE: &str = r#"Pipeline(version: 1, about: "how far things have moved",
    nodes: [(name: "gbuffer", pass: GBuffer()), (name: "motion", pass: Motion(gbuffer: "gbuffer")), (name: "image", pass: Composite(gbuffer: "gbuffer"))],
    outputs: { "picture": "image", "motion": "motion", "position": "gbuffer.position" })"#;

fn main() {
    let missing = block_on(Gpu::open()).err().map(|error| Missing::new("gpu", error.to_string()));
    let trials = vec![
        skips::fallible("motion_is_that_of_the_camera_and_of_objects", missing.as_ref(), motion),
        skips::fallible("motion_is_that_of_each_triangle_of_what_deforms", missing.as_ref(), bending),
    ];
    libtest_mimic::run(&Arguments::from_args(), trials).exit();
}

fn check(holds: bool, otherwise: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(otherwise().into()) }
}

struct Film {
    engine: Engine,
    pipeline: Pipeline,
    run: Run,
}

impl Film {
    /// Of a scene document.
    fn new(text: &str, stage: impl FnOnce(Scene) -> Result<Stage, Unchangeable>) -> Result<Self, Box<dyn Error>> {
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("scene.ron");
        fs::write(&file, text)?;
        bar::write(folder.path())?;
        let stage = Arc::new(stage(load(&file, &LoadOptions::default())?)?);
        let engine = block_on(Engine::open())?;
        let mut read = |path: &Path| if path == Path::new("motion.ron") { Ok(PIPELINE.to_owned()) } else { Err(io::ErrorKind::NotFound.into()) };
        let pipeline = engine.pipeline("motion.ron", &[], &mut read)?;
        let plan = engine.plan(&pipeline, &stage, SIZE)?;
        let run = block_on(engine.run(&stage, &plan, &stage.scene.cameras[0], SIZE))?;
        Ok(Self { engine, pipeline, run })
    }

    fn drawn(&mut self) -> Result<Layers, Box<dyn Error>> {
        block_on(self.run.frame(&|| Pace::GoOn))?;
        Ok(block_on(self.run.picture())?)
    }

    /// Moves the ball, the first of the movers.
    fn move_ball(&mut self, map: DAffine3) -> Outcome {
        block_on(self.engine.change(&mut self.run, &self.pipeline, &[Change::Place { mover: 0, map }]))?;
        Ok(())
    }
}

/// X, Y, Z of each pixel of a layer.
fn vectors(layers: &Layers, name: &str) -> Vec<Vec3> {
    let channel = |channel: &str| &layers.layers[name].channels[channel];
    let [x, y, z] = ["X", "Y", "Z"].map(channel);
    x.iter().zip(y).zip(z).map(|((x, y), z)| Vec3::new(*x, *y, *z)).collect()
}

/// Where a camera sees what lies in a direction, to the right and down [pixels].
fn seen(camera: &Camera, to: Vec3) -> Vec2 {
    let half = camera.half_extent(SIZE);
    let at = Vec2::new(to.dot(camera.right()) / half.x, -to.dot(camera.up) / half.y) / to.dot(camera.direction);
    at * 0.5 * Vec2::new(SIZE[0] as f32, SIZE[1] as f32)
}

fn motion() -> Outcome {
    let mut film = Film::new(SCENE, |scene| Stage::moving(scene, &[1, 0]))?;
    let first = film.drawn()?;
    check(vectors(&first, "motion").iter().all(|motion| *motion == Vec3::ZERO), || "a first picture has moved".into())?;

    let before = film.run.stage().scene.cameras[0].clone();
    let eye = before.eye + Vec3::new(0.3, -0.1, 0.2);
    let direction = (before.direction + Vec3::new(0.1, 0.05, 0.0)).normalize();
    let now = Camera { eye, direction, up: before.right().cross(direction).normalize(), ..before.clone() };
    let map = DAffine3::from_translation(DVec3::new(-0.4, 0.3, 0.1)) * DAffine3::from_rotation_y(0.2);
    film.move_ball(map)?;
    film.run.set_camera(&now);
    let second = film.drawn()?;
    held(&second, [&before, &now], map, film.run.stage().scene.origin)?;

    // A further sample of the same picture has moved as far.
    film.run.set_camera(&Camera { sample: Sample { number: 1, ..now.sample }, ..now.clone() });
    held(&film.drawn()?, [&before, &now], map, film.run.stage().scene.origin)?;
    film.run.set_camera(&now);
    let third = film.drawn()?;
    check(vectors(&third, "motion").iter().all(|motion| *motion == Vec3::ZERO), || "nothing has moved, and yet it has".into())?;

    // Another size is no cut.
    film.run.set_camera(&before);
    block_on(film.engine.resize(&mut film.run, &film.pipeline, SIZE))?;
    held(&film.drawn()?, [&now, &before], DAffine3::IDENTITY, film.run.stage().scene.origin)
}

/// The bar's upper square has turned down toward the camera around its lower edge; its triangles were stretched and turned on the way, all else has stayed.
fn bending() -> Outcome {
    let mut film = Film::new(BAR, Stage::animated)?;
    let camera = film.run.stage().scene.cameras[0].clone();
    film.drawn()?;
    let changes = film.run.stage().changes_to(&film.run.stage().scene.animation.at(1.0));
    block_on(film.engine.change(&mut film.run, &film.pipeline, &changes))?;
    let (layers, origin) = (film.drawn()?, film.run.stage().scene.origin.as_vec3());
    let mut counts = [0; 2];
    for (pixel, (motion, position)) in vectors(&layers, "motion").iter().zip(vectors(&layers, "position")).enumerate() {
        let at = position + origin;
        let is_bent = at.z > 1e-4;
        let was = if is_bent { Vec3::new(at.x, 1.0 + at.z, 0.0) } else { at } - origin;
        let [now, before] = [position, was].map(|at| at - camera.eye);
        let expected =
            if position == Vec3::ZERO { Vec3::ZERO } else { (seen(&camera, now) - seen(&camera, before)).extend((now - before).dot(camera.direction)) };
        counts[usize::from(is_bent)] += 1;
        let apart = (*motion - expected).abs();
        check(apart.max_element() < 1e-3 * (1.0 + expected.length()), || format!("pixel {pixel}: {motion}, not {expected}; at {at}"))?;
    }
    check(counts.iter().all(|count| *count > 100), || format!("{counts:?} pixels of what stays and of what bends"))?;
    check(vectors(&film.drawn()?, "motion").iter().all(|motion| *motion == Vec3::ZERO), || "nothing has moved, and yet it has".into())
}

/// The motion of each pixel beside that of its point, from the view of one camera to that of another.
fn held(layers: &Layers, [before, now]: [&Camera; 2], map: DAffine3, origin: DVec3) -> Outcome {
    let (motions, positions) = (vectors(layers, "motion"), vectors(layers, "position"));
    let middle = map.transform_point3(DVec3::new(0.5, 0.9, 0.0)) - origin;
    let mut counts = [0; 3];
    for (pixel, (motion, position)) in motions.iter().zip(&positions).enumerate() {
        let is_sky = *position == Vec3::ZERO;
        let is_ball = position.distance(middle.as_vec3()) < 0.85;
        let was = if is_ball { (map.inverse().transform_point3(position.as_dvec3() + origin) - origin).as_vec3() } else { *position };
        let [to_now, to_before] = if is_sky {
            let at = Vec2::new((pixel as u32 % SIZE[0]) as f32 + 0.5, (pixel as u32 / SIZE[0]) as f32 + 0.5);
            let half = now.half_extent(SIZE);
            let at = (at / Vec2::new(SIZE[0] as f32, SIZE[1] as f32) * 2.0 - 1.0) * Vec2::new(half.x, -half.y);
            [now.direction + now.right() * at.x + now.up * at.y; 2]
        } else {
            [*position - now.eye, was - before.eye]
        };
        counts[if is_sky { 0 } else { 1 + usize::from(is_ball) }] += 1;
        // What was beside the camera before or behind it was on no pixel.
        if to_before.dot(before.direction) < 0.01 * to_before.length() {
            continue;
        }
        let away = if is_sky { 0.0 } else { to_now.dot(now.direction) - to_before.dot(before.direction) };
        let expected = (seen(now, to_now) - seen(before, to_before)).extend(away);
        let apart = (*motion - expected).abs();
        check(apart.max_element() < 1e-3 * (1.0 + expected.length()), || format!("pixel {pixel}: {motion}, not {expected}; at {position}"))?;
    }
    check(counts.iter().all(|count| *count > 100), || format!("{counts:?} pixels of the sky, the floor, the ball"))
}

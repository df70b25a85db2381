//! The reference against closed forms, and the promises that it makes: repeatable, blind to units, honest about its noise.

use glam::{DVec3, Vec2, Vec3};
use hemisplat::{
    math::{harmonics::quadrature::hemisphere, lobe::Lobe},
    reference::{Bounces, MAX_SAMPLES, Pixels, Reference, ReferenceError, Settings, Stop, Tracer, VERSION, left_out, render},
    scene::{bvh::Bvh, model::*},
};
use std::f64::consts::PI;

/// A scene in code: no lights, a black sky.
fn scene(triangles: Vec<Triangle>, materials: Vec<Material>) -> Scene {
    Scene { name: "test".into(), triangles, materials, ..Scene::default() }
}

fn triangle(positions: [Vec3; 3], material: u32) -> Triangle {
    let normal = (positions[1] - positions[0]).cross(positions[2] - positions[0]).normalize();
    Triangle { positions, normals: [normal; 3], uvs: [Vec2::ZERO, Vec2::X, Vec2::ONE], tints: Default::default(), material }
}

/// A parallelogram that faces along `u × v`, its texture along them.
fn quad(corner: Vec3, u: Vec3, v: Vec3, material: u32) -> Vec<Triangle> {
    let mut halves = vec![triangle([corner, corner + u, corner + u + v], material), triangle([corner, corner + u + v, corner + v], material)];
    halves[1].uvs = [Vec2::ZERO, Vec2::ONE, Vec2::Y];
    halves
}

/// The unit cube, facing inward, with the materials of floor (y = 0), ceiling, and the walls x = 0, x = 1, z = 0, z = 1.
fn cube(materials: [u32; 6]) -> Vec<Triangle> {
    let (x, y, z, o) = (Vec3::X, Vec3::Y, Vec3::Z, Vec3::ZERO);
    let faces = [(o, z, x), (y, x, z), (o, y, z), (x, z, y), (o, x, y), (z, y, x)];
    faces.into_iter().zip(materials).flat_map(|((corner, u, v), material)| quad(corner, u, v, material)).collect()
}

/// A cube whose `face` emits 1 and whose other walls are black.
fn cube_with_emitting(face: usize) -> Scene {
    let mut materials = [0; 6];
    materials[face] = 1;
    scene(cube(materials), vec![grey(0.0), emitter(1.0)])
}

fn emitter(radiance: f32) -> Material {
    Material { emission: Vec3::splat(radiance), ..Material::diffuse("emitter", Vec3::ZERO) }
}

fn grey(reflectance: f32) -> Material {
    Material::diffuse("grey", Vec3::splat(reflectance))
}

fn point_light(position: Vec3, intensity: f32) -> Light {
    Light { name: "lamp".into(), kind: LightKind::Point { position, intensity: Vec3::splat(intensity) }, shadows: true }
}

/// A directional light of irradiance 1 straight down.
fn sun() -> Light {
    Light { name: "sun".into(), kind: LightKind::Directional { direction: -Vec3::Y, irradiance: Vec3::ONE }, shadows: true }
}

/// The unit sphere by `8·4^levels` inscribed triangles, facing inward.
fn sphere(levels: u32) -> Vec<Triangle> {
    let sign = |i: u32, bit: u32| if i >> bit & 1 == 0 { 1.0 } else { -1.0 };
    let mut faces: Vec<[Vec3; 3]> = (0..8).map(|i| [Vec3::X * sign(i, 0), Vec3::Y * sign(i, 1), Vec3::Z * sign(i, 2)]).collect();
    let split = |[a, b, c]: [Vec3; 3]| {
        let [ab, bc, ca] = [(a + b).normalize(), (b + c).normalize(), (c + a).normalize()];
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    };
    for _ in 0..levels {
        faces = faces.into_iter().flat_map(split).collect();
    }
    let inward = |[a, b, c]: [Vec3; 3]| if (b - a).cross(c - a).dot(a) < 0.0 { [a, b, c] } else { [a, c, b] };
    faces.into_iter().map(|face| triangle(inward(face), 0)).collect()
}

/// Direct and indirect irradiance at a point of a grey scene.
fn light_at(mut scene: Scene, position: Vec3, normal: Vec3, bounces: Bounces, samples: u32) -> (f64, f64) {
    let bvh = Bvh::build(&mut scene);
    let found = Tracer::new(&scene, &bvh).gather(position, normal, bounces, samples, 1);
    assert!((found.irradiance.x - found.irradiance.z).abs() <= 1e-12 * found.irradiance.x, "grey stays grey");
    (found.direct_irradiance.x, found.irradiance.x)
}

fn direct_at(scene: Scene, position: Vec3, normal: Vec3, samples: u32) -> f64 {
    light_at(scene, position, normal, Bounces::Count(0), samples).0
}

#[track_caller]
fn assert_close(found: f64, expected: f64, relative: f64) {
    let error = found / expected - 1.0;
    assert!(error.abs() <= relative, "{found} instead of {expected}: {:+.4} %", error * 100.0);
}

#[test]
fn furnace_of_emitting_walls_gives_pi_everywhere() {
    for place in [Vec3::new(0.5, 0.0, 0.5), Vec3::new(0.001, 0.0, 0.999)] {
        let (direct, indirect) = light_at(scene(cube([0; 6]), vec![emitter(1.0)]), place, Vec3::Y, Bounces::Count(2), 65536);
        assert_close(direct, PI, 0.002);
        assert_eq!(indirect, 0.0);
    }
}

#[test]
fn furnace_of_sky_gives_pi() {
    let mut plane = scene(quad(Vec3::ZERO, Vec3::Z, Vec3::X, 0), vec![grey(1.0)]);
    plane.environment = Environment::Constant(Vec3::ONE);
    let (direct, indirect) = light_at(plane, Vec3::new(0.5, 0.0, 0.5), Vec3::Y, Bounces::Count(1), 256);
    assert_close(direct, PI, 1e-6);
    assert_eq!(indirect, 0.0);
}

#[test]
fn bounces_of_a_furnace_are_a_geometric_series() {
    // Each bounce of walls that emit 1 adds ρ times the one before; all of them ρ/(1 − ρ).
    let walls = || Material { emission: Vec3::ONE, ..grey(0.5) };
    let indirect = |bounces| light_at(scene(cube([0; 6]), vec![walls()]), Vec3::new(0.3, 0.0, 0.4), Vec3::Y, bounces, 4096).1;
    for count in 0..4 {
        let expected: f64 = (1..=count).map(|k| PI * 0.5f64.powi(k as i32)).sum();
        let found = indirect(Bounces::Count(count));
        assert!((found - expected).abs() <= 0.01 * expected, "{count} bounces: {found} instead of {expected}");
    }
    assert_close(indirect(Bounces::All), PI, 0.01);
}

#[test]
fn what_bounces_leave_out_is_that_of_a_geometric_series() {
    // Of what walls reflect, ρ + ρ² + …, more than n bounces bring ρ to the (n + 1)th.
    let mut furnace = scene(cube([0; 6]), vec![Material { emission: Vec3::ONE, ..grey(0.6) }]);
    let bvh = Bvh::build(&mut furnace);
    for bounces in 0..4 {
        let found = left_out(&furnace, &bvh, &camera(1.0), [64, 48], bounces).unwrap();
        let expected = 0.6f64.powi(bounces as i32 + 1);
        assert!(found.bounces == bounces && (found.share - expected).abs() < 0.03 && found.interval[0] < found.share, "{expected}: {found:?}");
    }
}

#[test]
fn what_bounces_leave_out_is_in_its_interval() {
    let mut room = room(1.0);
    let bvh = Bvh::build(&mut room);
    let by = |bounces| {
        let reference = render(&room, &bvh, &camera(1.0), &Settings { size: [24, 18], bounces, stop: Stop::Samples(4096), ..SETTINGS }, &|_| true).unwrap();
        reference.direct.iter().chain(&reference.indirect).map(|light| light.as_dvec3().dot(DVec3::new(0.2126, 0.7152, 0.0722))).sum::<f64>()
    };
    let (one, all) = (by(Bounces::Count(1)), by(Bounces::All));
    let found = left_out(&room, &bvh, &camera(1.0), [240, 180], 1).unwrap();
    let [low, high] = found.interval;
    assert!(low < 1.0 - one / all && 1.0 - one / all < high && high - low < 0.15, "{}: {found:?}", 1.0 - one / all);
}

#[test]
fn nothing_is_left_out_of_nothing() {
    let mut dark = scene(cube([0; 6]), vec![grey(0.5)]);
    let bvh = Bvh::build(&mut dark);
    assert_eq!(left_out(&dark, &bvh, &camera(1.0), [64, 48], 1), None);
    let mut black = scene(cube([0; 6]), vec![Material { emission: Vec3::ONE, ..grey(0.0) }]);
    let bvh = Bvh::build(&mut black);
    assert_eq!(left_out(&black, &bvh, &camera(1.0), [64, 48], 1), None);
}

#[test]
fn point_on_a_cube_floor_sees_the_known_fractions() {
    let (centre, corner) = (Vec3::new(0.5, 0.0, 0.5), Vec3::new(1e-5, 0.0, 1e-5));
    for (place, face, fraction) in [(centre, 1, 0.23946), (centre, 2, 0.1901), (corner, 1, 0.13853), (corner, 3, 0.05573)] {
        assert_close(direct_at(cube_with_emitting(face), place, Vec3::Y, 16384) / PI, fraction, 0.003);
    }
}

#[test]
fn squares_exchange_the_known_form_factors() {
    for (face, factor) in [(1, 0.199825), (2, 0.200044)] {
        let mut cube = cube_with_emitting(face);
        let bvh = Bvh::build(&mut cube);
        let tracer = Tracer::new(&cube, &bvh);
        let cells = 32;
        let place = |i: u64| Vec3::new((i % cells) as f32 + 0.5, 0.0, (i / cells) as f32 + 0.5) / cells as f32;
        let sum: f64 = (0..cells * cells).map(|i| tracer.gather(place(i), Vec3::Y, Bounces::Count(0), 512, i).direct_irradiance.x).sum();
        assert_close(sum / (cells * cells) as f64 / PI, factor, 0.003);
    }
}

#[test]
fn rectangle_over_a_point_has_its_textbook_form_factor() {
    // A point under a corner of an a × b rectangle at height c (Howell's catalogue, configuration B-4).
    let (a, b, c) = (2.0f64, 0.7, 1.3);
    let (x, y) = (a / c, b / c);
    let (p, q) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    let factor = (x / p * (y / p).atan() + y / q * (x / q).atan()) / (2.0 * PI);
    let rectangle = quad(Vec3::Y * c as f32, Vec3::X * a as f32, Vec3::Z * b as f32, 0);
    assert_close(direct_at(scene(rectangle, vec![emitter(3.0)]), Vec3::ZERO, Vec3::Y, 4096), 3.0 * PI * factor, 0.002);
}

#[test]
fn disc_over_a_point_has_its_textbook_form_factor() {
    // E = πL r²/(r² + h²); 512 sectors stand for the disc.
    let (radius, height, sectors) = (0.8f32, 0.5, 512);
    let rim = |i: u32| {
        let (sin, cos) = (i as f32 / sectors as f32 * std::f32::consts::TAU).sin_cos();
        Vec3::new(cos * radius, height, sin * radius)
    };
    let disc = (0..sectors).map(|i| triangle([Vec3::Y * height, rim(i), rim(i + 1)], 0)).collect();
    let expected = PI * (radius * radius / (radius * radius + height * height)) as f64;
    assert_close(direct_at(scene(disc, vec![emitter(1.0)]), Vec3::ZERO, Vec3::Y, 4096), expected, 0.002);
}

#[test]
fn closed_sphere_multiplies_its_light() {
    // E = E_d + ρ/(1 − ρ)·mean(E_d), the mean being the lamp's flux over the area. 2048 flat faces stand for the sphere: 1 %.
    for reflectance in [0.3f64, 0.8] {
        let mut ball = scene(sphere(4), vec![grey(reflectance as f32)]);
        let area: f32 = ball.triangles.iter().map(|t| t.cross().length() / 2.0).sum();
        ball.lights.push(point_light(Vec3::ZERO, 2.0));
        let bottom = ball.triangles[700];
        let place = bottom.position(Vec2::splat(1.0 / 3.0));
        let (direct, indirect) = light_at(ball, place, bottom.face_normal(), Bounces::All, 65536);
        assert_close(direct, 2.0, 0.01);
        assert_close(indirect, 8.0 * PI / area as f64 * reflectance / (1.0 - reflectance), 0.01);
    }
}

#[test]
fn sky_beside_a_black_wall() {
    // E = π/2·(1 + x/√(x² + H²)) beside an endless wall of height H at distance x.
    let (x, height, far) = (0.6f32, 0.9f32, 60.0f32);
    let mut wall = scene(quad(Vec3::new(-x, 0.0, -far), Vec3::Y * height, Vec3::Z * 2.0 * far, 0), vec![grey(0.0)]);
    wall.environment = Environment::Constant(Vec3::ONE);
    let expected = PI / 2.0 * (1.0 + (x / (x * x + height * height).sqrt()) as f64);
    assert_close(direct_at(wall, Vec3::ZERO, Vec3::Y, 65536), expected, 0.002);
}

#[test]
fn one_bounce_off_a_sunlit_floor_has_its_closed_form() {
    // A wide floor of irradiance 1 has radiance ρ/π: what faces it from above gets ρ. No second bounce comes back.
    let far = 1e3f32;
    let mut floor = scene(quad(Vec3::new(-far, 0.0, -far), Vec3::Z * 2.0 * far, Vec3::X * 2.0 * far, 0), vec![grey(0.7)]);
    floor.lights.push(sun());
    let (direct, indirect) = light_at(floor, Vec3::Y, -Vec3::Y, Bounces::Count(3), 4096);
    assert_eq!(direct, 0.0);
    assert_close(indirect, 0.7, 1e-3);
}

#[test]
fn a_latitude_longitude_sky_gives_what_its_integral_says() {
    let (width, height) = (256u32, 128u32);
    let polar = |row: u32| (row as f64 + 0.5) / height as f64 * PI;
    // Radiance cos²θ over the upper half: E = 2π ∫ cos³θ sinθ dθ = π/2.
    let smooth = (0..width * height).map(|i| Vec3::splat(polar(i / width).cos().max(0.0).powi(2) as f32)).collect();
    // A sun of one texel, which bilinear lookup spreads as a product of two tents.
    let row = 20;
    let mut sun = vec![Vec3::ZERO; (width * height) as usize];
    sun[(row * width + 200) as usize] = Vec3::splat(1e4);
    let steps = 400;
    let tent = (0..steps).map(|k| 2.0 * (k as f64 + 0.5) / steps as f64 - 1.0).map(|offset| {
        let theta = polar(row) + offset * PI / height as f64;
        (1.0 - offset.abs()) * theta.cos() * theta.sin() * 2.0 / steps as f64
    });
    let sun_irradiance = 1e4 * tent.sum::<f64>() * (PI / height as f64) * (2.0 * PI / width as f64);
    for (texels, expected, tolerance) in [(smooth, PI / 2.0, 0.003), (sun, sun_irradiance, 0.01)] {
        let mut open = scene(vec![], vec![]);
        open.environment = Environment::LatLong { width, height, texels };
        assert_close(direct_at(open, Vec3::ZERO, Vec3::Y, 16384), expected, tolerance);
    }
}

#[test]
fn a_sun_in_the_sky_stands_where_its_texel_is() {
    // The middle column is −z and columns turn towards +x: +x on the horizon is three quarters along.
    let mut texels = vec![Vec3::ZERO; 64 * 32];
    [(47, 15), (48, 15), (47, 16), (48, 16)].into_iter().for_each(|(column, row)| texels[row * 64 + column] = Vec3::splat(100.0));
    let mut open = scene(vec![], vec![]);
    open.environment = Environment::LatLong { width: 64, height: 32, texels };
    let bvh = Bvh::build(&mut open);
    let tracer = Tracer::new(&open, &bvh);
    let lit = [Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::Y].map(|n| tracer.gather(Vec3::ZERO, n, Bounces::Count(0), 1024, 1).direct_irradiance.x);
    assert!(lit[0] > 1.0 && lit[1] == 0.0 && lit[2] < lit[0] / 10.0 && lit[3] < lit[0] / 10.0, "{lit:?}");
}

#[test]
fn spots_follow_the_gltf_falloff() {
    let (inner, outer) = (0.3f32, 0.6f32);
    let ramp = ((0.45f64.cos() - 0.6f64.cos()) / (0.3f64.cos() - 0.6f64.cos())).powi(2);
    for (angle, falloff) in [(0.1f32, 1.0f64), (0.45, ramp), (0.7, 0.0)] {
        let kind = LightKind::Spot { position: Vec3::Y * 2.0, direction: Vec3::NEG_Y, intensity: Vec3::splat(4.0), inner, outer };
        let mut open = scene(vec![], vec![]);
        open.lights.push(Light { name: "spot".into(), kind, shadows: true });
        // I·cos/d² with d = 2/cos and I = 4.
        let expected = falloff * (angle.cos() as f64).powi(3);
        let found = direct_at(open, Vec3::X * 2.0 * angle.tan(), Vec3::Y, 1);
        assert!((found - expected).abs() < 1e-4, "{angle}: {found} instead of {expected}");
    }
}

#[test]
fn lights_may_cast_no_shadow() {
    let blocked = |shadows| {
        let mut lid = scene(quad(Vec3::new(-1.0, 1.0, -1.0), Vec3::X * 2.0, Vec3::Z * 2.0, 0), vec![grey(0.0)]);
        lid.lights.push(Light { shadows, ..point_light(Vec3::Y * 2.0, 4.0) });
        direct_at(lid, Vec3::ZERO, Vec3::Y, 1)
    };
    assert_eq!(blocked(true), 0.0);
    assert_close(blocked(false), 1.0, 1e-4);
}

#[test]
fn one_sided_surfaces_are_unseen_from_behind_but_shadow() {
    // Over the place a lid that faces up, over it a lamp, over all a ceiling that emits and reflects.
    let under_lid = |two_sided| {
        let mut triangles = quad(Vec3::new(-9.0, 1.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0, 0);
        triangles.extend(quad(Vec3::new(-9.0, 2.0, -9.0), Vec3::X * 18.0, Vec3::Z * 18.0, 1));
        let mut scene = scene(triangles, vec![Material { two_sided, ..grey(0.5) }, Material { reflectance: Vec3::splat(0.5), ..emitter(1.0) }]);
        scene.lights.push(point_light(Vec3::Y * 1.5, 1.0));
        light_at(scene, Vec3::ZERO, Vec3::Y, Bounces::Count(1), 1024)
    };
    // Rays pass the back of the lid and meet the lit ceiling; its emission and the lamp are shadowed.
    let (direct, indirect) = under_lid(false);
    assert_eq!(direct, 0.0);
    assert!(indirect > 0.1, "{indirect}");
    assert_eq!(under_lid(true), (0.0, 0.0), "nothing lights the lower side of a two-sided lid");
}

#[test]
fn one_sided_surfaces_shadow_the_sky() {
    let texels = vec![Vec3::ONE; 8];
    for environment in [Environment::Constant(Vec3::ONE), Environment::LatLong { width: 4, height: 2, texels }] {
        let under_lid = |two_sided| {
            let lid = quad(Vec3::new(-1.0, 1.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0, 0);
            let mut scene = scene(lid, vec![Material { two_sided, ..grey(0.0) }]);
            scene.environment = environment.clone();
            direct_at(scene, Vec3::ZERO, Vec3::Y, 4096)
        };
        // All but the lid's share, four corner rectangles of 1 × 1 at height 1: 4·0.13853.
        assert_close(under_lid(true) / PI, 1.0 - 4.0 * 0.13853, 0.01);
        assert_close(under_lid(false), under_lid(true), 1e-6);
    }
}

#[test]
fn one_sided_emitters_shine_from_their_front_alone() {
    let from_behind = |two_sided| {
        let ceiling = quad(Vec3::new(-1.0, 1.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0, 0);
        direct_at(scene(ceiling, vec![Material { two_sided, ..emitter(1.0) }]), Vec3::ZERO, Vec3::Y, 1024)
    };
    assert_eq!(from_behind(false), 0.0);
    assert!(from_behind(true) > 0.5);
}

#[test]
fn alpha_masks_leave_holes() {
    // The half of the lid at x < 0 is transparent.
    let material = Material { texture: Some(0), alpha_cutoff: Some(0.5), ..grey(0.0) };
    let mut lid = scene(quad(Vec3::new(-1.0, 1.0, 1.0), Vec3::X * 2.0, Vec3::NEG_Z * 2.0, 0), vec![material]);
    let texels = (0..64).map(|i| [255, 255, 255, if i % 8 < 4 { 0 } else { 255 }]).collect();
    lid.textures.push(Texture { name: "mask".into(), width: 8, height: 8, texels, ..Default::default() });
    lid.lights.push(point_light(Vec3::new(-1.0, 2.0, 0.0), 1.0));
    let bvh = Bvh::build(&mut lid);
    let tracer = Tracer::new(&lid, &bvh);
    let lit = |x: f32| tracer.gather(Vec3::new(x, 0.0, 0.0), Vec3::Y, Bounces::Count(0), 2, 1).direct_irradiance.x;
    assert!(lit(0.0) > 0.0, "through the hole at x = −0.5");
    assert_eq!(lit(1.8), 0.0, "behind the solid half at x = 0.4");
}

#[test]
fn emitters_do_not_shine_from_their_holes() {
    let half_lit = |alpha_cutoff| {
        let material = Material { texture: Some(0), alpha_cutoff, ..emitter(1.0) };
        let mut lid = scene(quad(Vec3::new(-1.0, 1.0, 1.0), Vec3::X * 2.0, Vec3::NEG_Z * 2.0, 0), vec![material]);
        let texels = (0..64 * 64).map(|i| [255, 255, 255, if i % 64 < 32 { 0 } else { 255 }]).collect();
        lid.textures.push(Texture { name: "mask".into(), width: 64, height: 64, texels, ..Default::default() });
        direct_at(lid, Vec3::ZERO, Vec3::Y, 16384)
    };
    assert_close(half_lit(Some(0.5)), half_lit(None) / 2.0, 0.01);
}

#[test]
fn textures_colour_the_reflected_light() {
    let far = 500.0;
    let material = Material { texture: Some(0), ..grey(0.5) };
    let mut floor = scene(quad(Vec3::new(-far, 0.0, -far), Vec3::Z * 2.0 * far, Vec3::X * 2.0 * far, 0), vec![material]);
    floor.textures.push(Texture { name: "red".into(), width: 1, height: 1, texels: vec![[255, 0, 188, 255]], ..Default::default() });
    floor.lights.push(sun());
    let bvh = Bvh::build(&mut floor);
    let found = Tracer::new(&floor, &bvh).gather(Vec3::Y, Vec3::NEG_Y, Bounces::Count(1), 1024, 1).irradiance;
    // sRGB 188 is 0.5029 in linear light.
    assert!(found.distance(DVec3::new(0.5, 0.0, 0.2514)) < 2e-3, "{found}");
}

/// A room with coloured walls, a block, a lamp and an emitting panel.
fn room(scale: f32) -> Scene {
    let mut triangles = cube([0, 0, 1, 2, 0, 0]);
    let place = |p: Vec3| Vec3::new(0.55, 0.0, 0.2) + p * Vec3::new(0.25, 0.5, 0.3);
    triangles.extend(cube([0; 6]).iter().map(|t| triangle(t.positions.map(place), 0)));
    triangles.extend(quad(Vec3::new(0.4, 0.999, 0.4), Vec3::X * 0.2, Vec3::Z * 0.2, 3));
    let triangles = triangles.iter().map(|t| triangle(t.positions.map(|p| p * scale), t.material)).collect();
    let materials = vec![grey(0.7), Material::diffuse("red", Vec3::new(0.7, 0.1, 0.1)), Material::diffuse("green", Vec3::new(0.1, 0.6, 0.1)), emitter(5.0)];
    let mut room = scene(triangles, materials);
    room.lights.push(point_light(Vec3::new(0.3, 0.8, 0.7) * scale, 0.3 * scale * scale));
    room
}

fn camera(scale: f32) -> Camera {
    let direction = Vec3::new(-0.6, -0.25, -0.75).normalize();
    let up = direction.cross(Vec3::Y).cross(direction).normalize();
    Camera {
        name: "corner".into(),
        eye: Vec3::new(0.95, 0.6, 0.95) * scale,
        direction,
        up,
        field_of_view: FieldOfView::Horizontal(1.3),
        size: None,
        sample: Default::default(),
    }
}

const SETTINGS: Settings = Settings { size: [24, 16], pixels: Pixels::Every(1), bounces: Bounces::Count(2), stop: Stop::Samples(64), seed: 3 };

fn picture(scale: f32, settings: Settings) -> Reference {
    let mut room = room(scale);
    let bvh = Bvh::build(&mut room);
    render(&room, &bvh, &camera(scale), &settings, &|_| true).unwrap()
}

#[test]
fn the_unit_of_length_does_not_matter() {
    let unit = picture(1.0, SETTINGS);
    let mean = |layer: &[Rgb]| layer.iter().sum::<Vec3>().element_sum() as f64;
    for scale in [1e-3, 1e6] {
        let other = picture(scale, SETTINGS);
        for (a, b) in [(&unit.irradiance, &other.irradiance), (&unit.direct_irradiance, &other.direct_irradiance)] {
            // The same random numbers: only rounding differs, which now and then turns a shadow ray at an edge.
            let apart = a.iter().zip(b).filter(|(a, b)| a.distance(**b) > 1e-3 * a.length()).count();
            assert!(apart <= a.len() / 20, "{apart} pixels differ at scale {scale}");
            assert_close(mean(b), mean(a), 1e-3);
        }
        assert_close((other.depth[100] / scale) as f64, unit.depth[100] as f64, 1e-5);
    }
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        Reference { seconds: 0.0, ..pool.install(|| picture(1.0, SETTINGS)) }
    };
    assert_eq!(with(1), with(2));
}

/// Pictures that are kept carry the version: whoever changes what a seed gives raises it, and puts the new sum here.
#[test]
fn the_version_belongs_to_what_a_seed_gives() {
    let sum = |seed| {
        let reference = picture(1.0, Settings { size: [16, 12], stop: Stop::Samples(8), seed, ..SETTINGS });
        reference.irradiance.iter().sum::<Vec3>().element_sum() as f64
    };
    assert_eq!(VERSION, 3);
    assert_close(sum(0), 340.433, 1e-3);
    let others: Vec<f64> = (1..4).map(sum).collect();
    assert!(others.iter().all(|other| (other / 340.433 - 1.0).abs() > 3e-3), "a change of the random numbers would not be seen: {others:?}");
}

#[test]
fn a_stride_takes_the_full_pictures_pixels() {
    let full = picture(1.0, SETTINGS);
    for stride in [2, 3, 5] {
        let part = picture(1.0, Settings { pixels: Pixels::Every(stride), ..SETTINGS });
        let places = |side: u32| (stride / 2..side).step_by(stride as usize);
        assert_eq!((part.width as usize, part.height as usize), (places(24).count(), places(16).count()));
        let taken: Vec<usize> = places(16).flat_map(|y| places(24).map(move |x| (y * 24 + x) as usize)).collect();
        assert_eq!(part.picture, taken.iter().map(|&i| full.picture[i]).collect::<Vec<_>>(), "stride {stride}");
        assert_eq!(part.variance, taken.iter().map(|&i| full.variance[i]).collect::<Vec<_>>(), "stride {stride}");
    }
}

#[test]
fn windows_hold_the_full_pictures_pixels_and_nothing_else() {
    let settings = Settings { size: [150, 70], stop: Stop::Samples(2), ..SETTINGS };
    let full = picture(1.0, settings);
    let part = picture(1.0, Settings { pixels: Pixels::Windows(1), ..settings });
    let windows = part.windows.clone().unwrap();
    let mask = windows.mask([150, 70], 0);
    assert_eq!((part.width, part.height, part.stride, windows.corners().len()), (150, 70, 1, 1));
    assert_eq!(mask.iter().filter(|inside| **inside).count(), 64 * 64);
    for (at, inside) in mask.iter().enumerate() {
        let layers = |of: &Reference| [of.picture[at], of.irradiance[at], of.variance[at], of.direct[at], of.normal[at], Vec3::splat(of.depth[at])];
        assert_eq!(layers(&part), if *inside { layers(&full) } else { [Vec3::ZERO; 6] }, "pixel {at}");
    }
}

#[test]
fn the_stated_variance_is_the_variance() {
    let settings = |seed| Settings { seed, stop: Stop::Samples(256), ..SETTINGS };
    let shots: Vec<Reference> = (0..12).map(|seed| picture(1.0, settings(seed))).collect();
    let n = shots.len() as f64;
    let (mut seen, mut stated) = (0.0, 0.0);
    for i in 0..shots[0].irradiance.len() {
        let values = || shots.iter().map(|shot| shot.irradiance[i].x as f64);
        let mean = values().sum::<f64>() / n;
        seen += values().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0);
        stated += shots.iter().map(|shot| shot.variance[i].x as f64).sum::<f64>() / n;
    }
    // 384 pixels of 11 degrees of freedom: a standard deviation of 2 % for pixels of equal variance, more for unequal.
    assert_close(stated, seen, 0.1);
}

#[test]
fn the_layers_add_up() {
    let found = picture(1.0, SETTINGS);
    let mut room = room(1.0);
    let bvh = Bvh::build(&mut room);
    for i in 0..found.picture.len() {
        let ray = camera(1.0).pixel_ray(SETTINGS.size, [i as u32 % 24, i as u32 / 24]);
        let hit = bvh.closest_hit(&room, camera(1.0).eye, ray, f32::INFINITY).unwrap();
        let material = &room.materials[room.triangles[hit.triangle as usize].material as usize];
        let brdf = material.reflectance / std::f32::consts::PI;
        assert!(found.direct[i].distance(brdf * found.direct_irradiance[i]) < 1e-5);
        assert!(found.indirect[i].distance(brdf * found.irradiance[i]) < 1e-5);
        assert!(found.picture[i].distance(material.emission + found.direct[i] + found.indirect[i]) < 1e-5);
        assert!((found.depth[i] - hit.distance).abs() < 1e-5);
        assert!(found.normal[i].dot(ray) < 0.0);
        assert!(found.irradiance[i].is_finite() && found.irradiance[i].min_element() > 0.0);
    }
}

#[test]
fn a_relative_error_is_reached_and_no_more() {
    let found = picture(1.0, Settings { stop: Stop::RelativeError { error: 0.02, at_most: MAX_SAMPLES }, ..SETTINGS });
    let variance: f32 = found.variance.iter().map(|v| v.y).sum();
    let mean: f32 = found.irradiance.iter().map(|e| e.y).sum();
    let noise = (variance * found.variance.len() as f32).sqrt() / mean;
    assert!((0.01..0.025).contains(&noise), "{noise} after {} samples", found.samples);
}

#[test]
fn stopping_keeps_whole_rounds() {
    let mut room = room(1.0);
    let bvh = Bvh::build(&mut room);
    let settings = Settings { stop: Stop::Samples(40), ..SETTINGS };
    let until = |limit: f32| render(&room, &bvh, &camera(1.0), &settings, &|share| share < limit);
    assert_eq!(until(2.0).unwrap().samples, 40, "four rounds of 10 rays");
    assert_eq!(until(0.66).unwrap().samples, 20);
    assert_eq!(until(0.3), Err(ReferenceError::Stopped));
}

#[test]
fn bad_settings_are_named() {
    let mut plain = room(1.0);
    let bvh = Bvh::build(&mut plain);
    let error = |change: &dyn Fn(&mut Settings, &mut Camera)| {
        let (mut settings, mut camera) = (SETTINGS, camera(1.0));
        change(&mut settings, &mut camera);
        let error = render(&plain, &bvh, &camera, &settings, &|_| true).unwrap_err();
        miette::Diagnostic::code(&error).map(|code| code.to_string()).unwrap_or_default()
    };
    assert_eq!(error(&|s, _| s.size = [0, 5]), "reference::size");
    assert_eq!(error(&|s, _| s.size = [1, 40_000]), "reference::size");
    assert_eq!(error(&|s, _| s.size = [8192, 8192]), "reference::size");
    assert_eq!(error(&|s, _| s.pixels = Pixels::Every(0)), "reference::stride");
    assert_eq!(error(&|s, _| s.pixels = Pixels::Every(17)), "reference::stride");
    assert_eq!(error(&|s, _| s.pixels = Pixels::Windows(1)), "reference::windows");
    assert_eq!(error(&|s, _| (s.size, s.pixels) = ([128, 64], Pixels::Windows(0))), "reference::windows");
    assert_eq!(error(&|s, _| (s.size, s.pixels) = ([128, 64], Pixels::Windows(3))), "reference::windows");
    assert_eq!(error(&|s, _| s.stop = Stop::Samples(1)), "reference::samples");
    assert_eq!(error(&|s, _| s.stop = Stop::RelativeError { error: 0.0, at_most: 4 }), "reference::error");
    assert_eq!(error(&|s, _| s.stop = Stop::RelativeError { error: f32::NAN, at_most: 4 }), "reference::error");
    assert_eq!(error(&|_, c| c.up = c.direction), "reference::camera");
    assert_eq!(error(&|_, c| c.eye.x = f32::NAN), "reference::camera");
}

/// What a lobe reflects of light that is 1 everywhere, toward a viewer at an angle [degrees] across its first axis.
fn albedo(lobe: &Lobe, angle: f64) -> f64 {
    let outgoing = Vec3::new(0.0, angle.to_radians().sin() as f32, angle.to_radians().cos() as f32);
    let points = hemisphere(256, 512);
    points.into_iter().map(|(d, weight)| lobe.value(outgoing, Vec3::from(d.map(|x| x as f32))).x as f64 * d[2] * weight).sum()
}

fn glossy_materials() -> [Glossy; 5] {
    [
        Glossy::Phong { reflectance: Vec3::splat(0.6), exponent: 20.0 },
        Glossy::Ward { reflectance: Vec3::splat(0.6), alpha: Vec2::splat(0.3) },
        Glossy::Ward { reflectance: Vec3::splat(0.6), alpha: Vec2::new(0.15, 0.5) },
        Glossy::metallic_roughness(0.0, 0.6).unwrap(),
        Glossy::metallic_roughness(1.0, 0.4).unwrap(),
    ]
}

/// A pixel of a floor of a material, under a white sky or a lamp, seen at an angle [degrees].
fn floor_seen(material: Material, angle: f32, environment: f32, lights: Vec<Light>, above: Vec<Triangle>, settings: Settings) -> Reference {
    let mut floor = quad(Vec3::new(-5.0, 0.0, -5.0), Vec3::Z * 10.0, Vec3::X * 10.0, 0);
    floor.extend(above);
    let mut scene = Scene { lights, environment: Environment::Constant(Vec3::splat(environment)), ..scene(floor, vec![material, grey(1.0)]) };
    let bvh = Bvh::build(&mut scene);
    let (sine, cosine) = angle.to_radians().sin_cos();
    let toward = Vec3::new(sine, cosine, 0.0);
    let camera = Camera {
        name: "over".into(),
        eye: toward,
        direction: -toward,
        up: Vec3::Z,
        field_of_view: FieldOfView::Horizontal(1e-3),
        size: None,
        sample: Default::default(),
    };
    render(&scene, &bvh, &camera, &Settings { size: [1, 1], pixels: Pixels::Every(1), ..settings }, &|_| true).unwrap()
}

#[test]
fn lobes_under_a_white_sky_reflect_their_albedo() {
    for glossy in glossy_materials() {
        for angle in [0.0f32, 40.0, 70.0] {
            let material = Material { glossy: Some(glossy), ..grey(0.3) };
            let reflection = material.reflection(material.reflectance);
            let lobe = reflection.lobe.unwrap();
            let known = albedo(&lobe, angle as f64) + (reflection.diffuse * lobe.leaves(angle.to_radians().cos())).x as f64;
            // Ward's density is farthest from its value at grazing angles.
            let found = floor_seen(material, angle, 1.0, vec![], vec![], Settings { bounces: Bounces::Count(1), stop: Stop::Samples(1 << 15), ..SETTINGS });
            assert_close(found.direct[0].x as f64, known, 0.02);
            assert!(known <= 1.0 + 1e-3, "{glossy:?} at {angle}: {known}");
        }
    }
}

#[test]
fn lobes_reflect_a_punctual_light_by_their_value() {
    let light = Vec3::new(-0.4, 0.8, 0.2);
    for glossy in glossy_materials() {
        let material = Material { glossy: Some(glossy), ..grey(0.3) };
        let reflection = material.reflection(material.reflectance);
        let lobe = reflection.lobe.unwrap();
        let found =
            floor_seen(material, 30.0, 0.0, vec![point_light(light, 1.0)], vec![], Settings { bounces: Bounces::Count(0), stop: Stop::Samples(4), ..SETTINGS });
        // The floor's texture runs along z, so that this is where the lobe's first axis is.
        let local = |d: Vec3| Vec3::new(d.z, d.x, d.y);
        let outgoing = local(Vec3::new(0.5, 0.75f32.sqrt(), 0.0));
        let diffuse = reflection.diffuse * lobe.leaves(outgoing.z) / PI as f32;
        let known = (diffuse + lobe.value(outgoing, local(light.normalize()))) * light.normalize().y / light.length_squared();
        assert_close(found.direct[0].x as f64, known.x as f64, 1e-3);
    }
}

/// An endless ceiling that reflects all it gets and is lit evenly: the lobe sees nothing but it.
#[test]
fn indirect_light_reaches_the_viewer_by_the_lobe() {
    let ceiling = quad(Vec3::new(-400.0, 4.0, -400.0), Vec3::X * 800.0, Vec3::Z * 800.0, 1);
    let sun = Light { name: "sun".into(), kind: LightKind::Directional { direction: Vec3::Y, irradiance: Vec3::splat(PI as f32) }, shadows: false };
    let glossy = Glossy::Phong { reflectance: Vec3::splat(0.6), exponent: 20.0 };
    let material = Material { glossy: Some(glossy), ..grey(0.3) };
    let lobe = material.reflection(material.reflectance).lobe.unwrap();
    for angle in [0.0f32, 40.0] {
        let found = floor_seen(
            material.clone(),
            angle,
            0.0,
            vec![sun.clone()],
            ceiling.clone(),
            Settings { bounces: Bounces::Count(1), stop: Stop::Samples(4096), ..SETTINGS },
        );
        let layer = found.glossy.as_ref().unwrap();
        assert_close(layer.radiance[0].x as f64, albedo(&lobe, angle as f64), 0.02);
        assert_close(found.indirect[0].x as f64, 0.3 * found.irradiance[0].x as f64 / PI + layer.radiance[0].x as f64, 1e-4);
        assert!(layer.variance[0].x > 0.0);
    }
}

#[test]
fn more_than_all_is_scaled_down() {
    let mut bright = Material { glossy: Some(Glossy::Phong { reflectance: Vec3::splat(0.7), exponent: 5.0 }), ..grey(0.8) };
    assert!(bright.conserve_energy() && !bright.conserve_energy());
    let reflection = bright.reflection(bright.reflectance);
    assert!((reflection.diffuse + reflection.lobe.unwrap().reflectance).max_element() <= 1.0 + 1e-6);
}

#[test]
fn an_empty_view_is_a_picture_of_the_sky() {
    let mut nothing = scene(vec![], vec![]);
    nothing.environment = Environment::Constant(Vec3::new(1.0, 2.0, 3.0));
    let bvh = Bvh::build(&mut nothing);
    for stop in [Stop::Samples(2), Stop::RelativeError { error: 0.1, at_most: MAX_SAMPLES }] {
        let found = render(&nothing, &bvh, &camera(1.0), &Settings { stop, ..SETTINGS }, &|_| true).unwrap();
        assert!(found.picture.iter().all(|&p| p == Vec3::new(1.0, 2.0, 3.0)));
        assert!(found.irradiance.iter().chain(&found.normal).all(|&e| e == Vec3::ZERO));
    }
}

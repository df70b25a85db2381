//! The ways of one pass against each other: sums against double precision, splats pixel by pixel, walks for what they
//! leave uncovered, host against device for the weights of records, and each way against its own repetition.
//!
//! Needs a GPU adapter, a software one will do; without one each case is named as skipped, which
//! `HEMISPLAT_REQUIRE=gpu` makes a failure. The long cases run with `--ignored` or `--include-ignored`.

mod skips;

use glam::{Vec2, Vec3};
use hemisplat::{
    block_on,
    contract::{Arguments as Given, Encoder, ParameterKind, Place, Port, Value, encoder::Reported, encoder::Setting, find, port},
    gpu::{Gpu, Pace, Session, scene as scene_data, shader},
    math::{
        hemisphere::{Method, Shape, Table},
        record_index::{Layout, RecordIndex},
        sum::sum,
        weight::{self, Rule},
    },
    passes::{
        REGISTRY,
        photons::{Photon, SLOTS_BEFORE},
        record::{Radius, Record, Request, Weighting, summed_record},
    },
    scene::{load, model::*, needs::Needs, stage},
    schedule::*,
};
use libtest_mimic::{Arguments, Failed};
use skips::Missing;
use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
    sync::Arc,
    time::Instant,
};

type Outcome = Result<(), Failed>;
type Case = fn(&Stage) -> Outcome;

fn main() {
    let cases: [(&str, bool, Case); 18] = [
        ("host_steps_touch_nothing_undeclared", false, undeclared_is_refused),
        ("sums_agree_with_double_precision", false, sums_agree),
        ("curvatures_agree_with_double_precision", false, curvatures_agree),
        ("half_precision_sums_stay_finite", false, half_sums_are_bounded),
        ("rays_on_the_host_see_what_those_on_the_device_see", false, rays_agree),
        ("tiles_that_cannot_be_halved_are_refused", false, odd_tiles_are_refused),
        ("splats_agree_pixel_by_pixel", false, splats_agree),
        ("records_are_filtered_alike_on_host_and_device", false, filters_agree),
        ("fills_cover_every_pixel_and_repeat", false, fills_cover),
        ("fills_on_host_and_device_agree", false, fills_agree),
        ("neighbours_clamp_on_host_and_device_alike", false, clamping_agrees),
        ("no_record_reaches_beyond_what_those_before_it_saw", false, clamping_bounds),
        ("batches_serve_each_cell_once", false, batches_serve_each_cell_once),
        ("a_sequential_walk_has_no_surplus", false, sequential_walk),
        ("weights_on_the_host_are_those_on_the_device", false, weights_agree),
        ("indices_of_host_and_device_find_what_a_look_at_all_records_finds", false, indices_agree),
        ("as_many_photons_are_kept_on_host_and_device_as_there_is_room_for", false, photons_fit),
        ("as_many_records_as_fit_splat_alike", true, many_records),
    ];
    let stage = Stage::open().map(Arc::new);
    let missing = stage.as_ref().err().map(|reason| Missing::new("gpu", reason));
    let trials = cases.map(|(name, is_long, case)| {
        let stage = stage.clone();
        let run = move || case(&*stage?);
        skips::short_or_long(name, is_long, missing.as_ref(), run)
    });
    libtest_mimic::run(&Arguments::from_args(), trials.into()).exit();
}

/// A device, and a scene of some thousand triangles and two lights.
struct Stage {
    gpu: Arc<Gpu>,
    ready: Arc<stage::Stage>,
    needs: Needs,
}

/// A hall of some thousand triangles.
fn hall() -> Result<Scene, String> {
    let options = load::LoadOptions { overrides: vec![("triangles".into(), "1000".into())], ..Default::default() };
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/hall.ron");
    load::load(&path, &options).map_err(|e| e.to_string())
}

impl Stage {
    fn open() -> Result<Self, String> {
        Self::of(hall()?)
    }

    fn of(scene: Scene) -> Result<Self, String> {
        let gpu = block_on(Gpu::open()).map_err(|e| e.to_string())?;
        let needs = Needs::of(&scene);
        Ok(Self { gpu, ready: Arc::new(stage::Stage::new(scene)), needs })
    }

    /// The same with holes in a third of the hall's coloured surfaces, and another third that shines and is seen from one side only.
    fn with_holes() -> Result<Self, String> {
        let mut scene = hall()?;
        let texels = (0..64u32).map(|texel| if (texel % 8 + texel / 8) % 2 == 0 { [200, 130, 60, 255] } else { [255, 255, 255, 0] }).collect();
        scene.textures.push(Texture { name: "holes".into(), width: 8, height: 8, texels, ..Default::default() }.with_levels(Some(0.5)));
        let first = scene.materials.len() as u32;
        let plain = scene.materials[0].clone();
        scene.materials.push(Material { texture: Some(scene.textures.len() as u32 - 1), alpha_cutoff: Some(0.5), ..plain.clone() });
        scene.materials.push(Material { two_sided: false, emission: Vec3::new(0.5, 0.2, 0.0), ..plain });
        for (number, triangle) in scene.triangles.iter_mut().enumerate() {
            triangle.uvs = [Vec2::ZERO, Vec2::X, Vec2::Y];
            triangle.material = if number % 3 == 0 { triangle.material } else { first + number as u32 % 2 };
        }
        Self::of(scene)
    }

    /// The same with maps of all kinds on half of the hall's surfaces, which are glossy and shine, and with tints on a third.
    fn with_maps() -> Result<Self, String> {
        let mut scene = hall()?;
        let first = scene.textures.len() as u32;
        let mut numbers = Numbers(3);
        for (size, is_linear, wrap) in
            [([8, 4], false, [Wrap::Repeat, Wrap::Mirror]), ([5, 7], true, [Wrap::Clamp, Wrap::Repeat]), ([4, 4], false, [Wrap::Mirror, Wrap::Clamp])]
        {
            let texels = (0..size[0] * size[1]).map(|_| [0; 4].map(|_: u8| numbers.between(90.0, 255.0) as u8)).collect();
            let reading = Reading { is_linear, wrap, ..Default::default() };
            scene.textures.push(Texture { width: size[0], height: size[1], texels, reading, ..Default::default() }.with_levels(None));
        }
        let mapped = scene.materials.len() as u32;
        scene.materials.push(Material {
            texture: Some(first),
            maps: Maps {
                facets: Some(first + 1),
                normal: Some(first + 1),
                normal_scale: 0.6,
                emission: Some(first + 2),
                charts: Charts { facets: 0, normal: 1, emission: 2 },
            },
            emission: Vec3::new(0.5, 0.2, 0.4),
            glossy: Glossy::metallic_roughness(0.7, 0.9),
            ..scene.materials[0].clone()
        });
        for (number, triangle) in scene.triangles.iter_mut().enumerate() {
            triangle.uvs = [Vec2::new(-0.4, 0.3), Vec2::new(2.7, 0.1), Vec2::new(0.2, -3.1)];
            triangle.material = if number % 2 == 0 { triangle.material } else { mapped };
            if number % 3 == 0 {
                triangle.tints = [Vec3::X, Vec3::Y, Vec3::new(0.2, 0.4, 0.9)].map(Tint::new);
            }
        }
        let mut chart = || scene.triangles.iter().map(|_| [(); 3].map(|()| Vec2::new(numbers.between(-2.0, 2.0), numbers.between(-2.0, 2.0)))).collect();
        scene.charts = vec![chart(), chart()];
        let tangent = |(number, triangle): (usize, &Triangle)| if number % 5 == 0 { [Vec3::ZERO; 3] } else { triangle.positions };
        scene.tangents = scene.triangles.iter().enumerate().map(tangent).collect();
        Self::of(scene)
    }

    /// The ways of splatting that the adapter has.
    fn splats(&self) -> Vec<&'static str> {
        let blends = self.gpu.features.contains(wgpu::Features::FLOAT32_BLENDABLE);
        let blends = blends || !skips::skipped("splats by RasterBlend", Some(&Missing::new("adapter", "the adapter cannot blend 32-bit floats")));
        ["RasterBlend", "ComputeTiles", "Host"].into_iter().filter(|way| blends || *way != "RasterBlend").collect()
    }
}

/// Nodes wired by hand.
struct Graph<'a> {
    stage: &'a Stage,
    size: [u32; 2],
    schedule: Arc<Schedule>,
    ports: BTreeMap<String, Port>,
    reports: Vec<(&'static str, Reported)>,
    /// Records a round and whether the loop is sequential, while one is open.
    batch: Option<(u32, bool)>,
    looped: Vec<Step>,
}

impl<'a> Graph<'a> {
    fn new(stage: &'a Stage, size: [u32; 2]) -> Self {
        let mut schedule = Schedule::default();
        let mut declare = |name: &str, kind, lifetime| schedule.resources.push(ResourceDescription { name: name.into(), kind, lifetime });
        for data in SceneData::ALL {
            declare(data.name(), scene_data::kind(&stage.ready.scene, data), Lifetime::Scene(ScenePart::Main, data));
        }
        declare("camera", ResourceKind::Buffer { bytes: 256 }, Lifetime::Frame);
        Self { stage, size, schedule: Arc::new(schedule), ports: BTreeMap::new(), reports: Vec::new(), batch: None, looped: Vec::new() }
    }

    /// A buffer with these contents.
    fn buffer(&mut self, name: &str, contents: &[u8]) -> Resource {
        let kind = ResourceKind::Buffer { bytes: contents.len() as u64 };
        self.schedule().resources.push(ResourceDescription { name: name.into(), kind, lifetime: Lifetime::Constant(contents.into()) });
        Resource(self.schedule.resources.len() as u32 - 1)
    }

    /// A variable that the test sets.
    fn variable(&mut self, name: &str) -> Variable {
        self.schedule().variables.push(VariableDescription { name: name.into(), history: true });
        Variable(self.schedule.variables.len() as u32 - 1)
    }

    /// A node whose inputs are joined to ports by name: `("gbuffer", "gbuffer")`.
    fn node(&mut self, name: &str, pass: &str, values: &[(&str, &str)], inputs: &[(&str, &str)]) -> Result<(), Failed> {
        let pass = find(REGISTRY, pass).ok_or("no such pass")?;
        let description = pass.description();
        let given = arguments(description.parameters, values);
        let join = |input: &str| inputs.iter().find(|i| i.0 == input).and_then(|i| self.ports.get(i.1)).cloned();
        let joined: BTreeMap<_, _> = description.inputs.iter().filter_map(|i| Some((i.name, vec![join(i.name)?]))).collect();
        let setting = Setting { scene: &self.stage.ready.scene, needs: &self.stage.needs, device: Device::ABLE, size: self.size, tables: None };
        let mut encoder = Encoder::new(name, &given, setting, &joined, Arc::get_mut(&mut self.schedule).expect("no session runs it"));
        if let Some((batch, sequential)) = self.batch {
            encoder = encoder.in_loop(batch, sequential);
        }
        pass.encode(&mut encoder).map_err(|refusal| refusal.message)?;
        let encoded = encoder.finish();
        self.reports.extend(encoded.reports);
        for (output, port) in encoded.outputs {
            if output == description.outputs[0].name {
                self.ports.insert(name.into(), port.clone());
            }
            self.ports.insert(format!("{name}.{output}"), port);
        }
        let step = |mut commands: Vec<Command>| {
            // The host decides on each round here; tests/ahead.rs has loops that the device drives.
            commands.iter_mut().for_each(Command::drop_twin);
            Step::Node(Node { name: name.into(), pass: description.name, commands, keys: Keys::default() })
        };
        self.schedule().steps.push(step(encoded.prologue));
        if self.batch.is_some() {
            self.looped.push(step(encoded.commands))
        } else {
            self.schedule().steps.push(step(encoded.commands))
        }
        Ok(())
    }

    /// Ends the loop that was open.
    fn end_loop(&mut self, until: &str) -> Result<(), Failed> {
        let Some(Port::Flag(until)) = self.ports.get(until) else { return Err("no such flag".into()) };
        let until = *until;
        let round = self.variable("round");
        let steps = std::mem::take(&mut self.looped);
        self.schedule().steps.push(Step::Repeat(Repeat {
            name: "fill".into(),
            until: Some(until),
            round,
            at_most: 100_000,
            steps,
            time: TimeShare { at_least: 0, records: None, caches: 1 },
            driver: Driver::Host,
        }));
        self.batch = None;
        Ok(())
    }

    fn texture(&self, port: &str) -> Result<Resource, Failed> {
        match self.ports.get(port) {
            Some(Port::Image(image)) => Ok(image.texture),
            Some(Port::Splats(splats)) => Ok(splats.sums),
            _ => Err(format!("{port} is no image").into()),
        }
    }

    fn schedule(&mut self) -> &mut Schedule {
        Arc::get_mut(&mut self.schedule).expect("no session runs it")
    }

    fn session(&self, kept: &[Resource]) -> Result<Session, Failed> {
        let reported = self.reports.iter().filter_map(|r| if let Reported::Buffer(buffer, _) = r.1 { Some(buffer) } else { None });
        let kept: Vec<_> = kept.iter().copied().chain(reported).collect();
        let Stage { gpu, ready, .. } = self.stage;
        let placement = Placement::of(&self.schedule, &Lifetimes::of(&self.schedule, &kept));
        Ok(block_on(Session::new(gpu, ready, &self.schedule, &placement, &ready.scene.cameras[0], self.size)).map_err(|e| e.to_string())?)
    }

    /// The number that a node reports.
    fn report(&self, session: &Session, name: &str) -> Result<u32, Failed> {
        match self.reports.iter().find(|r| r.0 == name).ok_or("no such report")?.1 {
            Reported::Variable(variable) => Ok(session.variable(variable)),
            Reported::Buffer(buffer, index) => Ok(read::<u32>(session, buffer)?[index as usize]),
        }
    }
}

/// A host step that reads or writes what it has not said ends the frame, by name.
fn undeclared_is_refused(stage: &Stage) -> Outcome {
    type Step = fn(&mut dyn HostContext, Resource);
    let steps: [(&str, Step); 3] = [
        ("read", |host, resource| _ = host.read(resource)),
        ("write", |host, resource| host.write(resource, 0, &[1; 16])),
        ("take", |host, resource| {
            let contents = host.take(resource);
            host.put(resource, contents, 16);
        }),
    ];
    for (name, step) in steps {
        for is_declared in [false, true] {
            let mut graph = Graph::new(stage, [8, 8]);
            let buffer = graph.buffer("someone.numbers", &[0; 16]);
            let (reads, writes) = if is_declared { (vec![Read::whole(buffer)], vec![buffer]) } else { Default::default() };
            let run = move |host: &mut dyn HostContext| {
                step(host, buffer);
                Ok(())
            };
            let commands = vec![Command::Host(Host::new(name, reads, writes, run))];
            graph.schedule().steps.push(hemisplat::schedule::Step::Node(Node { name: "node".into(), pass: "Test", commands, keys: Default::default() }));
            let told = block_on(graph.session(&[])?.frame(&|| Pace::GoOn)).err().map(|error| error.to_string());
            let expected = (!is_declared).then(|| format!("node: `{name}` touches someone.numbers, which it does not declare"));
            check(told == expected, || format!("{told:?}, not {expected:?}"))?;
        }
    }
    Ok(())
}

/// The parameter that a way is a value of.
fn way(name: &str) -> (&str, &str) {
    (if ["Host", "Device"].contains(&name) { "place" } else { "by" }, name)
}

/// Values by name, all others their defaults; `MipmapChain:F16` chooses the first parameter of a choice too.
fn arguments(parameters: &'static [hemisplat::contract::Parameter], values: &[(&str, &str)]) -> Given {
    let mut given = Given::defaults(parameters);
    for parameter in parameters {
        let Some((_, text)) = values.iter().find(|v| v.0 == parameter.name) else { continue };
        given.set(
            parameter.name,
            match parameter.kind {
                ParameterKind::Bool { .. } => Value::Bool(*text == "true"),
                ParameterKind::Integer { .. } => Value::Integer(text.parse().expect("an integer")),
                ParameterKind::Float { .. } => Value::Float(text.parse().expect("a number")),
                ParameterKind::Choice { choices } => {
                    let (name, inner) = text.split_once(':').unwrap_or((text, ""));
                    let choice = choices.iter().find(|c| c.name == name).expect("a way");
                    let inner: Vec<_> = choice.parameters.first().filter(|_| !inner.is_empty()).map(|p| (p.name, inner)).into_iter().collect();
                    Value::Choice(choice.name, arguments(choice.parameters, &inner))
                }
            },
        );
    }
    given
}

fn read<T: bytemuck::Pod>(session: &Session, resource: Resource) -> Result<Vec<T>, Failed> {
    Ok(bytemuck::pod_collect_to_vec(&block_on(session.read(resource)).map_err(|e| e.to_string())?))
}

fn check(holds: bool, what: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(what().into()) }
}

/// Numbers that are the same on every machine.
struct Numbers(u64);

impl Numbers {
    /// In 0..1.
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }

    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.next()
    }

    fn exponent(&mut self, low: f32, high: f32) -> f32 {
        10f32.powf(self.between(low, high))
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), self.between(-1.0, 1.0))
    }
}

// Sums

const TILES: usize = 4;

/// The shapes with a resolution that can be halved to the end, and one that leaves three texels a side.
const SHAPES: [(Shape, u32); 6] = [
    (Shape::Concentric, 16),
    (Shape::Cosine, 16),
    (Shape::Plane { fov_degrees: 126.87 }, 64),
    (Shape::Hemicube, 16),
    (Shape::Hemispherical, 32),
    (Shape::Cosine, 24),
];

const SUMS: [&str; 5] = ["WorkgroupTree", "MipmapChain:F32", "PingPong:F32", "CpuReadback", "Host"];

/// Samples of a mild tile, of one with radiance from 1e-6 to 1e6, of one that touches a wall, and of a bit of ceiling under the sky.
fn tiles(table: &Table, extent: f32) -> [Vec<[f32; 4]>; TILES] {
    let mut numbers = Numbers(7);
    let mut tile = |radiance: fn(&mut Numbers) -> f32, distance: &dyn Fn(&mut Numbers) -> f32| {
        table.samples.iter().map(|_| [radiance(&mut numbers), radiance(&mut numbers), radiance(&mut numbers), distance(&mut numbers)]).collect::<Vec<_>>()
    };
    [
        tile(|n| n.between(0.5, 2.0), &|n| n.between(0.1, 1.0) * extent),
        tile(|n| n.exponent(-6.0, 6.0), &|n| n.between(0.1, 1.0) * extent),
        tile(|n| n.next(), &|n| if n.next() < 0.1 { 0.0 } else { n.exponent(-4.0, 0.0) * extent }),
        tile(|n| n.next(), &|n| if n.next() < 0.9 { 1e30 } else { 0.3 * extent }),
    ]
}

fn requests() -> [Request; TILES] {
    let mut numbers = Numbers(3);
    let mut request = |turn, stretch| Request { stretch, ..Request::new(numbers.vector(), 0.01, numbers.vector().normalize(), turn) };
    [request(0.0, 0.0), request(1.0, 0.5), request(2.5, 0.0), request(6.0, 0.0)]
}

/// The records of the tiles, summed one way, after two frames that must give the same bits.
fn summed(stage: &Stage, table: &Arc<Table>, shape: (Shape, u32), by: &str, radius: Radius) -> Result<Vec<Record>, Failed> {
    // More tiles than are asked for, in an atlas of two columns.
    let (capacity, size) = (TILES + 3, table.samples.len());
    let mut samples: Vec<[f32; 4]> = tiles(table, stage.ready.scene.extent()).concat();
    samples.resize(capacity * size, [f32::NAN; 4]);
    let mut places = requests().to_vec();
    places.resize(capacity, bytemuck::Zeroable::zeroed());
    let mut graph = Graph::new(stage, [16, 16]);
    let requests = port::Requests {
        places: graph.buffer("places", bytemuck::cast_slice(&places)),
        count: graph.variable("count"),
        capacity: capacity as u32,
        made: graph.variable("made"),
        at_most: u32::MAX,
        slots: None,
    };
    let tiles = port::Tiles {
        samples: graph.buffer("samples", bytemuck::cast_slice(&samples)),
        sureness: None,
        place: Place::Device,
        is_steady: false,
        sees_emission: true,
        requests,
        shape: shape.0,
        resolution: shape.1,
        tiles_per_row: 2,
        table: table.clone(),
    };
    graph.ports.insert("tiles".into(), Port::WeightedTiles(port::WeightedTiles { tiles, table: table.clone() }));
    graph.node("records", "IrradianceSum", &[way(by), ("radius", &format!("{radius:?}"))], &[("of", "tiles")])?;
    let Some(Port::Records(port::Records { records, .. })) = graph.ports.get("records") else { return Err("no records".into()) };
    let mut session = graph.session(&[*records])?;
    session.set_variable(requests.count, TILES as u32);
    let mut frames = Vec::new();
    for _ in 0..2 {
        block_on(session.frame(&|| Pace::GoOn)).map_err(|e| e.to_string())?;
        frames.push(read::<Record>(&session, *records)?[..TILES].to_vec());
    }
    check(bytemuck::cast_slice::<_, u8>(&frames[0]) == bytemuck::cast_slice::<_, u8>(&frames[1]), || format!("{by} does not repeat"))?;
    Ok(frames.swap_remove(0))
}

/// What the sums should be, and the sums of the moduli of what is added up in the two gradients: the scale of their rounding.
fn expected(table: &Table, extent: f32, radius: Radius) -> Result<Vec<(Record, [f32; 2])>, Failed> {
    let mut all = Vec::new();
    for (request, tile) in requests().iter().zip(tiles(table, extent)) {
        let nearest = f64::from(surface_offset(extent, Vec3::from(request.position)));
        let summed = sum(table, &tile, nearest).map_err(|e| e.to_string())?;
        let rotation: f64 = table.samples.iter().zip(&tile).map(|(s, t)| s.rotation[0].hypot(s.rotation[1]) * f64::from(t[0].max(t[1]).max(t[2]))).sum();
        let inverse = |i: u32| 1.0 / (f64::from(tile[i as usize][3]).max(nearest) * table.samples[i as usize].depth_cosine);
        let most = |i: u32| f64::from(tile[i as usize][..3].iter().fold(0.0f32, |a, b| a.max(*b)));
        let length = |g: [f64; 3]| g.iter().map(|x| x * x).sum::<f64>().sqrt();
        let translation: f64 = table.edges.iter().map(|e| length(e.gradient) * (most(e.a) + most(e.b)) * inverse(e.a).max(inverse(e.b))).sum();
        all.push((summed_record(request, &summed, true, radius), [rotation as f32, translation as f32]));
    }
    Ok(all)
}

/// The largest error of a record's parts, each in proportion to what was added up.
fn error(found: &Record, expected: &Record, scales: [f32; 2]) -> f32 {
    let relative = |a: f32, b: f32| (a - b).abs() / b.abs();
    let gradients =
        |a: &[[f32; 4]; 3], b: &[[f32; 4]; 3], scale: f32| a.iter().zip(b).flat_map(|(a, b)| (0..3).map(|i| (a[i] - b[i]).abs() / scale)).fold(0.0, f32::max);
    // The gradient's share of the luminance, as the gradient is.
    let luminance = Vec3::from(expected.irradiance).dot(Vec3::new(0.2126, 0.7152, 0.0722));
    let share = (found.translation[0][3] - expected.translation[0][3]).abs() * luminance / scales[1];
    let irradiance = found.irradiance.iter().zip(expected.irradiance).map(|(a, b)| relative(*a, b)).fold(0.0, f32::max);
    let distances = relative(found.radius, expected.radius).max(relative(found.minimum_distance, expected.minimum_distance));
    let uncertainty = found.error.iter().zip(expected.error).map(|(a, b)| relative(*a, b)).fold(0.0, f32::max);
    let all = [
        irradiance,
        uncertainty,
        share,
        distances,
        gradients(&found.rotation, &expected.rotation, scales[0]),
        gradients(&found.translation, &expected.translation, scales[1]),
    ];
    // NaN counts as the largest error.
    all.into_iter().fold(0.0, |worst, e| if e.is_nan() || e > worst { if e.is_nan() { f32::INFINITY } else { e } } else { worst })
}

fn table(shape: (Shape, u32)) -> Result<Arc<Table>, Failed> {
    Ok(Arc::new(Table::new(shape.0, shape.1, Method::BorderExtension).map_err(|e| e.to_string())?))
}

fn sums_agree(stage: &Stage) -> Outcome {
    for shape in SHAPES {
        let table = table(shape)?;
        let expected = expected(&table, stage.ready.scene.extent(), Radius::HarmonicMean)?;
        for by in SUMS {
            let found = summed(stage, &table, shape, by, Radius::HarmonicMean)?;
            let errors: Vec<f32> = found.iter().zip(&expected).map(|(f, (e, scales))| error(f, e, *scales)).collect();
            println!("{by} over {shape:?}: {errors:?}");
            check(errors.iter().all(|e| *e < 1e-5), || format!("{by} over {shape:?}: errors {errors:?}"))?;
        }
    }
    Ok(())
}

/// The ellipses of the second derivatives, which are what is left of large numbers of both signs.
fn curvatures_agree(stage: &Stage) -> Outcome {
    for shape in SHAPES {
        let table = table(shape)?;
        let expected = expected(&table, stage.ready.scene.extent(), Radius::Curvature)?;
        for by in SUMS {
            let found = summed(stage, &table, shape, by, Radius::Curvature)?;
            for (found, (expected, _)) in found.iter().zip(&expected) {
                let [a, b] = [found, expected].map(|r| Vec3::from(r.rotation.map(|g| g[3])));
                // An axis has no sign.
                let axes = (a - b).length().min((a + b).length());
                let radii = (found.radius - expected.radius).abs() / expected.radius;
                check(b.length() < 0.87 && radii < 2e-3 && axes < 2e-2, || {
                    format!("{by} over {shape:?}: radius {} and stretch {a}, not {} and {b}", found.radius, expected.radius)
                })?;
            }
        }
    }
    Ok(())
}

/// Half floats: 0.4 % on the mild tile; elsewhere bright contributions are cut, never added or infinite.
fn half_sums_are_bounded(stage: &Stage) -> Outcome {
    for shape in SHAPES {
        let table = table(shape)?;
        let expected = expected(&table, stage.ready.scene.extent(), Radius::HarmonicMean)?;
        for by in ["MipmapChain:F16", "PingPong:F16"] {
            let found = summed(stage, &table, shape, by, Radius::HarmonicMean)?;
            let mild = error(&found[0], &expected[0].0, expected[0].1);
            println!("{by} over {shape:?}: {mild:.1e}");
            check(mild < 4e-3, || format!("{by} over {shape:?}: error {mild:e}"))?;
            for (found, (expected, _)) in found.iter().zip(&expected) {
                let finite = bytemuck::cast_slice::<Record, f32>(std::slice::from_ref(found)).iter().all(|x| x.is_finite());
                let bounded = found.irradiance.iter().zip(expected.irradiance).all(|(f, e)| *f >= 0.0 && *f <= e * 1.004);
                check(finite && bounded, || format!("{by} over {shape:?}: {found:?}, not {expected:?}"))?;
            }
        }
    }
    Ok(())
}

/// What tiles above some triangles see, sample by sample, as the way says: radiance and distance.
fn seen(stage: &Stage, shape: &str, by: &str) -> Result<Vec<[f32; 4]>, Failed> {
    let above = |triangle: &Triangle| Request::new(triangle.positions.iter().sum::<Vec3>() / 3.0, 0.01, triangle.face_normal(), 0.7);
    let places: Vec<Request> = stage.ready.scene.triangles.iter().step_by(40).map(above).collect();
    let mut graph = Graph::new(stage, [16, 16]);
    let requests = port::Requests {
        places: graph.buffer("places", bytemuck::cast_slice(&places)),
        count: graph.variable("count"),
        capacity: places.len() as u32,
        made: graph.variable("made"),
        at_most: u32::MAX,
        slots: None,
    };
    graph.ports.insert("misses".into(), Port::Requests(requests));
    graph.node("shadow", "ShadowMap", &[("resolution", "512")], &[])?;
    graph.node("tiles", "HemisphereTiles", &[("shape", shape), way(by), ("resolution", "20")], &[("at", "misses"), ("shadow", "shadow")])?;
    let Some(Port::Tiles(tiles)) = graph.ports.get("tiles").cloned() else { return Err("no tiles".into()) };
    let mut session = graph.session(&[tiles.samples])?;
    session.set_variable(requests.count, places.len() as u32);
    block_on(session.frame(&|| Pace::GoOn)).map_err(|e| e.to_string())?;
    read(&session, tiles.samples)
}

fn rays_agree(stage: &Stage) -> Outcome {
    let [holed, mapped] = [Stage::with_holes()?, Stage::with_maps()?];
    // One of how many samples may have other light. Of the stage with holes every third triangle is a lamp, in the surfaces that it lights: rounding moves the points of
    // lamps as near as that, and which of them is chosen, but not what all of them give.
    for (stage, shape, one_of) in [
        (stage, "Hemispherical", 200),
        (stage, "Hemicube", 200),
        (stage, "Concentric", 200),
        (&holed, "Hemispherical", 5),
        (&holed, "Cosine", 5),
        (&mapped, "Concentric", 5),
    ] {
        let [device, host] = [seen(stage, shape, "Device")?, seen(stage, shape, "Host")?];
        let same = || device.iter().zip(&host).filter(|(a, b)| (a[3] - b[3]).abs() <= 1e-4 * a[3].max(b[3]));
        let apart = device.len() - same().count();
        println!("{shape}: {apart} of {} samples differ", device.len());
        // What is seen in the same place has the same light, but for places on the border of a shadow.
        let brightest = device.iter().flat_map(|a| a[..3].to_vec()).fold(0.0, f32::max);
        let lit_apart = same().filter(|(a, b)| (0..3).any(|c| (a[c] - b[c]).abs() > 2e-3 * a[c].max(b[c]) + 1e-5 * brightest)).count();
        println!("{shape}: {lit_apart} of {} have other light, of {brightest} at most", same().count());
        check(brightest > 0.0 && lit_apart * one_of < same().count(), || format!("{shape}: {lit_apart} of {} samples have other light", same().count()))?;
        let [by_device, by_host] = same().fold([0.0f64; 2], |[device, host], (a, b)| [device + f64::from(a[0]), host + f64::from(b[0])]);
        check((by_device / by_host - 1.0).abs() < 0.03, || format!("{shape}: the host has {by_host} of light, the device {by_device}"))?;
        // Rays that pass by an edge, or where two surfaces touch.
        check(device.len() > 5000 && apart * 500 < device.len(), || format!("{shape}: {apart} of {} samples see something else", device.len()))?;
    }
    Ok(())
}

fn odd_tiles_are_refused(stage: &Stage) -> Outcome {
    let shape = (Shape::Cosine, 22);
    let table = table(shape)?;
    let refused = summed(stage, &table, shape, "MipmapChain:F32", Radius::HarmonicMean).err().and_then(|e| e.message().map(String::from)).unwrap_or_default();
    check(refused.contains("22×22"), || format!("a mipmap chain of 22×22 samples was not refused: {refused}"))?;
    for shape in [(Shape::Cosine, 22), (Shape::Cosine, 21), (Shape::Concentric, 7), (Shape::Hemispherical, 5), (Shape::Plane { fov_degrees: 90.0 }, 33)] {
        let table = self::table(shape)?;
        let expected = expected(&table, stage.ready.scene.extent(), Radius::HarmonicMean)?;
        for by in ["PingPong:F32", "WorkgroupTree", "CpuReadback"] {
            let found = summed(stage, &table, shape, by, Radius::HarmonicMean)?;
            let errors: Vec<f32> = found.iter().zip(&expected).map(|(f, (e, scales))| error(f, e, *scales)).collect();
            check(errors.iter().all(|e| *e < 1e-5), || format!("{by} over {shape:?}: errors {errors:?}"))?;
        }
    }
    Ok(())
}

// Splats

/// Records on the scene's surfaces, on the side that the camera sees.
fn records(scene: &Scene, size: [u32; 2], count: usize) -> Vec<Record> {
    let mut numbers = Numbers(11);
    let camera = &scene.cameras[0];
    let pixel = 2.0 * camera.half_extent(size).x / size[0] as f32;
    (0..count)
        .map(|_| {
            let triangle = &scene.triangles[(numbers.next() * scene.triangles.len() as f32) as usize % scene.triangles.len()];
            let [a, b, c] = triangle.positions;
            let (u, v) = (numbers.next().sqrt(), numbers.next());
            let position = a * (1.0 - u) + b * (u * (1.0 - v)) + c * (u * v);
            let normal = (b - a).cross(c - a).normalize();
            let normal = if normal.dot(camera.eye - position) < 0.0 { -normal } else { normal };
            // The fourth numbers are the stretch, the relative gradient and the fineness.
            let gradients =
                |scale: f32, fourth: f32, numbers: &mut Numbers| std::array::from_fn(|_| (numbers.vector() * scale).extend(numbers.next() * fourth).to_array());
            Record {
                position: position.into(),
                radius: numbers.exponent(-1.0, 1.0),
                normal: normal.into(),
                minimum_distance: numbers.exponent(-1.0, 0.5),
                irradiance: [numbers.next(), numbers.next(), numbers.next()],
                footprint: (position - camera.eye).dot(camera.direction).abs().max(1e-3) * pixel,
                rotation: gradients(1.0, 0.3, &mut numbers),
                translation: gradients(0.3, 1.0, &mut numbers),
                error: [numbers.next(), numbers.next(), numbers.next()],
                padding: 0,
            }
        })
        .collect()
}

fn rule(weighting: weight::Weighting, most_pixels: f32) -> Rule {
    Rule { weighting, accuracy: 0.3, spacing: [1.5, most_pixels], nearest: 2.0, change: 1.5, overlap: 0.0, contrast: 0.005, finest_spacing: 0.4 }
}

/// One texel a pixel: sums, and the number of records in the first channel; the seconds that the second frame took.
struct Splatted {
    sums: Vec<[f32; 4]>,
    counts: Vec<[f32; 4]>,
    seconds: f64,
}

/// The records splatted one way, in so many frames that must give the same bits.
fn splatted(stage: &Stage, records: &[Record], rule: Rule, size: [u32; 2], (by, of): (&str, &str), repeats: usize) -> Result<Splatted, Failed> {
    let mut graph = Graph::new(stage, size);
    graph.node("gbuffer", "GBuffer", &[], &[])?;
    let uniform = Weighting::from(&rule);
    let cache = port::RecordCache {
        lasts: true,
        records: graph.buffer("records", bytemuck::cast_slice(records)),
        coefficients: None,
        count: graph.variable("count"),
        capacity: records.len() as u32,
        weighting: graph.buffer("weighting", bytemuck::bytes_of(&uniform)),
        rule,
        lives: None,
    };
    graph.ports.insert("cache".into(), Port::RecordCache(cache));
    graph.node("splats", "Splat", &[way(by), ("of", of), ("count", "true")], &[("records", "cache"), ("gbuffer", "gbuffer")])?;
    let Some(Port::Splats(port::Splats { sums, counts: Some(counts), .. })) = graph.ports.get("splats").cloned() else { return Err("no sums".into()) };
    let mut session = graph.session(&[sums, counts])?;
    session.set_variable(cache.count, records.len() as u32);
    let mut frames = Vec::new();
    let mut seconds = 0.0;
    for _ in 0..repeats {
        let start = Instant::now();
        block_on(session.frame(&|| Pace::GoOn)).map_err(|e| e.to_string())?;
        seconds = start.elapsed().as_secs_f64();
        frames.push((block_on(session.read(sums)).map_err(|e| e.to_string())?, read(&session, counts)?));
    }
    check(frames.iter().all(|frame| *frame == frames[0]), || format!("{by} does not repeat"))?;
    let (sums, counts) = frames.swap_remove(0);
    Ok(Splatted { sums: bytemuck::pod_collect_to_vec(&sums), counts, seconds })
}

/// Compares two ways: everywhere to `tolerance` of the pixel's value and of the largest weight there can be, but for
/// pixels at the rim of a record, where rounding decides whether it counts: at most one in ten thousand.
fn compare_splats(a: &Splatted, b: &Splatted, tolerance: f32) -> Outcome {
    let pixels = a.counts.len();
    let covered = a.counts.iter().filter(|c| c[0] > 0.0).count();
    check(covered * 4 > pixels, || format!("only {covered} pixels are covered"))?;
    let same = |pixel: usize| a.counts[pixel][0] == b.counts[pixel][0];
    let rim = (0..pixels).filter(|pixel| !same(*pixel)).count();
    check(rim * 10_000 <= pixels, || format!("the number of records differs at {rim} pixels"))?;
    for pixel in (0..pixels).filter(|pixel| same(*pixel)) {
        let (x, y) = (a.sums[pixel], b.sums[pixel]);
        let apart = x.iter().zip(y).map(|(x, y)| (x - y).abs()).fold(0.0, f32::max);
        check(apart <= tolerance * (1.0 + y[3]), || format!("pixel {pixel}: {x:?} and {y:?}"))?;
    }
    Ok(())
}

const WEIGHTINGS: [weight::Weighting; 3] = [weight::Weighting::Ward, weight::Weighting::TabellionLamorlette, weight::Weighting::Compact];

fn splats_agree(stage: &Stage) -> Outcome {
    // No multiple of a tile of 16 pixels.
    let size = [100, 75];
    let records = records(&stage.ready.scene, size, 3000);
    for weighting in WEIGHTINGS {
        for of in ["Estimate", "StandardError"] {
            let host = splatted(stage, &records, rule(weighting, 40.0), size, ("Host", of), 2)?;
            for by in stage.splats() {
                let found = splatted(stage, &records, rule(weighting, 40.0), size, (by, of), 2)?;
                compare_splats(&found, &host, 1e-5).map_err(|e| format!("{of}, {weighting:?} by {by}: {}", e.message().unwrap_or_default()))?;
            }
        }
    }
    Ok(())
}

/// Records that reach some others, with errors that explain some of what they differ by.
fn filters_agree(stage: &Stage) -> Outcome {
    let size = [100, 75];
    let records = records(&stage.ready.scene, size, 3000);
    let found = ["Host", "Device"].map(|place| filtered(stage, &records, size, place));
    let [host, device] = found.into_iter().collect::<Result<Vec<_>, _>>()?.try_into().expect("two");
    let mut changed = 0;
    for (number, ((host, device), before)) in host.iter().zip(&device).zip(&records).enumerate() {
        let numbers = |record: &Record| -> Vec<f32> {
            let gradients = record.rotation.iter().chain(&record.translation).flatten();
            record.irradiance.iter().chain(&record.error).chain(gradients).chain([&record.radius]).copied().collect()
        };
        let apart = numbers(host).iter().zip(numbers(device)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        check(apart < 1e-3, || format!("record {number} is {host:?} on the host and {device:?} on the device"))?;
        changed += usize::from((Vec3::from(host.irradiance) - Vec3::from(before.irradiance)).length() > 0.01);
    }
    check(changed > 500, || format!("{changed} records are changed"))
}

fn filtered(stage: &Stage, records: &[Record], size: [u32; 2], place: &str) -> Result<Vec<Record>, Failed> {
    let mut graph = Graph::new(stage, size);
    let rule = rule(weight::Weighting::Compact, 40.0);
    let cache = port::RecordCache {
        lasts: true,
        records: graph.buffer("records", bytemuck::cast_slice(records)),
        coefficients: None,
        count: graph.variable("count"),
        capacity: records.len() as u32,
        weighting: graph.buffer("weighting", bytemuck::bytes_of(&Weighting::from(&rule))),
        rule,
        lives: None,
    };
    graph.ports.insert("cache".into(), Port::RecordCache(cache));
    graph.node("filtered", "FilterRecords", &[way(place)], &[("records", "cache")])?;
    let Some(Port::RecordCache(port::RecordCache { records: filtered, .. })) = graph.ports.get("filtered").cloned() else { return Err("no cache".into()) };
    let mut session = graph.session(&[filtered])?;
    session.set_variable(cache.count, records.len() as u32);
    block_on(session.frame(&|| Pace::GoOn)).map_err(|e| e.to_string())?;
    Ok(read::<Record>(&session, filtered)?[..records.len()].to_vec())
}

/// As many records as the largest cache holds: 800,000, 128 MB; the tiles' masks take 32 MiB at most.
fn many_records(stage: &Stage) -> Outcome {
    let size = [512, 384];
    let records = records(&stage.ready.scene, size, 800_000);
    let found = stage.splats().into_iter().map(|by| {
        let found = splatted(stage, &records, rule(weight::Weighting::Compact, 3.0), size, (by, "Estimate"), 1)?;
        println!("{by}: {:.2} s", found.seconds);
        Ok(found)
    });
    let found = found.collect::<Result<Vec<_>, Failed>>()?;
    found.windows(2).try_for_each(|pair| compare_splats(&pair[0], &pair[1], 1e-5))
}

// Walks

/// What nodes report, by name.
type Reports = BTreeMap<&'static str, u32>;

/// How a cache is filled.
#[derive(Debug, Clone, Copy)]
struct Fill {
    batch: u32,
    sequential: bool,
    /// Whether the radius may not jump over what a neighbour has seen.
    clamps: bool,
}

const IN_BATCHES: Fill = Fill { batch: 32, sequential: false, clamps: false };

/// What a fill leaves.
#[derive(PartialEq)]
struct Filled {
    irradiance: Vec<u8>,
    /// What the nodes report, by name.
    reports: Reports,
    records: Vec<Record>,
}

/// A whole fill.
fn filled(stage: &Stage, fill: Fill, [splat, misses, sum, add]: [&str; 4]) -> Result<Filled, Failed> {
    let mut graph = Graph::new(stage, [60, 45]);
    graph.node("gbuffer", "GBuffer", &[], &[])?;
    // Closer than the default, of which a batch of 32 would fill a third of so small a picture.
    graph.node("cache", "RecordCache", &[("minimum_spacing", "4")], &[])?;
    let Some(&Port::RecordCache(cache)) = graph.ports.get("cache") else { return Err("no cache".into()) };
    graph.batch = Some((fill.batch, fill.sequential));
    graph.node("splats", "Splat", &[way(splat)], &[("records", "cache"), ("gbuffer", "gbuffer")])?;
    graph.node("misses", "FindMisses", &[way(misses)], &[("gbuffer", "gbuffer"), ("splats", "splats")])?;
    graph.node("tiles", "HemisphereTiles", &[("resolution", "8")], &[("at", "misses")])?;
    graph.node("closed", "Compensation", &[], &[("of", "tiles")])?;
    graph.node("records", "IrradianceSum", &[way(sum)], &[("of", "closed")])?;
    graph.node(
        "added",
        "AddRecords",
        &[way(add), ("neighbour_clamping", if fill.clamps { "true" } else { "false" })],
        &[("to", "cache"), ("records", "records")],
    )?;
    graph.end_loop("misses.none")?;
    graph.node("indirect", "Normalize", &[], &[("splats", "splats"), ("gbuffer", "gbuffer")])?;
    let irradiance = graph.texture("indirect.irradiance")?;
    let mut session = graph.session(&[irradiance, cache.records])?;
    let frame = block_on(session.frame(&|| Pace::GoOn)).map_err(|e| e.to_string())?;
    check(frame.unfinished.is_empty(), || "the fill did not end".into())?;
    let names = ["records", "new_records", "surplus_records", "uncovered_pixels", "non_finite_pixels"];
    let reports: Reports = names.into_iter().map(|name| Ok((name, graph.report(&session, name)?))).collect::<Result<_, Failed>>()?;
    let mut records: Vec<Record> = read(&session, cache.records)?;
    records.truncate(reports["records"] as usize);
    Ok(Filled { irradiance: block_on(session.read(irradiance)).map_err(|e| e.to_string())?, reports, records })
}

/// A fill that covers everything, twice with the same bits; its irradiance and its reports.
fn filled_twice(stage: &Stage, fill: Fill, ways: [&str; 4]) -> Result<(Vec<[f32; 4]>, Reports), Failed> {
    let runs = [filled(stage, fill, ways)?, filled(stage, fill, ways)?];
    let name = format!("{fill:?}, {ways:?}");
    check(runs[0] == runs[1], || format!("{name}: two runs differ"))?;
    let [Filled { irradiance, reports, .. }, _] = runs;
    println!("{name}: {reports:?}");
    let whole = reports["uncovered_pixels"] == 0 && reports["non_finite_pixels"] == 0 && reports["records"] > 50;
    check(whole, || format!("{name}: {reports:?}"))?;
    Ok((bytemuck::pod_collect_to_vec(&irradiance), reports))
}

fn fills_cover(stage: &Stage) -> Outcome {
    for splat in stage.splats() {
        filled_twice(stage, IN_BATCHES, [splat, "Device", "WorkgroupTree", "Device"])?;
    }
    for sum in &SUMS[1..] {
        filled_twice(stage, IN_BATCHES, ["ComputeTiles", "Device", sum, "Device"])?;
    }
    let (_, reports) = filled_twice(stage, IN_BATCHES, ["ComputeTiles", "Scan", "WorkgroupTree", "Device"])?;
    check(reports["surplus_records"] * 10 < reports["records"], || format!("a tenth of the records or more is surplus: {reports:?}"))
}

/// Whichever of the steps run on the host and hand each other what they made, and which on the device: the picture is the same but where rounding
/// decides whether a pixel misses a record.
fn fills_agree(stage: &Stage) -> Outcome {
    let (expected, reports) = filled_twice(stage, IN_BATCHES, ["ComputeTiles", "Device", "WorkgroupTree", "Device"])?;
    let mean = expected.iter().flatten().sum::<f32>() / expected.len() as f32;
    // Alone, in pairs of neighbours and of others, and all.
    for choice in [1, 2, 4, 8, 3, 6, 9, 15u32] {
        let pick = |bit: u32, ways: [&'static str; 2]| ways[(choice >> bit & 1) as usize];
        let ways = [pick(0, ["ComputeTiles", "Host"]), pick(1, ["Device", "Host"]), pick(2, ["WorkgroupTree", "Host"]), pick(3, ["Device", "Host"])];
        let (found, other) = filled_twice(stage, IN_BATCHES, ways)?;
        let squares: f32 = found.iter().flatten().zip(expected.iter().flatten()).map(|(a, b)| (a - b).powi(2)).sum();
        let error = (squares / expected.len() as f32).sqrt() / mean;
        check(error < 5e-3, || format!("{ways:?}: {error} of the mean apart"))?;
        check(other["records"].abs_diff(reports["records"]) * 50 <= reports["records"], || format!("{ways:?}: {other:?}, not {reports:?}"))?;
        check(other["surplus_records"].abs_diff(reports["surplus_records"]) <= 3, || format!("{ways:?}: {other:?}, not {reports:?}"))?;
    }
    Ok(())
}

/// Clamped by the records before them, most reach less far: more are needed, as many on the host as on the device.
fn clamping_agrees(stage: &Stage) -> Outcome {
    let records = |clamps: bool, add: &'static str| -> Result<u32, Failed> {
        Ok(filled_twice(stage, Fill { clamps, ..IN_BATCHES }, ["ComputeTiles", "Device", "WorkgroupTree", add])?.1["records"])
    };
    let (free, device, host) = (records(false, "Device")?, records(true, "Device")?, records(true, "Host")?);
    check(device > free && device.abs_diff(host) * 100 <= device, || format!("{free} records, clamped {device} on the device and {host} on the host"))
}

/// One by one, so that each record is clamped by all before it that face alike: no radius exceeds that of one of them and the way to it.
fn clamping_bounds(stage: &Stage) -> Outcome {
    for add in ["Device", "Host"] {
        let Filled { records, .. } = filled(stage, Fill { batch: 1, sequential: false, clamps: true }, ["ComputeTiles", "Device", "WorkgroupTree", add])?;
        let mut met = 0;
        for (number, record) in records.iter().enumerate() {
            let [position, normal] = [record.position, record.normal].map(Vec3::from);
            let alike = records[..number].iter().filter(|other| Vec3::from(other.normal).dot(normal) > 0.71);
            let bound = alike.map(|other| other.radius + position.distance(other.position.into())).fold(f32::INFINITY, f32::min);
            check(record.radius <= bound * 1.00001, || format!("record {number} by {add} reaches {}, not {bound} at most", record.radius))?;
            met += (record.radius > bound * 0.99999) as u32;
        }
        check(met > 5, || format!("{met} of {} records by {add} are clamped", records.len()))?;
    }
    Ok(())
}

/// Batches of two among cells of 8×8 pixels: none has a second record before each has one, though no record reaches beyond its pixel.
fn batches_serve_each_cell_once(stage: &Stage) -> Outcome {
    const SIZE: [u32; 2] = [64, 48];
    let mut graph = Graph::new(stage, SIZE);
    graph.node("gbuffer", "GBuffer", &[], &[])?;
    graph.node("cache", "RecordCache", &[("minimum_spacing", "0.1"), ("maximum_spacing", "0.3"), ("overlap", "0"), ("capacity", "48")], &[])?;
    let Some(&Port::RecordCache(cache)) = graph.ports.get("cache") else { return Err("no cache".into()) };
    graph.batch = Some((2, false));
    graph.node("splats", "Splat", &[("by", "ComputeTiles")], &[("records", "cache"), ("gbuffer", "gbuffer")])?;
    graph.node("misses", "FindMisses", &[("by", "Grid:8")], &[("gbuffer", "gbuffer"), ("splats", "splats")])?;
    graph.node("tiles", "HemisphereTiles", &[("resolution", "4")], &[("at", "misses")])?;
    graph.node("closed", "Compensation", &[], &[("of", "tiles")])?;
    graph.node("records", "IrradianceSum", &[], &[("of", "closed")])?;
    graph.node("added", "AddRecords", &[], &[("to", "cache"), ("records", "records")])?;
    graph.end_loop("misses.none")?;
    let mut session = graph.session(&[cache.records])?;
    block_on(session.frame(&|| Pace::GoOn)).map_err(|e| e.to_string())?;
    let records: Vec<Record> = read(&session, cache.records)?;
    let camera = &stage.ready.scene.cameras[0];
    let cell = |record: &Record| {
        let d = Vec3::from(record.position) - camera.eye;
        let half = camera.half_extent(SIZE) * d.dot(camera.direction);
        let across = |along: f32, half: f32, size: u32| ((along / half * 0.5 + 0.5) * size as f32) as u32 / 8;
        [across(d.dot(camera.right()), half.x, SIZE[0]), across(-d.dot(camera.up), half.y, SIZE[1])]
    };
    let cells: BTreeSet<_> = records.iter().map(cell).collect();
    check(cells.len() == 48, || format!("{} records stand in {} cells", records.len(), cells.len()))
}

fn sequential_walk(stage: &Stage) -> Outcome {
    for splat in stage.splats() {
        let (_, reports) = filled_twice(stage, Fill { batch: 1, sequential: true, ..IN_BATCHES }, [splat, "Scan", "WorkgroupTree", "Host"])?;
        check(reports["surplus_records"] == 0, || format!("{reports:?}"))?;
    }
    Ok(())
}

// Host and device

/// Reach, weight, estimate and fineness of one record at one point a lane.
const TWIN: &str = "
struct Place { position: vec3f, kind: u32, normal: vec3f, padding: u32 }
struct Value { estimate: vec3f, weight: f32, reach: f32, fineness: f32, padding_a: f32, padding_b: f32 }
@group(0) @binding(0) var<storage, read> records: array<Record>;
@group(0) @binding(1) var<storage, read> places: array<Place>;
@group(0) @binding(2) var<storage, read_write> values: array<Value>;
@compute @workgroup_size(64)
fn twin(@builtin(global_invocation_id) id: vec3u) {
    let place = places[id.x];
    let weighting = Weighting(0.3, 1.5, 40.0, place.kind, 2.0, 1.5, 0.0, 0.005, 0.4, 0u, 0u, 0u);
    let record = records[id.x];
    values[id.x] = Value(
        record_estimate(record, weighting, place.position, place.normal), record_weight(record, weighting, place.position, place.normal),
        validity_radius(record, weighting), fineness(record, weighting, 0.5), 0.0, 0.0,
    );
}
";

/// A pair per lane of [`TWIN`].
const PAIRS: usize = 64 * 256;

fn weights_agree(stage: &Stage) -> Outcome {
    let records = records(&stage.ready.scene, [512, 384], PAIRS);
    let mut numbers = Numbers(5);
    let places: Vec<[f32; 8]> = records
        .iter()
        .enumerate()
        .map(|(i, record)| {
            let kind = i % 3;
            let reach = rule(WEIGHTINGS[kind], 40.0).validity_radius(&weight::Record::from(record));
            // Some at the record's own place, some beyond its reach.
            let position = Vec3::from(record.position) + numbers.vector() * reach * if i % 50 == 0 { 0.0 } else { 0.8 };
            let normal = (Vec3::from(record.normal) + numbers.vector() * if i % 7 == 0 { 0.0 } else { 0.2 }).normalize();
            let [x, y, z] = position.to_array();
            let [a, b, c] = normal.to_array();
            [x, y, z, f32::from_bits(kind as u32), a, b, c, 0.0]
        })
        .collect();
    let values = run_twin(&stage.gpu, &records, &places)?;
    let mut counted = [0; 3];
    // Records that no contrast, some, and the most that counts make finer.
    let mut finer = [0; 3];
    for (i, (value, place)) in values.iter().zip(&places).enumerate() {
        let (record, rule) = (weight::Record::from(&records[i]), rule(WEIGHTINGS[i % 3], 40.0));
        let (position, normal) = (Vec3::new(place[0], place[1], place[2]), Vec3::new(place[4], place[5], place[6]));
        let (weight, estimate) = (rule.weight(&record, position, normal), rule.estimate(&record, position, normal));
        counted[i % 3] += (weight > 0.0) as u32;
        let near = |found: f32, expected: f32, scale: f32| (found - expected).abs() <= 1e-5 * scale;
        // A weight near its rim is a small difference of numbers near 1.
        let (reach, fineness) = (rule.validity_radius(&record), rule.fineness(&record, 0.5));
        let agrees = near(value[3], weight, weight.max(1.0)) && near(value[4], reach, reach) && near(value[5], fineness, 1.0);
        finer[if fineness == 1.0 { 0 } else { 1 + (fineness < 0.27) as usize }] += 1;
        let estimates = (0..3).all(|c| near(value[c], estimate[c], estimate[c].abs() + record.irradiance[c]));
        check(agrees && estimates, || format!("record {i}: weight {weight}, estimate {estimate}; the device says {value:?}"))?;
    }
    check(counted.iter().chain(&finer).all(|c| *c > 500), || format!("too few records count for a test: {counted:?}, {finer:?}"))
}

/// Runs [`TWIN`] over the records and places.
fn run_twin(gpu: &Gpu, records: &[Record], places: &[[f32; 8]]) -> Result<Vec<[f32; 8]>, Failed> {
    let text = shader::assemble("lib/record", &[]).map_err(|e| e.to_string())? + TWIN;
    let device = &gpu.device;
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some("twin"), source: wgpu::ShaderSource::Wgsl(text.into()) });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("twin"),
        layout: None,
        module: &module,
        entry_point: Some("twin"),
        compilation_options: Default::default(),
        cache: None,
    });
    let buffer = |bytes: u64, usage| device.create_buffer(&wgpu::BufferDescriptor { label: None, size: bytes, usage, mapped_at_creation: false });
    let filled = |contents: &[u8]| {
        let filled = buffer(contents.len() as u64, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST);
        gpu.queue.write_buffer(&filled, 0, contents);
        filled
    };
    let bytes = size_of_val(places) as u64;
    let values = buffer(bytes, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
    let bound = [filled(bytemuck::cast_slice(records)), filled(bytemuck::cast_slice(places)), values.clone()];
    let entries: Vec<_> = bound.iter().zip(0..).map(|(b, binding)| wgpu::BindGroupEntry { binding, resource: b.as_entire_binding() }).collect();
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout: &pipeline.get_bind_group_layout(0), entries: &entries });
    let staging = buffer(bytes, wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST);
    let mut encoder = device.create_command_encoder(&Default::default());
    let mut pass = encoder.begin_compute_pass(&Default::default());
    pass.set_pipeline(&pipeline);
    pass.set_bind_group(0, &group, &[]);
    pass.dispatch_workgroups((PAIRS / 64) as u32, 1, 1);
    drop(pass);
    encoder.copy_buffer_to_buffer(&values, 0, &staging, 0, bytes);
    gpu.queue.submit([encoder.finish()]);
    staging.map_async(wgpu::MapMode::Read, .., |_| ());
    block_on(gpu.wait("comparing host and device")).map_err(|e| e.to_string())?;
    let view = staging.get_mapped_range(..).map_err(|e| e.to_string())?;
    Ok(bytemuck::pod_collect_to_vec(&view))
}

// Indices over records

/// Of many records, few and one; with more hashes than a block of sums has, and with more blocks than a workgroup adds at once.
fn indices_agree(stage: &Stage) -> Outcome {
    for (count, capacity) in [(3000, 3500), (3000, 140_000), (70, 3500), (1, 3500), (0, 3500)] {
        let records = records(&stage.ready.scene, [512, 384], count);
        let mut graph = Graph::new(stage, [8, 8]);
        let held = if records.is_empty() { vec![0; size_of::<Record>()] } else { bytemuck::cast_slice(&records).to_vec() };
        let buffer = graph.buffer("records", &held);
        let counted = graph.variable("count");
        let new = port::Records { records: buffer, coefficients: None, count: counted, capacity, is_steady: false, sees_emission: false };
        graph.ports.insert("records".into(), Port::Records(new));
        let values = |place| [("place", place), ("spacing", "30")];
        graph.node("by_host", "RecordIndex", &values("Host"), &[("of", "records")])?;
        graph.node("by_device", "RecordIndex", &values("Device"), &[("of", "records")])?;
        let index = |name: &str| match graph.ports.get(name) {
            Some(Port::IrradianceField(port::IrradianceField::Records(index))) => Ok(*index),
            _ => Err(Failed::from("no index")),
        };
        let [by_host, by_device] = [index("by_host")?, index("by_device")?];
        let mut session = graph.session(&[by_host.data, by_device.data])?;
        session.set_variable(counted, count as u32);
        block_on(session.frame(&|| Pace::GoOn)).map_err(|e| e.to_string())?;
        let layout = Layout::of(capacity as usize);
        let all: Vec<weight::Record> = records.iter().map(weight::Record::from).collect();
        let words = [read::<u32>(&session, by_host.data)?, read::<u32>(&session, by_device.data)?];
        check(words[0][..4] == words[1][..4], || format!("headers differ: {:?} {:?}", &words[0][..4], &words[1][..4]))?;
        let apart = words[0].iter().zip(&words[1]).filter(|(host, device)| host != device).count();
        check(apart <= words[0].len() / 1000, || format!("{apart} of {} words differ", words[0].len()))?;
        let indices = words.map(|words| RecordIndex::new(&words, layout, all.clone(), by_host.rule));
        let mut numbers = Numbers(9);
        let mut found = 0;
        for _ in 0..2000.min(20 * count) {
            let near = &all[(numbers.next() * count as f32) as usize % count];
            let way = numbers.vector() * by_host.rule.longest_validity_radius(near) * 1.2;
            let position = near.position + way - near.normal * near.normal.dot(way) * 0.97;
            let normal = (near.normal + numbers.vector() * 0.3).normalize();
            let weighted = all.iter().map(|record| (by_host.rule.reaching(record).local_weight(position, normal), record));
            let (sum, weights) = weighted
                .filter(|(weight, _)| *weight > 0.0)
                .fold((Vec3::ZERO, 0.0), |(sum, weights), (weight, record)| (sum + by_host.rule.estimate(record, position, normal) * weight, weights + weight));
            if weights <= 0.0 {
                continue;
            }
            let expected = sum / weights;
            found += 1;
            for index in &indices {
                let (estimate, _) = index.estimate_at(position, normal);
                check((estimate - expected).length() <= 1e-3 * expected.length(), || format!("{estimate} instead of {expected}"))?;
            }
        }
        check(found >= count.min(100), || format!("only {found} of the points are reached"))?;
    }
    Ok(())
}

/// Where there is no room for the photons of all paths, only those paths count that came before; their light is shared out among them.
fn photons_fit(stage: &Stage) -> Outcome {
    for (photons, kept) in [("20000", "1024"), ("20000", "100000"), ("1", "1024"), ("0", "1024")] {
        let map = |place: &str| {
            let mut graph = Graph::new(stage, [8, 8]);
            graph.node("map", "PhotonMap", &[("place", place), ("photons", photons), ("kept", kept)], &[])?;
            let Some(Port::PhotonMap(map)) = graph.ports.get("map").cloned() else { return Err("no map".into()) };
            let mut session = graph.session(&[map.data])?;
            block_on(session.frame(&|| Pace::GoOn)).map_err(|e| e.to_string())?;
            let told = ["photons_emitted", "photons", "photons_cut_off"].map(|name| graph.report(&session, name));
            let [emitted, count, cut_off] = told.map(|number| number.unwrap_or(u32::MAX));
            let held: Vec<Photon> = read(&session, map.data)?;
            let flux = held[SLOTS_BEFORE as usize..][..count as usize].iter().map(|photon| f64::from(photon.flux[1])).sum::<f64>();
            Ok::<_, Failed>((emitted, count, cut_off, flux))
        };
        let (host, device) = (map("Host")?, map("Device")?);
        let [kept, photons]: [u32; 2] = [kept.parse()?, photons.parse()?];
        let told = || format!("{photons} photons, {kept} kept: host {host:?}, device {device:?}");
        let is_full = host.0 < photons;
        check(host.1 <= kept && device.1 <= kept && (!is_full || device.1 + 64 > kept), told)?;
        let are_alike = |a: u32, b: u32| a.abs_diff(b) <= 2 + a / 200;
        check(are_alike(host.0, device.0) && are_alike(host.1, device.1) && host.2 == device.2, told)?;
        check((host.3 - device.3).abs() <= 0.01 * host.3, told)?;
    }
    Ok(())
}

//! How well harmonics hold lobes, and what each way to rotate them costs and gets wrong: the figures 3.9 and 3.10 of Gautron's thesis, and the
//! errors of its section 3.4.
//!
//! `./bench harmonics` builds and runs it; docs/harmonics.md tells what came of it.

#[allow(dead_code, reason = "only parts of the race's modules are of use here")]
#[path = "../race/kept.rs"]
mod kept;
#[allow(dead_code, reason = "as above")]
#[path = "../race/machine.rs"]
mod machine;

use clap::Parser;
use glam::{DMat3, DVec3, Vec2, Vec3};
use hemisplat::{
    math::{
        harmonics::{Basis, Method, Tilting, count, families::Family, quadrature::hemisphere},
        lobe::{Lobe, Shape},
    },
    measure::plot::{Line, Mark, Paper, Plot, svg},
};
use kept::write;
use serde::Serialize;
use std::{path::PathBuf, process::ExitCode, time::Instant};

type Failure = Box<dyn std::error::Error>;

/// Measure how much of a lobe's energy families of functions hold, and the error, time and memory of the ways to rotate hemispherical harmonics
#[derive(Parser)]
#[command(name = "./bench harmonics")]
struct Options {
    /// Where results go
    #[arg(short, long, default_value = "benches/results")]
    out: PathBuf,
    /// Where the figures go
    #[arg(long, value_name = "DIR", default_value = "docs")]
    figures: PathBuf,
    /// Taken over from the benchmarks of pictures; nothing is rendered here
    #[arg(long, hide = true)]
    program: Option<PathBuf>,
    /// What `cargo bench` says
    #[arg(long, hide = true)]
    bench: bool,
}

/// Keys in JSON are the fields' names.
#[derive(Serialize)]
struct Report {
    /// Version of this record: 1.
    schema: u32,
    date: String,
    commit: String,
    /// Those of benches/changes.ron that this program has.
    changes: Vec<String>,
    captured: Vec<Captured>,
    rotations: Vec<Rotated>,
}

/// What a family holds of a function.
#[derive(Serialize)]
struct Captured {
    function: &'static str,
    family: String,
    order: usize,
    coefficients: usize,
    /// The share of the energy that is not held.
    lost: f64,
}

/// A way to rotate.
#[derive(Serialize)]
struct Rotated {
    method: String,
    order: usize,
    degrees: f64,
    /// Of the turned lobes against their projection, relative, root of the mean square over the lobes.
    error: f64,
    /// Of one rotation, on one core.
    microseconds: f64,
    /// Of its tables.
    bytes: usize,
}

/// The highest order compared.
const MOST: usize = 16;

fn main() -> ExitCode {
    machine::ended(measure(&Options::parse()))
}

fn measure(options: &Options) -> Result<(), Failure> {
    let (commit, changes) = (machine::clean_commit()?, machine::changes()?);
    let captured: Vec<Captured> = FUNCTIONS.iter().flat_map(|(name, function)| captured(name, function)).collect();
    for (name, _) in &FUNCTIONS[..DRAWN] {
        let file = options.figures.join(format!("harmonics-{name}.svg"));
        write(&file, &svg(&figure(name, &captured), Paper::Wide))?;
        println!("{}", file.display());
    }
    let rotations: Vec<Rotated> = [5, 10].into_iter().flat_map(rotations).collect();
    table(&captured, &rotations);
    let date = machine::date()?;
    let report = Report { schema: 1, date: date.clone(), commit, changes, captured, rotations };
    let file = options.out.join(format!("{date}-harmonics.json"));
    write(&file, &(serde_json::to_string_pretty(&report)? + "\n"))?;
    println!("{}", file.display());
    Ok(())
}

type Function = fn([f64; 3]) -> f64;

/// Unit direction toward which the lobes of the figures reflect, 30° from the normal.
fn outgoing() -> Vec3 {
    Vec3::new(0.5, 0.0, 0.75f32.sqrt())
}

fn value(shape: Shape, direction: [f64; 3]) -> f64 {
    let lobe = Lobe { shape, reflectance: Vec3::ONE };
    lobe.value(outgoing(), Vec3::from(direction.map(|x| x as f32))).x as f64
}

/// Figure 3.9: a Phong lobe of exponent 5. Figure 3.10: Ward's of slopes 0.2 and 0.5. And those of this project's scenes, with their cosine.
const FUNCTIONS: [(&str, Function); 5] = [
    ("phong-5", |d| value(Shape::Phong { exponent: 5.0 }, d)),
    ("ward", |d| value(Shape::Ward { alpha: Vec2::new(0.2, 0.5) }, d)),
    ("phong-20-cosine", |d| value(Shape::Phong { exponent: 20.0 }, d) * d[2]),
    ("ward-cosine", |d| value(Shape::Ward { alpha: Vec2::new(0.2, 0.5) }, d) * d[2]),
    ("microfacets-cosine", |d| value(Shape::Microfacets { alpha: 0.25 }, d) * d[2]),
];

/// The first of them, which the thesis draws too.
const DRAWN: usize = 2;

fn captured(function: &'static str, of: &Function) -> Vec<Captured> {
    let pairs = Family::ALL.into_iter().flat_map(|family| (1..=MOST).map(move |order| (family, order)));
    pairs
        .map(|(family, order)| {
            let (held, coefficients) = family.captured(order, of);
            Captured { function, family: format!("{family:?}"), order, coefficients, lost: (1.0 - held).max(0.0) }
        })
        .collect()
}

fn figure(function: &str, captured: &[Captured]) -> Plot {
    let line = |family: Family| {
        let name = format!("{family:?}");
        let mine = captured.iter().filter(|c| c.function == function && c.family == name);
        let mark = |c: &Captured| Mark {
            id: format!("{name}-{}", c.order),
            label: None,
            about: format!("{name}, order {}: {} coefficients lose {:.3} %", c.order, c.coefficients, 100.0 * c.lost),
            x: c.coefficients as f64,
            x_spread: [c.coefficients as f64; 2],
            y: c.lost.max(1e-6),
            y_spread: [c.lost.max(1e-6); 2],
            is_limit: false,
            is_on_front: false,
        };
        Line { marks: mine.map(mark).collect(), name }
    };
    Plot {
        title: format!("Energy of a lobe that is lost: {function}"),
        x_label: "coefficients".into(),
        y_label: "share of the energy lost".into(),
        label_of_marks: String::new(),
        lines: Family::ALL.map(line).into(),
    }
}

/// A power of the cosine to an axis, what [`rotations`] turn.
fn lobe_around(axis: DVec3, exponent: i32, direction: DVec3) -> f64 {
    axis.dot(direction).max(0.0).powi(exponent)
}

fn project(order: usize, function: impl Fn(DVec3) -> f64) -> Vec<f64> {
    let basis = Basis::<f64>::new(order);
    let mut sum = vec![0.0; count(order)];
    for (direction, weight) in hemisphere(48, 96) {
        let value = weight * function(DVec3::from(direction));
        sum.iter_mut().zip(basis.hemispherical(direction)).for_each(|(sum, basis)| *sum += value * basis);
    }
    sum
}

/// Axes of the lobes that are turned: angle from the normal and azimuth [degrees].
const AXES: [[f64; 2]; 6] = [[0.0, 0.0], [20.0, 40.0], [20.0, 220.0], [45.0, 100.0], [60.0, 300.0], [60.0, 180.0]];
const EXPONENT: i32 = 10;
const STEPS: usize = 64;

fn rotations(order: usize) -> Vec<Rotated> {
    let methods = [
        ("conversion, as many bands", Method::Conversion { spherical: order }),
        ("conversion, four bands more", Method::Conversion { spherical: order + 4 }),
        ("digon deletion", Method::DigonDeletion),
        ("precomputed", Method::Precomputed),
    ];
    let axes = AXES.map(|[theta, phi]| {
        let ((sine, cosine), (y, x)) = (theta.to_radians().sin_cos(), phi.to_radians().sin_cos());
        DVec3::new(sine * x, sine * y, cosine)
    });
    let projected: Vec<Vec<f64>> = axes.iter().map(|axis| project(order, |d| lobe_around(*axis, EXPONENT, d))).collect();
    let mut found = Vec::new();
    for (name, method) in methods {
        let tilting = Tilting::new(order, method, STEPS);
        for degrees in [2.0, 5.0, 10.0, 20.0, 30.0, 60.0] {
            let matrix = DMat3::from_rotation_y(f64::to_radians(degrees));
            let rows = matrix.transpose().to_cols_array_2d();
            let (mut error, mut size) = (0.0, 0.0);
            for (axis, values) in axes.iter().zip(&projected) {
                let turned = tilting.rotate(values, rows);
                // What lay below the horizon before is not known: the truth is what is left of the lobe's upper half.
                let inverse = matrix.transpose();
                let truth = project(order, |d| {
                    let before = inverse * d;
                    if before.z > 0.0 { lobe_around(*axis, EXPONENT, before) } else { 0.0 }
                });
                error += turned.iter().zip(&truth).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
                size += truth.iter().map(|v| v * v).sum::<f64>();
            }
            let start = Instant::now();
            const TIMES: usize = 200;
            for i in 0..TIMES {
                std::hint::black_box(tilting.rotate(&projected[i % projected.len()], rows));
            }
            let microseconds = start.elapsed().as_secs_f64() * 1e6 / TIMES as f64;
            found.push(Rotated { method: name.into(), order, degrees, error: (error / size).sqrt(), microseconds, bytes: tilting.memory() });
        }
    }
    found
}

/// The tables of docs/harmonics.md.
fn table(captured: &[Captured], rotations: &[Rotated]) {
    println!("\n| lobe | family | 25 coefficients | 49 | 100 | 196 |\n|---|---|---|---|---|---|");
    for (function, _) in FUNCTIONS {
        for family in Family::ALL.map(|family| format!("{family:?}")) {
            let at = |most: usize| {
                let fits = captured.iter().filter(|c| c.function == function && c.family == family && c.coefficients <= most);
                fits.map(|c| c.lost).fold(1.0, f64::min)
            };
            println!("| {function} | {family} | {} |", [25, 49, 100, 196].map(|most| format!("{:.3} %", 100.0 * at(most))).join(" | "));
        }
    }
    println!("\n| order | method | 2° | 5° | 10° | 20° | 30° | 60° | µs | KiB |\n|---|---|---|---|---|---|---|---|---|---|");
    for same in rotations.chunk_by(|a, b| (a.order, &a.method) == (b.order, &b.method)) {
        let errors: Vec<String> = same.iter().map(|r| format!("{:.1} %", 100.0 * r.error)).collect();
        let microseconds = same.iter().map(|r| r.microseconds).fold(f64::INFINITY, f64::min);
        println!("| {} | {} | {} | {microseconds:.0} | {:.0} |", same[0].order, same[0].method, errors.join(" | "), same[0].bytes as f64 / 1024.0);
    }
}

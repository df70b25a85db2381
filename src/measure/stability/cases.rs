//! The cases, in the order in which they are told.

use super::bench::{Bench, Change, RECORD_A_PIXEL, RECORDS_SEE_LIGHT, SIZE, Shot};
use super::rooms::{Room, View};
use super::{Case, Trouble, lobes};
use glam::DVec3;

pub(super) type Seen = Result<String, Trouble>;

/// Rounding that moves a few records, so that pixels between them change by their error.
const SAME_PICTURE: f64 = 0.02;
/// Rounding of sums in single precision.
const ROUNDING: f64 = 1e-4;

/// All cases.
pub const CASES: &[Case] = &[
    Case {
        name: "furnace",
        guards_against: "weights of a tile that do not add up: samples at its border, samples that nothing is seen by",
        must_hold: "π in every pixel, or what the tiles cover of it",
        is_long: false,
        run: furnace,
    },
    Case {
        name: "scale",
        guards_against: "biases and limits that are lengths of their own",
        must_hold: "the unit scene's picture: to the bit at 2⁻¹⁰ and 2²⁰, within 2 % at 10⁻³ and 10⁶",
        is_long: false,
        run: scale,
    },
    Case {
        name: "scale-beyond",
        guards_against: "areas whose squares overflow or vanish",
        must_hold: "refused at 10⁻⁶ and 10¹²",
        is_long: false,
        run: scale_beyond,
    },
    Case {
        name: "offset",
        guards_against: "cancellation far from the origin",
        must_hold: "the unit scene's picture within 2 %, moved by 10⁶ units",
        is_long: false,
        run: offset,
    },
    Case {
        name: "brightness",
        guards_against: "limits that are radiances of their own",
        must_hold: "the unit scene's picture times as much, to the bit at 2⁻²⁰ and 2²⁰",
        is_long: false,
        run: brightness,
    },
    Case {
        name: "brightness-beyond",
        guards_against: "light that overflows single precision and goes on as NaN",
        must_hold: "finite pixels at 10³⁸ W/sr, or an error that names the layer",
        is_long: false,
        run: brightness_beyond,
    },
    Case {
        name: "radiance-range",
        guards_against: "sums that lose what is small beside what is large",
        must_hold: "10⁻⁶ and 10⁶ in one tile add up to what a furnace has, within 10⁻⁴",
        is_long: false,
        run: radiance_range,
    },
    Case {
        name: "half-floats",
        guards_against: "half floats that overflow at 65,504 and lose what is below 6·10⁻⁸",
        must_hold: "a radiance of 10⁻⁶ and of 10⁶ makes the unit scene's picture times as much, within 1 %",
        is_long: false,
        run: half_floats,
    },
    Case {
        name: "few-samples",
        guards_against: "tiles too small to be reduced, gradients of next to no samples",
        must_hold: "4² samples: π in a furnace; the corner's mean within 25 % of that of 16²",
        is_long: false,
        run: few_samples,
    },
    Case {
        name: "many-samples",
        guards_against: "atlases beyond the adapter's limits, sums of 10⁵ terms that drift",
        must_hold: "512² samples: π in a furnace within 10⁻⁴",
        is_long: true,
        run: many_samples,
    },
    Case {
        name: "samples-beyond",
        guards_against: "tiles that cannot be laid out",
        must_hold: "2² and 1024² samples are refused",
        is_long: false,
        run: samples_beyond,
    },
    Case {
        name: "field-of-view",
        guards_against: "perspective that blows up towards 180° and loses all digits towards 0°",
        must_hold: "a furnace through 179.9° and through 0.001°: π in every pixel",
        is_long: false,
        run: field_of_view,
    },
    Case {
        name: "field-of-view-beyond",
        guards_against: "tangents that are infinite or negative",
        must_hold: "cameras of 0° and 180° and tiles of 176° are refused",
        is_long: false,
        run: field_of_view_beyond,
    },
    Case {
        name: "radius-to-nothing",
        guards_against: "records that crowd where walls meet until memory ends",
        must_hold: "the camera 10⁻³ units off a corner, a record's least validity radius a tenth of a pixel: at most one record a pixel",
        is_long: false,
        run: radius_to_nothing,
    },
    Case {
        name: "radius-to-infinity",
        guards_against: "records that see nothing but sky, whose mean distance is infinite",
        must_hold: "π in every pixel under an even sky",
        is_long: false,
        run: radius_to_infinity,
    },
    Case {
        name: "triangles",
        guards_against: "normals of no length, rays along planes, surfaces that hide themselves",
        must_hold: "π in a furnace with triangles without area, needles of 1 : 10⁶, every wall twice",
        is_long: false,
        run: triangles,
    },
    Case {
        name: "huge-triangle",
        guards_against: "biases that grow with the scene until they step over walls",
        must_hold: "the corner above a square 500 times as wide: every sum within 1 % of the corner's own",
        is_long: false,
        run: huge_triangle,
    },
    Case {
        name: "camera-in-a-wall",
        guards_against: "depths and footprints of 0",
        must_hold: "in a wall's plane, in an edge and in a solid block: every pixel that sees a surface has π",
        is_long: false,
        run: camera_in_a_wall,
    },
    Case {
        name: "no-lights",
        guards_against: "0 / 0 in weights of lights and in gradients over irradiance",
        must_hold: "black to the bit, covered",
        is_long: false,
        run: no_lights,
    },
    Case { name: "empty-view", guards_against: "fills without pixels", must_hold: "the sky in every pixel, no record", is_long: false, run: empty_view },
    Case {
        name: "accuracy-beyond",
        guards_against: "endless filling",
        must_hold: "an accuracy of 0, −1, NaN and 10⁹ is refused",
        is_long: false,
        run: accuracy_beyond,
    },
    Case {
        name: "records-beyond",
        guards_against: "memory that adapters need not have",
        must_hold: "a cache of 10⁶ records is refused, above the limit of 800,000",
        is_long: false,
        run: records_beyond,
    },
    Case {
        name: "records",
        guards_against: "sums of weights that drift or overflow",
        must_hold: "20,000 copies of the corner's records make its picture within 10⁻³",
        is_long: false,
        run: |bench| copies(bench, 20_000, 1e-3),
    },
    Case {
        name: "most-records",
        guards_against: "the same, as many as a cache holds",
        must_hold: "800,000 copies of the corner's records make its picture within 0.25 %",
        is_long: true,
        run: |bench| copies(bench, 800_000, 2.5e-3),
    },
    Case {
        name: "lobes",
        guards_against: "lobes between the points of a projection, recurrences that overflow at high orders",
        must_hold: "exponents of 0 and 10⁴, a slope of 10⁻³ at order 20, no roughness at order 1: their albedo under an even sky within 8 %",
        is_long: false,
        run: lobes::albedos,
    },
    Case {
        name: "lobes-beyond",
        guards_against: "powers and slopes that are no lobe, orders that are not tested",
        must_hold: "an exponent of −1, a slope of 0, orders of 0 and 21 are refused, and a lobe too sharp if asked for",
        is_long: false,
        run: lobes::beyond,
    },
    Case {
        name: "lobes-ringing",
        guards_against: "expansions that end too early, which ring and turn negative",
        must_hold: "a lobe of exponent 200 at order 4: no pixel is negative, the mean within 25 % of that at order 20",
        is_long: false,
        run: lobes::ringing,
    },
    Case {
        name: "lobes-scale",
        guards_against: "limits of glossy light that are lengths or radiances of their own",
        must_hold: "the unit corner's glossy light to the bit at lengths of 2²⁰, and times as much at light of 2⁻²⁰",
        is_long: false,
        run: lobes::scales,
    },
];

// What several cases claim

pub(super) fn expect(holds: bool, seen: String) -> Seen {
    if holds { Ok(seen) } else { Err(Trouble::Failed(seen)) }
}

pub(super) fn told(share: f64) -> String {
    format!("{:.1e}", share)
}

/// Refuses cases in which light comes straight from its sources, which photons leave out.
fn expect_sources(bench: &Bench<'_>) -> Result<(), Trouble> {
    ["IndirectLight", "PhotonDensity", "PhotonPlaces"].into_iter().try_for_each(|pass| bench.expect_no_pass(pass, "light comes straight from its sources"))
}

/// A furnace, changed: the irradiance of every pixel.
fn furnace_like(bench: &Bench<'_>, room: &Room, changes: &[Change]) -> Result<Shot, Trouble> {
    expect_sources(bench)?;
    let shot = bench.shot(room, &[&RECORDS_SEE_LIGHT, changes].concat())?;
    let off = shot.farthest(bench.furnace());
    if off <= ROUNDING { Ok(shot) } else { Err(Trouble::Failed(format!("a pixel is {off:.1e} off {:.4}", bench.furnace()))) }
}

/// All must be refused before work starts.
pub(super) fn expect_refused<const N: usize>(attempts: [(&str, Result<(), Trouble>); N]) -> Seen {
    let refusal = |(what, result)| match result {
        Err(Trouble::Refused(message)) => Ok(format!("{what}: {message}")),
        Err(other) => Err(other),
        Ok(()) => Err(Trouble::Failed(format!("{what} is accepted"))),
    };
    let refusals = attempts.into_iter().map(refusal).collect::<Result<Vec<_>, _>>()?;
    Ok(refusals.join("; "))
}

// The cases

fn furnace(bench: &Bench<'_>) -> Seen {
    let shot = furnace_like(bench, &Room::furnace(), &[])?;
    Ok(format!("{:.1e} off {:.4} at most, {} records", shot.farthest(bench.furnace()), bench.furnace(), shot.records))
}

fn scale(bench: &Bench<'_>) -> Seen {
    let unit = bench.corner()?;
    for exponent in [-10, 20] {
        let shot = bench.shot(&Room::corner().scaled(2f64.powi(exponent)), &[])?;
        if shot.irradiance != unit.irradiance {
            return Err(Trouble::Failed(format!("at 2^{exponent} it is {} off", told(shot.distance(unit, 1.0)))));
        }
    }
    if bench.expect_no_shown_lightmap().is_err() {
        return Ok("the same bits; where rounding chooses other texels shots differ by chance".into());
    }
    let off = |scale: f64| Ok(bench.shot(&Room::corner().scaled(scale), &[])?.distance(unit, 1.0));
    let off = [1e-3, 1e6].into_iter().map(off).collect::<Result<Vec<f64>, Trouble>>()?;
    let all: Vec<String> = off.iter().map(|off| told(*off)).collect();
    expect(off.iter().all(|off| *off <= SAME_PICTURE), format!("the same bits; {} off", all.join(", ")))
}

fn scale_beyond(bench: &Bench<'_>) -> Seen {
    expect_refused([1e-6, 1e12].map(|scale| ("extent", bench.accepts(&Room::corner().scaled(scale), &[]))))
}

fn offset(bench: &Bench<'_>) -> Seen {
    let room = Room::corner().moved(DVec3::new(1e6, -1e6, 3e5));
    let off = bench.shot(&room, &[])?.distance(bench.corner()?, 1.0);
    expect(off <= SAME_PICTURE, format!("{} off", told(off)))
}

fn brightness(bench: &Bench<'_>) -> Seen {
    let unit = bench.corner()?;
    for exponent in [-20, 20] {
        let factor = 2f64.powi(exponent);
        let off = bench.shot(&Room::corner().brightened(factor), &[])?.distance(unit, factor);
        if off > 0.0 {
            return Err(Trouble::Failed(format!("at 2^{exponent} it is {} off", told(off))));
        }
    }
    Ok("the same bits".into())
}

fn brightness_beyond(bench: &Bench<'_>) -> Seen {
    match bench.shot(&Room::corner().brightened(1e38 / 20.0), &[]) {
        Ok(shot) => Ok(format!("finite, {:.1e} W/m² at most", shot.values().fold(0.0, f64::max))),
        Err(Trouble::NotFinite(message)) => Ok(message),
        Err(other) => Err(other),
    }
}

fn radiance_range(bench: &Bench<'_>) -> Seen {
    expect_sources(bench)?;
    let [least, most] = [1e-6, 1e6];
    let shot = bench.shot(&Room::two_colours(least, most), &[&RECORDS_SEE_LIGHT[..], &RECORD_A_PIXEL].concat())?;
    let [red, green, blue] = &shot.irradiance;
    let off = |pixel: usize| {
        let [red, green, blue] = [red, green, blue].map(|plane| f64::from(plane[pixel]));
        ((red + green) / (least + most) / blue - 1.0).abs().max((blue / bench.furnace() - 1.0).abs())
    };
    let off = (0..blue.len()).filter(|pixel| shot.surfaces[*pixel]).map(off).fold(0.0, f64::max);
    expect(off <= ROUNDING, format!("{off:.1e} off at most"))
}

fn half_floats(bench: &Bench<'_>) -> Seen {
    let way = bench.way("IrradianceSum", "by").filter(|way| ["MipmapChain", "PingPong"].contains(way));
    let way = way.ok_or_else(|| Trouble::Absent("its sums hold no half floats".into()))?;
    let storage = format!("{way}(storage: F16)");
    let changes = [&RECORD_A_PIXEL[..], &[("IrradianceSum", "by", &storage)]].concat();
    let unit = bench.shot(&Room::corner(), &RECORD_A_PIXEL)?;
    let off = |brightness: f64| Ok(bench.shot(&Room::corner().brightened(brightness), &changes)?.distance(&unit, brightness));
    let off = [1.0, 1e-6, 1e6].into_iter().map(off).collect::<Result<Vec<f64>, Trouble>>()?;
    let all: Vec<String> = off.iter().map(|off| told(*off)).collect();
    expect(off.iter().all(|off| *off <= 0.01), format!("{} off at 1, 10⁻⁶, 10⁶", all.join(", ")))
}

fn few_samples(bench: &Bench<'_>) -> Seen {
    let few = [("HemisphereTiles", "resolution", "4")];
    furnace_like(bench, &Room::furnace(), &few)?;
    let mean = |shot: &Shot| shot.values().sum::<f64>() / shot.values().count() as f64;
    let off = mean(&bench.shot(&Room::corner(), &few)?) / mean(bench.corner()?) - 1.0;
    expect(off.abs() <= 0.25, format!("the corner's mean is {} off", told(off)))
}

fn many_samples(bench: &Bench<'_>) -> Seen {
    let changes = [
        ("HemisphereTiles", "resolution", "512"),
        ("RecordCache", "minimum_spacing", "12"),
        ("RecordCache", "maximum_spacing", "16"),
        ("PathVertices", "records", "16"),
    ];
    let batch = match bench.way("Fill", "order") {
        Some("Batched") => vec![("Fill", "order", "Batched(at_most: 2)")],
        _ => Vec::new(),
    };
    let shot = furnace_like(bench, &Room::furnace(), &[&changes[..], &batch].concat())?;
    Ok(format!("{:.1e} off {:.4} at most", shot.farthest(bench.furnace()), bench.furnace()))
}

fn samples_beyond(bench: &Bench<'_>) -> Seen {
    bench.expect_pass("HemisphereTiles")?;
    expect_refused(["2", "1024"].map(|resolution| (resolution, bench.accepts(&Room::corner(), &[("HemisphereTiles", "resolution", resolution)]))))
}

fn field_of_view(bench: &Bench<'_>) -> Seen {
    let told = |degrees: f64| {
        let shot = furnace_like(bench, &Room::furnace().with_field_of_view(degrees), &[])?;
        expect(shot.covered() == (SIZE[0] * SIZE[1]) as usize, format!("{degrees}°: {} pixels of {} see a surface", shot.covered(), SIZE[0] * SIZE[1]))
    };
    Ok([179.9, 1e-3].into_iter().map(told).collect::<Result<Vec<_>, _>>()?.join("; "))
}

fn field_of_view_beyond(bench: &Bench<'_>) -> Seen {
    let camera = |degrees: f64| bench.accepts(&Room::corner().with_field_of_view(degrees), &[]);
    let attempts = [("0°", camera(0.0)), ("180°", camera(180.0))];
    if bench.way("HemisphereTiles", "shape") != Some("Plane") {
        return expect_refused(attempts);
    }
    let [zero, straight] = attempts;
    expect_refused([zero, straight, ("176°", bench.accepts(&Room::corner(), &[("HemisphereTiles", "shape", "Plane(fov: 176)")]))])
}

fn radius_to_nothing(bench: &Bench<'_>) -> Seen {
    let near = View { eye: DVec3::splat(1e-3 - 1.0), target: DVec3::splat(-1.0), field_of_view: 60.0 };
    let shot = furnace_like(bench, &Room::furnace().seen_from(near), &[("RecordCache", "minimum_spacing", "0.1")])?;
    expect(shot.records as usize <= shot.covered(), format!("{} records for {} pixels", shot.records, shot.covered()))
}

fn radius_to_infinity(bench: &Bench<'_>) -> Seen {
    let shot = furnace_like(bench, &Room::open(), &[])?;
    Ok(format!("{:.1e} off {:.4} at most, {} records", shot.farthest(bench.furnace()), bench.furnace(), shot.records))
}

fn triangles(bench: &Bench<'_>) -> Seen {
    let room = Room::furnace()
        .with("Box(min: (-1, -1, -1), max: (1, 1, 1))")
        .with("Triangles(positions: [(0, 0, 0), (0.5, 0, 0), (0.25, 0, 0), (0, 0.5, 0), (0, 0.5, 0)], indices: [(0, 1, 2), (0, 3, 4), (0, 0, 0)])")
        .with("Triangles(positions: [(-0.9, -0.5, 0), (0.9, 0.5, 0), (0.9, 0.5, 0.000002)], indices: [(0, 1, 2)])")
        .with("Triangles(positions: [(-1, -1, 0.3), (1, -1, 0.3), (0, -0.999998, 0.3)], indices: [(0, 1, 2)])");
    let shot = furnace_like(bench, &room, &[])?;
    Ok(format!("{:.1e} off {:.4} at most, {} records", shot.farthest(bench.furnace()), bench.furnace(), shot.records))
}

fn huge_triangle(bench: &Bench<'_>) -> Seen {
    bench.expect_no_shown_lightmap()?;
    bench.expect_no_pass("PhotonMap", "nearly all photons go to the square, and few to the corner")?;
    let square = r#"Quad(corners: ((-1000, -9, -1000), (-1000, -9, 1000), (1000, -9, 1000), (1000, -9, -1000)), material: "floor")"#;
    let [alone, above] = [Room::corner(), Room::corner().with(square)].map(|room| bench.shot(&room, &RECORD_A_PIXEL));
    let off = above?.distance(&alone?, 1.0);
    expect(off <= 0.01, format!("{} off", told(off)))
}

fn camera_in_a_wall(bench: &Bench<'_>) -> Seen {
    let block = "Box(min: (-0.3, -1, -0.3), max: (0.3, 0.2, 0.3))";
    let eyes = [DVec3::new(1.0, 0.1, 0.2), DVec3::new(1.0, -1.0, 0.2), DVec3::new(0.0, -0.4, 0.0)];
    let told = |eye| {
        let view = View { eye, target: DVec3::new(0.1, 0.3, -0.2), field_of_view: 90.0 };
        Ok(furnace_like(bench, &Room::furnace().with(block).seen_from(view), &[])?.covered().to_string())
    };
    let covered = eyes.into_iter().map(told).collect::<Result<Vec<_>, Trouble>>()?;
    Ok(format!("{} pixels see a surface", covered.join(", ")))
}

fn no_lights(bench: &Bench<'_>) -> Seen {
    let shot = bench.shot(&Room::corner().without_light(), &[])?;
    expect(shot.picture.iter().all(|value| *value == 0.0) && shot.values().all(|value| value == 0.0), format!("black, {} records", shot.records))
}

fn empty_view(bench: &Bench<'_>) -> Seen {
    let away = View { eye: DVec3::new(0.0, 1.0, 0.0), target: DVec3::new(0.0, 2.0, 0.1), field_of_view: 60.0 };
    let shot = bench.shot(&Room::open().seen_from(away), &[])?;
    let is_sky = shot.covered() == 0 && shot.records == 0 && shot.picture.iter().all(|value| *value == 1.0);
    expect(is_sky, format!("{} records, {} pixels see a surface", shot.records, shot.covered()))
}

fn accuracy_beyond(bench: &Bench<'_>) -> Seen {
    bench.expect_pass("RecordCache")?;
    expect_refused(["0", "-1", "NaN", "1e9"].map(|accuracy| (accuracy, bench.accepts(&Room::corner(), &[("RecordCache", "accuracy", accuracy)]))))
}

fn records_beyond(bench: &Bench<'_>) -> Seen {
    bench.expect_pass("RecordCache")?;
    expect_refused([("10⁶", bench.accepts(&Room::corner(), &[("RecordCache", "capacity", "1000000")]))])
}

/// Addends that repeat are rounded alike while the sum stays within a power of two: the error grows with their number, not with its root.
fn copies(bench: &Bench<'_>, count: u32, tolerance: f64) -> Seen {
    bench.expect_pass("RecordCache")?;
    bench.expect_no_pass("PhotonPlaces", "records of photons join those that were there")?;
    let [alone, crowded] = bench.shots_with_copies(&Room::corner(), count)?;
    let off = crowded.distance(&alone, 1.0);
    expect(off <= tolerance && crowded.records == count, format!("{off:.1e} off with {} records", crowded.records))
}

//! Made pictures whose errors have the same size and look unlike: the measures must rank them as people do.

use hemisplat::math::windows::Windows;
use hemisplat::measure::{Errors, Layer, Layers, PICTURE, WINDOWS, compare};

const WIDTH: u32 = 320;
const HEIGHT: u32 = 256;
/// The size of every error, as a share of the mean.
const SIZE: f64 = 0.05;

/// A uniform number in 0..1 that depends on its index alone.
fn uniform(index: u32) -> f64 {
    let mut bits = index.wrapping_mul(0x9e37_79b9).wrapping_add(0x7f4a_7c15);
    bits = (bits ^ (bits >> 16)).wrapping_mul(0x85eb_ca6b);
    bits = (bits ^ (bits >> 13)).wrapping_mul(0xc2b2_ae35);
    f64::from(bits ^ (bits >> 16)) / f64::from(u32::MAX)
}

/// A board with a slanted outline before a wall.
fn is_board(x: f64, y: f64) -> bool {
    let (across, down) = (x - 150.0 + 0.3 * (y - 120.0), y - 120.0 - 0.2 * (x - 150.0));
    across.abs() < 60.0 && down.abs() < 50.0
}

/// The light on board and wall, changing slowly along both.
fn light(x: f64, y: f64) -> f64 {
    if is_board(x, y) { 1.6 - 0.002 * y } else { 0.8 + 0.001 * x }
}

fn plane(value: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    (0..WIDTH * HEIGHT).map(|at| value(f64::from(at % WIDTH), f64::from(at / WIDTH))).collect()
}

fn picture(light: &[f64]) -> Layers {
    let as_floats = |plane: Vec<f64>| Layer::value(plane.into_iter().map(|value| value as f32).collect());
    let normals: Vec<f32> = (0..WIDTH * HEIGHT).flat_map(|_| [0.0, 0.0, 1.0]).collect();
    Layers::new(WIDTH, HEIGHT)
        .with("irradiance", as_floats(light.to_vec()))
        .with(PICTURE, as_floats(light.to_vec()))
        .with("depth", as_floats(plane(|x, y| if is_board(x, y) { 5.0 } else { 8.0 })))
        .with("normal", Layer::interleaved(&["X", "Y", "Z"], &normals, 3))
}

/// The truth with an error, scaled to [`SIZE`].
fn wrong(error: &[f64]) -> Layers {
    let truth = plane(light);
    let mean = truth.iter().sum::<f64>() / truth.len() as f64;
    let bias = error.iter().sum::<f64>() / error.len() as f64;
    let size = (error.iter().map(|error| (error - bias).powi(2)).sum::<f64>() / error.len() as f64).sqrt();
    picture(&truth.iter().zip(error).map(|(light, error)| light + (error - bias) / size * SIZE * mean).collect::<Vec<_>>())
}

fn errors(test: &Layers) -> Errors {
    compare(test, &picture(&plane(light)), "irradiance", None).unwrap()
}

fn noise() -> Vec<f64> {
    (0..WIDTH * HEIGHT).map(|at| uniform(at) - 0.5).collect()
}

/// Discs of 5 to 9 pixels' radius, too bright or too dark, as records leave them that know too little.
fn discs() -> Vec<f64> {
    let disc = |index: u32| {
        let of = |what: u32| uniform(index * 4 + what + 1_000_000);
        let size = if of(3) < 0.5 { -1.0 } else { 1.0 };
        (of(0) * f64::from(WIDTH), of(1) * f64::from(HEIGHT), 5.0 + 4.0 * of(2), size)
    };
    let discs: Vec<_> = (0..300).map(disc).collect();
    plane(|x, y| discs.iter().map(|(cx, cy, radius, size)| if (x - cx).hypot(y - cy) < *radius { *size } else { 0.0 }).sum())
}

fn streaks() -> Vec<f64> {
    plane(|x, y| ((x + 0.4 * y) / 2.2).sin() * (1.0 + 0.5 * (y / 40.0).sin()))
}

/// The truth blurred over everything, less the truth.
fn blur() -> Vec<f64> {
    let weight = |d: i32| (-f64::from(d * d) / 8.0).exp();
    let taps: Vec<(f64, f64, f64)> = (-7..=7).flat_map(|dy| (-7..=7).map(move |dx| (f64::from(dx), f64::from(dy), weight(dx) * weight(dy)))).collect();
    let total: f64 = taps.iter().map(|(_, _, weight)| weight).sum();
    plane(|x, y| taps.iter().map(|(dx, dy, weight)| light(x + dx, y + dy) * weight).sum::<f64>() / total - light(x, y))
}

/// The outline a pixel too far to one side, from row to row and column to column another one.
fn jags() -> Vec<f64> {
    let shift = |line: f64, seed: u32| (3.0 * uniform(line as u32 + seed)).floor() - 1.0;
    plane(|x, y| light(x + shift(y, 5000), y + shift(x, 9000)) - light(x, y))
}

fn drift() -> Vec<f64> {
    plane(|x, y| (x / 60.0).sin() + (y / 70.0).cos())
}

/// Each error by what it is called.
fn all() -> Vec<(&'static str, Errors)> {
    [("noise", noise()), ("discs", discs()), ("streaks", streaks()), ("blur", blur()), ("jags", jags()), ("drift", drift())]
        .map(|(name, error)| (name, errors(&wrong(&error))))
        .into()
}

fn ranked(metric: &str) -> Vec<(&'static str, f64)> {
    let mut found: Vec<_> = all().into_iter().map(|(name, errors)| (name, errors.metric(metric).flatten().unwrap())).collect();
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    found
}

fn of(ranked: &[(&str, f64)], name: &str) -> f64 {
    ranked.iter().find(|found| found.0 == name).unwrap().1
}

#[test]
fn all_have_the_same_rmse() {
    for (name, errors) in all() {
        assert!((errors.rmse_over_mean / SIZE - 1.0).abs() < 1e-3, "{name}: {}", errors.rmse_over_mean);
        assert!((0.02..0.06).contains(&errors.edge_share.unwrap()), "{:?}", errors.edge_share);
    }
}

#[test]
fn discs_and_streaks_are_the_worst_of_bands_and_noise_comes_far_behind() {
    let found = ranked("band_error");
    let [discs, streaks, noise, blur, jags, drift] = ["discs", "streaks", "noise", "blur", "jags", "drift"].map(|name| of(&found, name));
    assert!(discs.min(streaks) > 1.7 * noise && discs.min(streaks) > 0.6 * SIZE, "{found:?}");
    assert!(noise > jags && noise > drift && noise > blur, "{found:?}");
    assert!(jags < 0.02 * SIZE, "a jag is no splotch: {found:?}");
}

#[test]
fn jags_are_the_worst_of_edges_and_the_least_inside() {
    let found = ranked("rmse_edges");
    assert_eq!((found[0].0, found[1].0), ("jags", "blur"), "{found:?}");
    assert!(found[1].1 > 4.0 * found[2].1, "{found:?}");
    let inside = ranked("rmse_interior");
    assert_eq!(inside[5].0, "jags", "{inside:?}");
    assert!(inside[5].1 < 0.1 * SIZE && of(&inside, "noise") > 0.95 * SIZE && of(&inside, "discs") > 0.9 * SIZE, "{inside:?}");
}

/// Noise of the reference is no error at edges, inside or in the band: what is left is that of the picture.
#[test]
fn noise_of_the_reference_is_taken_off_in_every_part() {
    let error = 0.04;
    let truth = plane(light);
    let noisy: Vec<f64> = truth.iter().zip(noise()).map(|(light, noise)| light + 0.4 * noise).collect();
    let variance = Layer::value(vec![(0.4f32).powi(2) / 12.0; truth.len()]);
    let reference = picture(&noisy).with("variance", variance);
    let test = wrong(&discs().iter().map(|disc| disc * error).collect::<Vec<_>>());
    let exact = errors(&test);
    let found = compare(&test, &reference, "irradiance", None).unwrap();
    for metric in ["rmse_edges", "rmse_interior", "band_error"] {
        let [exact, found] = [&exact, &found].map(|errors| errors.metric(metric).flatten().unwrap());
        assert!((found / exact - 1.0).abs() < 0.08, "{metric}: {found} in place of {exact}");
    }
    let raw = compare(&test, &picture(&noisy), "irradiance", None).unwrap();
    assert!(raw.band_error.unwrap() > 1.2 * exact.band_error.unwrap(), "the noise is not small");
}

/// The truth in windows: what lies between them is 0 and counts for nothing.
fn in_windows(windows: &Windows) -> Layers {
    let inside = windows.mask([WIDTH, HEIGHT], 0);
    let mut truth = picture(&plane(light)).with_attribute(WINDOWS, windows);
    let planes = truth.layers.values_mut().flat_map(|layer| layer.channels.values_mut());
    planes.for_each(|plane| plane.iter_mut().zip(&inside).filter(|(_, inside)| !**inside).for_each(|(value, _)| *value = 0.0));
    truth
}

#[test]
fn windows_measure_what_the_whole_picture_measures() {
    let whole = Windows::spread([WIDTH, HEIGHT], 20).unwrap();
    assert!(whole.mask([WIDTH, HEIGHT], 0).into_iter().all(|inside| inside), "20 windows are the whole picture");
    for (name, error) in [("noise", noise()), ("discs", discs()), ("jags", jags())] {
        let test = wrong(&error);
        let (exact, found) = (errors(&test), compare(&test, &in_windows(&whole), "irradiance", None).unwrap());
        assert_eq!((found.windows, found.pixels, found.rmse_over_mean), (Some(20), exact.pixels, exact.rmse_over_mean), "{name}");
        // Blocks of 10 pixels do not fill a window, edges and FLIP leave out its border: other pixels, the same size of error.
        for metric in ["rmse_edges", "rmse_interior", "band_error", "block_p50", "flip", "hdr_flip"] {
            let [exact, found] = [&exact, &found].map(|errors| errors.metric(metric).flatten().unwrap());
            assert!((found / exact - 1.0).abs() < 0.2 || found.max(exact) < 0.003, "{name}, {metric}: {found} in place of {exact}");
        }
        let few = compare(&test, &in_windows(&Windows::spread([WIDTH, HEIGHT], 5).unwrap()), "irradiance", None).unwrap();
        assert_eq!((few.windows, few.pixels, few.stride), (Some(5), 5 * 64 * 64, 1));
        assert!(few.flip.is_some() && few.block_p99.is_some() && few.band_error.is_some());
    }
}

/// What lies outside of the windows cannot be seen in any number.
#[test]
fn nothing_outside_of_the_windows_counts() {
    let windows = Windows::spread([WIDTH, HEIGHT], 3).unwrap();
    let truth = in_windows(&windows);
    let mask = windows.mask([WIDTH, HEIGHT], 0);
    let with = |outside: f64| wrong_outside(&discs(), &mask, outside);
    let found = compare(&with(0.0), &truth, "irradiance", None).unwrap();
    assert_eq!(compare(&with(1e3), &truth, "irradiance", None).unwrap(), found);
    let place = (found.largest.y * WIDTH + found.largest.x) as usize;
    assert!(mask[place]);
}

fn wrong_outside(error: &[f64], mask: &[bool], outside: f64) -> Layers {
    let light = plane(light).into_iter().zip(error).zip(mask).map(|((light, error), inside)| if *inside { light + 0.05 * error } else { outside });
    picture(&light.collect::<Vec<_>>())
}

#[test]
fn what_cannot_be_told_is_null() {
    let truth = picture(&plane(light));
    let test = wrong(&discs());
    let without = |picture: &Layers| Layers { layers: [("irradiance".to_owned(), picture.layers["irradiance"].clone())].into(), ..picture.clone() };
    let parts = |errors: &Errors| [errors.edge_share, errors.rmse_edges, errors.rmse_interior, errors.band_error].map(|value| value.is_some());
    let against = |test: &Layers, truth: &Layers| parts(&compare(test, truth, "irradiance", None).unwrap());
    assert_eq!(against(&without(&test), &without(&truth)), [false; 4]);
    assert_eq!(against(&without(&test), &truth), [true; 4]);
    // Where the truth has no geometry, the picture's decides.
    let [known, found] = [&truth, &without(&truth)].map(|truth| compare(&test, truth, "irradiance", None).unwrap());
    let of_geometry = |errors: &Errors| ["rmse_edges", "rmse_interior", "band_error"].map(|metric| (errors.metric(metric), errors.interval(metric)));
    assert_eq!((known.edge_share, of_geometry(&known)), (found.edge_share, of_geometry(&found)));
    let strided = strided(&truth, 4);
    assert_eq!(against(&without(&test), &strided), [false; 4], "neighbours of a strided truth are no neighbours");
    assert_eq!(against(&test, &strided), [true, true, true, false], "the picture tells its edges, but the band needs every pixel");
    let share = compare(&test, &strided, "irradiance", None).unwrap().edge_share.unwrap();
    assert!((share / known.edge_share.unwrap() - 1.0).abs() < 0.15, "{share}");
}

fn strided(picture: &Layers, stride: u32) -> Layers {
    let places = |length: u32| (stride / 2..length).step_by(stride as usize);
    let taken: Vec<usize> = places(HEIGHT).flat_map(|y| places(WIDTH).map(move |x| (y * WIDTH + x) as usize)).collect();
    let mut small = Layers { width: WIDTH / stride, height: HEIGHT / stride, ..picture.clone() }.with_attribute("stride", stride);
    let planes = small.layers.values_mut().flat_map(|layer| layer.channels.values_mut());
    planes.for_each(|plane| *plane = taken.iter().map(|at| plane[*at]).collect());
    small
}

/// The errors of each made picture, as the book has them.
fn table() -> String {
    let names = ["rmse_over_mean", "rmse_edges", "rmse_interior", "band_error", "flip"];
    let row = |(name, errors): (&str, Errors)| {
        let told = |metric: &&str| {
            let value = errors.metric(metric).flatten().unwrap();
            if Errors::is_share(metric) { format!(" {:.1} % |", 100.0 * value) } else { format!(" {value:.3} |") }
        };
        format!("| {name} |{}\n", names.iter().map(told).collect::<String>())
    };
    let mut rows = all();
    rows.sort_by(|a, b| b.1.band_error.unwrap().total_cmp(&a.1.band_error.unwrap()));
    let head = names.map(|name| format!(" `{name}` |")).concat();
    format!("| |{head}\n|{}\n{}", "---|".repeat(names.len() + 1), rows.into_iter().map(row).collect::<String>())
}

#[test]
fn the_book_has_their_errors() {
    let page = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/metrics.md")).unwrap();
    assert!(page.contains(&table()), "docs/metrics.md should have\n{}", table());
}

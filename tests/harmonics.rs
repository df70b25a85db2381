//! What Gautron's thesis says of its figures 3.9 and 3.10, count by count: docs/harmonics.md has the verdicts that are found here.

use glam::{Vec2, Vec3};
use hemisplat::math::harmonics::families::Family;
use hemisplat::math::lobe::{Lobe, Shape};
use std::{fs, path::Path};

/// As many coefficients as spherical harmonics of order 3, 5, 7 and 10 have.
const COUNTS: [usize; 4] = [9, 25, 49, 100];
/// Shares of the energy that lie closer than this are the same, and those of two that are said to be alike, closer than that.
const SAME: f64 = 0.001;
const ALIKE: f64 = 0.01;

/// What the thesis says hemispherical harmonics hold beside another family.
enum Claim {
    More,
    Less,
    AsMuch,
}

/// The share that a family's functions hold, no more of them than these.
fn held(family: Family, most: usize, shape: Shape) -> f64 {
    let lobe = Lobe { shape, reflectance: Vec3::ONE };
    let outgoing = Vec3::new(0.5, 0.0, 0.75f32.sqrt());
    let value = |direction: [f64; 3]| f64::from(lobe.value(outgoing, Vec3::from(direction.map(|x| x as f32))).x);
    let count = |order: usize| match family {
        Family::EvenReflected | Family::Zernike => order * (order + 1) / 2,
        _ => order * order,
    };
    let order = (1..).take_while(|order| count(*order) <= most).last().unwrap_or(1);
    family.captured(order, value).0
}

/// Less is held by the other for `more` > 0.
fn verdict(claim: &Claim, more: f64) -> &'static str {
    match claim {
        Claim::AsMuch if more.abs() <= ALIKE => "agrees",
        Claim::AsMuch if more > 0.0 => "better",
        Claim::AsMuch => "differs",
        Claim::More | Claim::Less if more.abs() <= SAME => "the same",
        Claim::More if more > 0.0 => "agrees",
        Claim::Less if more < 0.0 => "agrees",
        Claim::More | Claim::Less => "differs",
    }
}

#[test]
fn verdicts_on_figures_are_those_of_the_book() {
    let phong = Shape::Phong { exponent: 5.0 };
    let ward = Shape::Ward { alpha: Vec2::new(0.2, 0.5) };
    let claims = [
        ("3.9, Phong 5", "more than spherical harmonics", phong, Family::Spherical, Claim::More),
        ("", "more than even-reflected ones", phong, Family::EvenReflected, Claim::More),
        ("", "more than Zernike's", phong, Family::Zernike, Claim::More),
        ("", "as much as Makhotkin's", phong, Family::Jacobi, Claim::AsMuch),
        ("3.10, Ward 0.2, 0.5", "more than spherical harmonics", ward, Family::Spherical, Claim::More),
        ("", "less than even-reflected ones", ward, Family::EvenReflected, Claim::Less),
        ("", "as much as Zernike's", ward, Family::Zernike, Claim::AsMuch),
        ("", "as much as Makhotkin's", ward, Family::Jacobi, Claim::AsMuch),
    ];
    let page = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/harmonics.md")).unwrap();
    for (figure, words, shape, family, claim) in claims {
        let found = COUNTS.map(|most| verdict(&claim, held(Family::Hemispherical, most, shape) - held(family, most, shape)));
        let row = format!("| {figure} | {words} | {} |", found.join(" | ")).replace("|  |", "| |");
        assert!(page.contains(&row), "the page does not have\n{row}");
    }
}

//! Hemisphere tables: what each sample of a tile stands for, whatever the tile's shape.
//!
//! A tile holds one hemisphere as samples (radiance and distance each). A table says, computed once in double
//! precision, how to sum them: every sample's share of the irradiance and of the rotation gradient, and the walls
//! between neighbouring samples that carry the translation gradient. One summation kernel serves all shapes.
//!
//! The hemisphere is cut into regions, each owned by one sample; neighbouring regions share a wall. A compensation is
//! no exception: the band below a border pixel is one more region of that pixel, the line between two bands one more
//! wall. With `∫ ω dω` the region's moment m (see [`super::solid_angle`]), its cosine-weighted solid angle is `m_z`
//! and its rotation gradient per radiance `z × m`; a wall of unit tangent n from sample a to sample b moves by
//! `−δ·n/r` when the point moves by δ, so that it adds `(L_b − L_a) ∫ cosθ n/r dℓ` to the gradient, r the distance of
//! the nearer surface. On a raster plane `r = depth·√(1+u²+v²)`, and the integral becomes `∫ dv/(1+u²+v²)²`.

mod concentric;

pub use concentric::{ray, square};

use super::solid_angle::{
    Interval, disc_moment, disc_solid_angle, disc_wall, line_moment, polygon_moment, polygon_solid_angle, rectangle_moment, rectangle_solid_angle,
};
use glam::{DVec2, DVec3, Vec3};
use std::f64::consts::{PI, TAU};

/// Samples along a side of a tile: least and most.
pub const RESOLUTION: [u32; 2] = [4, 512];

/// Full opening angle of a plane in degrees: least and most. Beyond it a plane has all its pixels near the horizon.
pub const FIELD_OF_VIEW: [f64; 2] = [10.0, 175.0];

/// How directions are laid out in a tile of resolution N.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// One raster of N×N pixels along the normal; `fov_degrees` is the full angle (126.87 has half width 2 at
    /// distance 1). Incomplete: leaves out all below its edge.
    Plane { fov_degrees: f64 },
    /// Five rasters, N×N along the normal and four of N×N/2 above the horizon, in a tile of N×3N. N is even.
    Hemicube,
    /// N×N over the square around the unit disc: a pixel is the x and y of its unit direction, so that equal areas
    /// have equal cosine-weighted solid angles. Pixels whose centre is outside the disc are unused.
    Hemispherical,
    /// N×N strata of equal cosine-weighted solid angle, rows by sin²θ from the normal down, columns by azimuth.
    /// For rays; has no raster view.
    Cosine,
    /// N×N strata of equal cosine-weighted solid angle, squares of the square that Shirley and Chiu (1997) map to the unit
    /// disc: nearly as wide as high, and none is cut by the horizon. Rays are shifted within their strata. For rays; has no raster view.
    Concentric,
}

impl Shape {
    /// Whether it leaves directions above the horizon out.
    pub fn is_incomplete(self) -> bool {
        matches!(self, Self::Plane { .. })
    }
}

/// How an incomplete shape makes up for the directions it leaves out. Complete shapes need none and ignore it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Not at all: the exact integrals of the pixels alone.
    None,
    /// The unseen has the mean brightness of the seen (Larsen and Christensen 2004): each measure is divided by the
    /// fraction of it that is seen, the translation gradient by the cosine's fraction, so that it stays in proportion
    /// to the irradiance. The rotation gradient is not divided: a remainder that is equally bright all around has none.
    CoverageRatio,
    /// Each border pixel also stands for the band between its outer edge and the horizon (Gautron 2005, 5.2).
    #[default]
    BorderExtension,
    /// The same with the plain weights in place of the cosine-weighted ones, each times its pixel's own cosine, as the formula of the slides reads:
    /// they add up to 1.17 π. A mistake, kept to see what it costs.
    ConfusedMeasure,
}

/// How to sum the samples of one tile.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Samples along a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width · height` samples, row by row.
    pub samples: Vec<Sample>,
    /// Walls between neighbouring samples, each pair once, sorted by `(a, b)`.
    pub edges: Vec<Edge>,
    /// Of each four samples that are neighbours all around, the last one's index: the others are before it, above it, and before that.
    pub blocks: Vec<u32>,
    /// The rasters that fill the tile; empty for shapes that need rays.
    pub views: Vec<View>,
}

/// What one sample stands for, in the record's frame (z is the normal). A sample without weight is unused: it has no
/// edges, and its radiance must not be read.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sample {
    /// Unit direction.
    pub direction: [f64; 3],
    /// `∫ cosθ dω`, compensation included; a complete tile adds to π.
    pub cosine_weight: f64,
    /// `∫ dω` in sr, compensation included; a complete tile adds to 2π.
    pub plain_weight: f64,
    /// x and y of `∫ (n × ω) dω`, compensation included.
    pub rotation: [f64; 2],
    /// Distance times this is the depth that edges divide by: the cosine to a raster's axis, 1 for other shapes.
    pub depth_cosine: f64,
}

/// A wall between two samples: with d = min(depth_a, depth_b), `∇E += (L_b − L_a) · gradient / d` and
/// `HE += (L_b − L_a) · hessian / d²`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edge {
    /// Index of the one sample, less than `b`.
    pub a: u32,
    pub b: u32,
    /// In the record's frame; the z component is the derivative along the normal.
    pub gradient: [f64; 3],
    /// xx, xy and yy of the second derivatives along the surface.
    pub hessian: [f64; 3],
}

/// A camera at the record, in the record's frame, that fills a rectangle of the tile. Pixel centres are the
/// directions of the samples there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Unit axes of a right-handed camera: right of the picture, up in the picture, into the picture
    /// (`right = forward × up`).
    pub right: DVec3,
    pub up: DVec3,
    pub forward: DVec3,
    /// The window at distance 1 along `forward`, left and bottom; for a non-linear view the x and y of unit directions.
    pub minimum: DVec2,
    /// Right and top of the window.
    pub maximum: DVec2,
    /// x, y, width, height in the tile, rows from the top.
    pub rectangle: [u32; 4],
    /// A perspective projection; otherwise the picture plane is x and y of the unit direction (right, up), and
    /// triangles must be small for their edges to come out straight.
    pub linear: bool,
}

/// Why there is no table.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum TableError {
    #[error("a hemisphere of {0} samples a side: it takes {min} to {max}", min = RESOLUTION[0], max = RESOLUTION[1])]
    Resolution(u32),
    #[error("a hemicube of {0} samples a side: its half faces need an even number")]
    OddHemicube(u32),
    #[error("a plane with a field of view of {0} degrees: it takes {min} to {max}", min = FIELD_OF_VIEW[0], max = FIELD_OF_VIEW[1])]
    FieldOfView(f64),
}

impl Shape {
    /// Width and height of a tile of `resolution` N [samples].
    pub fn size(self, resolution: u32) -> [u32; 2] {
        [resolution, if self == Self::Hemicube { 3 * resolution } else { resolution }]
    }

    /// The column and row of the sample of a tile that a direction in its frame falls on, of any length, not below the horizon: of the shapes Hemispherical and Hemicube.
    pub fn sample_at(self, resolution: u32, direction: Vec3) -> Option<[u32; 2]> {
        let at = |share: f32, samples: u32| ((0.5 * (share + 1.0) * samples as f32) as u32).min(samples - 1);
        match self {
            Self::Hemispherical => {
                let flat = direction.truncate() / direction.length();
                Some([at(flat.x, resolution), at(flat.y, resolution)])
            }
            Self::Hemicube => {
                let Vec3 { x, y, z } = direction;
                if z >= x.abs().max(y.abs()) {
                    return Some([at(x / z, resolution), at(y / z, resolution)]);
                }
                let [side, forward, right] = if x.abs() >= y.abs() {
                    if x > 0.0 { [0.0, x, -y] } else { [2.0, -x, y] }
                } else if y < 0.0 {
                    [1.0, -y, -x]
                } else {
                    [3.0, y, x]
                };
                // Upper halves of the upright faces, from the top face's edge down.
                let row = (((1.0 - z / forward) * 0.5 * resolution as f32) as u32).min(resolution / 2 - 1);
                Some([at(right / forward, resolution), resolution + side as u32 * (resolution / 2) + row])
            }
            _ => None,
        }
    }
}

impl Table {
    /// The table of a tile of `resolution` N, see [`Shape`].
    ///
    /// # Errors
    /// A resolution outside [`RESOLUTION`], an odd one for the hemicube, a field of view outside [`FIELD_OF_VIEW`].
    pub fn new(shape: Shape, resolution: u32, method: Method) -> Result<Self, TableError> {
        if !(RESOLUTION[0]..=RESOLUTION[1]).contains(&resolution) {
            return Err(TableError::Resolution(resolution));
        }
        match shape {
            Shape::Plane { fov_degrees } if !(FIELD_OF_VIEW[0]..=FIELD_OF_VIEW[1]).contains(&fov_degrees) => Err(TableError::FieldOfView(fov_degrees)),
            Shape::Plane { fov_degrees } => Ok(plane((fov_degrees.to_radians() / 2.0).tan(), resolution, method)),
            Shape::Hemicube if resolution % 2 == 1 => Err(TableError::OddHemicube(resolution)),
            Shape::Hemicube => Ok(hemicube(resolution)),
            Shape::Hemispherical => Ok(hemispherical(resolution)),
            Shape::Cosine => Ok(cosine(resolution)),
            Shape::Concentric => Ok(concentric::table(resolution)),
        }
    }

    /// The blocks of samples that have walls between them.
    fn walled_blocks(&self) -> Vec<u32> {
        let (width, count) = (self.width as usize, self.samples.len());
        let [mut before, mut above] = [vec![false; count], vec![false; count]];
        for edge in &self.edges {
            let (a, b) = (edge.a as usize, edge.b as usize);
            before[b] |= b == a + 1 && b % width > 0;
            above[b] |= b == a + width;
        }
        let is_block = |last: &usize| before[*last] && above[*last] && before[last - width] && above[last - 1];
        (0..count).filter(is_block).map(|last| last as u32).collect()
    }

    /// How many times as much all samples stand for as the blocks' last ones do, in squares of weights.
    pub fn block_share(&self) -> f64 {
        let square = |sample: &Sample| sample.cosine_weight * sample.cosine_weight;
        let of_blocks: f64 = self.blocks.iter().map(|last| square(&self.samples[*last as usize])).sum();
        if of_blocks > 0.0 { self.samples.iter().map(square).sum::<f64>() / of_blocks } else { 0.0 }
    }
}

impl View {
    /// A view along the normal: x grows with the column, y with the row.
    fn along_normal(half: f64, resolution: u32, linear: bool) -> Self {
        let half = DVec2::splat(half);
        let rectangle = [0, 0, resolution, resolution];
        Self { right: DVec3::X, up: DVec3::NEG_Y, forward: DVec3::Z, minimum: -half, maximum: half, rectangle, linear }
    }

    /// Unit direction of the centre of a pixel, counted within the rectangle; none where a non-linear view has none.
    pub fn direction(&self, column: u32, row: u32) -> Option<DVec3> {
        let [u, v] = [self.column(column), self.row(row)].map(|[low, high]| (low + high) / 2.0);
        if self.linear {
            return Some(self.to_local(DVec3::new(u, v, 1.0)).normalize());
        }
        let square = 1.0 - u * u - v * v;
        (square > 0.0).then(|| self.to_local(DVec3::new(u, v, square.sqrt())))
    }

    /// Bounds of a column of pixels in the window.
    fn column(&self, column: u32) -> Interval {
        let step = (self.maximum.x - self.minimum.x) / f64::from(self.rectangle[2]);
        [column, column + 1].map(|i| self.minimum.x + f64::from(i) * step)
    }

    /// Bounds of a row of pixels in the window, lower one first.
    fn row(&self, row: u32) -> Interval {
        let step = (self.maximum.y - self.minimum.y) / f64::from(self.rectangle[3]);
        [row + 1, row].map(|i| self.maximum.y - f64::from(i) * step)
    }

    /// From (right, up, forward) to the record's frame.
    fn to_local(self, v: DVec3) -> DVec3 {
        self.right * v.x + self.up * v.y + self.forward * v.z
    }

    /// The wall at `u` over the interval `v` of the window, towards larger u.
    fn wall_across_u(&self, u: f64, v: Interval) -> Wall {
        let gradient = self.to_local(line_moment(u, v)).z * (self.right - self.forward * u);
        Wall { gradient, ends: v.map(|v| self.to_local(DVec3::new(u, v, 1.0))) }
    }

    /// The wall at `v` over the interval `u` of the window, towards larger v.
    fn wall_across_v(&self, v: f64, u: Interval) -> Wall {
        let moment = line_moment(v, u);
        let gradient = self.to_local(DVec3::new(moment.y, moment.x, moment.z)).z * (self.up - self.forward * v);
        Wall { gradient, ends: u.map(|u| self.to_local(DVec3::new(u, v, 1.0))) }
    }
}

/// Where two samples meet, at depth 1.
#[derive(Clone, Copy)]
struct Wall {
    /// What the irradiance changes by, per step of radiance across the wall.
    gradient: DVec3,
    ends: [DVec3; 2],
}

impl Wall {
    /// Along the circle of a polar angle (sine, cosine), between two azimuths (cosine, sine) so far apart, away from the normal.
    fn along_parallel(polar: DVec2, azimuths: [DVec2; 2], width: f64) -> Self {
        let (DVec2 { x: sine, y: cosine }, [from, to]) = (polar, azimuths);
        // ∫ (cosφ, sinφ) dφ
        let azimuth = -(to - from).perp();
        let gradient = (azimuth * cosine).extend(-sine * width) * (cosine * sine);
        Self { gradient, ends: azimuths.map(|azimuth| (azimuth * sine).extend(cosine)) }
    }

    /// xx, xy, yy of the second derivatives along the surface, per step of radiance across the wall: those of Lambert's
    /// formula `E = ½ ΔL θ ĉ·n` for the segment from r₀ to r₁, with `θ ĉ = r₀×r₁ / (|r₀||r₁|)` as θ is small. `r₀×r₁`
    /// is linear in the point, so that only the lengths are differentiated twice: no arc cosine, no differences of
    /// nearly equal numbers, and 0 where the radiance is uniform.
    fn hessian(&self) -> [f64; 3] {
        let [a, b] = self.ends;
        let [along_a, along_b] = self.ends.map(|r| r / r.length_squared());
        let lengths = 1.0 / (a.length() * b.length());
        let (height, lift) = (a.cross(b).z, (b - a).cross(DVec3::Z));
        // Derivatives of height and of the lengths' factor.
        let (first, both) = (-lift, along_a + along_b);
        let second = |i: usize, j: usize| {
            let lengths_twice = both[i] * both[j] + 2.0 * (along_a[i] * along_a[j] + along_b[i] * along_b[j])
                - if i == j { 1.0 / a.length_squared() + 1.0 / b.length_squared() } else { 0.0 };
            0.5 * lengths * (first[i] * both[j] + first[j] * both[i] + height * lengths_twice)
        };
        // Lambert's sum runs counterclockwise; the gradient knows on which side of the wall it is.
        let gradient = (first + both * height) * (0.5 * lengths);
        let sign = gradient.dot(self.gradient).signum();
        [second(0, 0), second(0, 1), second(1, 1)].map(|h| sign * h)
    }
}

/// A table in the making: regions and walls in any order.
struct Builder {
    table: Table,
}

impl Builder {
    fn new(width: u32, height: u32) -> Self {
        let samples = vec![Sample::default(); width as usize * height as usize];
        Self { table: Table { width, height, samples, edges: Vec::new(), blocks: Vec::new(), views: Vec::new() } }
    }

    /// Index of the pixel of a view.
    fn index(&self, view: &View, column: u32, row: u32) -> u32 {
        (view.rectangle[1] + row) * self.table.width + view.rectangle[0] + column
    }

    fn place(&mut self, index: u32, direction: DVec3, depth_cosine: f64) {
        let sample = &mut self.table.samples[index as usize];
        sample.direction = direction.to_array();
        sample.depth_cosine = depth_cosine;
    }

    /// A region that `owner` stands for.
    fn region(&mut self, owner: u32, moment: DVec3, solid_angle: f64) {
        let sample = &mut self.table.samples[owner as usize];
        sample.cosine_weight += moment.z;
        sample.plain_weight += solid_angle;
        sample.rotation[0] -= moment.y;
        sample.rotation[1] += moment.x;
    }

    /// A wall between a region of sample `from` and one of sample `to`, whose normal points to the latter.
    fn wall(&mut self, from: u32, to: u32, wall: Wall) {
        if from != to && wall.gradient != DVec3::ZERO {
            let sign = if from < to { 1.0 } else { -1.0 };
            let [gradient, hessian] = [wall.gradient.to_array(), wall.hessian()].map(|all| all.map(|x| sign * x));
            self.table.edges.push(Edge { a: from.min(to), b: from.max(to), gradient, hessian });
        }
    }

    /// All pixels of a perspective view, and the walls between them.
    fn face(&mut self, view: View) {
        let [_, _, width, height] = view.rectangle;
        for (row, column) in grid(width, height) {
            let (u, v, index) = (view.column(column), view.row(row), self.index(&view, column, row));
            let direction = view.to_local(DVec3::new((u[0] + u[1]) / 2.0, (v[0] + v[1]) / 2.0, 1.0)).normalize();
            self.place(index, direction, direction.dot(view.forward));
            self.region(index, view.to_local(rectangle_moment(u, v)), rectangle_solid_angle(u, v));
            if column + 1 < width {
                self.wall(index, index + 1, view.wall_across_u(u[1], v));
            }
            if row + 1 < height {
                self.wall(index + self.table.width, index, view.wall_across_v(v[0], u));
            }
        }
        self.table.views.push(view);
    }

    /// Walls sorted, those of the same pair of samples added up, and the blocks between them.
    fn finish(mut self) -> Table {
        let edges = &mut self.table.edges;
        edges.sort_by_key(|edge| (edge.a, edge.b));
        edges.dedup_by(|later, kept| {
            let same = (later.a, later.b) == (kept.a, kept.b);
            if same {
                for (sum, part) in [(&mut kept.gradient, later.gradient), (&mut kept.hessian, later.hessian)] {
                    *sum = (DVec3::from(*sum) + DVec3::from(part)).to_array();
                }
            }
            same
        });
        self.table.blocks = self.table.walled_blocks();
        self.table
    }
}

/// Rows and columns, row by row.
fn grid(width: u32, height: u32) -> impl Iterator<Item = (u32, u32)> {
    (0..height).flat_map(move |row| (0..width).map(move |column| (row, column)))
}

fn plane(half: f64, resolution: u32, method: Method) -> Table {
    let mut builder = Builder::new(resolution, resolution);
    builder.face(View::along_normal(half, resolution, true));
    if matches!(method, Method::BorderExtension | Method::ConfusedMeasure) {
        extend_border(&mut builder, half, resolution);
    }
    let mut table = builder.finish();
    match method {
        Method::CoverageRatio => divide_by_coverage(&mut table, half),
        Method::ConfusedMeasure => table.samples.iter_mut().for_each(|sample| sample.cosine_weight = sample.plain_weight * sample.direction[2]),
        Method::None | Method::BorderExtension => {}
    }
    table
}

/// Adds the bands between the plane's border and the horizon. What a border pixel sees is taken to go straight down to
/// the horizon, an upright wall at the horizontal distance `depth · tanθ_b`.
fn extend_border(builder: &mut Builder, half: f64, resolution: u32) {
    let border = border(half, resolution);
    let next = |i: usize| border[(i + 1) % border.len()];
    for (i, &(owner, start)) in border.iter().enumerate() {
        let (neighbour, end) = next(i);
        let [low_start, low_end] = [start, end].map(|p| p.extend(0.0).normalize());
        let [high_start, high_end] = [start, end].map(|p| p.extend(1.0).normalize());
        let band = [low_start, low_end, high_end, high_start];
        builder.region(owner, polygon_moment(&band), polygon_solid_angle(&band));
        let tangent = end.length();
        let gradient = low_end.cross(DVec3::Z) * (-0.5 / (tangent * (1.0 + tangent * tangent)));
        builder.wall(owner, neighbour, Wall { gradient, ends: [end.extend(0.0), end.extend(1.0)] });
    }
}

/// The outer edges of the border pixels by increasing azimuth: the pixel, and the point at distance 1 where its edge
/// begins. A corner pixel comes twice.
fn border(half: f64, resolution: u32) -> Vec<(u32, DVec2)> {
    let last = resolution - 1;
    let at = |i: u32| half * (2.0 * f64::from(i) / f64::from(resolution) - 1.0);
    let index = |column: u32, row: u32| row * resolution + column;
    let up = (0..resolution).map(|i| (index(last, i), DVec2::new(half, at(i))));
    let back = (0..resolution).map(|i| (index(last - i, last), DVec2::new(at(resolution - i), half)));
    let down = (0..resolution).map(|i| (index(0, last - i), DVec2::new(-half, at(resolution - i))));
    let forth = (0..resolution).map(|i| (index(i, 0), DVec2::new(at(i), -half)));
    up.chain(back).chain(down).chain(forth).collect()
}

fn divide_by_coverage(table: &mut Table, half: f64) {
    let window = [-half, half];
    let cosine = rectangle_moment(window, window).z / PI;
    let plain = rectangle_solid_angle(window, window) / TAU;
    for sample in &mut table.samples {
        sample.cosine_weight /= cosine;
        sample.plain_weight /= plain;
    }
    for edge in &mut table.edges {
        edge.gradient = edge.gradient.map(|g| g / cosine);
        edge.hessian = edge.hessian.map(|h| h / cosine);
    }
}

fn hemicube(resolution: u32) -> Table {
    let [width, height] = Shape::Hemicube.size(resolution);
    let mut builder = Builder::new(width, height);
    let top = View::along_normal(1.0, resolution, true);
    let sides = side_views(resolution);
    builder.face(top);
    for (side, right_neighbour) in sides.iter().zip(sides.iter().cycle().skip(1)) {
        builder.face(*side);
        join_top(&mut builder, side, &top);
        join_sides(&mut builder, side, right_neighbour);
    }
    builder.finish()
}

/// The upper halves of the four upright faces; each one's right edge is the next one's left edge.
fn side_views(resolution: u32) -> [View; 4] {
    let mut rectangle = [0, resolution, resolution, resolution / 2];
    [DVec3::X, DVec3::NEG_Y, DVec3::NEG_X, DVec3::Y].map(|forward| {
        let (up, right) = (DVec3::Z, forward.cross(DVec3::Z));
        let view = View { right, up, forward, minimum: DVec2::new(-1.0, 0.0), maximum: DVec2::ONE, rectangle, linear: true };
        rectangle[1] += resolution / 2;
        view
    })
}

/// The seam between a side and the top. On a cube's edge the depths along both faces' axes are the same, so that the
/// two samples' own depths can be compared as within a face.
fn join_top(builder: &mut Builder, side: &View, top: &View) {
    let resolution = top.rectangle[2];
    let pixel = |x: f64| (((x + 1.0) / 2.0 * f64::from(resolution)) as u32).min(resolution - 1);
    for column in 0..resolution {
        let u = side.column(column);
        let seam = side.to_local(DVec3::new((u[0] + u[1]) / 2.0, 1.0, 1.0));
        let (below, above) = (builder.index(side, column, 0), builder.index(top, pixel(seam.x), pixel(seam.y)));
        builder.wall(below, above, side.wall_across_v(1.0, u));
    }
}

/// The upright seam between a side and the one to its right.
fn join_sides(builder: &mut Builder, side: &View, right_neighbour: &View) {
    let [_, _, width, height] = side.rectangle;
    for row in 0..height {
        let (from, to) = (builder.index(side, width - 1, row), builder.index(right_neighbour, 0, row));
        builder.wall(from, to, side.wall_across_u(1.0, side.row(row)));
    }
}

fn hemispherical(resolution: u32) -> Table {
    let mut builder = Builder::new(resolution, resolution);
    let view = View::along_normal(1.0, resolution, false);
    // In the record's own axes: `up` is −y, so rows grow with y just as columns grow with x.
    let cell = |i: u32| view.column(i);
    for (row, column) in grid(resolution, resolution) {
        let (x, y, index) = (cell(column), cell(row), row * resolution + column);
        let on_the_rim = || DVec3::new(x[0] + x[1], y[0] + y[1], 0.0).normalize();
        builder.place(index, view.direction(column, row).unwrap_or_else(on_the_rim), 1.0);
        let Some(owner) = disc_owner(&view, column, row) else { continue };
        builder.region(owner, disc_moment(x, y), disc_solid_angle(x, y));
        if let Some(right) = disc_owner(&view, column + 1, row) {
            builder.wall(owner, right, disc_wall_between(x[1], y, DVec2::new));
        }
        if let Some(below) = disc_owner(&view, column, row + 1) {
            builder.wall(owner, below, disc_wall_between(y[1], x, |y, x| DVec2::new(x, y)));
        }
    }
    builder.table.views.push(view);
    builder.finish()
}

/// The wall at `across` over the interval `along`; `place` tells which of the two is x.
fn disc_wall_between(across: f64, along: Interval, place: impl Fn(f64, f64) -> DVec2) -> Wall {
    let gradient = disc_wall(across, along);
    let limit = (1.0 - across * across).max(0.0).sqrt();
    let ends = along.map(|along| {
        let at = place(across, along.clamp(-limit, limit));
        at.extend((1.0 - at.length_squared()).max(0.0).sqrt())
    });
    Wall { gradient: place(gradient.x, gradient.y).extend(gradient.z), ends }
}

/// The sample that stands for the part of a cell within the disc: its own, or the next one inward when its centre is
/// outside; none for a cell that is wholly outside.
fn disc_owner(view: &View, column: u32, row: u32) -> Option<u32> {
    let resolution = view.rectangle[2];
    let last = resolution - 1;
    if column > last || row > last {
        return None;
    }
    let offset = |i: u32| i.abs_diff(last - i);
    let inward = |i: u32| if 2 * i > last { i - 1 } else { i + u32::from(2 * i < last) };
    let nearest = |i: u32| {
        let [low, high] = view.column(i);
        low.max(-high).max(0.0)
    };
    if DVec2::new(nearest(column), nearest(row)).length() >= 1.0 {
        return None;
    }
    // Straight inward along the larger coordinate if that will do.
    let straight = if offset(column) >= offset(row) { (inward(column), row) } else { (column, inward(row)) };
    [(column, row), straight, (inward(column), inward(row))]
        .into_iter()
        .find(|&(column, row)| view.direction(column, row).is_some())
        .map(|(column, row)| row * resolution + column)
}

fn cosine(resolution: u32) -> Table {
    let mut builder = Builder::new(resolution, resolution);
    for (row, column) in grid(resolution, resolution) {
        let (strip, index) = (Strip::new(resolution, row), row * resolution + column);
        let [from, to] = [column, column + 1].map(|i| DVec2::from_angle(TAU * f64::from(i) / f64::from(resolution)));
        let width = TAU / f64::from(resolution);
        let middle = DVec2::from_angle(TAU * (f64::from(column) + 0.5) / f64::from(resolution));
        // ∫ (cosφ, sinφ) dφ over the column.
        let azimuth = -(to - from).perp();
        builder.place(index, (middle * strip.middle.x).extend(strip.middle.y), 1.0);
        builder.region(index, (azimuth * strip.sine_square).extend(strip.cosine_sine * width), strip.cosine_difference() * width);
        let next = row * resolution + (column + 1) % resolution;
        let meridian = |polar: DVec2| (to * polar.x).extend(polar.y);
        let gradient = to.perp().extend(0.0) * (strip.lower.x - strip.upper.x);
        builder.wall(index, next, Wall { gradient, ends: [meridian(strip.upper), meridian(strip.lower)] });
        if row + 1 < resolution {
            builder.wall(index, index + resolution, Wall::along_parallel(strip.lower, [from, to], width));
        }
    }
    builder.finish()
}

/// One row of the cosine grid, polar angles as (sine, cosine).
struct Strip {
    upper: DVec2,
    middle: DVec2,
    lower: DVec2,
    /// `∫ sin²θ dθ`
    sine_square: f64,
    /// `∫ cosθ sinθ dθ`
    cosine_sine: f64,
}

impl Strip {
    fn new(resolution: u32, row: u32) -> Self {
        let polar = |i: f64| DVec2::new((i / f64::from(resolution)).sqrt(), (1.0 - i / f64::from(resolution)).sqrt());
        let row = f64::from(row);
        let (upper, middle, lower) = (polar(row), polar(row + 0.5), polar(row + 1.0));
        let sine_square = |p: DVec2| (p.x.atan2(p.y) - p.x * p.y) / 2.0;
        Self { upper, middle, lower, sine_square: sine_square(lower) - sine_square(upper), cosine_sine: 0.5 / f64::from(resolution) }
    }

    /// `∫ sinθ dθ`
    fn cosine_difference(&self) -> f64 {
        self.upper.y - self.lower.y
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::math::solid_angle::ROTATION_TOTAL;
    use proptest::prelude::*;

    const FOV: f64 = 126.869_897_645_844_03;
    pub(in crate::math) const COMPLETE: [Shape; 4] = [Shape::Hemicube, Shape::Hemispherical, Shape::Cosine, Shape::Concentric];
    const PLANE: Shape = Shape::Plane { fov_degrees: FOV };

    fn table(shape: Shape, resolution: u32, method: Method) -> Table {
        Table::new(shape, resolution, method).expect("a table")
    }

    /// Cosine-weighted and plain solid angle, moduli of the rotation.
    fn totals(table: &Table) -> [f64; 3] {
        let sum = |f: fn(&Sample) -> f64| table.samples.iter().map(f).sum();
        [sum(|s| s.cosine_weight), sum(|s| s.plain_weight), sum(|s| DVec2::from(s.rotation).length())]
    }

    fn assert_near(found: f64, expected: f64, tolerance: f64, what: impl std::fmt::Debug) {
        assert!((found - expected).abs() <= tolerance, "{what:?}: {found}, not {expected}");
    }

    #[test]
    fn directions_fall_on_their_samples() {
        for shape in [Shape::Hemispherical, Shape::Hemicube] {
            let table = Table::new(shape, 32, Method::None).unwrap();
            for (at, sample) in (0..).zip(&table.samples).filter(|(_, sample)| sample.cosine_weight > 0.0) {
                let direction = 3.0 * DVec3::from(sample.direction).as_vec3();
                let [x, y] = shape.sample_at(32, direction).unwrap();
                let is_on_the_rim = direction.z < 1e-3;
                assert!(is_on_the_rim || y * table.width + x == at, "{shape:?}: {direction} on {x}, {y}, not {at}");
            }
        }
        assert_eq!(Shape::Concentric.sample_at(32, Vec3::Z), None);
    }

    #[test]
    fn complete_tiles_add_to_the_hemisphere() {
        for resolution in [4, 8, 16, 64, 128, 512] {
            let compensated = [Method::BorderExtension, Method::CoverageRatio].map(|method| table(PLANE, resolution, method));
            let complete = COMPLETE.map(|shape| table(shape, resolution, Method::None));
            for table in compensated.iter().chain(&complete) {
                let [cosine, plain, _] = totals(table);
                assert_near(cosine, PI, 1e-9, (resolution, table.width, table.height));
                assert_near(plain, TAU, 1e-9, (resolution, table.width, table.height));
            }
        }
    }

    #[test]
    fn the_rotation_moduli_of_a_furnace_add_to_half_pi_squared() {
        for shape in COMPLETE.into_iter().chain([PLANE]) {
            let table = table(shape, 64, Method::BorderExtension);
            let [_, _, rotation] = totals(&table);
            assert_near(rotation, ROTATION_TOTAL, 2e-3, shape);
            let sum: DVec2 = table.samples.iter().map(|s| DVec2::from(s.rotation)).sum();
            assert!(sum.length() < 1e-9, "{sum}");
        }
    }

    #[test]
    fn the_bare_plane_holds_its_share() {
        let [cosine, plain, rotation] = totals(&table(PLANE, 64, Method::None));
        let t = 2.0 / 5f64.sqrt();
        assert_near(cosine / PI, 2.0 / PI * 2.0 * t * t.atan(), 1e-12, "cosine");
        assert_near(cosine / PI, 0.831, 5e-4, "cosine");
        assert_near(plain / TAU, 0.59, 5e-3, "plain");
        assert_near(rotation / ROTATION_TOTAL, 0.49, 5e-3, "rotation");
        let wide = totals(&table(Shape::Plane { fov_degrees: 160.0 }, 128, Method::None))[0];
        assert_near(1.0 - wide / PI, 0.025, 5e-4, "left out at 160 degrees");
    }

    #[test]
    fn the_coverage_ratio_scales_each_measure_by_its_own_share() {
        let (bare, ratio) = (table(PLANE, 16, Method::None), table(PLANE, 16, Method::CoverageRatio));
        let [cosine, plain, _] = totals(&bare);
        for (bare, ratio) in bare.samples.iter().zip(&ratio.samples) {
            assert_near(ratio.cosine_weight * cosine / PI, bare.cosine_weight, 1e-14, "cosine");
            assert_near(ratio.plain_weight * plain / TAU, bare.plain_weight, 1e-14, "plain");
            assert_eq!(ratio.rotation, bare.rotation);
        }
        for (bare, ratio) in bare.edges.iter().zip(&ratio.edges) {
            assert!((DVec3::from(ratio.gradient) * cosine / PI).abs_diff_eq(DVec3::from(bare.gradient), 1e-14));
        }
    }

    /// The measures must not be mixed: the plain weights of a border extension, weighted by the pixels' own cosines,
    /// make a furnace too bright by a sixth.
    #[test]
    fn plain_weights_with_the_pixels_cosine_are_no_cosine_weights() {
        let mixed: f64 = table(PLANE, 64, Method::ConfusedMeasure).samples.iter().map(|s| s.cosine_weight).sum();
        assert_near(mixed / PI, 1.17, 5e-3, "mixed measures");
    }

    #[test]
    fn impossible_tables_are_refused() {
        for resolution in [0, 3, 513, u32::MAX] {
            assert_eq!(Table::new(PLANE, resolution, Method::None), Err(TableError::Resolution(resolution)));
        }
        assert_eq!(Table::new(Shape::Hemicube, 7, Method::None), Err(TableError::OddHemicube(7)));
        for fov_degrees in [f64::NAN, -90.0, 0.0, 179.9, 180.0, 1e9, f64::INFINITY] {
            assert!(matches!(Table::new(Shape::Plane { fov_degrees }, 64, Method::None), Err(TableError::FieldOfView(_))), "{fov_degrees}");
        }
    }

    #[test]
    fn views_look_through_the_samples() {
        for shape in [PLANE, Shape::Hemicube, Shape::Hemispherical] {
            let table = table(shape, 8, Method::BorderExtension);
            let mut seen = vec![0; table.samples.len()];
            for view in &table.views {
                assert!(view.forward.cross(view.up).abs_diff_eq(view.right, 0.0), "right-handed");
                let [x, y, width, height] = view.rectangle;
                for (row, column) in grid(width, height) {
                    let index = ((y + row) * table.width + x + column) as usize;
                    let sample = &table.samples[index];
                    seen[index] += 1;
                    match view.direction(column, row) {
                        Some(direction) => assert!(direction.abs_diff_eq(DVec3::from(sample.direction), 1e-15)),
                        None => assert_eq!(sample.plain_weight, 0.0),
                    }
                }
            }
            assert!(seen.iter().all(|&count| count == 1), "each sample belongs to one view");
        }
        assert!([Shape::Cosine, Shape::Concentric].iter().all(|&shape| table(shape, 8, Method::None).views.is_empty()));
    }

    /// Every sample's direction lies within what the sample stands for.
    #[test]
    fn samples_stand_for_their_surroundings() {
        for shape in COMPLETE {
            for sample in table(shape, 32, Method::None).samples.iter().filter(|s| s.plain_weight > 0.0) {
                let moment = DVec3::new(sample.rotation[1], -sample.rotation[0], sample.cosine_weight);
                assert!(moment.length() <= sample.plain_weight * (1.0 + 1e-9));
                assert!(moment.normalize().dot(DVec3::from(sample.direction)) > 0.97, "{shape:?} {sample:?}");
            }
        }
    }

    /// Strata and discs are made so that the cosine measure is uniform.
    #[test]
    fn uniform_shapes_have_uniform_weights() {
        for (shape, resolution) in [(Shape::Cosine, 16), (Shape::Concentric, 16), (Shape::Concentric, 9)] {
            for sample in &table(shape, resolution, Method::None).samples {
                assert_near(sample.cosine_weight, PI / f64::from(resolution * resolution), 1e-14, shape);
            }
        }
        let disc = table(Shape::Hemispherical, 16, Method::None);
        assert_near(disc.samples[8 * 16 + 8].cosine_weight, 4.0 / 256.0, 1e-14, "pixel");
        assert_eq!(disc.samples[0].cosine_weight, 0.0);
    }

    #[test]
    fn edges_are_sorted_and_between_used_samples() {
        for shape in COMPLETE.into_iter().chain([PLANE]) {
            let table = table(shape, 16, Method::BorderExtension);
            assert!(table.edges.windows(2).all(|e| (e[0].a, e[0].b) < (e[1].a, e[1].b)), "{shape:?}");
            for edge in &table.edges {
                assert!(edge.a < edge.b && edge.gradient.iter().all(|g| g.is_finite()));
                assert!([edge.a, edge.b].iter().all(|&i| table.samples[i as usize].plain_weight > 0.0), "{shape:?} {edge:?}");
            }
        }
    }

    fn beside(table: &Table, sample: u32) -> impl Iterator<Item = &Edge> {
        table.edges.iter().filter(move |edge| edge.a == sample || edge.b == sample)
    }

    /// What the walls around a sample add up to, outward.
    fn around(table: &Table, sample: u32) -> DVec3 {
        beside(table, sample).map(|edge| DVec3::from(edge.gradient) * if edge.a == sample { 1.0 } else { -1.0 }).sum()
    }

    /// The walls around a sample are the whole boundary of its region. By the divergence theorem on the sphere,
    /// `∮ cosθ n dℓ = ∫ (∇cosθ − 2 cosθ ω) dω` for the outward n, and `∇cosθ = z − cosθ ω`.
    #[test]
    fn the_walls_of_a_stratum_close() {
        let table = table(Shape::Cosine, 16, Method::None);
        let index = 5 * 16 + 3;
        let around = around(&table, index);
        let steps = 400;
        let (low, high) = (5.0 / 16.0, 6.0 / 16.0);
        let integral: DVec3 = (0..steps * steps)
            .map(|i| {
                let square: f64 = low + (high - low) * (f64::from(i % steps) + 0.5) / f64::from(steps);
                let azimuth = TAU / 16.0 * (3.0 + (f64::from(i / steps) + 0.5) / f64::from(steps));
                let cosine = (1.0 - square).sqrt();
                let direction = (DVec2::from_angle(azimuth) * square.sqrt()).extend(cosine);
                // dω = d(sin²θ) dφ / (2 cosθ)
                (DVec3::Z - direction * (3.0 * cosine)) / (2.0 * cosine)
            })
            .sum();
        let integral = integral * ((high - low) / f64::from(steps)) * (TAU / 16.0 / f64::from(steps));
        assert!(around.abs_diff_eq(integral, 1e-6), "{around} {integral}");
    }

    /// The same of all squares but those at the horizon: on a diagonal, beside it, in the middle.
    #[test]
    fn the_walls_of_concentric_squares_close() {
        for resolution in [8, 9] {
            let table = table(Shape::Concentric, resolution, Method::None);
            for (row, column) in grid(resolution, resolution).filter(|&(row, column)| [row, column].iter().all(|&i| i > 0 && i + 1 < resolution)) {
                let index = row * resolution + column;
                assert_eq!(beside(&table, index).count(), 4, "{row} {column}");
                let (around, integral) = (around(&table, index), integral_over_square(resolution, row, column));
                assert!(around.abs_diff_eq(integral, 1e-5), "{row} {column}: {around} {integral}");
            }
        }
    }

    /// Shirley and Chiu's map of a place in −1..1 squared.
    fn on_disc(x: f64, y: f64) -> DVec2 {
        if x.abs() > y.abs() {
            DVec2::from_angle(PI / 4.0 * y / x) * x
        } else if y == 0.0 {
            DVec2::ZERO
        } else {
            DVec2::from_angle(PI / 2.0 - PI / 4.0 * x / y) * y
        }
    }

    /// `∫ (z − 3 cosθ ω) dω` by the midpoint rule over the square that is mapped.
    fn integral_over_square(resolution: u32, row: u32, column: u32) -> DVec3 {
        let steps = 200;
        let at = |cell: u32, step: u32| (2.0 * (f64::from(cell) + (f64::from(step) + 0.5) / f64::from(steps)) / f64::from(resolution)) - 1.0;
        let points = grid(steps, steps).map(|(i, j)| {
            let (x, y) = (at(column, i), at(row, j));
            let disc = on_disc(x, y);
            let cosine = (1.0 - disc.length_squared()).sqrt();
            (DVec3::Z - disc.extend(cosine) * (3.0 * cosine)) / cosine
        });
        points.sum::<DVec3>() * (PI / (f64::from(resolution * resolution) * f64::from(steps * steps)))
    }

    /// The sample that stands for a direction, told by where the direction is alone; and the axis that its depth is along, if any.
    fn stands_for(shape: Shape, resolution: u32, direction: DVec3) -> (u32, Option<DVec3>) {
        let cell = |share: f64| ((share * f64::from(resolution)) as u32).min(resolution - 1);
        let [x, y, z] = direction.to_array();
        let azimuth = y.atan2(x).rem_euclid(TAU);
        let raster = |x: f64, y: f64| cell(0.5 + 0.5 * y) * resolution + cell(0.5 + 0.5 * x);
        match shape {
            Shape::Plane { fov_degrees } => {
                let half = (fov_degrees.to_radians() / 2.0).tan();
                let widest = (x.abs().max(y.abs()) / half).max(z);
                (raster(x / widest / half, y / widest / half), Some(DVec3::Z))
            }
            Shape::Hemicube => {
                let side = |number: u32, forward: DVec3, right: f64| {
                    let depth = direction.dot(forward);
                    let row = cell(1.0 - z / depth / 2.0 - 0.5) + resolution / 2 * number;
                    (resolution * (resolution + row) + cell(0.5 + 0.5 * right / depth), Some(forward))
                };
                if z >= x.abs().max(y.abs()) {
                    (raster(x / z, y / z), Some(DVec3::Z))
                } else if x.abs() >= y.abs() {
                    if x > 0.0 { side(0, DVec3::X, -y) } else { side(2, DVec3::NEG_X, y) }
                } else if y < 0.0 {
                    side(1, DVec3::NEG_Y, -x)
                } else {
                    side(3, DVec3::Y, x)
                }
            }
            Shape::Hemispherical => {
                let (column, row) = (cell(0.5 + 0.5 * x), cell(0.5 + 0.5 * y));
                let middle = |i: u32| 2.0 * (f64::from(i) + 0.5) / f64::from(resolution) - 1.0;
                let inside = |&(column, row): &(u32, u32)| middle(column).hypot(middle(row)) < 1.0;
                let inward = |i: u32| {
                    if middle(i) > 1e-9 {
                        i - 1
                    } else if middle(i) < -1e-9 {
                        i + 1
                    } else {
                        i
                    }
                };
                let straight = if middle(column).abs() > middle(row).abs() - 1e-9 { (inward(column), row) } else { (column, inward(row)) };
                let owner = [(column, row), straight, (inward(column), inward(row))].into_iter().find(inside);
                (owner.map_or(u32::MAX, |(column, row)| row * resolution + column), None)
            }
            Shape::Cosine => (cell(x * x + y * y) * resolution + cell(azimuth / TAU), None),
            Shape::Concentric => {
                let [x, y] = on_square(direction);
                (raster(x, y), None)
            }
        }
    }

    /// The inverse of [`on_disc`].
    fn on_square(direction: DVec3) -> [f64; 2] {
        let radius = direction.truncate().length();
        let turned = (direction.y.atan2(direction.x) + PI / 4.0).rem_euclid(TAU);
        let quarter = (turned / (PI / 2.0)).floor();
        let across = radius * ((turned - quarter * PI / 2.0) / (PI / 4.0) - 1.0);
        [[radius, across], [-across, radius], [-radius, -across], [across, -radius]][quarter as usize % 4]
    }

    /// Small tables of all shapes; the last is a plane that is extended to the horizon.
    fn small() -> [(Shape, u32); 7] {
        let [hemicube, hemispherical, cosine, concentric] = COMPLETE;
        [(hemicube, 4), (hemispherical, 8), (hemispherical, 9), (cosine, 5), (concentric, 4), (concentric, 5), (PLANE, 5)]
    }

    /// Directions with their solid angles: so many heights of equal area, twice as many azimuths.
    fn directions(heights: u32) -> impl Iterator<Item = (DVec3, f64)> {
        let size = f64::from(heights);
        let at = move |(i, k): (u32, u32)| {
            let z = (f64::from(i) + 0.5) / size;
            ((DVec2::from_angle(PI * (f64::from(k) + 0.5) / size) * (1.0 - z * z).sqrt()).extend(z), PI / (size * size))
        };
        grid(2 * heights, heights).map(at)
    }

    /// Weights and rotations are sums over the directions that a sample stands for.
    #[test]
    fn samples_are_the_integrals_over_what_they_stand_for() {
        for (shape, resolution) in small() {
            let table = table(shape, resolution, Method::BorderExtension);
            let mut sums = vec![[0.0; 4]; table.samples.len()];
            for (direction, solid_angle) in directions(400) {
                let sum = &mut sums[stands_for(shape, resolution, direction).0 as usize];
                let parts = [direction.z, 1.0, -direction.y, direction.x];
                sum.iter_mut().zip(parts).for_each(|(sum, part)| *sum += part * solid_angle);
            }
            for (index, (sample, sum)) in table.samples.iter().zip(sums).enumerate() {
                let found = [sample.cosine_weight, sample.plain_weight, sample.rotation[0], sample.rotation[1]];
                for (found, sum) in found.into_iter().zip(sum) {
                    assert_near(found, sum, 2e-3, (shape, resolution, index));
                }
            }
        }
    }

    /// A sample looks at what it stands for, and its depth is along the axis of its raster.
    #[test]
    fn samples_look_at_what_they_stand_for() {
        for (shape, resolution) in small() {
            for (index, sample) in table(shape, resolution, Method::BorderExtension).samples.iter().enumerate() {
                let direction = DVec3::from(sample.direction);
                assert_near(direction.length(), 1.0, 1e-14, (shape, index));
                if sample.plain_weight > 0.0 {
                    let (owner, axis) = stands_for(shape, resolution, direction);
                    assert_eq!(owner as usize, index, "{shape:?} {resolution} {direction}");
                    assert_near(sample.depth_cosine, axis.map_or(1.0, |axis| axis.dot(direction)), 1e-14, (shape, index));
                }
            }
        }
        // Middles of strata, and rays that golden fractions shift within theirs.
        let cosine = table(Shape::Cosine, 5, Method::None).samples[2 * 5 + 3].direction;
        let sine = 0.5f64.sqrt();
        assert!(DVec3::from(cosine).abs_diff_eq((DVec2::from_angle(TAU * 0.7) * sine).extend(sine), 1e-14));
        let golden = (5f64.sqrt() - 1.0) / 2.0;
        for ((row, column), sample) in grid(5, 5).zip(&table(Shape::Concentric, 5, Method::None).samples) {
            let [x, y] = on_square(DVec3::from(sample.direction)).map(|at| (at + 1.0) / 2.0 * 5.0);
            assert_near(x - f64::from(column), ((f64::from(row) + 0.5) * golden).fract(), 1e-12, (row, column));
            assert_near(y - f64::from(row), ((f64::from(column) + 0.5) * golden).fract(), 1e-12, (row, column));
        }
    }

    /// Of every sample, by the divergence theorem on the sphere: `∮ g n dℓ = ∫ (∇g − 2 g ω) dω` for the outward n. With g = cosθ that is `z − 3 cosθ ω`; where depths
    /// are along an axis f, g is `cosθ f·ω` and the integrand `z f·ω + f cosθ − 4 cosθ f·ω ω`. At the horizon g is 0.
    #[test]
    fn the_walls_of_every_sample_close() {
        for (shape, resolution) in small() {
            let table = table(shape, resolution, Method::None);
            let mut sums = vec![DVec3::ZERO; table.samples.len()];
            for (direction, solid_angle) in directions(400) {
                let (owner, axis) = stands_for(shape, resolution, direction);
                let cosine = direction.z;
                let part = axis.map_or(DVec3::Z - direction * (3.0 * cosine), |axis| {
                    let depth = axis.dot(direction);
                    DVec3::Z * depth + axis * cosine - direction * (4.0 * cosine * depth)
                });
                sums[owner as usize] += part * solid_angle;
            }
            // Of a plane that is not extended only what lies within has all its walls.
            let is_closed = |index: usize| shape != PLANE || [index % 5, index / 5].iter().all(|i| (1..4).contains(i));
            for (index, sum) in sums.into_iter().enumerate().filter(|(index, _)| is_closed(*index)) {
                let found = around(&table, index as u32);
                assert!(found.abs_diff_eq(sum, 4e-3), "{shape:?} {resolution} {index}: {found}, not {sum}");
            }
        }
    }

    /// `θ ĉ·n / 2` of an edge of Lambert's sum, seen from a point of the surface, with sin θ in place of θ.
    fn lambert([a, b]: [DVec3; 2], point: DVec2) -> f64 {
        let [a, b] = [a, b].map(|end| end - point.extend(0.0));
        0.5 * a.cross(b).z / (a.length() * b.length())
    }

    /// Its second derivatives xx, xy, yy, by differences.
    fn second_differences(ends: [DVec3; 2]) -> DVec3 {
        let h = 1e-3;
        let at = |x: f64, y: f64| lambert(ends, DVec2::new(x * h, y * h));
        let twice = |axis: DVec2| at(axis.x, axis.y) + at(-axis.x, -axis.y) - 2.0 * at(0.0, 0.0);
        let mixed = (at(1.0, 1.0) + at(-1.0, -1.0) - at(1.0, -1.0) - at(-1.0, 1.0)) / 4.0;
        DVec3::new(twice(DVec2::X), mixed, twice(DVec2::Y)) / (h * h)
    }

    /// What the walls around a sample do to second derivatives is what the edges of its outline do to Lambert's sum.
    #[test]
    fn second_derivatives_are_those_of_the_outline() {
        let place = |shape: Shape, x: f64, y: f64| match shape {
            Shape::Hemicube | Shape::Plane { .. } => DVec3::new(x, y, 1.0),
            Shape::Hemispherical => DVec3::new(x, y, (1.0 - x * x - y * y).sqrt()),
            Shape::Cosine => (DVec2::from_angle(PI * (x + 1.0)) * ((y + 1.0) / 2.0).sqrt()).extend(((1.0 - y) / 2.0).sqrt()),
            Shape::Concentric => {
                let disc = on_disc(x, y);
                disc.extend((1.0 - disc.length_squared()).sqrt())
            }
        };
        let assert_outline = |shape: Shape, table: &Table, index: u32, corners: [DVec3; 4]| {
            let edges = [[0, 1], [1, 2], [2, 3], [3, 0]].map(|edge| edge.map(|corner| corners[corner]));
            // What is seen is brighter, whichever way the outline runs.
            let sign = edges.iter().map(|&edge| lambert(edge, DVec2::ZERO)).sum::<f64>().signum();
            let known = edges.into_iter().map(second_differences).sum::<DVec3>() * sign;
            let found: DVec3 = beside(table, index).map(|edge| DVec3::from(edge.hessian) * if edge.b == index { 1.0 } else { -1.0 }).sum();
            assert!(found.abs_diff_eq(known, 1e-4), "{shape:?} {index}: {found}, not {known}");
        };
        for shape in [PLANE, Shape::Hemicube, Shape::Hemispherical, Shape::Cosine, Shape::Concentric] {
            let (resolution, half) = (8, if shape == PLANE { 2.0 } else { 1.0 });
            let table = table(shape, resolution, Method::None);
            for (row, column) in grid(4, 4).map(|(row, column)| (row + 2, column + 2)) {
                let at = |i: u32| half * (2.0 * f64::from(i) / f64::from(resolution) - 1.0);
                let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| place(shape, at(column + i), at(row + j)));
                assert_outline(shape, &table, row * resolution + column, corners);
            }
        }
        // The sides of a hemicube, all but their lowest rows: next to the top and to each other too.
        let table = table(Shape::Hemicube, 8, Method::None);
        for (side, forward) in [DVec3::X, DVec3::NEG_Y, DVec3::NEG_X, DVec3::Y].into_iter().enumerate() {
            for (row, column) in grid(8, 3) {
                let at = |i: u32, j: u32| forward + forward.cross(DVec3::Z) * (f64::from(column + i) / 4.0 - 1.0) + DVec3::Z * (1.0 - f64::from(row + j) / 4.0);
                let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| at(i, j));
                assert_outline(Shape::Hemicube, &table, 8 * (8 + 4 * side as u32 + row) + column, corners);
            }
        }
    }

    /// Between two border pixels the bands below them add a wall that goes straight down at the distance t of the corner between them: `∫ cosθ sinθ/t dθ`, and what an
    /// upright edge there adds to second derivatives. All other walls stay.
    #[test]
    fn bands_add_upright_walls() {
        let (resolution, half) = (4, 2.0);
        let [bare, extended] = [Method::None, Method::BorderExtension].map(|method| table(PLANE, resolution, method));
        let edge = |table: &Table, a: u32, b: u32| {
            let found = table.edges.iter().find(|edge| (edge.a, edge.b) == (a, b));
            found.map_or([DVec3::ZERO; 2], |edge| [edge.gradient, edge.hessian].map(DVec3::from))
        };
        let mut added = 0;
        for kept in &extended.edges {
            let [[gradient, hessian], [bare_gradient, bare_hessian]] = [&extended, &bare].map(|table| edge(table, kept.a, kept.b));
            let [(ax, ay), (bx, by)] = [kept.a, kept.b].map(|at| (at % resolution, at / resolution));
            let line = |i: u32| half * (2.0 * f64::from(i) / f64::from(resolution) - 1.0);
            let outer = |i: u32| if i == 0 { Some(-half) } else { (i + 1 == resolution).then_some(half) };
            // Where the line between two pixels meets the border.
            let corner = match (ay == by, ax == bx) {
                (true, false) => outer(ay).map(|y| DVec2::new(line(bx), y)),
                (false, true) => outer(ax).map(|x| DVec2::new(x, line(by))),
                _ => None,
            };
            let (mut known, mut curved) = (DVec3::ZERO, DVec3::ZERO);
            if let Some(corner) = corner {
                added += 1;
                let t = corner.length();
                let [towards, from] = [kept.b, kept.a].map(|at| DVec3::from(bare.samples[at as usize].direction));
                let normal = corner.perp().extend(0.0) / t;
                known = normal * (normal.dot(towards - from).signum() * 0.5 / (t * (1.0 + t * t)));
                curved = second_differences([corner.extend(0.0), corner.extend(1.0)]) * if normal.dot(towards - from) > 0.0 { 1.0 } else { -1.0 };
            }
            assert!((gradient - bare_gradient).abs_diff_eq(known, 1e-14), "{kept:?}: {}, not {known}", gradient - bare_gradient);
            let found = hessian - bare_hessian;
            assert!(found.abs_diff_eq(curved, 1e-5), "{kept:?}: {found}, not {curved}");
        }
        assert_eq!((added, bare.edges.len(), extended.edges.len()), (12, 24, 24));
    }

    #[test]
    fn ratios_scale_second_derivatives_and_mistakes_are_as_described() {
        let [bare, ratio, extended, confused] =
            [Method::None, Method::CoverageRatio, Method::BorderExtension, Method::ConfusedMeasure].map(|method| table(PLANE, 6, method));
        let cosine = totals(&bare)[0] / PI;
        for (bare, ratio) in bare.edges.iter().zip(&ratio.edges) {
            assert!((DVec3::from(ratio.hessian) * cosine).abs_diff_eq(DVec3::from(bare.hessian), 1e-14));
        }
        for (extended, confused) in extended.samples.iter().zip(&confused.samples) {
            assert_near(confused.cosine_weight, extended.plain_weight * extended.direction[2], 1e-15, "the pixel's own cosine");
            assert_eq!((confused.plain_weight, confused.rotation), (extended.plain_weight, extended.rotation));
        }
    }

    #[test]
    fn extremes_have_tables() {
        assert!(PLANE.is_incomplete() && COMPLETE.iter().all(|shape| !shape.is_incomplete()));
        for (fov_degrees, resolution) in [(10.0, 4), (175.0, 4), (90.0, 512)] {
            let found = table(Shape::Plane { fov_degrees }, resolution, Method::None);
            assert_eq!((found.width, found.height), (resolution, resolution));
        }
    }

    /// A view of 4 by 2 pixels, neither side like the other.
    #[test]
    fn views_have_pixels_from_the_top_left() {
        let view = View {
            right: DVec3::Y,
            up: DVec3::Z,
            forward: DVec3::NEG_X,
            minimum: DVec2::new(-0.5, -0.25),
            maximum: DVec2::new(1.5, 0.75),
            rectangle: [3, 5, 4, 2],
            linear: true,
        };
        assert_eq!((view.column(1), view.row(0), view.row(1)), ([0.0, 0.5], [0.25, 0.75], [-0.25, 0.25]));
        assert_eq!(Builder::new(10, 10).index(&view, 2, 1), 65);
        let direction = view.direction(3, 0).expect("a direction");
        assert!(direction.abs_diff_eq(DVec3::new(-1.0, 1.25, 0.5).normalize(), 1e-15));
        let flat = View { linear: false, ..view };
        assert_eq!(flat.direction(3, 0), None);
        let rim = View { minimum: DVec2::new(0.5, -0.5), maximum: DVec2::new(1.5, 0.5), rectangle: [0, 0, 1, 1], ..flat };
        assert_eq!(rim.direction(0, 0), None);
        let direction = flat.direction(1, 0).expect("within the disc");
        assert!(direction.abs_diff_eq(DVec3::new(-(1.0f64 - 0.25 * 0.25 - 0.5 * 0.5).sqrt(), 0.25, 0.5), 1e-15));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn planes_of_any_angle_add_to_the_hemisphere(fov_degrees in 10.0..175.0f64, resolution in 4..48u32) {
            for method in [Method::BorderExtension, Method::CoverageRatio] {
                let [cosine, plain, _] = totals(&table(Shape::Plane { fov_degrees }, resolution, method));
                prop_assert!((cosine - PI).abs() < 1e-9 && (plain - TAU).abs() < 1e-9);
            }
        }

        /// Every sample has a wall to each of its neighbours, also where two faces of a hemicube meet; only the horizon has none.
        #[test]
        fn a_hemicube_has_no_open_seam(half_resolution in 2..32u32) {
            let resolution = 2 * half_resolution;
            let table = table(Shape::Hemicube, resolution, Method::None);
            prop_assert_eq!(table.edges.len() as u32, 6 * resolution * resolution - 2 * resolution);
        }

        /// Samples that a wall parts lie beside each other: at most two pixels apart.
        #[test]
        fn samples_beside_a_wall_adjoin(half_resolution in 2..32u32) {
            let resolution = 2 * half_resolution;
            for (shape, width) in [(Shape::Hemicube, 2.0), (PLANE, 4.0)] {
                let table = table(shape, resolution, Method::BorderExtension);
                let direction = |sample: u32| DVec3::from(table.samples[sample as usize].direction);
                let widest = table.edges.iter().map(|edge| direction(edge.a).angle_between(direction(edge.b))).fold(0.0, f64::max);
                prop_assert!(widest <= 2.0 * width / f64::from(resolution), "{shape:?} {resolution}: {widest}");
            }
        }

        #[test]
        fn complete_shapes_of_any_size_add_to_the_hemisphere(half_resolution in 2..40u32) {
            for (shape, resolution) in [(Shape::Hemicube, 2 * half_resolution), (Shape::Hemispherical, 2 * half_resolution + 1), (Shape::Cosine, 2 * half_resolution + 1), (Shape::Concentric, half_resolution + 2)] {
                let [cosine, plain, _] = totals(&table(shape, resolution, Method::None));
                prop_assert!((cosine - PI).abs() < 1e-9 && (plain - TAU).abs() < 1e-9);
            }
        }
    }
}

//! Shadow rays: 64 from one point, which only have to know whether anything is in their way.

use super::*;
use crate::scene::{LightKind, bvh::Bvh};

/// Rays from one point; their lengths matter where they have an end.
pub struct ShadowRays {
    pub directions: [Vec3; RAYS],
    /// A bit for each that there is.
    pub all: u64,
}

/// How far rays reach.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Until {
    /// Up to just before the point that a direction ends at.
    TheirEnd,
    /// From just beyond where they start up to that point: the light that they start at may lie on a surface.
    FromLight,
    Forever,
}

/// The share of the way to a point that has to be free: the point lies on a surface.
pub const ALMOST: f32 = 0.9999;

/// What walks of the hierarchy are to do yet; kept between them.
#[derive(Default)]
pub struct ToDo(Vec<Visit>);

/// What holds all rays that have an end: multiples up to `limit` of the vectors between two corners.
struct Beam {
    middle: Vec3,
    half: Vec3,
    /// What is nearer blocks nothing.
    from: f32,
    limit: f32,
    /// 1 over the least and the largest component along each axis.
    inverse: [Vec3; 2],
}

/// Half the width that a narrow beam has at most, over its length.
const NARROW: f32 = 0.2;

/// Beams are wider by this share of their components than rounding may take.
const WIDER: f32 = 1e-5;

impl Beam {
    fn new(rays: &ShadowRays, [from, limit]: [f32; 2], scale: f32) -> Self {
        let each = (0..RAYS).filter(|ray| rays.all & 1 << ray != 0).map(|ray| rays.directions[ray]);
        let [low, high] = each.fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], way| [low.min(way), high.max(way)]);
        let (middle, half) = (0.5 * scale * (low + high), 0.5 * scale * (high - low));
        let half = half + WIDER * (middle.abs() + half);
        Self { middle, half, from, limit, inverse: [middle - half, middle + half].map(|corner| corner.map(inverse)) }
    }
}

impl Beam {
    /// Whether its rays have much in common: a wide one goes almost everywhere.
    fn is_narrow(&self) -> bool {
        self.half.length_squared() <= (NARROW * NARROW) * self.middle.length_squared()
    }
}

impl Packets {
    /// A bit for each of the rays that something blocks. A surface blocks from both of its sides, whatever its sidedness; holes of alpha-masked
    /// textures let light through.
    pub fn hidden(&self, scene: &Scene, origin: Vec3, rays: &ShadowRays, until: Until, to_do: &mut ToDo) -> u64 {
        let Some(root) = self.root.filter(|_| rays.all != 0) else { return 0 };
        let origin = self.inside(origin).clamp(Vec3::splat(-FARTHEST), Vec3::splat(FARTHEST));
        let walker = Walker { packets: self, scene, origin };
        to_do.0.clear();
        to_do.0.push(Visit { near: 0.0, rays: rays.all, content: root });
        let span = match until {
            Until::TheirEnd => [0.0, ALMOST],
            Until::FromLight => [1.0 - ALMOST, 1.0],
            Until::Forever => [0.0, FAR_AWAY],
        };
        // Those without an end are as long as they are told to be, in extents.
        let scale = if until == Until::Forever { 1.0 } else { self.scale };
        let beam = (until != Until::Forever).then(|| Beam::new(rays, span, scale)).filter(Beam::is_narrow);
        let walk = Rays { direction: rays.directions.map(|direction| direction * scale), all: rays.all, limit: [span[1]; RAYS], ..Rays::none() };
        dispatch!(Level::new(), simd => match &beam {
            Some(beam) => walker.block_beam(simd, walk, beam, &mut to_do.0),
            None => walker.block(simd, walk, span[0], &mut to_do.0),
        })
    }
}

/// So many times as far from a surface as rays start do rays from lights end.
const SHORT: f32 = 8.0;

impl Bvh {
    /// A bit for each of the points in `rays.all` that something hides from a punctual light. The points are where `rays` has directions, and are replaced
    /// by them.
    pub fn hidden_from(&self, scene: &Scene, extent: f32, light: &LightKind, rays: &mut ShadowRays, to_do: &mut ToDo) -> u64 {
        let all = rays.all;
        let points = (0..RAYS).filter(|ray| all & 1 << ray != 0);
        match *light {
            LightKind::Point { position, .. } | LightKind::Spot { position, .. } => {
                for ray in points {
                    let (start, way) = (rays.directions[ray], rays.directions[ray] - position);
                    // A way that is long is rounded by more than rays start off a surface.
                    rays.directions[ray] = way * (1.0 - SHORT * surface_offset(extent, start) / way.length().max(f32::MIN_POSITIVE)).max(0.0);
                }
                self.packets(scene).hidden(scene, position, rays, Until::FromLight, to_do)
            }
            LightKind::Directional { direction, .. } => {
                points.map(|ray| u64::from(self.occluded(scene, rays.directions[ray], -direction, f32::INFINITY)) << ray).sum()
            }
        }
    }
}

impl Walker<'_> {
    /// Rays to anywhere: each looks which children it enters. A bit for each that is blocked beyond `from`.
    #[inline(always)]
    fn block<S: Simd>(&self, simd: S, mut walk: Rays, from: f32, to_do: &mut Vec<Visit>) -> u64 {
        // No child is nearer than another: whichever blocks a ray first will do.
        let all = walk.all;
        walk.inverse = walk.direction.map(|direction| direction.map(inverse));
        while let Some(mut visit) = to_do.pop() {
            visit.rays &= walk.all;
            if visit.content & LEAF == 0 {
                self.enter(simd, &visit, &walk, to_do);
            } else {
                self.block_in_leaf(simd, &visit, None, from, &mut walk);
            }
        }
        all & !walk.all
    }

    /// Rays that are near each other: all enter a child if their beam does.
    #[inline(always)]
    fn block_beam<S: Simd>(&self, simd: S, mut walk: Rays, beam: &Beam, to_do: &mut Vec<Visit>) -> u64 {
        let all = walk.all;
        while let Some(visit) = to_do.pop() {
            if visit.content & LEAF != 0 {
                self.block_in_leaf(simd, &visit, Some(beam), beam.from, &mut walk);
                if walk.all == 0 {
                    break;
                }
                continue;
            }
            let node = &self.packets.nodes[visit.content as usize];
            let mut slots = self.entered(simd, node, beam);
            while slots != 0 {
                let slot = slots.trailing_zeros() as usize % CHILDREN;
                slots &= slots - 1;
                to_do.push(Visit { content: node.contents[slot], ..visit });
            }
        }
        all & !walk.all
    }

    /// A bit for each child that a beam enters: there is a multiple at which it is beyond the near and not beyond the far side along each axis.
    #[inline(always)]
    fn entered<S: Simd>(&self, simd: S, node: &Node8, beam: &Beam) -> u32 {
        let (centre, half) = (self.relative(simd, &node.centres), Vectors::load(simd, &node.halves));
        let (mut least, mut most) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, beam.limit));
        let axes = [(centre.x, half.x), (centre.y, half.y), (centre.z, half.z)];
        let [low, high] = beam.inverse.map(|corner| corner.to_array());
        for (axis, (centre, half)) in axes.into_iter().enumerate() {
            let (upper, lower) = ((centre + half) * low[axis], (centre - half) * high[axis]);
            if low[axis] > 0.0 {
                most = most.min(upper);
            } else {
                least = least.max(upper);
            }
            if high[axis] > 0.0 {
                least = least.max(lower);
            } else {
                most = most.min(lower);
            }
        }
        least.simd_le(most).to_bitmask() as u32
    }

    #[inline(always)]
    fn block_in_leaf<S: Simd>(&self, simd: S, visit: &Visit, beam: Option<&Beam>, from: f32, rays: &mut Rays) {
        let mut place = (visit.content & !LEAF) as usize;
        loop {
            let block = &self.packets.blocks[place];
            let seen = self.seen_block(simd, block);
            let is_missed = beam.is_some_and(|beam| seen.is_missed(simd, beam));
            let mut left = if is_missed { 0 } else { visit.rays & rays.all };
            while left != 0 {
                let ray = left.trailing_zeros() as usize % RAYS;
                left &= left - 1;
                let mut meeting = seen.meet(simd, rays.direction[ray], rays.limit[ray]);
                if from > 0.0 && meeting.lanes != 0 {
                    meeting.lanes &= meeting.distance.simd_gt(f32x8::splat(simd, from)).to_bitmask() as u32;
                }
                if meeting.lanes != 0 && (!block.has_holes || self.is_solid(block, &meeting)) {
                    rays.all &= !(1 << ray);
                }
            }
            if !block.goes_on || rays.all == 0 {
                return;
            }
            place += 1;
        }
    }

    /// Whether any triangle that a ray meets has no hole there.
    fn is_solid<S: Simd>(&self, block: &Block, meeting: &Meeting<S>) -> bool {
        let lanes = (0..BLOCK).filter(|lane| meeting.lanes & 1 << lane != 0);
        lanes.map(|lane| meeting.candidate(block, lane)).any(|candidate| {
            let triangle = &self.scene.triangles[candidate.triangle];
            !is_hole(triangle, &self.scene.materials[triangle.material as usize], &self.scene.textures, candidate.barycentric)
        })
    }
}

impl<S: Simd> SeenBlock<S> {
    /// Whether no ray of a beam meets any of the triangles: all pass an edge on one side and another edge on the other, or end before the plane.
    #[inline(always)]
    fn is_missed(&self, simd: S, beam: &Beam) -> bool {
        let zero = f32x8::splat(simd, 0.0);
        let [first, second, third] = &self.edges;
        let middles = [first.product(beam.middle), second.product(beam.middle), third.product(beam.middle)];
        let spreads = [first.magnitude().product(beam.half), second.magnitude().product(beam.half), third.magnitude().product(beam.half)];
        let least = (middles[0] - spreads[0]).max(middles[1] - spreads[1]).max(middles[2] - spreads[2]);
        let most = (middles[0] + spreads[0]).min(middles[1] + spreads[1]).min(middles[2] + spreads[2]);
        let aside = least.simd_gt(zero) & most.simd_lt(zero);
        // Along the plane's normal, toward the plane.
        let sign = self.heights.to_bits() & u32x8::splat(simd, 0x8000_0000);
        let toward = changed(self.normal.product(beam.middle), sign) + self.normal.magnitude().product(beam.half);
        let before = (toward * beam.limit).simd_le(self.heights.abs() * (1.0 - WIDER));
        (aside | before).to_bitmask() as u32 == (1 << BLOCK) - 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{hash, unit};
    use crate::scene::{
        Texture, Triangle,
        bvh::{Bvh, tests::clutter},
    };

    #[test]
    fn packets_are_blocked_where_single_rays_are() {
        for scale in [1.0, 1e-3, 1e6] {
            let mut scene = clutter(scale);
            // So few that light finds a way, half of them half holes.
            scene.triangles = scene.triangles.into_iter().step_by(11).collect();
            scene.textures.push(Texture {
                name: "holes".into(),
                width: 2,
                height: 2,
                texels: [0, 255, 255, 0].map(|alpha| [255, 255, 255, alpha]).into(),
                ..Default::default()
            });
            (scene.materials[1].texture, scene.materials[1].alpha_cutoff) = (Some(0), Some(0.5));
            scene.triangles.iter_mut().for_each(|triangle| triangle.uvs = [Vec2::ZERO, 3.0 * Vec2::X, 3.0 * Vec2::Y]);
            let bvh = Bvh::build(&mut scene);
            let places: Vec<(Vec3, Vec3)> = scene.triangles.iter().map(|t| (t.positions.iter().sum::<Vec3>() / 3.0, t.face_normal())).collect();
            let mut to_do = ToDo::default();
            let (mut rays, mut blocked, mut others) = (0, 0, 0);
            for (at, normal) in &places {
                let origin = *at + *normal * surface_offset(scene.extent(), *at);
                for until in [Until::TheirEnd, Until::FromLight, Until::Forever] {
                    let point = |ray: usize| places[ray % places.len()].0;
                    let direction = |ray: usize| 0.5 * (point(7 * ray + 3) + point(5 * ray + 1)) - origin;
                    let directions = std::array::from_fn(|ray| if until == Until::Forever { direction(ray).normalize_or(*normal) } else { direction(ray) });
                    let all = 0x5fff_ffff_ffff_fffa;
                    let hidden = bvh.packets(&scene).hidden(&scene, origin, &ShadowRays { directions, all }, until, &mut to_do);
                    assert_eq!(hidden & !all, 0);
                    let limit = if until == Until::Forever { f32::INFINITY } else { ALMOST };
                    for ray in (0..RAYS).filter(|ray| all & 1 << ray != 0) {
                        let found = hidden & 1 << ray != 0;
                        rays += 1;
                        blocked += found as u32;
                        let from = if until == Until::FromLight { origin + (1.0 - ALMOST) * directions[ray] } else { origin };
                        others += (bvh.occluded(&scene, from, directions[ray], limit) != found) as u32;
                    }
                }
            }
            // Edges, where either is right.
            assert!(
                rays > 3000 && blocked > 300 && blocked < rays - 300 && others * 200 < rays,
                "{others} of {rays} differ at scale {scale}, {blocked} blocked"
            );
        }
    }

    /// Rays that end just before small triangles far away are free, whatever way those face.
    #[test]
    fn small_lamps_far_away_do_not_hide_themselves() {
        let number = |at: u32| 2.0 * unit(hash(at)) - 1.0;
        let point = |at: u32| Vec3::new(number(3 * at), number(3 * at + 1), number(3 * at + 2));
        let triangle = |at: u32| {
            let corner = 10.0 * point(at).normalize();
            Triangle { positions: [corner, corner + 0.01 * point(1000 + at), corner + 0.01 * point(2000 + at)], ..clutter(1.0).triangles[0] }
        };
        let mut scene = clutter(1.0);
        scene.triangles = (0..400).map(triangle).collect();
        let bvh = Bvh::build(&mut scene);
        let (mut to_do, mut hidden) = (ToDo::default(), 0);
        for some in scene.triangles.chunks(RAYS) {
            let mut rays = ShadowRays { directions: [Vec3::ZERO; RAYS], all: 0 };
            for (ray, triangle) in some.iter().enumerate() {
                rays.directions[ray] = triangle.positions.iter().sum::<Vec3>() / 3.0;
                rays.all |= 1 << ray;
            }
            hidden += bvh.packets(&scene).hidden(&scene, Vec3::ZERO, &rays, Until::TheirEnd, &mut to_do).count_ones();
        }
        // Some stand before others.
        assert!(hidden < 3, "{hidden} of 400 are hidden");
    }
}

//! Shadow rays: 64 from one point, which only have to know whether anything is in their way.

use super::*;

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
    Forever,
}

/// The share of the way to a point that has to be free: the point lies on a surface.
const ALMOST: f32 = 0.9999;

/// What walks of the hierarchy are to do yet; kept between them.
#[derive(Default)]
pub struct ToDo(Vec<Visit>);

impl Packets {
    /// A bit for each of the rays that something blocks. A surface blocks from both of its sides, whatever its sidedness; holes of alpha-masked
    /// textures let light through.
    pub fn hidden(&self, scene: &Scene, origin: Vec3, rays: &ShadowRays, until: Until, to_do: &mut ToDo) -> u64 {
        let (scale, limit) = match until {
            Until::TheirEnd => (self.scale, ALMOST),
            Until::Forever => (1.0, FAR_AWAY),
        };
        let origin = self.inside(origin).clamp(Vec3::splat(-FARTHEST), Vec3::splat(FARTHEST));
        let walker = Walker { packets: self, scene, origin };
        // No child is nearer than another: whichever blocks a ray first will do.
        let mut walk = Rays { direction: rays.directions.map(|direction| direction * scale), limit: [limit; RAYS], all: rays.all, ..Rays::none() };
        walk.inverse = walk.direction.map(|direction| direction.map(inverse));
        dispatch!(Level::new(), simd => walker.block(simd, &mut walk, &mut to_do.0));
        rays.all & !walk.all
    }
}

impl Walker<'_> {
    /// Leaves the rays that nothing blocks.
    #[inline(always)]
    fn block<S: Simd>(&self, simd: S, rays: &mut Rays, to_do: &mut Vec<Visit>) {
        to_do.clear();
        if !self.packets.nodes.is_empty() {
            to_do.push(Visit { near: 0.0, rays: rays.all, content: 0 });
        }
        while let Some(mut visit) = to_do.pop() {
            visit.rays &= rays.all;
            if visit.content & LEAF == 0 {
                self.enter(simd, &visit, rays, to_do);
            } else {
                self.block_in_leaf(simd, &visit, rays);
            }
        }
    }

    #[inline(always)]
    fn block_in_leaf<S: Simd>(&self, simd: S, visit: &Visit, rays: &mut Rays) {
        let mut place = (visit.content & !LEAF) as usize;
        loop {
            let block = &self.packets.blocks[place];
            let seen = self.seen_block(simd, block);
            let mut left = visit.rays & rays.all;
            while left != 0 {
                let ray = left.trailing_zeros() as usize % RAYS;
                left &= left - 1;
                let meeting = seen.meet(simd, rays.direction[ray], rays.limit[ray]);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{
        Texture,
        bvh::{Bvh, tests::clutter},
    };

    #[test]
    fn packets_are_blocked_where_single_rays_are() {
        for scale in [1.0, 1e-3, 1e6] {
            let mut scene = clutter(scale);
            // So few that light finds a way, half of them half holes.
            scene.triangles = scene.triangles.into_iter().step_by(11).collect();
            scene.textures.push(Texture { name: "holes".into(), width: 2, height: 2, texels: [0, 255, 255, 0].map(|alpha| [255, 255, 255, alpha]).into() });
            (scene.materials[1].texture, scene.materials[1].alpha_cutoff) = (Some(0), Some(0.5));
            scene.triangles.iter_mut().for_each(|triangle| triangle.uvs = [Vec2::ZERO, 3.0 * Vec2::X, 3.0 * Vec2::Y]);
            let bvh = Bvh::build(&mut scene);
            let places: Vec<(Vec3, Vec3)> = scene.triangles.iter().map(|t| (t.positions.iter().sum::<Vec3>() / 3.0, t.face_normal())).collect();
            let mut to_do = ToDo::default();
            let (mut rays, mut blocked, mut others) = (0, 0, 0);
            for (at, normal) in &places {
                let origin = *at + *normal * surface_offset(scene.extent(), *at);
                for until in [Until::TheirEnd, Until::Forever] {
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
                        others += (bvh.occluded(&scene, origin, directions[ray], limit) != found) as u32;
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
}

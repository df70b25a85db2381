//! A host without a device, for tests of steps and of what they share: variables that are 0 until set, contents that tests put there.

use crate::contract::port;
use crate::math::weight::{Record, Rule, Weighting};
use crate::scene::{Camera, FieldOfView, Scene, Triangle, bvh::Bvh, emitters::Emission, stage::Motion};
use crate::schedule::*;
use glam::{Vec3, Vec4};
use std::any::Any;
use std::collections::HashMap;
use std::sync::OnceLock;

pub struct MockHost {
    pub variables: HashMap<Variable, u32>,
    /// A whole number of 16 bytes each.
    pub contents: HashMap<Resource, Vec<Vec4>>,
    pub draws: HashMap<Resource, Vec<Draw>>,
    pub states: HashMap<Resource, Option<Box<dyn Any + Send + Sync>>>,
    pub is_last_round: bool,
    pub is_timed: bool,
    pub cut_short: Option<(Variable, Shortfall)>,
    pub size: [u32; 2],
    pub motions: Vec<Motion>,
    pub lapse: Lapse,
    pub scene: Scene,
    pub bvh: Bvh,
    /// Of the scene as it stands when it is asked for.
    pub emission: OnceLock<Emission>,
}

impl MockHost {
    /// The camera stands at 0 and looks along −z, 90 degrees wide.
    pub fn new(triangles: Vec<Triangle>, size: [u32; 2]) -> Self {
        let camera = Camera {
            name: String::new(),
            eye: Vec3::ZERO,
            direction: Vec3::NEG_Z,
            up: Vec3::Y,
            field_of_view: FieldOfView::Horizontal(std::f32::consts::FRAC_PI_2),
            size: None,
            sample: Default::default(),
        };
        let mut scene = Scene { triangles, cameras: vec![camera], ..Scene::default() };
        let bvh = Bvh::build(&mut scene);
        Self {
            variables: HashMap::new(),
            contents: HashMap::new(),
            draws: HashMap::new(),
            states: HashMap::new(),
            is_last_round: false,
            is_timed: false,
            cut_short: None,
            size,
            motions: Vec::new(),
            lapse: Lapse::NEXT,
            scene,
            bvh,
            emission: OnceLock::new(),
        }
    }
}

impl HostContext for MockHost {
    fn read(&self, resource: Resource) -> &[u8] {
        bytemuck::cast_slice(&self.contents[&resource])
    }

    fn write(&mut self, resource: Resource, offset: u64, bytes: &[u8]) {
        let (contents, offset) = (self.contents.entry(resource).or_default(), offset as usize);
        contents.resize(contents.len().max((offset + bytes.len()).div_ceil(16)), Vec4::ZERO);
        bytemuck::cast_slice_mut::<_, u8>(contents)[offset..][..bytes.len()].copy_from_slice(bytes);
    }

    fn take(&mut self, resource: Resource) -> Vec<Vec4> {
        self.contents.remove(&resource).unwrap_or_default()
    }

    fn put(&mut self, resource: Resource, contents: Vec<Vec4>, _bytes: u64) {
        self.contents.insert(resource, contents);
    }

    fn variable(&self, variable: Variable) -> u32 {
        self.variables.get(&variable).copied().unwrap_or(0)
    }

    fn set(&mut self, variable: Variable, value: u32) {
        self.variables.insert(variable, value);
    }

    fn draws(&mut self, resource: Resource) -> &mut Vec<Draw> {
        self.draws.entry(resource).or_default()
    }

    fn state(&mut self, resource: Resource) -> &mut Option<Box<dyn Any + Send + Sync>> {
        self.states.entry(resource).or_default()
    }

    fn scene(&self) -> &Scene {
        &self.scene
    }

    fn bvh(&self) -> &Bvh {
        &self.bvh
    }

    fn emission(&self) -> &Emission {
        self.emission.get_or_init(|| Emission::of(&self.scene))
    }

    fn extent(&self) -> f32 {
        self.scene.extent()
    }

    fn is_last_round(&self) -> bool {
        self.is_last_round
    }

    fn is_timed(&self) -> bool {
        self.is_timed
    }

    fn cut_short(&mut self, until: Variable, because: Shortfall) {
        self.cut_short = Some((until, because));
    }

    fn motions(&self) -> &[Motion] {
        &self.motions
    }

    fn lapse(&self) -> Lapse {
        self.lapse
    }

    fn camera(&self) -> (&Camera, [u32; 2]) {
        (&self.scene.cameras[0], self.size)
    }
}

/// Records reach half of their radius; pixels and surroundings set no limits.
pub fn rule() -> Rule {
    Rule { weighting: Weighting::Compact, accuracy: 0.5, spacing: [0.0, 1e6], nearest: 1e6, change: 1e6, overlap: 0.25, contrast: 1.0, finest_spacing: 0.0 }
}

/// A record at 0 that faces along z, of white light, without gradients.
pub fn record() -> Record {
    Record {
        position: Vec3::ZERO,
        radius: 1.0,
        normal: Vec3::Z,
        minimum_distance: 1.0,
        irradiance: Vec3::ONE,
        footprint: 1.0,
        error: Vec3::ZERO,
        rotation: [Vec3::ZERO; 3],
        translation: [Vec3::ZERO; 3],
        stretch: Vec3::ZERO,
        relative_gradient: 0.0,
        fineness: 1.0,
        confinement: 0.0,
    }
}

/// A cache in resource 0 whose records variable 0 counts.
pub fn cache(capacity: u32) -> port::RecordCache {
    port::RecordCache { records: Resource(0), coefficients: None, count: Variable(0), capacity, weighting: Resource(1), rule: rule(), lasts: true, lives: None }
}

//! Shadow maps of the punctual lights.

use crate::contract::recorder::shadow_taps;
use crate::contract::{Arguments, Description, Need, Output, Parameter, ParameterKind, Pass, Port, PortKind, Recorder, Refusal, port};
use crate::host_struct;
use crate::recording::*;
use crate::scene::{Light, LightKind, Scene, needs::Needs, shadow_layers};
use glam::Vec3;

pub struct ShadowMap;

static DESCRIPTION: Description = Description {
    name: "ShadowMap",
    about: "Depth of the scene from every punctual light: six maps a point light, one a spot or directional light",
    source: "THESIS section 4.6 (1024² with 16-tap percentage-closer filtering)",
    parameters: &[
        Parameter { name: "resolution", about: "edge of a map", unit: "texels", kind: ParameterKind::Integer { default: 1024, min: 16, max: 8192 } },
        Parameter {
            name: "taps",
            about: "percentage-closer taps of a lookup: 4, 9, 16 or 25",
            unit: "",
            kind: ParameterKind::Integer { default: 16, min: 4, max: 25 },
        },
    ],
    inputs: &[],
    outputs: &[Output { name: "maps", about: "the maps", kind: PortKind::ShadowMaps }],
};

host_struct! {
    /// A map's camera at the light.
    pub struct ShadowView {
        origin: [f32; 3],
        near: f32,
        right: [f32; 3],
        half_width: f32,
        up: [f32; 3],
        half_height: f32,
        forward: [f32; 3],
        /// Depth that an orthographic map spans, 0 for a perspective one.
        range: f32,
    }
}

impl Pass for ShadowMap {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn need(&self, _: &Arguments, needs: &Needs) -> Need {
        if needs.shadowed_lights == 0 { Need::Dropped("no punctual light casts shadows") } else { Need::Kept }
    }

    fn record(&self, r: &mut Recorder<'_>) -> Result<(), Refusal> {
        let resolution = r.arguments.integer("resolution") as u32;
        let taps = shadow_taps(r.arguments)?;
        let views: Vec<ShadowView> = r.setting.scene.lights.iter().flat_map(|light| views(light, r.setting.scene)).collect();
        let layers = views.len() as u32;
        let buffer = r.constant_buffer("views", bytemuck::cast_slice(&views));
        let depth = r.texture("depth", [resolution, resolution], layers, Format::Depth32Float);
        let vertices = r.scene_data(SceneData::Positions);
        for layer in 0..layers {
            r.command(Command::Raster(Raster {
                program: Program::new("shadow_map")
                    .import("VISIBILITY", "lib/visibility/shadow_maps")
                    .constant("RESOLUTION", resolution)
                    .bind("shadow_views", buffer),
                vertex: "vertex",
                fragment: r.setting.needs.alpha_masks.then_some("fragment"),
                colours: Vec::new(),
                depth: Some(DepthTarget { texture: depth, layer }),
                vertices: Some(vertices),
                instances: None,
                topology: Topology::Triangles,
                draws: Draws::Fixed(vec![Draw { rectangle: None, vertices: [0, 3 * r.setting.needs.triangles], instances: [layer, layer + 1] }]),
            }));
        }
        r.output("maps", Port::ShadowMaps(port::ShadowMaps { depth, views: buffer, resolution, taps }));
        Ok(())
    }
}

/// The cameras of a light's maps, in the order of the shader's cube faces.
fn views(light: &Light, scene: &Scene) -> Vec<ShadowView> {
    let near = scene.extent() * 1e-5;
    let perspective = |origin: Vec3, forward: Vec3, half: f32| view(origin, forward, half, near, 0.0);
    match light.kind {
        _ if shadow_layers(light) == 0 => Vec::new(),
        LightKind::Point { position, .. } => AXES.iter().map(|axis| perspective(position, *axis, 1.0)).collect(),
        LightKind::Spot { position, .. } if shadow_layers(light) == 6 => AXES.iter().map(|axis| perspective(position, *axis, 1.0)).collect(),
        LightKind::Spot { position, direction, outer, .. } => vec![perspective(position, direction, outer.tan() * 1.01)],
        LightKind::Directional { direction, .. } => {
            let radius = scene.extent() * 0.505;
            vec![view(scene.bounds().centre() - direction * radius, direction, radius, near, 2.0 * radius)]
        }
    }
}

const AXES: [Vec3; 6] = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];

fn view(origin: Vec3, forward: Vec3, half: f32, near: f32, range: f32) -> ShadowView {
    let forward = forward.normalize_or(Vec3::NEG_Y);
    let right = forward.any_orthonormal_vector();
    ShadowView {
        origin: origin.into(),
        near,
        right: right.into(),
        half_width: half,
        up: right.cross(forward).into(),
        half_height: half,
        forward: forward.into(),
        range,
    }
}

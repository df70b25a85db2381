//! Shadow maps of the punctual lights.

use crate::contract::recorder::shadow_taps;
use crate::contract::{Arguments, Description, Need, Output, Parameter, ParameterKind, Pass, Port, PortKind, Recorder, Refusal, port};
use crate::recording::*;
use crate::scene::{needs::Needs, shadow_layers};

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

/// Numbers of a light's instances: as the shader takes them apart.
const FACES: u32 = 8;

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
        let lights = &r.setting.scene.lights;
        // Lights with the sides of their cubes, in the order of the layers.
        let views: Vec<[u32; 2]> = (0..).zip(lights).flat_map(|(light, about)| (0..shadow_layers(about)).map(move |face| [light, face])).collect();
        let depth = r.texture("depth", [resolution, resolution], views.len().max(1) as u32, Format::Depth32Float);
        if views.is_empty() {
            // Kept for a scene without shadows: a map that no light looks up.
            r.clear(depth);
        }
        let vertices = r.scene_data(SceneData::Positions);
        for (layer, [light, face]) in (0..).zip(views) {
            let instance = light * FACES + face;
            r.command(Command::Raster(Raster {
                program: Program::new("shadow_map").import("VISIBILITY", "lib/visibility/shadow_maps").constant("SHADOW_RESOLUTION", resolution),
                vertex: "vertex",
                fragment: r.setting.needs.alpha_masks.then_some("fragment"),
                colours: Vec::new(),
                depth: Some(DepthTarget { texture: depth, layer }),
                vertices: Some(vertices),
                instances: None,
                indices: None,
                topology: Topology::Triangles,
                draws: Draws::Fixed(vec![Draw {
                    rectangle: None,
                    vertices: [0, 3 * r.setting.needs.triangles],
                    is_indexed: false,
                    instances: [instance, instance + 1],
                }]),
            }));
        }
        r.output("maps", Port::ShadowMaps(port::ShadowMaps { depth, resolution, taps }));
        Ok(())
    }
}

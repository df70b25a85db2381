//! Every struct that host and shaders share has the same fields at the same places on both sides.

use hemisplat::gpu::{scene, shader::Shader};
use hemisplat::host_struct;
use hemisplat::passes::{
    add_records, average, choose_texel,
    find_misses::grid,
    hemisphere_tiles::{raster, sift},
    irradiance_sum::workgroup_tree,
    lobe_coefficients, path_vertices, photons,
    radiance_projection::matrix_product,
    record, texels,
};
use hemisplat::pipeline::ahead;
use hemisplat::schedule::{HostField, HostLayout};
use naga::TypeInner;

/// A shader that names each group of structs.
fn shared() -> Vec<(&'static str, Vec<HostLayout>)> {
    vec![
        ("hemisphere_tiles/shade", scene::LAYOUTS.iter().copied().filter(|l| !["FrameCamera", "SceneMover"].contains(&l.name)).collect()),
        ("motion", scene::LAYOUTS.iter().copied().filter(|l| ["FrameCamera", "SceneMover"].contains(&l.name)).collect()),
        ("irradiance_sum/reduce", record::LAYOUTS.to_vec()),
        ("irradiance_sum/workgroup_tree", vec![workgroup_tree::Cell::LAYOUT]),
        ("radiance_projection", vec![matrix_product::TileWall::LAYOUT]),
        ("lobe_coefficients", vec![lobe_coefficients::device::Shape::LAYOUT]),
        ("classify", vec![lobe_coefficients::MaterialTables::LAYOUT]),
        ("environment_light", vec![record::TablePlace::LAYOUT]),
        ("photon_tiles", vec![photons::Photon::LAYOUT, photons::MapHead::LAYOUT]),
        ("add_records", vec![add_records::Batch::LAYOUT]),
        ("path_vertices", vec![path_vertices::WalkedVertex::LAYOUT]),
        ("lightmap", vec![texels::TexelPlace::LAYOUT, texels::TexelSurface::LAYOUT]),
        ("choose_texel", vec![texels::Shot::LAYOUT, choose_texel::Pick::LAYOUT, choose_texel::Iteration::LAYOUT]),
        ("average", vec![average::Share::LAYOUT]),
        ("rounds", vec![ahead::Rounds::LAYOUT, ahead::Sizing::LAYOUT]),
        ("find_misses/device_grid", vec![grid::Round::LAYOUT]),
        ("hemisphere_tiles/raster", vec![raster::TileView::LAYOUT, raster::TileCamera::LAYOUT, sift::SiftView::LAYOUT]),
    ]
}

/// A shader's type as Rust writes it: a vector or an array of scalars, or an array of vectors.
fn written(module: &naga::Module, ty: naga::Handle<naga::Type>) -> String {
    let scalar = |scalar: naga::Scalar| match scalar.kind {
        naga::ScalarKind::Float => format!("f{}", 8 * scalar.width),
        naga::ScalarKind::Uint => format!("u{}", 8 * scalar.width),
        other => format!("{other:?}"),
    };
    match module.types[ty].inner {
        TypeInner::Scalar(kind) => scalar(kind),
        TypeInner::Vector { size, scalar: kind } => format!("[{}; {}]", scalar(kind), size as u8),
        TypeInner::Array { base, size: naga::ArraySize::Constant(count), .. } => format!("[{}; {count}]", written(module, base)),
        ref other => format!("{other:?}"),
    }
}

/// Name, offset [bytes] and type of each field.
type Fields = Vec<(String, usize, String)>;

/// What differs between a host struct and the shader's of the same name.
fn difference(module: &naga::Module, host: &HostLayout) -> Option<String> {
    let found = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(host.name));
    let Some((_, naga::Type { inner: TypeInner::Struct { members, span }, .. })) = found else {
        return Some(format!("no shader struct is called {}", host.name));
    };
    let shader: Fields = members.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset as usize, written(module, m.ty))).collect();
    let own: Fields = host.fields.iter().map(|field| (field.name.to_owned(), field.offset, field.kind.to_owned())).collect();
    let agree = (*span as usize, &shader) == (host.bytes, &own);
    (!agree).then(|| format!("{}: {} bytes of {own:?} on the host, {span} bytes of {shader:?} in the shader", host.name, host.bytes))
}

#[test]
fn host_and_shader_structs_agree_field_by_field() {
    for (name, layouts) in shared() {
        let imports = [("VISIBILITY", "lib/visibility/rays"), ("EMITTERS", "lib/emitters/traced"), ("SEEN", "lib/seen/strata")];
        let shader = Shader::load(name, &imports).unwrap_or_else(|e| panic!("{e}"));
        assert!(!layouts.is_empty());
        layouts.iter().for_each(|layout| assert_eq!(difference(&shader.module, layout), None));
    }
}

const PROBE: &str = "struct Probe { place: vec3f, weight: f32, list: array<vec4f, 2>, count: u32, a: u32, b: u32, c: u32 }
@group(0) @binding(0) var<storage, read> probes: array<Probe>;";

host_struct! {
    struct Probe {
        place: [f32; 3],
        weight: f32,
        list: [[f32; 4]; 2],
        count: u32,
        a: u32,
        b: u32,
        c: u32,
    }
}

/// Host structs as near to the shader's as mistakes are: none may pass.
#[test]
fn structs_that_differ_are_told_apart() {
    let module = naga::front::wgsl::parse_str(PROBE).unwrap();
    let right = Probe::LAYOUT;
    assert_eq!(difference(&module, &right), None);
    let change = |index: usize, change: fn(&mut HostField)| -> &'static [HostField] {
        let mut fields = right.fields.to_vec();
        change(&mut fields[index]);
        fields.leak()
    };
    let wrong = [
        ("another name", HostLayout { name: "Probes", ..right }),
        ("more padding at the end", HostLayout { bytes: 80, ..right }),
        ("a missing field", HostLayout { fields: &right.fields[..6], ..right }),
        ("a field's other name", HostLayout { fields: change(3, |field| field.name = "number"), ..right }),
        ("a wrong offset", HostLayout { fields: change(1, |field| field.offset = 16), ..right }),
        ("a wider type", HostLayout { fields: change(0, |field| field.kind = "[f32; 4]"), ..right }),
        ("another type of the same size", HostLayout { fields: change(3, |field| field.kind = "f32"), ..right }),
        ("a longer array", HostLayout { fields: change(2, |field| field.kind = "[[f32; 4]; 3]"), ..right }),
    ];
    for (what, layout) in wrong {
        assert!(difference(&module, &layout).is_some(), "{what} passes");
    }
}

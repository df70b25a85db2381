//! Every struct that host and shaders share has the same fields at the same places on both sides.

use hemisplat::gpu::{scene, shader::Shader};
use hemisplat::passes::{add_records, find_misses::device_grid, hemisphere_tiles::raster, record, shadow_map};
use hemisplat::recording::HostLayout;
use naga::TypeInner;

/// A shader that names each group of structs.
fn shared() -> Vec<(&'static str, Vec<HostLayout>)> {
    vec![
        ("hemisphere_tiles/shade", scene::LAYOUTS.iter().copied().filter(|l| l.name != "FrameCamera").collect()),
        ("gbuffer", scene::LAYOUTS.iter().copied().filter(|l| l.name == "FrameCamera").collect()),
        ("irradiance_sum/workgroup_tree", record::LAYOUTS.to_vec()),
        ("add_records", vec![add_records::Batch::LAYOUT]),
        ("find_misses/device_grid", vec![device_grid::Grid::LAYOUT]),
        ("hemisphere_tiles/raster", vec![raster::TileView::LAYOUT]),
        ("shadow_map", vec![shadow_map::ShadowView::LAYOUT]),
    ]
}

/// Bytes of a type as it stands inside a struct; an array's padding at its end belongs to it.
fn size(module: &naga::Module, ty: naga::Handle<naga::Type>) -> usize {
    module.types[ty].inner.size(module.to_ctx()) as usize
}

fn compare(module: &naga::Module, host: &HostLayout) {
    let found = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(host.name));
    let Some((_, naga::Type { inner: TypeInner::Struct { members, span }, .. })) = found else { panic!("no shader struct is called {}", host.name) };
    assert_eq!(*span as usize, host.bytes, "size of {}", host.name);
    let shader: Vec<_> = members.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset as usize, size(module, m.ty))).collect();
    let host_fields: Vec<_> = host.fields.iter().map(|(name, offset, bytes)| (name.to_string(), *offset, *bytes)).collect();
    assert_eq!(shader, host_fields, "fields of {}", host.name);
}

#[test]
fn host_and_shader_structs_agree_field_by_field() {
    for (name, layouts) in shared() {
        let shader = Shader::load(name, &[("VISIBILITY", "lib/visibility/shadow_maps")]).unwrap_or_else(|e| panic!("{e}"));
        assert!(!layouts.is_empty());
        layouts.iter().for_each(|layout| compare(&shader.module, layout));
    }
}

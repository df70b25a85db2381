#import lib/splat

// Adds each record's weighted estimate to the pixels it covers: a screen rectangle that bounds the sphere it reaches,
// blended additively.

@group(0) @binding(0) var<storage, read> records: array<Record>;
@group(0) @binding(1) var<uniform> weighting: Weighting;
@group(0) @binding(2) var position: texture_2d<f32>;
@group(0) @binding(3) var normal: texture_2d<f32>;
// The records to be splatted.
@group(0) @binding(4) var<uniform> stretch: Stretch;

// A record and where it is drawn. Each fragment would otherwise read all of the record from memory.
struct Fragment {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat, either) position_radius: vec4f,
    @location(1) @interpolate(flat, either) normal_nearest: vec4f,
    @location(2) @interpolate(flat, either) irradiance_footprint: vec4f,
    @location(3) @interpolate(flat, either) rotation_red: vec4f,
    @location(4) @interpolate(flat, either) rotation_green: vec4f,
    @location(5) @interpolate(flat, either) rotation_blue: vec4f,
    @location(6) @interpolate(flat, either) translation_red: vec4f,
    @location(7) @interpolate(flat, either) translation_green: vec4f,
    @location(8) @interpolate(flat, either) translation_blue: vec4f,
    @location(9) @interpolate(flat, either) error_index: vec4u,
}

@vertex
fn vertex(@builtin(vertex_index) corner: u32, @builtin(instance_index) instance: u32) -> Fragment {
    let index = stretch.first + instance;
    let record = records[index];
    let bounds = rectangle_of(record, weighting);
    let at = select(bounds.low, bounds.high, vec2<bool>((corner & 1u) != 0u, corner > 1u));
    return Fragment(
        select(vec4f(at, 0.5, 1.0), vec4f(2.0, 2.0, 0.5, 1.0), bounds.behind),
        vec4f(record.position, record.radius),
        vec4f(record.normal, record.minimum_distance),
        vec4f(record.irradiance, record.footprint),
        record.rotation[0],
        record.rotation[1],
        record.rotation[2],
        record.translation[0],
        record.translation[1],
        record.translation[2],
        vec4u(bitcast<vec3u>(record.error), index),
    );
}

fn record_of(in: Fragment) -> Record {
    return Record(
        in.position_radius.xyz,
        in.position_radius.w,
        in.normal_nearest.xyz,
        in.normal_nearest.w,
        in.irradiance_footprint.xyz,
        in.irradiance_footprint.w,
        array(in.rotation_red, in.rotation_green, in.rotation_blue),
        array(in.translation_red, in.translation_green, in.translation_blue),
        bitcast<vec3f>(in.error_index.xyz),
        0u,
    );
}

struct Sums {
    @location(0) sums: vec4f,
    @location(1) count: vec4f,
}

fn value_at(in: Fragment) -> vec4f {
    let pixel = vec2u(in.clip.xy);
    return contribution(record_of(in), in.error_index.w, weighting, textureLoad(position, pixel, 0), textureLoad(normal, pixel, 0).xyz, pixel);
}

@fragment
fn fragment(in: Fragment) -> @location(0) vec4f {
    let value = value_at(in);
    if value.w == 0.0 {
        discard;
    }
    return value;
}

// Counts the records of each pixel as well.
@fragment
fn fragment_counted(in: Fragment) -> Sums {
    let value = value_at(in);
    if value.w == 0.0 {
        discard;
    }
    return Sums(value, vec4f(1.0));
}

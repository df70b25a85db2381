#import lib/splat

// Adds each record's weighted estimate to the pixels it covers: a screen rectangle that bounds the sphere it reaches,
// blended additively.

@group(0) @binding(0) var<storage, read> records: array<Record>;
@group(0) @binding(1) var<uniform> weighting: Weighting;
@group(0) @binding(2) var position: texture_2d<f32>;
@group(0) @binding(3) var normal: texture_2d<f32>;

struct Fragment {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat, either) record: u32,
}

@vertex
fn vertex(@builtin(vertex_index) corner: u32, @builtin(instance_index) index: u32) -> Fragment {
    let bounds = rectangle_of(records[index], weighting);
    let at = select(bounds.low, bounds.high, vec2<bool>((corner & 1u) != 0u, corner > 1u));
    return Fragment(select(vec4f(at, 0.5, 1.0), vec4f(2.0, 2.0, 0.5, 1.0), bounds.behind), index);
}

struct Sums {
    @location(0) sums: vec4f,
    @location(1) count: vec4f,
}

fn value_at(in: Fragment) -> vec4f {
    let pixel = vec2u(in.clip.xy);
    return contribution(records[in.record], weighting, textureLoad(position, pixel, 0), textureLoad(normal, pixel, 0).xyz);
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

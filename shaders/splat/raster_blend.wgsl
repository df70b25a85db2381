#import lib/camera
#import lib/record

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

// Range of x/z over a disc in the plane of one picture axis and the view axis, within ±2: math::projection is the twin.
fn extent_along(lateral: f32, depth: f32, radius: f32, half: f32) -> vec2f {
    let squared = lateral * lateral + depth * depth - radius * radius;
    if squared <= 0.0 {
        return vec2f(-1.0, 1.0);
    }
    let tangent = sqrt(squared);
    // Directions of the two tangents through the eye; one that points behind the eye leaves that side open.
    let low = vec2f(lateral * tangent - depth * radius, depth * tangent + lateral * radius);
    let high = vec2f(lateral * tangent + depth * radius, depth * tangent - lateral * radius);
    let a = select(-1.0, low.x / (low.y * half), low.y > 1e-6 * tangent * tangent);
    let b = select(1.0, high.x / (high.y * half), high.y > 1e-6 * tangent * tangent);
    return clamp(vec2f(a, b), vec2f(-1.0), vec2f(1.0));
}

@vertex
fn vertex(@builtin(vertex_index) corner: u32, @builtin(instance_index) index: u32) -> Fragment {
    let record = records[index];
    let radius = reach(record, weighting) * 1.0001;
    let d = record.position - camera.eye;
    let depth = dot(d, camera.forward);
    let x = extent_along(dot(d, camera.right), depth, radius, camera.half_width);
    let y = extent_along(dot(d, camera.up), depth, radius, camera.half_height);
    // Half a pixel wider: a pixel is covered where its centre is.
    let margin = 1.0 / vec2f(camera.size);
    let at = vec2f(select(x.x - margin.x, x.y + margin.x, (corner & 1u) != 0u), select(y.x - margin.y, y.y + margin.y, corner > 1u));
    let behind = depth + radius <= 0.0;
    return Fragment(select(vec4f(at, 0.5, 1.0), vec4f(2.0, 2.0, 0.5, 1.0), behind), index);
}

struct Sums {
    @location(0) sums: vec4f,
    @location(1) count: vec4f,
}

fn contribution(in: Fragment) -> vec4f {
    let pixel = vec2u(in.clip.xy);
    let place = textureLoad(position, pixel, 0);
    let record = records[in.record];
    let facing = textureLoad(normal, pixel, 0).xyz;
    let weight = record_weight(record, weighting, place.xyz, facing);
    if place.w == 0.0 || weight <= 0.0 {
        return vec4f(0.0);
    }
    return vec4f(record_estimate(record, place.xyz, facing), 1.0) * weight;
}

@fragment
fn fragment(in: Fragment) -> @location(0) vec4f {
    let value = contribution(in);
    if value.w == 0.0 {
        discard;
    }
    return value;
}

// Counts the records of each pixel as well.
@fragment
fn fragment_counted(in: Fragment) -> Sums {
    let value = contribution(in);
    if value.w == 0.0 {
        discard;
    }
    return Sums(value, vec4f(1.0));
}

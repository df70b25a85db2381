#import lib/beside
#import lib/colour

// What neighbouring pixels see by their lobes, together: as passes/lobe_rays/filter.rs.

@group(0) @binding(0) var position: texture_2d<f32>;
@group(0) @binding(1) var normal: texture_2d<f32>;
// Light that a pixel's rays see, and the standard error of its luminance.
@group(0) @binding(2) var seen: texture_2d<f32>;
// The share of light that the lobe reflects.
@group(0) @binding(3) var albedo: texture_2d<f32>;
@group(0) @binding(4) var radiance: texture_storage_2d<rgba32float, write>;

// Standard errors that what two pixels see may lie apart.
override TOLERANCE: f32 = 0.5;

const REACH = 3;
const LEAST_VARIANCE = 1e-30;

fn likeness(own: vec4f, other: vec4f) -> f32 {
    let apart = luminance(other.rgb - own.rgb);
    let variance = max(own.a * own.a + other.a * other.a, LEAST_VARIANCE);
    return exp(-0.5 * apart * apart / (TOLERANCE * TOLERANCE * variance));
}

@compute @workgroup_size(8, 8)
fn filter_pixels(@builtin(global_invocation_id) id: vec3u) {
    let size = vec2i(textureDimensions(position));
    let at = vec2i(id.xy);
    if any(at >= size) {
        return;
    }
    let place = textureLoad(position, at, 0);
    if place.w <= 0.0 {
        textureStore(radiance, at, vec4f(0.0, 0.0, 0.0, 1.0));
        return;
    }
    let facing = textureLoad(normal, at, 0).xyz;
    let own = textureLoad(seen, at, 0);
    var sum = own.rgb;
    var weights = 1.0;
    for (var y = -REACH; y <= REACH; y++) {
        for (var x = -REACH; x <= REACH; x++) {
            let there = at + vec2i(x, y);
            if (x == 0 && y == 0) || any(there < vec2i(0)) || any(there >= size) {
                continue;
            }
            let other = textureLoad(position, there, 0);
            if other.w > 0.0 && is_beside(place.xyz, facing, other.xyz, textureLoad(normal, there, 0).xyz) {
                let light = textureLoad(seen, there, 0);
                let weight = likeness(own, light);
                // Not so where what is seen is no number.
                if weight > 0.0 {
                    sum += light.rgb * weight;
                    weights += weight;
                }
            }
        }
    }
    textureStore(radiance, at, vec4f(textureLoad(albedo, at, 0).rgb * sum / weights, 1.0));
}

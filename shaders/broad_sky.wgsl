#import lib/light
#import lib/pixel
#import lib/beside
#import lib/colour

// What the diffuse parts of the visible surfaces reflect of the broad sky: seen by a few rays at each pixel, smoothed over pixels beside each other, and
// added to the rest. As passes/direct_light/sky.rs.

@group(0) @binding(0) var triangles: texture_2d<u32>;
@group(0) @binding(1) var position: texture_2d<f32>;
@group(0) @binding(2) var normal: texture_2d<f32>;
// The mean radiance of the sky that a pixel sees, and the standard error of its luminance.
@group(0) @binding(3) var seen: texture_2d<f32>;
@group(0) @binding(4) var albedo: texture_2d<f32>;
@group(0) @binding(5) var rest: texture_2d<f32>;
@group(0) @binding(6) var seen_out: texture_storage_2d<rgba32float, write>;
@group(0) @binding(7) var albedo_out: texture_storage_2d<rgba32float, write>;
@group(0) @binding(8) var radiance: texture_storage_2d<rgba32float, write>;

// Standard errors that what two pixels see may lie apart.
override TOLERANCE: f32 = 1.0;
// From one pixel that is asked to the next.
override STEP: i32 = 1;

const REACH = 2;
const LEAST_VARIANCE = 1e-30;
const LEAST_WEIGHT = 1e-20;

@compute @workgroup_size(8, 8)
fn see(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(triangles)) {
        return;
    }
    let triangle = textureLoad(triangles, id.xy, 0).x;
    var light = vec4f(0.0);
    var reflectance = vec3f(0.0);
    if triangle != 0u {
        let surface = surface_in_pixel(triangle - 1u, id.xy);
        light = broad_sky(surface, combine(id.x, id.y));
        reflectance = surface.reflectance;
    }
    textureStore(seen_out, id.xy, light);
    textureStore(albedo_out, id.xy, vec4f(reflectance, 1.0));
}

// Whether another pixel shows the same surface as one at `place`.
fn shows_same(place: vec4f, facing: vec3f, there: vec2i) -> bool {
    if any(there < vec2i(0)) || any(there >= vec2i(textureDimensions(position))) {
        return false;
    }
    let other = textureLoad(position, there, 0);
    return other.w > 0.0 && is_beside(place.xyz, facing, other.xyz, textureLoad(normal, there, 0).xyz);
}

@compute @workgroup_size(8, 8)
fn smooth_sky(@builtin(global_invocation_id) id: vec3u) {
    let at = vec2i(id.xy);
    if any(at >= vec2i(textureDimensions(position))) {
        return;
    }
    let place = textureLoad(position, at, 0);
    let own = textureLoad(seen, at, 0);
    if place.w <= 0.0 {
        textureStore(seen_out, at, own);
        return;
    }
    let facing = textureLoad(normal, at, 0).xyz;
    // Of a pixel's own rays too many may have got through by chance, or none: it does not know by how much they vary, nor what is usual.
    var variance = own.a * own.a;
    var middle = own.rgb;
    var pixels = vec2f(1.0);
    for (var y = -REACH; y <= REACH; y++) {
        for (var x = -REACH; x <= REACH; x++) {
            let there = at + STEP * vec2i(x, y);
            if (x != 0 || y != 0) && shows_same(place, facing, there) {
                let other = textureLoad(seen, there, 0);
                let is_near = STEP * max(abs(x), abs(y)) == 1;
                variance += other.a * other.a;
                middle += select(vec3f(0.0), other.rgb, is_near);
                pixels += vec2f(1.0, select(0.0, 1.0, is_near));
            }
        }
    }
    middle /= pixels.y;
    let apart_by_chance = TOLERANCE * TOLERANCE * 2.0 * max(variance / pixels.x, LEAST_VARIANCE);
    var sum = LEAST_WEIGHT * own.rgb;
    var squares = 0.0;
    var weights = LEAST_WEIGHT;
    for (var y = -REACH; y <= REACH; y++) {
        for (var x = -REACH; x <= REACH; x++) {
            let there = at + STEP * vec2i(x, y);
            if (x == 0 && y == 0) || shows_same(place, facing, there) {
                let other = textureLoad(seen, there, 0);
                let apart = luminance(other.rgb - middle);
                let weight = exp(-0.5 * apart * apart / apart_by_chance);
                // Not so where what is seen is no number.
                if weight > 0.0 {
                    sum += other.rgb * weight;
                    squares += other.a * other.a * weight * weight;
                    weights += weight;
                }
            }
        }
    }
    textureStore(seen_out, at, vec4f(sum, sqrt(squares)) / weights);
}

@compute @workgroup_size(8, 8)
fn add(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(rest)) {
        return;
    }
    let light = textureLoad(rest, id.xy, 0);
    textureStore(radiance, id.xy, vec4f(light.rgb + textureLoad(albedo, id.xy, 0).rgb * textureLoad(seen, id.xy, 0).rgb, light.a));
}

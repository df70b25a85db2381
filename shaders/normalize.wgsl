// Weighted sums to irradiance and reflected radiance; counts what went wrong.

@group(0) @binding(0) var sums: texture_2d<f32>;
@group(0) @binding(1) var position: texture_2d<f32>;
@group(0) @binding(2) var reflectance: texture_2d<f32>;
@group(0) @binding(3) var irradiance: texture_storage_2d<rgba32float, write>;
@group(0) @binding(4) var radiance: texture_storage_2d<rgba32float, write>;
// Pixels that see a surface and no record counts, pixels whose value is not finite, pixels of negative radiance: harmonics ring.
@group(0) @binding(5) var<storage, read_write> faults: array<atomic<u32>, 4>;

// Standard errors of the irradiance.
@group(0) @binding(6) var uncertainty: texture_storage_2d<rgba32float, write>;

fn is_finite(value: vec4f) -> bool {
    // An exponent of all ones is infinity or NaN; comparisons may be optimised away, bits are not.
    let exponents = bitcast<vec4u>(value) & vec4u(0x7f800000u);
    return all(exponents != vec4u(0x7f800000u));
}

// Whether the sums are of radiance toward the camera in place of irradiance.
override OF_RADIANCE: bool = false;

@compute @workgroup_size(8, 8)
fn divide(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(position)) {
        return;
    }
    let sum = textureLoad(sums, id.xy, 0);
    var value = vec3f(0.0);
    if textureLoad(position, id.xy, 0).w > 0.0 {
        if !is_finite(sum) {
            atomicAdd(&faults[1], 1u);
        } else if sum.w > 0.0 {
            value = sum.rgb / sum.w;
        } else {
            atomicAdd(&faults[0], 1u);
        }
    }
    if OF_RADIANCE {
        if any(value < vec3f(0.0)) {
            atomicAdd(&faults[2], 1u);
        }
        textureStore(radiance, id.xy, vec4f(max(value, vec3f(0.0)), 1.0));
        return;
    }
    textureStore(irradiance, id.xy, vec4f(value, 1.0));
    textureStore(radiance, id.xy, vec4f(value * textureLoad(reflectance, id.xy, 0).rgb / 3.14159265358979, 1.0));
}

// The same of sums of standard errors; nothing where nothing is known.
@compute @workgroup_size(8, 8)
fn divide_errors(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(position)) {
        return;
    }
    let sum = textureLoad(sums, id.xy, 0);
    let is_known = textureLoad(position, id.xy, 0).w > 0.0 && is_finite(sum) && sum.w > 0.0;
    textureStore(uncertainty, id.xy, vec4f(select(vec3f(0.0), sum.rgb / max(sum.w, 1e-37), is_known), 1.0));
}

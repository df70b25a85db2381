#import lib/record

// What a record of irradiance may be wrong by at a pixel.

// Weighted standard error and weight at a pixel that sees `place`, whose fourth component is 0 where nothing is seen.
fn contribution(record: Record, index: u32, weighting: Weighting, place: vec4f, facing: vec3f, pixel: vec2u) -> vec4f {
    let weight = record_weight(record, weighting, place.xyz, facing);
    if place.w == 0.0 || weight <= 0.0 {
        return vec4f(0.0);
    }
    return vec4f(record.error, 1.0) * weight;
}

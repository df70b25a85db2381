#import lib/record

// Coefficients of records in half the bytes, at eleven bits each.

@group(0) @binding(16) var<storage, read> coefficients: array<vec2u>;

fn coefficient_four(index: u32) -> vec4f {
    let packed = coefficients[index];
    return vec4f(unpack2x16float(packed.x), unpack2x16float(packed.y));
}

// What expansions and their derivatives are multiples of.
fn coefficient_units(record: Record) -> vec2f {
    return half_units(record);
}

#import lib/record

// Coefficients of records as they were projected.

@group(0) @binding(16) var<storage, read> coefficients: array<vec4f>;

fn coefficient_four(index: u32) -> vec4f {
    return coefficients[index];
}

// What expansions and their derivatives are multiples of.
fn coefficient_units(record: Record) -> vec2f {
    return vec2f(1.0);
}

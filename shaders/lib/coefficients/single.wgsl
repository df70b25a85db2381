// Coefficients of records as they were projected.

@group(0) @binding(16) var<storage, read> coefficients: array<vec4f>;

fn coefficient_four(index: u32) -> vec4f {
    return coefficients[index];
}

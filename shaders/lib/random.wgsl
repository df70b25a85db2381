// Counter-based random numbers: the same arguments give the same number on every device.

// One round of the PCG output permutation (Jarzynski and Olano 2020, "pcg").
fn hash(value: u32) -> u32 {
    let state = value * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

fn combine(a: u32, b: u32) -> u32 {
    return hash(a ^ (hash(b) + 0x9e3779b9u));
}

// In [0, 1).
fn unit(bits: u32) -> f32 {
    return f32(bits >> 8u) / 16777216.0;
}

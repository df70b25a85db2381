#import lib/random

// Cells of an index over records, as math::record_index has them.

// The cell that a point is in, of those whose edge is a power of two.
fn cell_of(position: vec3f, exponent: i32) -> vec3i {
    let scale = bitcast<f32>(u32(127 - exponent) << 23u);
    return vec3i(clamp(floor(position * scale), vec3f(-2e9), vec3f(2e9)));
}

// The place of a cell's list among so many, a power of two.
fn cell_hash(cell: vec3i, level: u32, hashes: u32) -> u32 {
    let at = bitcast<vec3u>(cell);
    return hash((at.x * 2654435761u) ^ (at.y * 2246822519u) ^ (at.z * 3266489917u) ^ (level * 668265263u)) & (hashes - 1u);
}

// Sums over a workgroup of 256.

const GROUP = 256u;

var<workgroup> shared_sums: array<vec2f, 256>;

// The sum of what each lane has, for all of them.
fn sum_of_lanes(lane: u32, own: vec2f) -> vec2f {
    shared_sums[lane] = own;
    for (var step = GROUP / 2u; step > 0u; step /= 2u) {
        workgroupBarrier();
        if lane < step {
            shared_sums[lane] += shared_sums[lane + step];
        }
    }
    workgroupBarrier();
    return shared_sums[0];
}

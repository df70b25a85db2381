#import lib/record
#import lib/variables

// Where the device drives a fill: the next stretch of the records that the sums do not have yet.

@group(0) @binding(0) var<storage, read_write> fresh_stretch: Stretch;

// Most records of a stretch, and how many stretches there are.
override MOST: u32 = 1u;
override STRETCHES: u32 = 1u;
// Where variables stand: records in the cache, of those splatted, the next stretch, and how many records the first stretch has.
override ALL: u32 = 0u;
override FIRST: u32 = 0u;
override NEXT: u32 = 0u;
override COUNTS: u32 = 0u;

@compute @workgroup_size(1)
fn fresh() {
    let first = variables[FIRST];
    let count = min(variables[ALL] - min(variables[ALL], first), MOST);
    fresh_stretch = Stretch(first, count, 0u, 0u);
    variables[COUNTS + variables[NEXT]] = count;
    variables[NEXT] = (variables[NEXT] + 1u) % STRETCHES;
    variables[FIRST] = first + count;
}

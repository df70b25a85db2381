#import lib/variables

// Begins the lists of shaders/record_index, where the device drives the loops before them.

@group(0) @binding(0) var<storage, read_write> header: array<u32>;

// Where the numbers stand of the records, of those that are listed, and of the lists to be made: one.
override RECORDS: u32 = 0u;
override LISTED: u32 = 0u;
override LISTS: u32 = 0u;
override HASHES: u32 = 1u;

@compute @workgroup_size(1)
fn begin() {
    let count = variables[RECORDS];
    header[0] = 0u;
    header[1] = 0u;
    header[2] = HASHES;
    header[3] = count;
    variables[LISTED] = count;
    variables[LISTS] = 1u;
}

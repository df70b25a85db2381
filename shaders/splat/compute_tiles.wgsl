#import lib/splat

// Records binned over tiles of 16×16 pixels, then added pixel by pixel in the records' order.
// A tile's mask has a bit a record, and before those a bit for each of their words that is not 0. Setting bits in any
// order gives the same masks, so every run gives the same sums.

@group(0) @binding(0) var<storage, read> records: array<Record>;
@group(0) @binding(1) var<uniform> weighting: Weighting;
// The records of this chunk, `MASK_WORDS · 32` at most.
@group(0) @binding(2) var<uniform> stretch: Stretch;
// Tile by tile; 0 between chunks.
@group(0) @binding(3) var<storage, read_write> masks: array<atomic<u32>>;
@group(0) @binding(4) var position: texture_2d<f32>;
@group(0) @binding(5) var normal: texture_2d<f32>;
// What is in the sums so far: images of 32-bit floats cannot be both read and written.
@group(0) @binding(6) var<storage, read_write> added: array<vec4f>;
@group(0) @binding(7) var sums: texture_storage_2d<rgba32float, write>;
@group(0) @binding(8) var<storage, read_write> counted: array<u32>;
@group(0) @binding(9) var counts: texture_storage_2d<rgba32float, write>;

// Words with a bit a record, and with a bit a word.
override MASK_WORDS: u32 = 1024u;
override SUMMARY_WORDS: u32 = 32u;

const TILE = 16u;

// Where a tile's mask begins; the words of records follow its summary.
fn mask_of(tile: u32) -> u32 {
    return tile * (SUMMARY_WORDS + MASK_WORDS);
}

fn tiles() -> vec2u {
    return (camera.size + TILE - 1u) / TILE;
}

@compute @workgroup_size(64)
fn bin(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let index = (group.x + group.y * groups.x) * 64u + lane;
    if index >= stretch.count {
        return;
    }
    let bounds = rectangle_of(records[stretch.first + index], weighting);
    if bounds.behind {
        return;
    }
    let size = vec2f(camera.size);
    let low = clamp((vec2f(bounds.low.x, -bounds.high.y) + 1.0) * 0.5 * size, vec2f(0.0), size - 1.0);
    let high = clamp((vec2f(bounds.high.x, -bounds.low.y) + 1.0) * 0.5 * size, vec2f(0.0), size - 1.0);
    let first = vec2u(low) / TILE;
    let last = vec2u(high) / TILE;
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            let mask = mask_of(y * tiles().x + x);
            atomicOr(&masks[mask + index / 1024u], 1u << (index / 32u % 32u));
            atomicOr(&masks[mask + SUMMARY_WORDS + index / 32u], 1u << (index % 32u));
        }
    }
}

struct Pixel {
    at: vec2u,
    index: u32,
    inside: bool,
}

fn pixel_of(tile: u32, lane: u32) -> Pixel {
    let across = tiles();
    let at = vec2u(tile % across.x, tile / across.x) * TILE + vec2u(lane % TILE, lane / TILE);
    return Pixel(at, at.y * camera.size.x + at.x, tile < across.x * across.y && all(at < camera.size));
}

// Adds the chunk's records to a pixel in their order, then empties the tile's mask; returns how many count there.
fn walk(tile: u32, pixel: Pixel, lane: u32) -> u32 {
    let place = select(vec4f(0.0), textureLoad(position, pixel.at, 0), pixel.inside);
    let facing = textureLoad(normal, pixel.at, 0).xyz;
    let mask = mask_of(tile);
    // A dispatch of many tiles has some groups too many.
    let records_binned = select(0u, stretch.count, tile < tiles().x * tiles().y);
    var sum = added[select(0u, pixel.index, pixel.inside)];
    var count = 0u;
    for (var i = 0u; i < (records_binned + 1023u) / 1024u; i++) {
        var words = atomicLoad(&masks[mask + i]);
        while words != 0u {
            let word = i * 32u + firstTrailingBit(words);
            words &= words - 1u;
            var bits = atomicLoad(&masks[mask + SUMMARY_WORDS + word]);
            while bits != 0u {
                let index = stretch.first + word * 32u + firstTrailingBit(bits);
                bits &= bits - 1u;
                let value = contribution(records[index], index, weighting, place, facing, pixel.at);
                sum += value;
                count += select(0u, 1u, value.w > 0.0);
            }
        }
    }
    storageBarrier();
    let used = select(0u, SUMMARY_WORDS + (records_binned + 31u) / 32u, records_binned > 0u);
    for (var i = lane; i < used; i += TILE * TILE) {
        atomicStore(&masks[mask + i], 0u);
    }
    if count > 0u {
        added[pixel.index] = sum;
        textureStore(sums, pixel.at, sum);
    }
    return count;
}

// One workgroup a tile, one lane a pixel.
@compute @workgroup_size(256)
fn add(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let tile = group.x + group.y * groups.x;
    walk(tile, pixel_of(tile, lane), lane);
}

// Counts the records of each pixel as well.
@compute @workgroup_size(256)
fn add_counted(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let tile = group.x + group.y * groups.x;
    let pixel = pixel_of(tile, lane);
    let count = walk(tile, pixel, lane);
    if count > 0u {
        let all = counted[pixel.index] + count;
        counted[pixel.index] = all;
        textureStore(counts, pixel.at, vec4f(f32(all)));
    }
}

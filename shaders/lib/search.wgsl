// Which cells a round of a search for misses looks at.
struct Round {
    // Edge of a cell [pixels], a power of two.
    cell: u32,
    // Which of the four cells of a 2×2 block are looked at: bit 0 along x, bit 1 along y.
    phase: u32,
    capacity: u32,
    // Blocks before this one have been served.
    start: u32,
}

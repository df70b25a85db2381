// The numbers of a schedule, as a loop that the device drives has them: six of the loop, then those that passes declare, then what each of
// those was last before it became 0.

@group(0) @binding(31) var<storage, read_write> variables: array<u32>;

// Rounds that have begun.
const ROUNDS = 0u;
// Whether the loop has ended, so that the rounds encoded ahead do nothing.
const IS_OVER = 1u;
const IS_LAST_ROUND = 2u;
// Why the loop ends although work is left, by its code; 0 for no reason.
const SHORTFALL = 3u;
// Whether a loop has more to do than the host takes for granted: then loops do nothing until the host has looked.
const HELD = 4u;
// Where the variable stands that ends the loop.
const UNTIL = 5u;
const VARIABLES_BEFORE = 6u;

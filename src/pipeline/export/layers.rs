//! A layered drawing of one level of a graph, from top to bottom (Sugiyama and others 1981): ranks by longest path, a place in each
//! rank that a long line crosses, an order of few crossings, coordinates, and lines of horizontal and vertical parts.
//!
//! Between two ranks lies a channel, and all horizontal parts run in channels, so that no line crosses a block. What leaves one
//! output is one net: its lines share their way as far as they can.

use std::collections::BTreeMap;
use std::ops::Range;

/// Something with a place of its own, and where lines enter at its top and leave at its bottom.
#[derive(Debug, Clone, Default)]
pub struct Block {
    pub size: [i32; 2],
    pub inputs: Vec<Pin>,
    pub outputs: Vec<Pin>,
    pub role: Role,
    /// Left and top.
    pub position: [i32; 2],
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Role {
    /// Its pins are put in the order of fewest crossings.
    #[default]
    Node,
    /// Its pins stay where they are.
    Frame,
    /// What stands in the first rank before the others.
    Title,
    /// Where a line comes in from outside.
    Entry,
    /// Where a line goes on outside.
    Exit,
    /// Where a line crosses a rank.
    Passage,
}

impl Role {
    fn is_line(self) -> bool {
        matches!(self, Self::Entry | Self::Exit | Self::Passage)
    }
}

/// Where a line meets a block.
#[derive(Debug, Clone, Copy, Default)]
pub struct Pin {
    /// From the block's left edge.
    pub offset: i32,
    /// Width that its label needs.
    pub cell: i32,
    /// The middle of the label, from the block's left edge.
    pub label: i32,
}

/// A block and a pin of it.
pub type End = (usize, usize);

/// All that leaves one output.
#[derive(Debug, Clone)]
pub struct Net {
    pub source: End,
    pub targets: Vec<End>,
    /// Targets that may be above the source: the line goes around then.
    pub back: Vec<End>,
}

/// One level of a graph.
#[derive(Debug, Clone, Default)]
pub struct Level {
    pub blocks: Vec<Block>,
    pub nets: Vec<Net>,
}

/// A line from a net's source to one of its targets.
#[derive(Debug, Clone)]
pub struct Line {
    pub net: usize,
    pub target: End,
    pub points: Vec<[i32; 2]>,
}

/// Room beside blocks and lines.
const BLOCK_GAP: i32 = 28;
const LINE_GAP: i32 = 16;
const MIXED_GAP: i32 = 22;
/// Least distance of vertical parts of two nets in a channel.
const APART: i32 = 7;
/// A line is straight rather than jogs by this.
const JOG: i32 = 11;
/// From one horizontal part to the next, from a rank to the first of them, and from the last to the rank below: an arrow's head has room.
const TRACK: i32 = 10;
const ABOVE_TRACKS: i32 = 14;
const BELOW_TRACKS: i32 = 22;
/// Between lines that go around.
const LANE: i32 = 14;

const SWEEPS: usize = 12;

impl Level {
    /// Places the blocks from `margin` on, and draws the lines; the size is that of all with the margin at right. The first rank starts at the
    /// top, the last ends at the bottom.
    pub fn lay_out(&mut self, margin: i32) -> ([i32; 2], Vec<Line>) {
        let mut layers = Layers::new(self);
        layers.order();
        layers.arrange_pins();
        layers.place(margin);
        let right = layers.blocks.iter().map(|block| block.position[0] + block.size[0]).max().unwrap_or(margin);
        let channels = layers.channels(right);
        let height = layers.stack(&channels);
        let (lines, lanes) = layers.lines(&channels, right);
        let count = self.blocks.len();
        self.blocks = layers.blocks;
        self.blocks.truncate(count);
        ([right + lanes * LANE + margin, height], lines)
    }
}

/// Part of a net between a rank and the next.
#[derive(Debug, Clone, Copy)]
struct Step {
    net: usize,
    from: End,
    to: End,
}

struct Layers {
    /// Those of the level, then passages.
    blocks: Vec<Block>,
    nets: Vec<Net>,
    rank_of: Vec<usize>,
    /// Blocks of each rank from left to right.
    ranks: Vec<Vec<usize>>,
    /// Steps from each rank to the next.
    steps: Vec<Vec<Step>>,
}

/// Horizontal and vertical parts of one net in one channel.
#[derive(Debug, Clone, Default)]
struct Wire {
    /// Where it goes up from its horizontal part, and where down.
    up: Vec<i32>,
    down: Vec<i32>,
    track: i32,
}

/// What a wire belongs to: a net, and for those that go around, which of its targets.
type WireKey = (usize, Option<usize>);

#[derive(Debug, Clone, Default)]
struct Channel {
    wires: BTreeMap<WireKey, Wire>,
    height: i32,
}

impl Layers {
    fn new(level: &Level) -> Self {
        let rank_of = ranks(level);
        let count = rank_of.iter().max().map_or(1, |last| last + 1);
        let mut layers =
            Self { blocks: level.blocks.clone(), nets: level.nets.clone(), rank_of, ranks: vec![Vec::new(); count], steps: vec![Vec::new(); count] };
        for index in 0..level.nets.len() {
            layers.straighten(index);
            layers.split(index);
        }
        for block in 0..layers.blocks.len() {
            layers.ranks[layers.rank_of[block]].push(block);
        }
        layers
    }

    /// A target that turns out to be below the source needs no way around.
    fn straighten(&mut self, index: usize) {
        let net = &mut self.nets[index];
        let (below, back) = net.back.drain(..).partition(|target: &End| self.rank_of[target.0] > self.rank_of[net.source.0]);
        net.back = back;
        net.targets.extend::<Vec<End>>(below);
    }

    /// Splits a net into steps, with a passage in each rank that it crosses.
    fn split(&mut self, index: usize) {
        let net = self.nets[index].clone();
        let first = self.rank_of[net.source.0];
        let last = net.targets.iter().map(|target| self.rank_of[target.0]).max().unwrap_or(first);
        let mut from = net.source;
        for rank in first..last {
            let here = net.targets.iter().filter(|target| self.rank_of[target.0] == rank + 1);
            self.steps[rank].extend(here.map(|to| Step { net: index, from, to: *to }));
            if rank + 1 < last {
                let passage = (self.blocks.len(), 0);
                self.blocks.push(Block { role: Role::Passage, inputs: vec![Pin::default()], outputs: vec![Pin::default()], ..Block::default() });
                self.rank_of.push(rank + 1);
                self.steps[rank].push(Step { net: index, from, to: passage });
                from = passage;
            }
        }
    }

    /// Orders the blocks of each rank by the middle of their neighbours, down and up, and keeps the order of fewest crossings.
    fn order(&mut self) {
        let mut best = (self.crossings(), self.ranks.clone());
        for sweep in 0..SWEEPS {
            let down = sweep % 2 == 0;
            let count = self.ranks.len();
            for at in 0..count {
                self.order_rank(if down { at } else { count - 1 - at }, down);
            }
            self.exchange();
            let crossings = self.crossings();
            if crossings < best.0 {
                best = (crossings, self.ranks.clone());
            }
        }
        self.ranks = best.1;
    }

    fn order_rank(&mut self, rank: usize, down: bool) {
        let places = self.places();
        let mut keyed: Vec<(bool, f32, usize, usize)> = Vec::new();
        for (place, block) in self.ranks[rank].iter().enumerate() {
            let others: Vec<f32> = match down {
                true if rank > 0 => {
                    self.steps[rank - 1].iter().filter(|step| step.to.0 == *block).map(|step| self.place_of(step.from, false, &places)).collect()
                }
                false => self.steps[rank].iter().filter(|step| step.from.0 == *block).map(|step| self.place_of(step.to, true, &places)).collect(),
                true => Vec::new(),
            };
            let middle = if others.is_empty() { place as f32 } else { others.iter().sum::<f32>() / others.len() as f32 };
            keyed.push((self.blocks[*block].role != Role::Title, middle, place, *block));
        }
        keyed.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
        self.ranks[rank] = keyed.into_iter().map(|key| key.3).collect();
    }

    /// Exchanges neighbours as long as that saves crossings.
    fn exchange(&mut self) {
        for rank in 0..self.ranks.len() {
            for left in 1..self.ranks[rank].len() {
                if self.blocks[self.ranks[rank][left - 1]].role == Role::Title {
                    continue;
                }
                let before = self.crossings_at(rank);
                self.ranks[rank].swap(left - 1, left);
                if self.crossings_at(rank) >= before {
                    self.ranks[rank].swap(left - 1, left);
                }
            }
        }
    }

    /// Of each block in its rank.
    fn places(&self) -> Vec<usize> {
        let mut places = vec![0; self.blocks.len()];
        for rank in &self.ranks {
            rank.iter().enumerate().for_each(|(place, block)| places[*block] = place);
        }
        places
    }

    /// Where a pin is among those of its rank: pins of a node count as one, as they can be put in any order.
    fn place_of(&self, (block, pin): End, is_input: bool, places: &[usize]) -> f32 {
        let block_pins = if is_input { &self.blocks[block].inputs } else { &self.blocks[block].outputs };
        let within =
            if self.blocks[block].role == Role::Frame { (block_pins[pin].offset as f32 + 1.0) / (self.blocks[block].size[0] as f32 + 2.0) } else { 0.5 };
        places[block] as f32 + within
    }

    fn crossings(&self) -> usize {
        let places = self.places();
        (0..self.steps.len()).map(|rank| self.crossings_below(rank, &places)).sum()
    }

    fn crossings_at(&self, rank: usize) -> usize {
        let places = self.places();
        (rank.saturating_sub(1)..=rank).map(|rank| self.crossings_below(rank, &places)).sum()
    }

    fn crossings_below(&self, rank: usize, places: &[usize]) -> usize {
        let ends = |step: &Step| (self.place_of(step.from, false, places), self.place_of(step.to, true, places), step.net);
        let steps: Vec<(f32, f32, usize)> = self.steps[rank].iter().map(ends).collect();
        let cross = |a: &(f32, f32, usize), b: &(f32, f32, usize)| a.2 != b.2 && (a.0 - b.0) * (a.1 - b.1) < 0.0;
        steps.iter().enumerate().map(|(index, a)| steps[..index].iter().filter(|b| cross(a, b)).count()).sum()
    }

    /// Puts the pins of nodes in the order of what they are joined to, side by side in the middle of the edge.
    fn arrange_pins(&mut self) {
        let places = self.places();
        for block in 0..self.blocks.len() {
            if self.blocks[block].role == Role::Node {
                let rank = self.rank_of[block];
                let above = if rank > 0 { &self.steps[rank - 1][..] } else { &[] };
                let inputs = above.iter().filter(|step| step.to.0 == block).map(|step| (step.to.1, self.place_of(step.from, false, &places))).collect();
                let outputs =
                    self.steps[rank].iter().filter(|step| step.from.0 == block).map(|step| (step.from.1, self.place_of(step.to, true, &places))).collect();
                let width = self.blocks[block].size[0];
                distribute(&mut self.blocks[block].inputs, inputs, width);
                distribute(&mut self.blocks[block].outputs, outputs, width);
            }
        }
    }

    /// Gives every block its place from left to right: as near to straight lines as the order allows.
    fn place(&mut self, margin: i32) {
        for rank in 0..self.ranks.len() {
            let mut left = margin;
            for at in 0..self.ranks[rank].len() {
                left += if at > 0 { self.gap(rank, at) } else { 0 };
                self.blocks[self.ranks[rank][at]].position[0] = left;
                left += self.blocks[self.ranks[rank][at]].size[0];
            }
        }
        for sweep in 0..SWEEPS {
            let both = sweep + 2 < SWEEPS;
            (0..self.ranks.len()).for_each(|rank| self.place_rank(rank, true, both));
            if sweep + 1 < SWEEPS {
                (0..self.ranks.len()).rev().for_each(|rank| self.place_rank(rank, false, both));
            }
        }
        let least = self.blocks.iter().map(|block| block.position[0]).min().unwrap_or(margin);
        for block in &mut self.blocks {
            block.position[0] = if block.role == Role::Title { margin } else { block.position[0] + margin - least };
        }
    }

    /// Room between a block and the one before it.
    fn gap(&self, rank: usize, at: usize) -> i32 {
        let is_line = |at: usize| self.blocks[self.ranks[rank][at]].role.is_line();
        match (is_line(at - 1), is_line(at)) {
            (true, true) => LINE_GAP,
            (false, false) => BLOCK_GAP,
            _ => MIXED_GAP,
        }
    }

    /// Moves the blocks of a rank to where lines from above (or below, or both) are straight, no closer than they may be.
    fn place_rank(&mut self, rank: usize, from_above: bool, both: bool) {
        let row = self.ranks[rank].clone();
        let mut offsets = Vec::new();
        let mut wishes = Vec::new();
        let mut offset = 0;
        for (at, block) in row.iter().enumerate() {
            offset += if at > 0 { self.gap(rank, at) + self.blocks[row[at - 1]].size[0] } else { 0 };
            offsets.push(offset);
            let (wish, weight) = self.wish(*block, rank, from_above, both);
            wishes.push((f64::from(wish - offset), weight));
        }
        for ((block, offset), place) in row.iter().zip(offsets).zip(ascending(&wishes)) {
            self.blocks[*block].position[0] = place.round() as i32 + offset;
        }
    }

    /// Where a block's lines are straight, and how much that counts.
    fn wish(&self, block: usize, rank: usize, from_above: bool, both: bool) -> (i32, f64) {
        let is_line = |block: usize| self.blocks[block].role.is_line();
        let mut wishes: Vec<(i32, f64)> = Vec::new();
        let weight = |other: usize| match (is_line(block), is_line(other)) {
            (true, true) => 40.0,
            (false, false) => 1.0,
            _ => 2.0,
        };
        if rank > 0 && (from_above || both) {
            let steps = self.steps[rank - 1].iter().filter(|step| step.to.0 == block);
            wishes.extend(steps.map(|step| (self.x_below(step.from) - self.blocks[block].inputs[step.to.1].offset, weight(step.from.0))));
        }
        if !from_above || both || wishes.is_empty() {
            let steps = self.steps[rank].iter().filter(|step| step.from.0 == block);
            wishes.extend(steps.map(|step| (self.x_above(step.to) - self.blocks[block].outputs[step.from.1].offset, weight(step.to.0))));
        }
        let total: f64 = wishes.iter().map(|wish| wish.1).sum();
        if wishes.is_empty() {
            return (self.blocks[block].position[0], 0.1);
        }
        if both {
            return ((wishes.iter().map(|wish| f64::from(wish.0) * wish.1).sum::<f64>() / total).round() as i32, total);
        }
        wishes.sort_by_key(|wish| wish.0);
        let mut below = 0.0;
        let median = wishes.iter().find(|wish| {
            below += wish.1;
            below >= total / 2.0
        });
        (median.map_or(0, |wish| wish.0), total)
    }

    fn x_above(&self, (block, pin): End) -> i32 {
        self.blocks[block].position[0] + self.blocks[block].inputs[pin].offset
    }

    fn x_below(&self, (block, pin): End) -> i32 {
        self.blocks[block].position[0] + self.blocks[block].outputs[pin].offset
    }

    /// What runs between the ranks: channel 0 is above the first of them. Lines that go around run right of `right`.
    fn channels(&mut self, right: i32) -> Vec<Channel> {
        let mut channels = vec![Channel::default(); self.ranks.len() + 1];
        for rank in 0..self.ranks.len() {
            self.keep_apart(rank);
            for step in &self.steps[rank] {
                let wire = channels[rank + 1].wires.entry((step.net, None)).or_default();
                wire.up = vec![self.x_below(step.from)];
                wire.down.push(self.x_above(step.to));
            }
        }
        let mut lane = right;
        for (index, net) in self.nets.iter().enumerate() {
            for (back, target) in net.back.iter().enumerate() {
                lane += LANE;
                let wire = channels[self.rank_of[net.source.0] + 1].wires.entry((index, None)).or_default();
                wire.up.push(lane);
                if !wire.up.contains(&self.x_below(net.source)) {
                    wire.up.push(self.x_below(net.source));
                }
                let down = vec![self.x_above(*target), lane];
                channels[self.rank_of[target.0]].wires.insert((index, Some(back)), Wire { down, ..Wire::default() });
            }
        }
        channels.iter_mut().for_each(Channel::assign_tracks);
        channels
    }

    /// Moves pins below a rank by a little: to where a line is straight, and off the lines of other nets.
    fn keep_apart(&mut self, rank: usize) {
        let around = self.nets.iter().enumerate().flat_map(|(index, net)| net.back.iter().map(move |to| Step { net: index, from: net.source, to: *to }));
        let around = around.filter(|step| self.rank_of[step.to.0] == rank + 1);
        let mut ends: Vec<(i32, Step)> = self.steps[rank].iter().copied().chain(around).map(|step| (self.x_above(step.to), step)).collect();
        ends.sort_by_key(|end| end.0);
        let mut above: Vec<(i32, usize)> = self.steps[rank].iter().map(|step| (self.x_below(step.from), step.net)).collect();
        above.extend(
            self.nets
                .iter()
                .enumerate()
                .filter(|(_, net)| !net.back.is_empty() && self.rank_of[net.source.0] == rank)
                .map(|(i, net)| (self.x_below(net.source), i)),
        );
        self.move_frames(rank + 1, &mut ends, &above);
        for index in 0..ends.len() {
            let (x, step) = ends[index];
            if self.blocks[step.to.0].role == Role::Frame {
                continue;
            }
            let is_free = |x: i32| {
                let off_lines = above.iter().all(|(other, net)| *net == step.net || (other - x).abs() >= APART);
                let off_pins = ends.iter().enumerate().all(|(other, end)| other == index || (end.0 - x).abs() >= APART);
                off_lines && off_pins && self.range(step.to, rank + 1).contains(&x)
            };
            let straight = self.x_below(step.from);
            let near = (0..=2 * JOG).flat_map(|by| [x + by, x - by]);
            let found = Some(straight).filter(|straight| (straight - x).abs() <= JOG).into_iter().chain(near).find(|x| is_free(*x)).unwrap_or(x);
            ends[index].0 = found;
            match self.blocks[step.to.0].role {
                Role::Node => self.blocks[step.to.0].inputs[step.to.1].offset += found - x,
                _ => self.blocks[step.to.0].position[0] += found - x,
            }
        }
    }

    /// Moves whole frames where a pin would lie on another net's line: their pins stay where they are.
    fn move_frames(&mut self, rank: usize, ends: &mut [(i32, Step)], above: &[(i32, usize)]) {
        let frames: Vec<usize> = self.ranks.get(rank).into_iter().flatten().copied().filter(|block| self.blocks[*block].role == Role::Frame).collect();
        for frame in frames {
            let mine = |end: &&mut (i32, Step)| end.1.to.0 == frame;
            let pins: Vec<(i32, usize)> = ends.iter().filter(|end| end.1.to.0 == frame).map(|(x, step)| (*x, step.net)).collect();
            let is_free = |by: i32| pins.iter().all(|(x, net)| above.iter().all(|(other, of)| of == net || (other - x - by).abs() > APART / 2));
            let range = self.range((frame, 0), rank);
            let left = self.blocks[frame].position[0];
            let fits = |by: &i32| range.contains(&(left + by)) && range.contains(&(left + by + self.blocks[frame].size[0]));
            let by = (0..4 * JOG).flat_map(|by| [by, -by]).filter(fits).find(|by| is_free(*by)).unwrap_or(0);
            self.blocks[frame].position[0] += by;
            ends.iter_mut().filter(mine).for_each(|end| end.0 += by);
        }
    }

    /// Where a pin may be moved to: along its block's edge, or between its neighbours.
    fn range(&self, (block, _): End, rank: usize) -> Range<i32> {
        let [left, width] = [self.blocks[block].position[0], self.blocks[block].size[0]];
        if self.blocks[block].role == Role::Node {
            return left + 8..left + width - 7;
        }
        let row = &self.ranks[rank];
        let place = row.iter().position(|other| *other == block).unwrap_or(0);
        let before = place.checked_sub(1).map_or(0, |place| self.blocks[row[place]].position[0] + self.blocks[row[place]].size[0]);
        let after = row.get(place + 1).map_or(i32::MAX, |next| self.blocks[*next].position[0]);
        before + APART..after - APART + 1
    }

    /// Gives ranks and channels their place from top to bottom; the height of all.
    fn stack(&mut self, channels: &[Channel]) -> i32 {
        let mut top = 0;
        for (rank, row) in self.ranks.iter().enumerate() {
            top += channels[rank].height(rank > 0);
            row.iter().for_each(|block| self.blocks[*block].position[1] = top);
            top += self.row_height(rank);
        }
        top + channels[self.ranks.len()].height(false)
    }

    fn row_height(&self, rank: usize) -> i32 {
        self.ranks[rank].iter().map(|block| self.blocks[*block].size[1]).max().unwrap_or(0)
    }

    /// Top of a channel: where the rank above it ends.
    fn channel_top(&self, channel: usize, channels: &[Channel]) -> i32 {
        let above = (0..channel).map(|rank| channels[rank].height(rank > 0) + self.row_height(rank));
        above.sum()
    }

    /// The lines, and how many go around.
    fn lines(&self, channels: &[Channel], right: i32) -> (Vec<Line>, i32) {
        let track =
            |channel: usize, key: WireKey| self.channel_top(channel, channels) + channels[channel].wires.get(&key).map_or(0, |wire| channels[channel].y(wire));
        let (mut lines, mut lanes) = (Vec::new(), 0);
        for (index, net) in self.nets.iter().enumerate() {
            let start = [self.x_below(net.source), self.blocks[net.source.0].position[1] + self.blocks[net.source.0].size[1]];
            for target in &net.targets {
                let mut points = vec![start];
                for step in self.way(index, *target) {
                    let y = track(self.rank_of[step.from.0] + 1, (index, None));
                    points.extend([[self.x_below(step.from), y], [self.x_above(step.to), y]]);
                }
                points.push([self.x_above(*target), self.blocks[target.0].position[1]]);
                lines.push(Line { net: index, target: *target, points: corners(points) });
            }
            for (back, target) in net.back.iter().enumerate() {
                lanes += 1;
                let lane = right + lanes * LANE;
                let [low, high] = [track(self.rank_of[net.source.0] + 1, (index, None)), track(self.rank_of[target.0], (index, Some(back)))];
                let x = self.x_above(*target);
                let points = vec![start, [start[0], low], [lane, low], [lane, high], [x, high], [x, self.blocks[target.0].position[1]]];
                lines.push(Line { net: index, target: *target, points: corners(points) });
            }
        }
        (lines, lanes)
    }

    /// The steps from a net's source to a target.
    fn way(&self, net: usize, target: End) -> Vec<Step> {
        let mut way = Vec::new();
        let mut at = target;
        for rank in (self.rank_of[self.nets[net].source.0]..self.rank_of[target.0]).rev() {
            let Some(step) = self.steps[rank].iter().find(|step| step.net == net && step.to == at) else { break };
            way.push(*step);
            at = step.from;
        }
        way.reverse();
        way
    }
}

impl Wire {
    fn ends(&self) -> impl Iterator<Item = i32> {
        self.up.iter().chain(&self.down).copied()
    }

    fn span(&self) -> [i32; 2] {
        [self.ends().min().unwrap_or(0), self.ends().max().unwrap_or(0)]
    }

    fn is_straight(&self) -> bool {
        let [left, right] = self.span();
        left == right
    }

    /// Crossings where this is above the other; lines that would lie on each other count most.
    fn cost_above(&self, other: &Self) -> i32 {
        let crosses = |x: &&i32, [left, right]: [i32; 2]| left < **x && **x < right;
        let crossings = other.up.iter().filter(|x| crosses(x, self.span())).count() + self.down.iter().filter(|x| crosses(x, other.span())).count();
        let overlaps = self.down.iter().filter(|x| other.up.iter().any(|up| (up - **x).abs() < 3)).count();
        (crossings + 1000 * overlaps) as i32
    }
}

impl Channel {
    /// Puts horizontal parts that would meet one below the other, in an order of few crossings.
    fn assign_tracks(&mut self) {
        let mut waiting: Vec<WireKey> = self.wires.iter().filter(|(_, wire)| !wire.is_straight()).map(|(key, _)| *key).collect();
        let mut order = Vec::new();
        while !waiting.is_empty() {
            let cost = |key: &WireKey| {
                waiting.iter().map(|other| self.wires[key].cost_above(&self.wires[other]) - self.wires[other].cost_above(&self.wires[key])).sum::<i32>()
            };
            let next = (0..waiting.len()).min_by_key(|at| cost(&waiting[*at])).unwrap_or(0);
            order.push(waiting.remove(next));
        }
        let mut placed: Vec<([i32; 2], i32)> = Vec::new();
        for key in order {
            let Some(wire) = self.wires.get_mut(&key) else { continue };
            let [left, right] = wire.span();
            let above = placed.iter().filter(|([l, r], _)| *l < right + APART && left < *r + APART).map(|(_, track)| track + 1);
            wire.track = above.max().unwrap_or(0);
            placed.push(([left, right], wire.track));
        }
        self.height = placed.iter().map(|(_, track)| track + 1).max().unwrap_or(0);
    }

    /// Of a channel between ranks, or of one that only what goes around runs in.
    fn height(&self, is_between: bool) -> i32 {
        match self.height {
            0 if is_between => ABOVE_TRACKS + BELOW_TRACKS,
            0 => 0,
            tracks => ABOVE_TRACKS + (tracks - 1) * TRACK + BELOW_TRACKS,
        }
    }

    /// Of a wire's horizontal part, from the channel's top.
    fn y(&self, wire: &Wire) -> i32 {
        ABOVE_TRACKS + wire.track * TRACK
    }
}

/// Ranks by the longest way from above; a block that nothing leads to stands just above what it leads to.
fn ranks(level: &Level) -> Vec<usize> {
    let has_border = level.blocks.iter().any(|block| matches!(block.role, Role::Title | Role::Entry));
    let is_border = |role: Role| matches!(role, Role::Title | Role::Entry);
    let mut ranks: Vec<usize> = level.blocks.iter().map(|block| usize::from(has_border && !is_border(block.role))).collect();
    // As many times as the longest way has steps at most, which the number of blocks bounds.
    for _ in 0..level.blocks.len() {
        for net in &level.nets {
            for target in &net.targets {
                ranks[target.0] = ranks[target.0].max(ranks[net.source.0] + 1);
            }
        }
    }
    for (block, item) in level.blocks.iter().enumerate() {
        let is_source = !is_border(item.role) && level.nets.iter().all(|net| net.targets.iter().all(|target| target.0 != block));
        let targets = level.nets.iter().filter(|net| net.source.0 == block).flat_map(|net| &net.targets).map(|target| ranks[target.0]);
        if let Some(nearest) = targets.min().filter(|_| is_source) {
            ranks[block] = ranks[block].max(nearest - 1);
        }
    }
    let last = ranks.iter().zip(&level.blocks).filter(|(_, block)| block.role != Role::Exit).map(|(rank, _)| rank + 1).max().unwrap_or(0);
    for (rank, block) in ranks.iter_mut().zip(&level.blocks) {
        *rank = if block.role == Role::Exit { last } else { *rank };
    }
    ranks
}

/// Puts pins side by side in the middle of an edge, in the order of the places that they are joined to.
fn distribute(pins: &mut [Pin], joined: Vec<(usize, f32)>, width: i32) {
    let key = |pin: usize| {
        let places: Vec<f32> = joined.iter().filter(|(joined, _)| *joined == pin).map(|(_, place)| *place).collect();
        // What goes around leaves at the right.
        if places.is_empty() { f32::MAX } else { places.iter().sum::<f32>() / places.len() as f32 }
    };
    let mut order: Vec<usize> = (0..pins.len()).collect();
    order.sort_by(|a, b| key(*a).total_cmp(&key(*b)).then(a.cmp(b)));
    let mut left = (width - pins.iter().map(|pin| pin.cell).sum::<i32>()) / 2;
    for pin in order {
        pins[pin].offset = left + pins[pin].cell / 2;
        pins[pin].label = pins[pin].offset;
        left += pins[pin].cell;
    }
}

/// The ascending numbers next to some wishes with their weights (isotonic regression: pool adjacent violators).
fn ascending(wishes: &[(f64, f64)]) -> Vec<f64> {
    let mut pools: Vec<(f64, f64, usize)> = Vec::new();
    for (wish, weight) in wishes {
        pools.push((*wish, *weight, 1));
        while let [.., (before, heavy, many), (after, light, few)] = pools[..] {
            if before <= after {
                break;
            }
            pools.truncate(pools.len() - 2);
            pools.push(((before * heavy + after * light) / (heavy + light), heavy + light, many + few));
        }
    }
    pools.into_iter().flat_map(|(place, _, count)| std::iter::repeat_n(place, count)).collect()
}

/// Without points that lie on the way between others.
fn corners(points: Vec<[i32; 2]>) -> Vec<[i32; 2]> {
    let mut kept: Vec<[i32; 2]> = Vec::new();
    for point in points {
        if kept.last() == Some(&point) {
            continue;
        }
        if let [.., a, b] = kept[..]
            && ((a[0] == b[0] && b[0] == point[0]) || (a[1] == b[1] && b[1] == point[1]))
        {
            kept.pop();
        }
        kept.push(point);
    }
    kept
}

//! A picture of several samples a pixel: the mean of pictures whose rays are a part of a pixel apart.

use super::layers::{Layer, Layers};
use super::run::{FrameReport, PassReport};
use std::collections::BTreeMap;

/// Channels that are averaged: light, and what share of a pixel shows surfaces. What tells of a place, such as depth and normals, is that of the first picture.
const AVERAGED: [&str; 4] = ["R", "G", "B", "A"];

/// The mean of pictures so far.
pub struct Average {
    sum: Layers,
    pictures: u32,
}

impl Average {
    pub fn of(first: Layers) -> Self {
        Self { sum: first, pictures: 1 }
    }

    /// Adds a picture of the same layers and size.
    pub fn add(&mut self, picture: &Layers) {
        self.pictures += 1;
        for (name, layer) in &mut self.sum.layers {
            let Some(other) = picture.layers.get(name) else { continue };
            for (plane, other) in averaged(layer).filter_map(|(name, plane)| Some((plane, other.channels.get(name)?))) {
                plane.iter_mut().zip(other).for_each(|(sum, value)| *sum += value);
            }
        }
    }

    pub fn mean(mut self) -> Layers {
        if self.pictures == 1 {
            return self.sum;
        }
        let share = 1.0 / self.pictures as f32;
        for (_, plane) in self.sum.layers.values_mut().flat_map(averaged) {
            plane.iter_mut().for_each(|value| *value *= share);
        }
        self.sum
    }
}

fn averaged(layer: &mut Layer) -> impl Iterator<Item = (&String, &mut Vec<f32>)> {
    layer.channels.iter_mut().filter(|(name, _)| AVERAGED.contains(&name.as_str()))
}

impl FrameReport {
    /// The report of this frame and of one that went on with its records.
    pub fn and(mut self, next: Self) -> Self {
        let add = |a: Option<u32>, b: Option<u32>| a.zip(b).map(|(a, b)| a.saturating_add(b));
        let mut before: BTreeMap<String, PassReport> = self.passes.drain(..).map(|pass| (pass.node.clone(), pass)).collect();
        let joined = |pass: PassReport| match before.remove(&pass.node) {
            None => pass,
            Some(earlier) => PassReport {
                gpu_ms: earlier.gpu_ms.zip(pass.gpu_ms).map(|(a, b)| a + b),
                cpu_ms: earlier.cpu_ms + pass.cpu_ms,
                runs: earlier.runs + pass.runs,
                numbers: larger(earlier.numbers, pass.numbers),
                ..pass
            },
        };
        let unfinished = self.unfinished.into_iter().chain(next.unfinished).fold(Vec::new(), |mut all, ended| {
            all.extend((!all.contains(&ended)).then_some(ended));
            all
        });
        Self {
            seconds: self.seconds + next.seconds,
            records: next.records,
            new_records: add(self.new_records, next.new_records),
            surplus_records: add(self.surplus_records, next.surplus_records),
            fill_rounds: add(self.fill_rounds, next.fill_rounds),
            waits: self.waits + next.waits,
            uncovered_pixels: self.uncovered_pixels.max(next.uncovered_pixels),
            coarse_pixels: self.coarse_pixels.max(next.coarse_pixels),
            coarsest: self.coarsest.max(next.coarsest),
            non_finite_pixels: self.non_finite_pixels.max(next.non_finite_pixels),
            passes: next.passes.into_iter().map(joined).collect(),
            complete: self.complete && next.complete,
            unfinished,
        }
    }
}

/// Of each number the larger: what one frame had to do the other may have found done.
fn larger(mut earlier: BTreeMap<&'static str, u32>, later: BTreeMap<&'static str, u32>) -> BTreeMap<&'static str, u32> {
    for (name, number) in later {
        earlier.entry(name).and_modify(|before| *before = number.max(*before)).or_insert(number);
    }
    earlier
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_is_averaged_and_places_are_the_firsts() {
        let picture = |light: f32, depth: f32| {
            let colour = Layer {
                channels: [("R", light), ("G", 2.0 * light), ("B", 0.0), ("A", light)].map(|(name, value)| (name.to_owned(), vec![value])).into(),
                half: false,
            };
            Layers::new(1, 1).with("picture", colour).with("depth", Layer::value(vec![depth]))
        };
        let mut average = Average::of(picture(0.0, 3.0));
        [0.5, 1.0].into_iter().for_each(|light| average.add(&picture(light, 7.0)));
        let mean = average.mean();
        assert_eq!(mean, picture(0.5, 3.0));
    }
}

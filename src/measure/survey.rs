//! What is to be measured: rows of pipelines, each over the same values of some parameters. `hemisplat sweep` makes one of its arguments, a study
//! is one as a file.

use super::compare::letters;
use super::criteria::{Cost, Metric};
use super::expectation::Expectation;
use super::sweep::{Axis, Outcome, Point, grid};
use crate::pipeline::Set;
use crate::pipeline::syntax::{Place, Word};

pub struct Survey {
    pub rows: Vec<Row>,
    pub over: Vec<Swept>,
    /// Runs of each point.
    pub runs: u16,
    /// The error of tables, front and plot.
    pub metric: Metric,
    /// What that error is held against.
    pub cost: Cost,
    /// Nodes whose traffic is told.
    pub moved: Vec<Word>,
    /// What a study expects of its numbers.
    pub expected: Vec<Expectation>,
}

/// A pipeline, as it is before parameters are swept.
pub struct Row {
    /// What tables and plots call it.
    pub name: String,
    /// A path, or the name of one that ships.
    pub pipeline: String,
    /// Where the pipeline is named; None on the command line.
    pub place: Option<Place>,
    pub sets: Vec<Set>,
}

/// A parameter and the values that it takes in turn.
pub struct Swept {
    /// `node.parameter`
    pub parameter: String,
    pub sets: Vec<Set>,
}

impl Swept {
    /// As reports have it.
    pub fn axis(&self) -> Axis {
        Axis { parameter: self.parameter.clone(), values: self.sets.iter().map(|set| set.value.written().to_owned()).collect() }
    }
}

impl Survey {
    /// Points of a row.
    pub fn columns(&self) -> usize {
        self.over.iter().map(|swept| swept.sets.len()).fold(1, usize::saturating_mul)
    }

    pub fn axes(&self) -> Vec<Axis> {
        self.over.iter().map(Swept::axis).collect()
    }

    /// Every row with every combination of values: by row, then by values, those of the last parameter the fastest.
    pub fn points(&self) -> Vec<(&Row, Vec<Set>, Point)> {
        let lengths: Vec<usize> = self.over.iter().map(|swept| swept.sets.len()).collect();
        let places = grid(&lengths);
        let pairs = self.rows.iter().flat_map(|row| places.iter().map(move |place| (row, place)));
        pairs.enumerate().map(|(index, (row, place))| self.point(letters(index), row, place)).collect()
    }

    fn point<'s>(&'s self, id: String, row: &'s Row, place: &[usize]) -> (&'s Row, Vec<Set>, Point) {
        let swept: Vec<&Set> = self.over.iter().zip(place).map(|(swept, at)| &swept.sets[*at]).collect();
        let values = swept.iter().map(|set| (set.key.text.clone(), set.value.written().to_owned())).collect();
        let sets: Vec<Set> = row.sets.iter().chain(swept).cloned().collect();
        let set = sets.iter().map(Set::to_string).collect();
        let point = Point { id, row: row.name.clone(), pipeline: row.pipeline.clone(), set, values, outcome: Outcome::Open, traffic: None, pareto: false };
        (row, sets, point)
    }
}

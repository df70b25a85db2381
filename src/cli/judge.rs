//! What the pictures of a survey are judged by.

use super::console::Console;
use super::failure::Failure;
use super::scene::View;
use super::truth::{Judged, Shorter, Truth, TruthOptions};
use crate::measure::compare::ReferenceReport;
use crate::measure::survey::Survey;
use std::collections::BTreeMap;

pub(super) enum Judge<'t> {
    Nothing,
    /// Of each frame of a sequence another.
    Frames(Frames<'t>),
    /// And by shorter ones what is the method's.
    Truth(Box<Truth>, Vec<Shorter>),
    Row(JudgingRow),
}

/// A row whose pictures judge those of the other rows.
pub(super) struct JudgingRow {
    pub(super) name: String,
    /// Its place among the rows.
    index: usize,
    /// Points of a row.
    columns: usize,
    /// Its pictures so far, by point.
    pub(super) pictures: BTreeMap<usize, Truth>,
}

/// Truths of frames, which are traced as they are wanted, and found from then on.
pub(super) struct Frames<'t> {
    pub(super) options: &'t TruthOptions,
    pub(super) judged: Judged,
}

impl Frames<'_> {
    /// That of a view, where one is wanted.
    pub(super) fn truth(&self, view: &View, console: &Console) -> Result<Option<Truth>, Failure> {
        self.options.keeper(view, self.judged)?.map(|keeper| keeper.obtain(view, console)).transpose()
    }
}

impl JudgingRow {
    /// The point of this row with the same values.
    pub(super) fn point_of(&self, point: usize) -> usize {
        self.index * self.columns + point % self.columns
    }
}

impl Judge<'_> {
    /// By the row of this place, or else by this picture, if there is one.
    pub(super) fn new(row: Option<usize>, survey: &Survey, truth: Option<Truth>, shorter: Vec<Shorter>) -> Self {
        match (row, truth) {
            (Some(index), _) => Self::Row(JudgingRow { name: survey.rows[index].name.clone(), index, columns: survey.columns(), pictures: BTreeMap::new() }),
            (None, Some(truth)) => Self::Truth(Box::new(truth), shorter),
            (None, None) => Self::Nothing,
        }
    }

    pub(super) fn report(&self) -> Option<ReferenceReport> {
        match self {
            // The file of the last one is told by who has led to it.
            Self::Nothing | Self::Frames(_) => None,
            Self::Truth(truth, _) => Some(truth.report()),
            Self::Row(row) => Some(ReferenceReport {
                file: None,
                row: Some(row.name.clone()),
                own: true,
                bounces: None,
                samples: None,
                noise_over_mean: None,
                error_asked: None,
                stride: None,
                windows: None,
            }),
        }
    }
}

//! What places next to each other have in common.

use crate::passes::record::Request;
use glam::{IVec3, Vec3};
use std::collections::{HashMap, HashSet};

/// Where a place is, in edges of a cell, and where it faces, in steps of [`FACING`].
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Cell([IVec3; 2]);

const FACING: f32 = 2.0;

/// Something of each cell that places have been in.
pub struct Cells<T> {
    known: HashMap<Cell, T>,
    /// Of a cell [scene units].
    edge: f32,
}

impl<T> Cells<T> {
    pub fn new(edge: f32) -> Self {
        Self { known: HashMap::new(), edge }
    }

    pub fn of(&self, place: &Request) -> Cell {
        let [position, normal] = [place.position, place.normal].map(Vec3::from);
        Cell([position / self.edge, normal * FACING].map(|at| at.round().as_ivec3()))
    }

    pub fn at(&self, place: &Request) -> Option<&T> {
        self.known.get(&self.of(place))
    }

    /// Whether nothing is known of a place's cell and no place was seen there; from now on one was.
    pub fn is_first(&self, place: &Request, seen: &mut HashSet<Cell>) -> bool {
        self.at(place).is_none() && seen.insert(self.of(place))
    }

    pub fn entry(&mut self, place: &Request) -> std::collections::hash_map::Entry<'_, Cell, T> {
        self.known.entry(self.of(place))
    }
}

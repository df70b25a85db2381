//! What a frame finds of those before it, to be kept outside of the device: a session that is given it goes on as if it had made them.

use super::device::GpuError;
use super::memory::Physical;
use super::session::Session;
use super::views::View;
use crate::schedule::*;
use std::collections::BTreeMap;

/// Of all histories but those that are the same made anew.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct State {
    /// Since the scene has changed.
    pub frames: u32,
    /// By name.
    pub variables: BTreeMap<String, u32>,
    /// By name, as far as they are in use.
    pub resources: BTreeMap<String, Vec<u8>>,
}

/// Memory of frames before that a schedule has: what is in it, and how many bytes of that are in use.
struct Held {
    resource: Resource,
    used: Option<(u64, Variable)>,
}

impl Session {
    /// What the last frame leaves to the next, but for what others keep; None where it cannot be kept, as it would be of images of depths.
    pub async fn state(&self, but: &Histories) -> Result<Option<State>, GpuError> {
        let held = self.held(but);
        if held.iter().any(|held| self.is_of_depths(held.resource)) {
            return Ok(None);
        }
        let (mut resources, mut reader) = (BTreeMap::new(), self.reader());
        for Held { resource, used } in held {
            let whole = self.unpadded_bytes(resource) as u64;
            let bytes = used.map_or(whole, |(each, count)| (each * u64::from(self.variable(count))).min(whole));
            let contents = reader.look_first(resource, bytes as usize, <[u8]>::to_vec).await?;
            resources.insert(self.schedule.resource(resource).name.clone(), contents);
        }
        let variables = self.counted(but).into_iter().map(|(variable, name)| (name, self.variable(variable))).collect();
        Ok(Some(State { frames: self.frames, variables, resources }))
    }

    /// Goes on from what another session's last frame left; whether this one has the same histories. If not, nothing is taken over.
    pub fn go_on_from(&mut self, state: &State, but: &Histories) -> bool {
        let (held, counted) = (self.held(but), self.counted(but));
        let are_all = (held.len(), counted.len()) == (state.resources.len(), state.variables.len());
        if !are_all || !self.put_back(state, &held, &counted) {
            return false;
        }
        self.frames = state.frames;
        true
    }

    /// Goes on with what is added to in any frame, as another session left it; whether this one has the same. If not, nothing is taken over.
    pub fn add_to(&mut self, state: &State, but: &Histories) -> bool {
        let (mut held, mut counted) = (self.held(but), self.counted(but));
        let added = &self.schedule.accumulated;
        held.retain(|held| added.resources.contains(&held.resource));
        counted.retain(|(variable, _)| added.variables.contains(variable));
        self.put_back(state, &held, &counted)
    }

    fn put_back(&mut self, state: &State, held: &[Held], counted: &[(Variable, String)]) -> bool {
        let schedule = self.schedule.clone();
        let name = |held: &Held| &schedule.resource(held.resource).name;
        let fits = |held: &Held| {
            let whole = self.unpadded_bytes(held.resource);
            let found = state.resources.get(name(held)).map(Vec::len);
            found.is_some_and(|found| if held.used.is_some() { found <= whole && found.is_multiple_of(4) } else { found == whole })
        };
        if !held.iter().all(fits) || !counted.iter().all(|(_, name)| state.variables.contains_key(name)) {
            return false;
        }
        for held in held {
            self.copies.invalidate(|other| other == held.resource);
            self.put(&self.physical[held.resource.0 as usize], 0, &state.resources[name(held)]);
        }
        counted.iter().for_each(|(variable, name)| self.set_variable(*variable, state.variables[name]));
        self.is_still = false;
        true
    }

    /// Takes the scene as it is now, seen from where the camera is, for the picture before.
    pub fn see_before(&mut self) {
        self.views.see(View { camera: self.camera.0.clone(), poses: self.stage.poses() });
    }

    /// Memory of frames before.
    fn held(&self, but: &Histories) -> Vec<Held> {
        let schedule = &self.schedule;
        let is_elsewhere = |resource: &Resource| but.resources.contains(resource) || schedule.remade.resources.contains(resource);
        let is_kept = |resource: &Resource| matches!(schedule.resource(*resource).lifetime, Lifetime::History) && !is_elsewhere(resource);
        let used = |resource| schedule.used.iter().find(|read| read.resource == resource).and_then(|read| read.counted);
        let all = (0..schedule.resources.len() as u32).map(Resource);
        all.filter(is_kept).map(|resource| Held { resource, used: used(resource) }).collect()
    }

    /// Numbers of frames before.
    fn counted(&self, but: &Histories) -> Vec<(Variable, String)> {
        let schedule = &self.schedule;
        let is_elsewhere = |variable: &Variable| but.variables.contains(variable) || schedule.remade.variables.contains(variable);
        let all = (0..).map(Variable).zip(&schedule.variables);
        all.filter(|(variable, it)| it.history && !is_elsewhere(variable)).map(|(variable, it)| (variable, it.name.clone())).collect()
    }

    fn is_of_depths(&self, resource: Resource) -> bool {
        matches!(self.physical[resource.0 as usize], Physical::Texture { format: Format::Depth32Float, .. })
    }
}

//! What the host has of resources. Contents stay on the side that made them until the other side looks: host steps that work on one thing after another
//! move nothing, and what only they look at never reaches the device. Resources that share memory on the device share room here.

use crate::schedule::{Placement, Resource};
use glam::Vec4;
use std::collections::HashMap;
use std::iter;
use std::ops::Range;

/// Copies on the host.
#[derive(Default)]
pub struct Copies {
    /// The allocation that a resource lives in, or else itself.
    rooms: HashMap<Resource, Room>,
    copies: HashMap<Room, (Resource, HostCopy)>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Room {
    Shared(u32),
    Own(Resource),
}

/// Of one resource, texture rows without padding.
#[derive(Default)]
pub struct HostCopy {
    /// In vectors, so that items of up to 16 bytes are aligned.
    contents: Vec<Vec4>,
    /// Bytes from the start that are what the resource holds, but for those that the device has changed since.
    valid: usize,
    /// No two of them meet.
    behind: Vec<Range<usize>>,
    /// Of those, the bytes that the device has not got.
    ahead: Range<usize>,
}

impl Copies {
    pub fn new(placement: &Placement) -> Self {
        let shared = (0..).map(Resource).zip(&placement.slots).filter_map(|(resource, slot)| slot.map(|slot| (resource, Room::Shared(slot))));
        Self { rooms: shared.collect(), copies: HashMap::new() }
    }

    pub fn get(&self, resource: Resource) -> Option<&HostCopy> {
        self.copies.get(&self.room(resource)).filter(|(owner, _)| *owner == resource).map(|(_, copy)| copy)
    }

    /// Where of a resource's first bytes the device has what is not here.
    pub fn missing(&self, resource: Resource, bytes: usize) -> Vec<Range<usize>> {
        self.get(resource).unwrap_or(&HostCopy::default()).missing(bytes)
    }

    /// Takes the room over from a resource that had it before: nobody looks at that any more, as nobody does on the device.
    pub fn entry(&mut self, resource: Resource) -> &mut HostCopy {
        let (owner, copy) = self.copies.entry(self.room(resource)).or_insert_with(|| (resource, HostCopy::default()));
        if std::mem::replace(owner, resource) != resource {
            copy.invalidate();
        }
        copy
    }

    /// Forgets what resources hold that are as told, not the room for it.
    pub fn invalidate(&mut self, which: impl Fn(Resource) -> bool) {
        self.copies.values_mut().filter(|(resource, _)| which(*resource)).for_each(|(_, copy)| copy.invalidate());
    }

    /// The device changes these bytes of a resource alone.
    pub fn fall_behind(&mut self, resource: Resource, range: Range<usize>) {
        let own = self.copies.get_mut(&self.room(resource)).filter(|(owner, _)| *owner == resource);
        own.into_iter().for_each(|(_, copy)| copy.fall_behind(range.clone()));
    }

    fn room(&self, resource: Resource) -> Room {
        self.rooms.get(&resource).copied().unwrap_or(Room::Own(resource))
    }
}

impl HostCopy {
    /// The first bytes, if they are known.
    pub fn known(&self, bytes: usize) -> Option<&[u8]> {
        self.missing(bytes).is_empty().then(|| &bytemuck::cast_slice(&self.contents)[..bytes])
    }

    /// Where of the first bytes the device has what is not here.
    pub fn missing(&self, bytes: usize) -> Vec<Range<usize>> {
        if bytes > self.valid {
            return iter::once(0..bytes).collect();
        }
        let within = self.behind.iter().map(|range| range.start..range.end.min(bytes));
        within.filter(|range| !range.is_empty()).collect()
    }

    pub fn invalidate(&mut self) {
        (self.valid, self.ahead) = (0, 0..0);
        self.behind.clear();
    }

    /// The device changes these bytes alone.
    pub fn fall_behind(&mut self, mut range: Range<usize>) {
        self.behind.retain(|known| {
            let is_apart = known.end < range.start || range.end < known.start;
            if !is_apart {
                range = known.start.min(range.start)..known.end.max(range.end);
            }
            is_apart
        });
        self.behind.push(range);
    }

    /// Takes over from the device what is missing of the first bytes.
    pub fn look<E>(&mut self, bytes: usize, fill: impl FnOnce(&mut [u8]) -> Result<(), E>) -> Result<(), E> {
        self.make_room(bytes);
        fill(&mut bytemuck::cast_slice_mut(&mut self.contents)[..bytes])?;
        (self.valid, self.ahead) = (self.valid.max(bytes), 0..0);
        self.behind.retain_mut(|range| {
            range.start = range.start.max(bytes);
            range.start < range.end
        });
        Ok(())
    }

    /// Whether bytes at `offset` were taken; not where those before them are unknown here.
    pub fn write(&mut self, offset: usize, bytes: &[u8]) -> bool {
        if offset > self.valid {
            return false;
        }
        let end = offset + bytes.len();
        self.make_room(end);
        bytemuck::cast_slice_mut(&mut self.contents)[offset..end].copy_from_slice(bytes);
        self.changed(offset..end);
        true
    }

    /// The room, `bytes` long at least, to be filled and given back.
    pub fn take(&mut self, bytes: usize) -> Vec<Vec4> {
        self.make_room(bytes);
        std::mem::take(&mut self.contents)
    }

    /// Gives back what was taken, the first `bytes` filled.
    pub fn put(&mut self, contents: Vec<Vec4>, bytes: usize) {
        self.contents = contents;
        self.behind.clear();
        self.changed(0..bytes);
        self.valid = bytes;
    }

    /// What the device has not got, and where it belongs.
    pub fn ahead(&self) -> Option<(usize, &[u8])> {
        (!self.ahead.is_empty()).then(|| (self.ahead.start, &bytemuck::cast_slice(&self.contents)[self.ahead.clone()]))
    }

    /// From now on the device has it.
    pub fn caught_up(&mut self) {
        self.ahead = 0..0;
    }

    fn changed(&mut self, range: Range<usize>) {
        self.ahead = if self.ahead.is_empty() { range.clone() } else { self.ahead.start.min(range.start)..self.ahead.end.max(range.end) };
        self.valid = self.valid.max(range.end);
    }

    fn make_room(&mut self, bytes: usize) {
        let vectors = bytes.div_ceil(size_of::<Vec4>());
        if self.contents.len() < vectors {
            self.contents.resize(vectors, Vec4::ZERO);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_ahead_is_told_once_and_all_of_it() {
        let mut copy = HostCopy::default();
        assert!(copy.write(0, &[1; 8]) && copy.write(4, &[2; 8]));
        assert_eq!(copy.known(12), Some(&[1, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2, 2][..]));
        assert_eq!(copy.known(13), None);
        assert_eq!(copy.ahead(), Some((0, &[1, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2, 2][..])));
        copy.caught_up();
        assert_eq!(copy.ahead(), None);
        assert!(copy.write(12, &[3; 4]));
        assert_eq!(copy.ahead(), Some((12, &[3; 4][..])));
    }

    #[test]
    fn resources_that_share_memory_share_room() {
        let placement = Placement { slots: vec![Some(0), None, Some(0)], allocations: Vec::new() };
        let mut copies = Copies::new(&placement);
        let [first, other, second] = [0, 1, 2].map(Resource);
        assert!(copies.entry(first).write(0, &[1; 64]) && copies.entry(other).write(0, &[2; 4]));
        assert!(copies.get(second).is_none());
        let room = copies.entry(first).contents.as_ptr();
        let copy = copies.entry(second);
        assert_eq!((copy.known(1), copy.ahead(), copy.contents.as_ptr()), (None, None, room));
        assert!(copies.get(first).is_none() && copies.get(other).is_some_and(|copy| copy.known(4) == Some(&[2; 4][..])));
    }

    #[test]
    fn a_gap_is_left_to_the_device() {
        let mut copy = HostCopy::default();
        assert!(!copy.write(4, &[1; 4]));
        let looked: Result<(), ()> = copy.look(8, |bytes| {
            bytes.fill(5);
            Ok(())
        });
        assert!(looked.is_ok());
        assert!(copy.write(8, &[1; 4]) && copy.known(12) == Some(&[5, 5, 5, 5, 5, 5, 5, 5, 1, 1, 1, 1]));
        copy.invalidate();
        assert!(copy.known(1).is_none() && copy.ahead().is_none());
    }

    #[test]
    fn what_the_device_changed_alone_is_read_again_alone() {
        let missing = |copy: &HostCopy, bytes| copy.missing(bytes).iter().map(|range| [range.start, range.end]).collect::<Vec<_>>();
        let mut copy = HostCopy::default();
        copy.fall_behind(0..4);
        assert_eq!(missing(&copy, 8), [[0, 8]]);
        let looked: Result<(), ()> = copy.look(8, |bytes| {
            bytes.fill(5);
            Ok(())
        });
        assert!(looked.is_ok() && copy.known(8).is_some());
        [4..8, 4..8, 5..6, 0..2].into_iter().for_each(|range| copy.fall_behind(range));
        assert_eq!((missing(&copy, 8), missing(&copy, 5), copy.known(1)), (vec![[4, 8], [0, 2]], vec![[4, 5], [0, 2]], None));
        let looked: Result<(), ()> = copy.look(6, |bytes| {
            bytes[0..2].fill(7);
            bytes[4..6].fill(7);
            Ok(())
        });
        assert!(looked.is_ok());
        assert_eq!((copy.known(6), missing(&copy, 8)), (Some(&[7, 7, 5, 5, 7, 7][..]), vec![[6, 8]]));
        copy.invalidate();
        assert_eq!(missing(&copy, 8), [[0, 8]]);
    }

    #[test]
    fn what_is_put_back_is_what_there_is() {
        let mut copy = HostCopy::default();
        let room = copy.take(33);
        assert_eq!(room.len(), 3);
        copy.put(room, 20);
        assert!(copy.known(20).is_some() && copy.known(21).is_none());
        assert_eq!(copy.ahead().map(|(at, bytes)| (at, bytes.len())), Some((0, 20)));
    }
}

//! Tables that are slow to make and depend on parameters alone, kept for the next plan.

use super::Encoder;
use bytemuck::Pod;
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

/// Where tables are kept, by everything that they depend on.
pub trait TableStore: Sync {
    /// None where there is none, or none that can be trusted.
    fn load(&self, key: &str) -> Option<Vec<u8>>;
    /// To fail costs no more than to make the table again; the store says so.
    fn save(&self, key: &str, table: &[u8]);
}

/// Keeps tables as long as it lives.
#[derive(Default)]
pub struct Remembered(Mutex<HashMap<String, Vec<u8>>>);

impl TableStore for Remembered {
    fn load(&self, key: &str) -> Option<Vec<u8>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get(key).cloned()
    }

    fn save(&self, key: &str, table: &[u8]) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).insert(key.into(), table.into());
    }
}

impl Encoder<'_> {
    /// The table of `count` numbers or vectors that was kept under this key, or else one that is made now. Keys name the version of what makes the table.
    pub fn table<T: Pod>(&self, key: &str, count: usize, make: impl FnOnce() -> Vec<T>) -> Vec<T> {
        let Some(store) = self.setting.tables else { return make() };
        if let Some(kept) = store.load(key).filter(|kept| kept.len() == count * size_of::<T>()) {
            return bytemuck::pod_collect_to_vec(&kept);
        }
        let table = make();
        store.save(key, bytemuck::cast_slice(&table));
        table
    }
}

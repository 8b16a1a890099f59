//! What a worker has made of parcels, as long as it fits.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// A slot that is filled once, by whoever comes first.
type Slot<T> = Arc<OnceLock<Result<Arc<T>, String>>>;

/// Values by key, the last ones used.
pub(super) struct Cache<T> {
    most: usize,
    slots: Mutex<Vec<(u64, Slot<T>)>>,
}

impl<T> Cache<T> {
    /// A cache for so many values.
    pub(super) const fn new(most: usize) -> Self {
        Cache { most, slots: Mutex::new(Vec::new()) }
    }

    /// The value of a key, made where it is not there. Others that want the same wait for it; those that want another one do not.
    pub(super) fn get(&self, key: u64, make: impl FnOnce() -> Result<T, String>) -> Result<Arc<T>, String> {
        let slot = {
            let mut slots = self.slots.lock().unwrap_or_else(PoisonError::into_inner);
            let known = slots.iter().position(|(other, _)| *other == key).map(|k| slots.remove(k));
            let newest = known.unwrap_or_else(|| (key, Slot::<T>::default()));
            slots.push(newest.clone());
            if slots.len() > self.most {
                slots.remove(0);
            }
            newest.1
        };
        slot.get_or_init(|| make().map(Arc::new)).clone()
    }
}

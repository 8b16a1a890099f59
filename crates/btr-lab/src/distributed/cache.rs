//! The worker's cache of decoded payloads.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// A slot that is filled once.
type Slot<T, E> = Arc<OnceLock<Result<Arc<T>, Arc<E>>>>;

/// Values by key; the least recently used are dropped.
pub(super) struct Cache<T, E> {
    capacity: usize,
    slots: Mutex<Vec<(u64, Slot<T, E>)>>,
}

impl<T, E> Cache<T, E> {
    /// A cache for `capacity` values.
    pub(super) const fn new(capacity: usize) -> Self {
        Cache { capacity, slots: Mutex::new(Vec::new()) }
    }

    /// The value of a key, made if it is absent. Threads that request the same key wait for it; other keys are not
    /// blocked.
    pub(super) fn get(&self, key: u64, make: impl FnOnce() -> Result<T, E>) -> Result<Arc<T>, Arc<E>> {
        let slot = {
            let mut slots = self.slots.lock().unwrap_or_else(PoisonError::into_inner);
            let known = slots.iter().position(|(other, _)| *other == key).map(|k| slots.remove(k));
            let newest = known.unwrap_or_else(|| (key, Slot::<T, E>::default()));
            slots.push(newest.clone());
            if slots.len() > self.capacity {
                slots.remove(0);
            }
            newest.1
        };
        let value = slot.get_or_init(|| make().map(Arc::new).map_err(Arc::new)).clone();
        if value.is_err() {
            // A missing file may exist the next time.
            let mut slots = self.slots.lock().unwrap_or_else(PoisonError::into_inner);
            slots.retain(|(_, other)| !Arc::ptr_eq(other, &slot));
        }
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_made_once_while_it_fits_and_a_failure_is_forgotten() {
        let cache: Cache<u64, String> = Cache::new(2);
        let make = |key: u64, value: u64| cache.get(key, || Ok(value)).map(|value| *value);
        assert_eq!((make(1, 10), make(1, 11), make(2, 20)), (Ok(10), Ok(10), Ok(20)));
        assert_eq!(
            (make(1, 12), make(3, 30), make(2, 21)),
            (Ok(10), Ok(30), Ok(21)),
            "the least recently used value is dropped"
        );
        assert_eq!(cache.get(9, || Err("not yet".to_owned())), Err(Arc::new("not yet".to_owned())));
        assert_eq!(make(9, 90), Ok(90));
    }
}

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

    /// The value of a key, made where it is not there. Others that want the same wait for it; those that want another one do
    /// not.
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
        let made = slot.get_or_init(|| make().map(Arc::new)).clone();
        if made.is_err() {
            // What was missing may be there the next time.
            let mut slots = self.slots.lock().unwrap_or_else(PoisonError::into_inner);
            slots.retain(|(_, other)| !Arc::ptr_eq(other, &slot));
        }
        made
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_made_once_while_it_fits_and_a_failure_is_forgotten() {
        let cache: Cache<u64> = Cache::new(2);
        let make = |key: u64, value: u64| cache.get(key, || Ok(value)).map(|value| *value);
        assert_eq!((make(1, 10), make(1, 11), make(2, 20)), (Ok(10), Ok(10), Ok(20)));
        assert_eq!(
            (make(1, 12), make(3, 30), make(2, 21)),
            (Ok(10), Ok(30), Ok(21)),
            "the one used longest ago had to go"
        );
        assert_eq!(cache.get(9, || Err("not yet".to_owned())), Err("not yet".to_owned()));
        assert_eq!(make(9, 90), Ok(90));
    }
}

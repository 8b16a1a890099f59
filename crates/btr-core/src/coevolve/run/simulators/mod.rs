//! Step 3: simulators that explain the real tests, by a search or by an estimate, and S itself where none does.

mod detect_drift;
mod enlarge;
mod estimate;
mod search;

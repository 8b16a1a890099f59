//! A run of `btr coevolve` on disk: a folder with the experiment, the real tests, a checkpoint after every step and, at
//! the end, the results. A run that is killed loses at most the step in flight, never a real test. Its space S may
//! grow.

pub mod augment;
mod checkpoint;
pub mod conclusions;
pub mod doubts;
pub mod execute;
mod files;
mod folder;
pub mod identify;
mod lock;
pub mod report;
mod rescue;
mod resume;
mod run_error;

pub use folder::Run;
pub use resume::Snapshot;
pub use run_error::RunError;

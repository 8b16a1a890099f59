//! Experiment files, realities, identification problems, distributed work, runs in their folders, and the verbs that
//! the command line and Python call.

pub mod digits;
pub mod distributed;
pub mod execution;
pub mod experiment;
pub mod export;
pub mod failure;
pub mod identification;
mod log_quality;
pub mod meshes;
pub mod model_text;
pub mod motion;
pub mod new_model;
pub mod output;
pub mod python;
pub mod reality;
mod robot_format;
pub mod run;
mod scales;
pub mod suggest;
mod urdf_file;
pub mod verbs;

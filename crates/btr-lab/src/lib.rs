//! What a run needs around the physics: experiment files, realities, a model beside its logs, work on other machines,
//! runs in their folders, and the verbs that the command line and Python call.

pub mod distributed;
pub mod experiment;
pub mod failure;
pub mod identification;
pub mod output;
pub mod reality;
pub mod run;
pub mod verbs;

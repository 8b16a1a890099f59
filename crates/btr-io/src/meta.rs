//! What is recorded about a log.

use std::collections::BTreeMap;

/// Description of a log, written into MCAP files beside it.
#[derive(Clone, Debug, Default)]
pub struct Meta {
    /// The robot for viewers, as URDF: `/robot_description`.
    pub urdf: Option<String>,
    /// The root link's name, the child frame of `/tf`; `base_link` when absent.
    pub base_link: Option<String>,
    /// The model that the log belongs to, as TOML: the attachment `model.toml`.
    pub model_toml: Option<String>,
    /// Seeds, hashes and other notes: the metadata record `btr`, which also gets btr's `version`.
    pub notes: BTreeMap<String, String>,
}

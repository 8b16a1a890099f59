//! The formats of robots' files.

use std::path::Path;

/// The format of a robot's file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RobotFormat {
    /// URDF.
    Urdf,
    /// URDF with macros.
    Xacro,
    /// MuJoCo's XML, or a compiled model.
    Mujoco,
}

impl RobotFormat {
    /// By the end of the name, and the root element of an `.xml`; `None` if it is no robot's file.
    pub(crate) fn of(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_string_lossy().to_lowercase();
        let text = || btr_io::read_text(path).unwrap_or_default();
        match ending.as_str() {
            "xacro" => Some(RobotFormat::Xacro),
            "mjcf" | "mjb" => Some(RobotFormat::Mujoco),
            "urdf" if text().contains("xmlns:xacro") => Some(RobotFormat::Xacro),
            "urdf" => Some(RobotFormat::Urdf),
            "xml" => {
                let text = text();
                let at = |tag: &str| text.find(tag).unwrap_or(usize::MAX);
                match (at("<mujoco"), at("<robot")) {
                    (usize::MAX, usize::MAX) => None,
                    (mujoco, robot) if mujoco < robot => Some(RobotFormat::Mujoco),
                    _ if text.contains("xmlns:xacro") => Some(RobotFormat::Xacro),
                    _ => Some(RobotFormat::Urdf),
                }
            }
            _ => None,
        }
    }

    /// What such a file is.
    pub(crate) fn words(self) -> &'static str {
        match self {
            RobotFormat::Urdf => "a robot's URDF",
            RobotFormat::Xacro => "a robot's xacro file",
            RobotFormat::Mujoco => "a robot's MuJoCo model",
        }
    }
}

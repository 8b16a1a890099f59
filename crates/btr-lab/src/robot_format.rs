//! The formats of robots' files.

use btr_core::limits::LONGEST_TEXT;
use std::path::Path;

/// How many bytes from the beginning of a file tell what it is.
const BEGINNING: u64 = 1 << 12;

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

/// A format that btr does not read, though it is one of robots.
pub(crate) struct ForeignFormat {
    endings: &'static [&'static str],
    /// How files of it begin, or their first element does.
    begins: &'static [&'static str],
    /// What such a file is.
    pub(crate) words: &'static str,
    /// What to give instead.
    pub(crate) help: &'static str,
}

const FOREIGN: [ForeignFormat; 4] = [
    ForeignFormat {
        endings: &["sdf", "world"],
        begins: &["<sdf"],
        words: "an SDF file (Gazebo)",
        help: "give the URDF or xacro file from which it was made, or the robot's MJCF file",
    },
    ForeignFormat {
        endings: &["usd", "usda", "usdc", "usdz"],
        begins: &["#usda", "PXR-USDC"],
        words: "a USD file (Isaac Sim, Omniverse)",
        help: "give the URDF or MJCF file from which it was imported, or export it as URDF there",
    },
    ForeignFormat {
        endings: &["srdf"],
        begins: &[],
        words: "an SRDF file (MoveIt)",
        help: "give the URDF or xacro file that belongs to it",
    },
    ForeignFormat {
        endings: &["stl", "obj", "dae", "glb", "gltf", "ply"],
        begins: &["<COLLADA"],
        words: "a mesh",
        help: "give the robot's URDF, xacro or MJCF file, which names its meshes",
    },
];

impl ForeignFormat {
    /// By the end of the name, or the beginning of the file.
    pub(crate) fn of(path: &Path) -> Option<&'static Self> {
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let bytes = btr_io::read_beginning(path, BEGINNING).unwrap_or_default();
        let text = String::from_utf8_lossy(&bytes);
        let element = first_element(&text);
        FOREIGN.iter().find(|format| {
            let begins = |with: &&str| text.starts_with(*with) || element.is_some_and(|at| at.starts_with(*with));
            format.endings.contains(&ending.as_str()) || format.begins.iter().any(begins)
        })
    }
}

/// The text from its first element on: after declarations and remarks.
fn first_element(text: &str) -> Option<&str> {
    let mut rest = text;
    loop {
        rest = &rest[rest.find('<')?..];
        let end = match rest {
            remark if remark.starts_with("<!--") => "-->",
            declaration if declaration.starts_with("<?") || declaration.starts_with("<!") => ">",
            _ => return Some(rest),
        };
        rest = &rest[rest.find(end)? + end.len()..];
    }
}

impl RobotFormat {
    /// By the end of the name, and the first element of an `.xml` or `.urdf`; `None` if it is no robot's file.
    pub(crate) fn of(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_string_lossy().to_lowercase();
        match ending.as_str() {
            "xacro" => Some(RobotFormat::Xacro),
            "mjcf" | "mjb" => Some(RobotFormat::Mujoco),
            "urdf" | "xml" => {
                let bytes = btr_io::read_beginning(path, LONGEST_TEXT).unwrap_or_default();
                let text = String::from_utf8_lossy(&bytes);
                match first_element(&text) {
                    Some(first) if first.starts_with("<mujoco") => Some(RobotFormat::Mujoco),
                    Some(first) if !first.starts_with("<robot") => (ending == "urdf").then_some(RobotFormat::Urdf),
                    Some(_) if text.contains("xmlns:xacro") => Some(RobotFormat::Xacro),
                    None if ending == "xml" => None,
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

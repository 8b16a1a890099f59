//! Errors and warnings of reading a URDF, by the name of the link or joint.

use btr_core::limits::{DEEPEST_XML, MOST_LINKS};

/// Why a URDF cannot be read as a robot.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum UrdfError {
    /// Not XML, or not URDF.
    #[error("not a URDF: {what}")]
    Syntax {
        /// The parser's message.
        what: String,
    },
    /// Elements that lie too deep inside each other.
    #[error("more than {DEEPEST_XML} elements lie inside each other; a URDF needs no more than five")]
    Deep,
    /// Too many links.
    #[error("{links} links; at most {MOST_LINKS} are simulated")]
    Links {
        /// How many there are.
        links: usize,
    },
    /// A kind of joint that btr does not simulate.
    #[error("joint `{joint}`: {kind} joints are not simulated; split it into hinges and slides")]
    Kind {
        /// The joint.
        joint: String,
        /// Its type.
        kind: String,
    },
    /// A link that a joint names and that is not defined.
    #[error("joint `{joint}` names the link `{link}`, which does not exist")]
    NoLink {
        /// The joint.
        joint: String,
        /// The link.
        link: String,
    },
    /// Two links or two joints with one name.
    #[error("two {what} are called `{name}`")]
    Twice {
        /// Links or joints.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// A link that is the child of two joints.
    #[error("link `{link}` is the child of the joints `{first}` and `{second}`; a robot is a tree")]
    TwoParents {
        /// The link.
        link: String,
        /// One joint.
        first: String,
        /// The other.
        second: String,
    },
    /// No links.
    #[error("there is no <link> in the <robot>")]
    NoLinks,
    /// No root: each link has a parent.
    #[error("every link is the child of a joint, so the links form a loop; a robot has one root")]
    NoRoot,
    /// Several roots.
    #[error("{} links have no parent ({}); a robot has one root", roots.len(), roots.join(", "))]
    Roots {
        /// The links without a parent.
        roots: Vec<String>,
    },
    /// Links that form a loop.
    #[error("the links {} form a loop", links.join(", "))]
    Loop {
        /// The links that the root does not reach.
        links: Vec<String>,
    },
    /// An invalid value of a physical quantity.
    #[error("{what} of `{name}` is {value}, which is not a valid {what}")]
    Value {
        /// The link or joint.
        name: String,
        /// Which quantity.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// A joint whose leader is not an independent movable joint.
    #[error("joint `{joint}` mimics `{leader}`, which {why}")]
    Mimic {
        /// The joint.
        joint: String,
        /// The joint it should follow.
        leader: String,
        /// Why the leader is invalid.
        why: &'static str,
    },
    /// A joint that carries no mass.
    #[error("joint `{joint}` moves `{link}`, which has no mass and carries no link with mass; give it an <inertial>")]
    Massless {
        /// The joint.
        joint: String,
        /// The link it moves.
        link: String,
    },
}

impl UrdfError {
    /// What to do about it, where the message does not say so.
    pub fn help(&self) -> Option<&'static str> {
        match self {
            UrdfError::NoLinks => Some("give the file with the robot's links and joints"),
            UrdfError::Roots { .. } => {
                Some("join them by joints (type=\"fixed\" where nothing moves), or remove what is no part of the robot")
            }
            UrdfError::NoRoot | UrdfError::Loop { .. } | UrdfError::TwoParents { .. } => {
                Some("remove the joint that closes the loop; a <mimic> can stand for a linkage of two joints")
            }
            UrdfError::Twice { .. } => Some("give one of them another name"),
            UrdfError::NoLink { .. } => Some("define the link, or correct its name in the joint"),
            _ => None,
        }
    }
}

/// What a robot lacks of its URDF.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum UrdfWarning {
    /// A mesh.
    #[error("link `{link}`: contacts of the mesh `{file}`; only primitives have contacts")]
    Mesh {
        /// The link.
        link: String,
        /// The mesh's file.
        file: String,
    },
    /// A link with a mass and without an inertia.
    #[error("link `{link}`: an inertia, which the file does not state; all its mass is at one point")]
    PointMass {
        /// The link.
        link: String,
    },
    /// A hinge or slide without a range.
    #[error("joint `{joint}` has no limits; its range is unlimited")]
    NoLimits {
        /// The joint.
        joint: String,
    },
}

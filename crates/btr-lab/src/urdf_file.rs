//! A robot's URDF in a file: errors at their lines, and the meshes that it names.

use crate::meshes::enclose;
use btr_physics::robot::urdf::{Mesh, UrdfError, UrdfWarning, meshes, parse_urdf};
use btr_physics::robot::{Base, Robot};
use roxmltree::{Document, Error, ParsingOptions};
use std::path::{Path, PathBuf};

/// Elements of a URDF that are looked through for what is no XML.
const MOST_NODES: u32 = 1_000_000;

/// A URDF with the path of its file.
pub(crate) struct UrdfFile<'a> {
    pub(crate) path: &'a Path,
    pub(crate) text: &'a str,
}

/// Why a URDF is refused.
pub(crate) struct RefusedUrdf {
    /// Line from 1; 0 when the whole file is meant.
    pub(crate) line: usize,
    pub(crate) message: String,
    /// The remedy.
    pub(crate) help: Option<&'static str>,
}

impl UrdfFile<'_> {
    /// The robot, with what it lacks of its URDF.
    ///
    /// # Errors
    /// An invalid URDF, at its line.
    pub(crate) fn robot(&self, base: Base) -> Result<(Robot, Vec<UrdfWarning>), RefusedUrdf> {
        parse_urdf(self.text, base).map_err(|error| self.refused(&error))
    }

    /// The meshes that it names.
    ///
    /// # Errors
    /// An invalid URDF, at its line.
    pub(crate) fn meshes(&self) -> Result<Vec<Mesh>, RefusedUrdf> {
        meshes(self.text).map_err(|error| self.refused(&error))
    }

    /// Gives a robot the boxes around the meshes, which are looked for in `packages` too. Returns what is not known.
    ///
    /// # Errors
    /// An invalid URDF, at its line.
    pub(crate) fn enclose(&self, robot: &mut Robot, packages: &[PathBuf]) -> Result<Vec<String>, RefusedUrdf> {
        Ok(enclose(robot, &self.meshes()?, (self.path, self.text), packages))
    }

    pub(crate) fn refused(&self, error: &UrdfError) -> RefusedUrdf {
        let broken = match error {
            UrdfError::Syntax { .. } => not_xml(self.text),
            _ => None,
        };
        let message = error.to_string();
        match broken {
            Some(broken) => RefusedUrdf {
                line: broken.pos().row as usize,
                message: format!("not an XML file: {broken}"),
                help: Some("give a whole URDF file: XML with a <robot>"),
            },
            None => RefusedUrdf { line: self.line_of(&message).unwrap_or(0), message, help: error.help() },
        }
    }

    /// The line that a message refers to: the first occurrence of the name that it quotes. The parser reports no lines.
    fn line_of(&self, message: &str) -> Option<usize> {
        let name = message.split('`').nth(1)?;
        let at = ['"', '\''].iter().find_map(|quote| self.text.find(&format!("{quote}{name}{quote}")))?;
        Some(self.text[..at].matches('\n').count() + 1)
    }
}

/// Why a text is no XML, if it is none.
fn not_xml(text: &str) -> Option<Error> {
    let options = ParsingOptions { nodes_limit: MOST_NODES, ..ParsingOptions::default() };
    let error = Document::parse_with_options(text, options).err()?;
    (!matches!(error, Error::NodesLimitReached)).then_some(error)
}

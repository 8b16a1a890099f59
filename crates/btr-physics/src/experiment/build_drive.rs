//! What drives the joints.

use super::build::Builder;
use super::file::{DriveSection, SearchedSection};
use super::parse::FileError;
use crate::drive::{DRIVES, DriveError, DriveKind, DrivePlan, Replay};
use crate::robot::Robot;
use indexmap::IndexMap;
use std::sync::Arc;

impl Builder<'_> {
    pub(super) fn drive(&self, robot: &Robot) -> Result<DrivePlan, FileError> {
        let Some(section) = &self.file.drive else {
            let none = IndexMap::new();
            return DrivePlan::new(DriveKind::Hold, robot, &none, &IndexMap::new(), false)
                .map_err(|e| self.error(&["drive"], e, None));
        };
        let kind = self.drive_kind(section, robot)?;
        let dims = kind.dims(robot).map_err(|e| self.error(&["drive"], e, None))?;
        let searched = match &section.search {
            SearchedSection::Word(word) if word == "all" => dims.iter().map(|d| (d.name.clone(), None)).collect(),
            SearchedSection::Word(word) if word == "none" => IndexMap::new(),
            SearchedSection::Word(word) => {
                return Err(self.unknown(&["drive", "search"], "choice", word, ["all", "none"]));
            }
            SearchedSection::Names(names) => names.iter().map(|name| (name.clone(), None)).collect(),
            SearchedSection::Bounds(bounds) => bounds.iter().map(|(name, b)| (name.clone(), Some(*b))).collect(),
        };
        DrivePlan::new(kind, robot, &section.set, &searched, section.start_from_nominal).map_err(|e| match &e {
            DriveError::Unknown { name, known } => {
                let table = if section.set.contains_key(name) { "set" } else { "search" };
                self.unknown(&["drive", table, name], "drive parameter", name, known.iter().map(String::as_str))
            }
            DriveError::Space(e) => self.error(&["drive", "search"], e, None),
            DriveError::World(e) => self.error(&["drive", "kind"], e, None),
        })
    }

    fn drive_kind(&self, section: &DriveSection, robot: &Robot) -> Result<DriveKind, FileError> {
        match section.kind.as_str() {
            "hold" => Ok(DriveKind::Hold),
            "nao_walk" => Ok(DriveKind::NaoWalk),
            "nao_kick" => Ok(DriveKind::NaoKick),
            "sine" => match section.omega_rad_s {
                Some(omega_rad_s) => Ok(DriveKind::Sine { omega_rad_s }),
                None => Err(self.error(&["drive", "kind"], "a sine drive needs omega_rad_s", None)),
            },
            "replay" => {
                let path =
                    section.log.as_ref().ok_or_else(|| self.error(&["drive"], "replay needs log = PATH", None))?;
                let path = self.source.folder().join(path);
                let (log, _) = crate::io::read_recorded(&path, &self.file.channels)
                    .map_err(|e| self.error(&["drive", "log"], &e, Some(e.help())))?;
                Ok(DriveKind::Replay(Arc::new(Replay::new(&log, robot))))
            }
            other => Err(self.unknown(&["drive", "kind"], "drive", other, DRIVES.iter().map(|d| d.0))),
        }
    }
}

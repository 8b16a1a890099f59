//! Builds the drive of the joints.

use super::builder::Builder;
use crate::experiment::file::{DriveSection, SearchedSection};
use crate::experiment::source::FileError;
use btr_core::limits::MOST_HIDDEN;
use btr_physics::drive::{DRIVES, DriveError, DriveKind, DrivePlan, PolicyPlan, Replay, SENSES, SearchStart};
use btr_physics::robot::Robot;
use btr_physics::robot::site;
use indexmap::IndexMap;
use std::sync::Arc;

impl Builder<'_> {
    pub(super) fn drive(&self, robot: &Robot) -> Result<DrivePlan, FileError> {
        if let Some(known) = self.drive.get() {
            return Ok(known.clone());
        }
        let plan = self.read_drive(robot)?;
        Ok(self.drive.get_or_init(|| plan).clone())
    }

    fn read_drive(&self, robot: &Robot) -> Result<DrivePlan, FileError> {
        let Some(section) = &self.file.drive else {
            let none = IndexMap::new();
            return DrivePlan::new(DriveKind::Hold, robot, &none, &IndexMap::new(), SearchStart::Random)
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
        let start = if section.start_from_nominal { SearchStart::Nominal } else { SearchStart::Random };
        DrivePlan::new(kind, robot, &section.set, &searched, start).map_err(|e| match &e {
            DriveError::Unknown { name, known } => {
                let table = if section.set.contains_key(name) { "set" } else { "search" };
                self.unknown(&["drive", table, name], "drive parameter", name, known.iter().map(String::as_str))
            }
            DriveError::Space(e) => self.error(&["drive", "search"], e, None),
            DriveError::World(e) => self.error(&["drive", "kind"], e, None),
            other => self.error(&["drive"], other, None),
        })
    }

    fn drive_kind(&self, section: &DriveSection, robot: &Robot) -> Result<DriveKind, FileError> {
        let policy_keys = [
            ("around", section.around.is_some()),
            ("sensors", section.sensors.is_some()),
            ("joints", section.joints.is_some()),
            ("hidden", section.hidden.is_some()),
        ];
        match policy_keys.iter().find(|(_, stated)| *stated && section.kind != "policy") {
            Some((key, _)) => Err(self.error(&["drive", key], format!("only a policy has `{key}`"), None)),
            None if section.kind == "policy" => self.policy(section, robot),
            None => self.open_loop(&section.kind, "kind", section, robot),
        }
    }

    fn policy(&self, section: &DriveSection, robot: &Robot) -> Result<DriveKind, FileError> {
        if section.hidden.is_some_and(|hidden| hidden > MOST_HIDDEN) {
            let message = format!("a policy has at most {MOST_HIDDEN} hidden units");
            return Err(self.error(&["drive", "hidden"], message, None));
        }
        let around = self.open_loop(section.around.as_deref().unwrap_or("hold"), "around", section, robot)?;
        let sensors = section.sensors.clone().unwrap_or_else(|| vec!["tilt".to_owned(), "gyro".to_owned()]);
        let known = || SENSES.iter().map(|sense| sense.0);
        if let Some(other) = sensors.iter().find(|name| known().all(|known| known != **name)) {
            return Err(self.unknown(&["drive", "sensors"], "sense", other, known()));
        }
        if sensors.iter().any(|name| name == "clock") && section.omega_rad_s.is_none() {
            return Err(self.error(&["drive", "sensors"], "a clock needs omega_rad_s", None));
        }
        let joints = section.joints.clone().unwrap_or_else(|| "*".to_owned());
        let mut names = robot.movable().map(|(_, link)| link.joint.name.as_str());
        if !names.any(|name| site::matches(&joints, name)) {
            return Err(self.unknown(
                &["drive", "joints"],
                "joint",
                &joints,
                robot.movable().map(|(_, l)| &*l.joint.name),
            ));
        }
        let (hidden, omega_rad_s) = (section.hidden.unwrap_or(0), section.omega_rad_s.unwrap_or(0.0));
        let policy = PolicyPlan { sensors, joints, hidden, omega_rad_s };
        Ok(DriveKind::Policy { around: Box::new(around), policy })
    }

    /// A drive that depends on time alone; `key` is the key of its kind.
    fn open_loop(&self, kind: &str, key: &str, section: &DriveSection, robot: &Robot) -> Result<DriveKind, FileError> {
        match kind {
            "hold" => Ok(DriveKind::Hold),
            "nao_walk" => Ok(DriveKind::NaoWalk),
            "nao_kick" => Ok(DriveKind::NaoKick),
            "sine" => match section.omega_rad_s {
                Some(omega_rad_s) => Ok(DriveKind::Sine { omega_rad_s }),
                None => Err(self.error(&["drive", key], "a sine drive needs omega_rad_s", None)),
            },
            "replay" => {
                let path =
                    section.log.as_ref().ok_or_else(|| self.error(&["drive"], "replay needs log = PATH", None))?;
                let path = self.source.folder().join(path);
                let (log, _) = btr_io::read_recorded(&path, &self.file.channels)
                    .map_err(|e| self.error(&["drive", "log"], &e, Some(e.help())))?;
                Ok(DriveKind::Replay(Arc::new(Replay::new(&log, robot))))
            }
            "policy" => Err(self.error(&["drive", key], "a policy cannot correct another policy", None)),
            other => Err(self.unknown(&["drive", key], "drive", other, DRIVES.iter().map(|d| d.0))),
        }
    }
}

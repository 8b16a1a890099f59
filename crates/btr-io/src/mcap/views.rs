//! Views of a log as standard ROS messages.

use super::ros::{Header, Imu, JointState, Quaternion, TfMessage, Time, Transform, TransformStamped, Vector3};
use btr_core::log::{Channel, Log};
use std::array;

/// The joints of a log as `JointState`: position, velocity and effort if any joint has them, NaN for joints that lack
/// them.
pub(crate) struct Joints<'a> {
    names: Vec<String>,
    position: Vec<Option<&'a [f64]>>,
    velocity: Vec<Option<&'a [f64]>>,
    effort: Vec<Option<&'a [f64]>>,
}

impl<'a> Joints<'a> {
    /// `q_`, `dq_` and `tau_`; `None` when there are none.
    pub(crate) fn states(log: &'a Log) -> Option<Self> {
        let names = joints(log, &["q_", "dq_", "tau_"])?;
        let column = |prefix: &str| names.iter().map(|joint| values(log, prefix, joint)).collect();
        Some(Joints { position: column("q_"), velocity: column("dq_"), effort: column("tau_"), names })
    }

    /// `cmd_`: efforts where the unit says so, positions else; `None` when there are none.
    pub(crate) fn commands(log: &'a Log) -> Option<Self> {
        let names = joints(log, &["cmd_"])?;
        let is_effort = |channel: &Channel| matches!(channel.unit.as_str(), "N·m" | "N");
        let column = |effort: bool| -> Vec<Option<&'a [f64]>> {
            let channels = names.iter().map(|joint| log.channel(&format!("cmd_{joint}")));
            channels.map(|c| c.filter(|c| is_effort(c) == effort).map(|c| c.values.as_slice())).collect()
        };
        Some(Joints { position: column(false), velocity: vec![None; names.len()], effort: column(true), names })
    }

    /// The message of one tick.
    pub(crate) fn message(&self, tick: usize, ns: u64) -> JointState {
        JointState {
            header: header(ns, ""),
            name: self.names.clone(),
            position: at(&self.position, tick),
            velocity: at(&self.velocity, tick),
            effort: at(&self.effort, tick),
        }
    }
}

/// Joints that have a channel with one of the prefixes, in the log's order.
fn joints(log: &Log, prefixes: &[&str]) -> Option<Vec<String>> {
    let mut names: Vec<String> = Vec::new();
    for (channel, _) in log.channels() {
        let joint = prefixes.iter().find_map(|prefix| channel.strip_prefix(prefix));
        if let Some(joint) = joint.filter(|joint| !names.iter().any(|n| n == joint)) {
            names.push(joint.to_owned());
        }
    }
    (!names.is_empty()).then_some(names)
}

fn values<'a>(log: &'a Log, prefix: &str, rest: &str) -> Option<&'a [f64]> {
    log.channel(&format!("{prefix}{rest}")).map(|channel| channel.values.as_slice())
}

/// One value per joint, or nothing at all when no joint has any.
fn at(columns: &[Option<&[f64]>], tick: usize) -> Vec<f64> {
    if columns.iter().all(Option::is_none) {
        return Vec::new();
    }
    columns.iter().map(|c| c.map_or(f64::NAN, |values| values[tick])).collect()
}

pub(super) fn header(ns: u64, frame: &str) -> Header {
    Header { stamp: Time::of_ns(ns), frame_id: frame.to_owned() }
}

/// The channels `<prefix>_<axis>` of some axes, when all of them are there.
fn axes<'a, const N: usize>(log: &'a Log, prefix: &str, names: [&str; N]) -> Option<[&'a [f64]; N]> {
    let found: Vec<&[f64]> = names.iter().filter_map(|axis| values(log, prefix, axis)).collect();
    found.try_into().ok()
}

const ROTATION: [&str; 4] = ["qx", "qy", "qz", "qw"];

fn quaternion(columns: Option<[&[f64]; 4]>, tick: usize) -> Quaternion {
    match columns {
        Some(columns) => quaternion_of(columns.map(|values| values[tick])),
        None => Quaternion { w: 1.0, ..Quaternion::default() },
    }
}

fn vector(columns: Option<[&[f64]; 3]>, tick: usize) -> Vector3 {
    columns.map_or(Vector3::default(), |columns| vector_of(columns.map(|values| values[tick])))
}

pub(super) fn quaternion_of([x, y, z, w]: [f64; 4]) -> Quaternion {
    Quaternion { x, y, z, w }
}

pub(super) fn vector_of([x, y, z]: [f64; 3]) -> Vector3 {
    Vector3 { x, y, z }
}

/// The channels `imu_acc_x..`, `imu_gyro_x..` and `imu_qx..` as `sensor_msgs/msg/Imu`.
pub(crate) struct ImuView<'a> {
    acceleration: Option<[&'a [f64]; 3]>,
    turning: Option<[&'a [f64]; 3]>,
    orientation: Option<[&'a [f64]; 4]>,
}

impl<'a> ImuView<'a> {
    /// `None` when there is neither acceleration nor rate of turn.
    pub(crate) fn new(log: &'a Log) -> Option<Self> {
        let acceleration = axes(log, "imu_", ["acc_x", "acc_y", "acc_z"]);
        let turning = axes(log, "imu_", ["gyro_x", "gyro_y", "gyro_z"]);
        let orientation = axes(log, "imu_", ROTATION);
        (acceleration.is_some() || turning.is_some()).then_some(ImuView { acceleration, turning, orientation })
    }

    /// The message of one tick.
    pub(crate) fn message(&self, tick: usize, ns: u64) -> Imu {
        // By sensor_msgs' convention, -1 first in a covariance means that the quantity is not there; 0 is unknown.
        let covariance = |there: bool| array::from_fn(|i| if i == 0 && !there { -1.0 } else { 0.0 });
        Imu {
            header: header(ns, "imu"),
            orientation: quaternion(self.orientation, tick),
            orientation_covariance: covariance(self.orientation.is_some()),
            angular_velocity: vector(self.turning, tick),
            angular_velocity_covariance: covariance(self.turning.is_some()),
            linear_acceleration: vector(self.acceleration, tick),
            linear_acceleration_covariance: covariance(self.acceleration.is_some()),
        }
    }
}

/// The channels `base_x..` and `base_qx..` as the transform from `world` to the root link.
pub(crate) struct BaseView<'a> {
    link: &'a str,
    position: [&'a [f64]; 3],
    rotation: Option<[&'a [f64]; 4]>,
}

impl<'a> BaseView<'a> {
    /// `None` when the log does not know where the base is.
    pub(crate) fn new(log: &'a Log, link: &'a str) -> Option<Self> {
        let position = axes(log, "base_", ["x", "y", "z"])?;
        Some(BaseView { link, position, rotation: axes(log, "base_", ROTATION) })
    }

    /// The message of one tick.
    pub(crate) fn message(&self, tick: usize, ns: u64) -> TfMessage {
        let transform =
            Transform { translation: vector(Some(self.position), tick), rotation: quaternion(self.rotation, tick) };
        let stamped = TransformStamped { header: header(ns, "world"), child_frame_id: self.link.to_owned(), transform };
        TfMessage { transforms: vec![stamped] }
    }
}

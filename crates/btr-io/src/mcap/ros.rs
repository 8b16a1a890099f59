//! The ROS 2 messages that logs are made of, and their definitions as MCAP carries them.
//!
//! Field order is wire order. Source: ros2/common_interfaces, ros2/rcl_interfaces and ros2/geometry2.

use re_cdr::{BigEndian, LittleEndian};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// A message with its ROS name and definition.
pub(crate) trait Ros: Serialize {
    const NAME: &'static str;
    const DEFINITION: &'static str;
}

macro_rules! definition {
    ($own:literal $(, $part:expr)*) => { concat!($own $(, "================================================================================\n", $part)*) };
}
macro_rules! header {
    () => {
        "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
    };
}
macro_rules! time {
    () => {
        "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    };
}
macro_rules! vector3 {
    () => {
        "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
    };
}
macro_rules! quaternion {
    () => {
        "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
    };
}

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Time {
    pub(crate) sec: i32,
    pub(crate) nanosec: u32,
}

impl Time {
    pub(crate) fn of_ns(ns: u64) -> Self {
        // A header holds seconds up to 2^31; the exact time is in `/btr/channels`.
        Time {
            sec: i32::try_from(ns / 1_000_000_000).unwrap_or(i32::MAX),
            nanosec: u32::try_from(ns % 1_000_000_000).unwrap_or(0),
        }
    }

    /// Nanoseconds; 0, which ROS reads as "no time", for anything before the epoch.
    pub(crate) fn ns(self) -> u64 {
        u64::try_from(self.sec).unwrap_or(0) * 1_000_000_000 + u64::from(self.nanosec)
    }
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Header {
    pub(crate) stamp: Time,
    pub(crate) frame_id: String,
}

#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct JointState {
    pub(crate) header: Header,
    pub(crate) name: Vec<String>,
    pub(crate) position: Vec<f64>,
    pub(crate) velocity: Vec<f64>,
    pub(crate) effort: Vec<f64>,
}

impl Ros for JointState {
    const NAME: &'static str = "sensor_msgs/msg/JointState";
    const DEFINITION: &'static str = definition!(
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
        header!(),
        time!()
    );
}

#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct Vector3 {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) z: f64,
}

#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct Quaternion {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) z: f64,
    pub(crate) w: f64,
}

#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct Imu {
    pub(crate) header: Header,
    pub(crate) orientation: Quaternion,
    pub(crate) orientation_covariance: [f64; 9],
    pub(crate) angular_velocity: Vector3,
    pub(crate) angular_velocity_covariance: [f64; 9],
    pub(crate) linear_acceleration: Vector3,
    pub(crate) linear_acceleration_covariance: [f64; 9],
}

impl Ros for Imu {
    const NAME: &'static str = "sensor_msgs/msg/Imu";
    const DEFINITION: &'static str = definition!(
        "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n\
         geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n\
         geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n",
        header!(),
        time!(),
        quaternion!(),
        vector3!()
    );
}

#[derive(Debug, Serialize)]
pub(crate) struct Transform {
    pub(crate) translation: Vector3,
    pub(crate) rotation: Quaternion,
}

#[derive(Debug, Serialize)]
pub(crate) struct TransformStamped {
    pub(crate) header: Header,
    pub(crate) child_frame_id: String,
    pub(crate) transform: Transform,
}

#[derive(Debug, Serialize)]
pub(crate) struct TfMessage {
    pub(crate) transforms: Vec<TransformStamped>,
}

impl Ros for TfMessage {
    const NAME: &'static str = "tf2_msgs/msg/TFMessage";
    const DEFINITION: &'static str = definition!(
        "geometry_msgs/TransformStamped[] transforms\n",
        "MSG: geometry_msgs/TransformStamped\nstd_msgs/Header header\nstring child_frame_id\n\
         geometry_msgs/Transform transform\n",
        header!(),
        time!(),
        "MSG: geometry_msgs/Transform\ngeometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
        vector3!(),
        quaternion!()
    );
}

#[derive(Debug, Serialize)]
pub(crate) struct Text {
    pub(crate) data: String,
}

impl Ros for Text {
    const NAME: &'static str = "std_msgs/msg/String";
    const DEFINITION: &'static str = "string data\n";
}

#[derive(Debug, Default, Deserialize)]
pub(crate) struct JointTrajectory {
    pub(crate) header: Header,
    pub(crate) joint_names: Vec<String>,
    pub(crate) points: Vec<TrajectoryPoint>,
}

#[derive(Debug, Default, Deserialize)]
pub(crate) struct TrajectoryPoint {
    pub(crate) positions: Vec<f64>,
    /// Velocities, accelerations and efforts: on the wire, not used.
    _rest: [Vec<f64>; 3],
    pub(crate) time_from_start: Time,
}

impl TrajectoryPoint {
    pub(crate) fn new(positions: Vec<f64>, time_from_start: Time) -> Self {
        TrajectoryPoint { positions, _rest: Default::default(), time_from_start }
    }
}

#[derive(Debug, Default, Deserialize)]
pub(crate) struct Float64MultiArray {
    _layout: (Vec<(String, u32, u32)>, u32),
    pub(crate) data: Vec<f64>,
}

/// The four bytes before every message: little-endian plain CDR, no options.
pub(crate) const LITTLE_ENDIAN_CDR: [u8; 4] = [0, 1, 0, 0];

/// A message with its encapsulation.
pub(crate) fn encode<T: Serialize>(message: &T) -> std::io::Result<Vec<u8>> {
    let body = re_cdr::to_vec::<T, LittleEndian>(message).map_err(std::io::Error::other)?;
    Ok([&LITTLE_ENDIAN_CDR[..], &body].concat())
}

/// Decodes plain CDR of either endianness; the text says why not.
pub(crate) fn decode<T: DeserializeOwned>(data: &[u8]) -> Result<T, String> {
    let (kind, body) = data.split_at_checked(4).ok_or("shorter than a CDR header")?;
    let decoded = match kind[1] {
        0 => re_cdr::from_bytes::<T, BigEndian>(body),
        1 => re_cdr::from_bytes::<T, LittleEndian>(body),
        other => return Err(format!("CDR representation {other}, where plain CDR (0 or 1) is read")),
    };
    decoded.map(|(message, _)| message).map_err(|e| e.to_string())
}

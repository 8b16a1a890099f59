//! Other people's messages as named samples: CDR or JSON, by joint name.

use super::ros::{
    Float64MultiArray, Imu, JointState, JointTrajectory, Quaternion, Time, TrajectoryPoint, Vector3, decode,
};
use crate::channels::mapping::Topics;
use indexmap::IndexSet;
use serde_json::Value;

/// The names of channels by number, in the order in which they came.
#[derive(Default)]
pub(crate) struct Names {
    all: IndexSet<String>,
    /// Lists as messages had them: they come again, usually in the same order.
    lists: Vec<List>,
    /// The place of the one that came last.
    last: usize,
}

/// The numbers of names that came together.
struct List {
    prefix: &'static str,
    names: Vec<String>,
    numbers: Vec<usize>,
}

/// More lists than that are no repetition.
const MOST_LISTS: usize = 1024;

impl Names {
    fn number(&mut self, prefix: &str, rest: &str) -> usize {
        self.all.insert_full(format!("{prefix}{rest}")).0
    }

    /// The numbers of all names of a message.
    fn numbers(&mut self, prefix: &'static str, names: &[String]) -> &[usize] {
        let many = self.lists.len();
        let is_it = |at: &usize| self.lists[*at].prefix == prefix && self.lists[*at].names == names;
        let known = (1..=many).map(|k| (self.last + k) % many).find(is_it);
        self.last = known.unwrap_or_else(|| {
            let numbers = names.iter().map(|name| self.number(prefix, name)).collect();
            if many == MOST_LISTS {
                self.lists.clear();
            }
            self.lists.push(List { prefix, names: names.to_vec(), numbers });
            self.lists.len() - 1
        });
        &self.lists[self.last].numbers
    }

    /// The names, the first number's first.
    pub(crate) fn iter(&self) -> impl ExactSizeIterator<Item = &str> {
        self.all.iter().map(String::as_str)
    }

    /// The name of a number.
    pub(crate) fn of(&self, number: usize) -> &str {
        &self.all[number]
    }
}

/// What was known at one moment.
#[derive(Debug)]
pub(crate) struct Sample {
    /// The message's own time in ns, 0 where it has none.
    pub(crate) stamp_ns: u64,
    /// When it was recorded, in ns.
    pub(crate) log_ns: u64,
    /// Channels by their numbers in [`Names`].
    pub(crate) values: Vec<(usize, f64)>,
    /// For the first point of a trajectory: how far after the trajectory's start it lies, in ns. What earlier
    /// trajectories had planned from that start on is void.
    pub(crate) after_start_ns: Option<u64>,
}

/// What a topic carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TopicKind {
    States,
    Commands,
    Trajectory,
    Imu,
    Array,
}

/// How messages are encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    Cdr,
    Json,
}

/// How a topic is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TopicFormat {
    pub(crate) kind: TopicKind,
    encoding: Encoding,
}

/// How the topic is read, or why it cannot be; `None` for topics nobody asks for.
pub(crate) fn format(
    topics: &Topics,
    topic: &str,
    schema: &str,
    encoding: &str,
) -> Option<Result<TopicFormat, String>> {
    let name = schema.rsplit(['/', '.']).next().unwrap_or_default();
    let kind = match name {
        "JointState" if topic == topics.states => TopicKind::States,
        "JointState" if topic == topics.commands => TopicKind::Commands,
        "JointTrajectory" if topic == topics.commands => TopicKind::Trajectory,
        "Imu" if topic == topics.imu => TopicKind::Imu,
        "Float64MultiArray" if topics.arrays.contains_key(topic) => TopicKind::Array,
        _ => {
            let asked = [&topics.states, &topics.commands, &topics.imu].into_iter().chain(topics.arrays.keys());
            let wanted = asked.into_iter().any(|t| t == topic);
            return wanted.then(|| Err(format!("`{schema}` ({encoding}) is not read there")));
        }
    };
    let encoding = match encoding {
        "cdr" => Encoding::Cdr,
        "json" => Encoding::Json,
        other => return Some(Err(format!("messages encoded as `{other}` are not read"))),
    };
    Some(Ok(TopicFormat { kind, encoding }))
}

/// Decodes a message into samples; `elements` are those of an array of bare numbers. The text says why not.
pub(crate) fn samples(
    format: TopicFormat,
    elements: &[String],
    data: &[u8],
    log_ns: u64,
    names: &mut Names,
) -> Result<Vec<Sample>, String> {
    let value = match format.encoding {
        Encoding::Cdr => None,
        Encoding::Json => Some(serde_json::from_slice::<Value>(data).map_err(|e| e.to_string())?),
    };
    let value = value.as_ref();
    let one = |stamp: Time, values| Ok(vec![Sample { stamp_ns: stamp.ns(), log_ns, values, after_start_ns: None }]);
    match format.kind {
        TopicKind::States => {
            let m = value.map_or_else(|| decode::<JointState>(data), |v| Ok(json_joint_state(v)))?;
            one(m.header.stamp, states(&m, names)?)
        }
        TopicKind::Commands => {
            let m = value.map_or_else(|| decode::<JointState>(data), |v| Ok(json_joint_state(v)))?;
            one(m.header.stamp, commands(&m, names)?)
        }
        TopicKind::Trajectory => {
            let m = value.map_or_else(|| decode::<JointTrajectory>(data), |v| Ok(json_trajectory(v)))?;
            trajectory(&m, log_ns, names)
        }
        TopicKind::Imu => {
            let m = value.map_or_else(|| decode::<Imu>(data), |v| Ok(json_imu(v)))?;
            one(m.header.stamp, imu(&m, names))
        }
        TopicKind::Array => {
            let data =
                value.map_or_else(|| decode::<Float64MultiArray>(data).map(|m| m.data), |v| Ok(numbers(&v["data"])))?;
            one(Time::default(), named("", elements, &data, names)?)
        }
    }
}

/// `<prefix><element>` for each number; none at all where the message leaves the array empty.
fn named(
    prefix: &'static str,
    elements: &[String],
    numbers: &[f64],
    names: &mut Names,
) -> Result<Vec<(usize, f64)>, String> {
    if numbers.is_empty() {
        return Ok(Vec::new());
    }
    if numbers.len() != elements.len() {
        return Err(format!("{} numbers for {} names", numbers.len(), elements.len()));
    }
    Ok(names.numbers(prefix, elements).iter().copied().zip(numbers.iter().copied()).collect())
}

fn states(m: &JointState, names: &mut Names) -> Result<Vec<(usize, f64)>, String> {
    let parts = [("q_", &m.position), ("dq_", &m.velocity), ("tau_", &m.effort)];
    let mut values = Vec::with_capacity(3 * m.name.len());
    for (prefix, numbers) in parts {
        values.extend(named(prefix, &m.name, numbers, names)?);
    }
    Ok(values)
}

/// The position where a joint has one, else its effort: robots under torque control are told efforts.
fn commands(m: &JointState, names: &mut Names) -> Result<Vec<(usize, f64)>, String> {
    let mut values = named("cmd_", &m.name, &m.position, names)?;
    let efforts = named("cmd_", &m.name, &m.effort, names)?;
    if values.is_empty() {
        return Ok(efforts);
    }
    for ((_, value), (_, effort)) in values.iter_mut().zip(efforts) {
        if value.is_nan() {
            *value = effort;
        }
    }
    Ok(values)
}

/// One sample per point, at its own time after the start.
fn trajectory(m: &JointTrajectory, log_ns: u64, names: &mut Names) -> Result<Vec<Sample>, String> {
    let sample = |(i, point): (usize, &TrajectoryPoint)| {
        let (stamp_ns, after_ns) = (m.header.stamp.ns(), point.time_from_start.ns());
        let values = named("cmd_", &m.joint_names, &point.positions, names)?;
        let stamp_ns = if stamp_ns == 0 { 0 } else { stamp_ns.saturating_add(after_ns) };
        let after_start_ns = (i == 0).then_some(after_ns);
        Ok(Sample { stamp_ns, log_ns: log_ns.saturating_add(after_ns), values, after_start_ns })
    };
    m.points.iter().enumerate().map(sample).collect()
}

fn imu(m: &Imu, names: &mut Names) -> Vec<(usize, f64)> {
    let mut values = Vec::new();
    let mut add = |there: bool, parts: &[(&str, f64)]| {
        if there {
            values.extend(parts.iter().map(|(axis, x)| (names.number("imu_", axis), *x)));
        }
    };
    // -1 first in a covariance says that the quantity is not there.
    let there = |covariance: &[f64; 9]| covariance[0] >= 0.0;
    let (a, w, q) = (&m.linear_acceleration, &m.angular_velocity, &m.orientation);
    add(there(&m.linear_acceleration_covariance), &[("acc_x", a.x), ("acc_y", a.y), ("acc_z", a.z)]);
    add(there(&m.angular_velocity_covariance), &[("gyro_x", w.x), ("gyro_y", w.y), ("gyro_z", w.z)]);
    add(there(&m.orientation_covariance), &[("qx", q.x), ("qy", q.y), ("qz", q.z), ("qw", q.w)]);
    values
}

// JSON as Foxglove and rosbridge write it: fields may be missing, NaN is null, nanoseconds go by three names.

fn number(v: &Value) -> f64 {
    v.as_f64().unwrap_or(f64::NAN)
}

fn numbers(v: &Value) -> Vec<f64> {
    v.as_array().map(|a| a.iter().map(number).collect()).unwrap_or_default()
}

fn strings(v: &Value) -> Vec<String> {
    v.as_array().map(|a| a.iter().filter_map(|s| s.as_str().map(str::to_owned)).collect()).unwrap_or_default()
}

fn json_time(v: &Value) -> Time {
    let part = |names: &[&str]| names.iter().find_map(|name| v[*name].as_u64()).unwrap_or(0);
    let sec = i32::try_from(part(&["sec", "secs"])).unwrap_or(i32::MAX);
    Time { sec, nanosec: u32::try_from(part(&["nanosec", "nsec", "nsecs"])).unwrap_or(0) }
}

fn json_joint_state(v: &Value) -> JointState {
    let mut m = JointState { name: strings(&v["name"]), position: numbers(&v["position"]), ..JointState::default() };
    m.header.stamp = json_time(&v["header"]["stamp"]);
    (m.velocity, m.effort) = (numbers(&v["velocity"]), numbers(&v["effort"]));
    m
}

fn json_trajectory(v: &Value) -> JointTrajectory {
    let point = |p: &Value| TrajectoryPoint::new(numbers(&p["positions"]), json_time(&p["time_from_start"]));
    let points = v["points"].as_array().map(|a| a.iter().map(point).collect()).unwrap_or_default();
    let mut m = JointTrajectory { joint_names: strings(&v["joint_names"]), points, ..JointTrajectory::default() };
    m.header.stamp = json_time(&v["header"]["stamp"]);
    m
}

fn json_imu(v: &Value) -> Imu {
    let vector = |v: &Value| Vector3 { x: number(&v["x"]), y: number(&v["y"]), z: number(&v["z"]) };
    let q = &v["orientation"];
    let mut m = Imu {
        linear_acceleration: vector(&v["linear_acceleration"]),
        angular_velocity: vector(&v["angular_velocity"]),
        orientation: Quaternion { x: number(&q["x"]), y: number(&q["y"]), z: number(&q["z"]), w: number(&q["w"]) },
        ..Imu::default()
    };
    m.header.stamp = json_time(&v["header"]["stamp"]);
    let covariance = |name: &str| {
        let there = numbers(&v[name]).first().is_none_or(|x| *x >= 0.0);
        std::array::from_fn(|i| if i == 0 && !there { -1.0 } else { 0.0 })
    };
    m.orientation_covariance = covariance("orientation_covariance");
    m.angular_velocity_covariance = covariance("angular_velocity_covariance");
    m.linear_acceleration_covariance = covariance("linear_acceleration_covariance");
    m
}

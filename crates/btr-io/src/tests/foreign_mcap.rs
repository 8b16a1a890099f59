//! MCAP files as other people record them.

use super::own_mcap::{bytes, walk};
use super::*;
use ::mcap::records::MessageHeader;
use ::mcap::{MessageStream, Writer};
use serde::Serialize;
use std::collections::BTreeMap;

type Stamp = (i32, u32);
type JointState<'a> = ((Stamp, &'a str), Vec<&'a str>, Vec<f64>, Vec<f64>, Vec<f64>);

/// A recording in the making.
struct Bag(Writer<std::io::Cursor<Vec<u8>>>);

impl Bag {
    fn new() -> Self {
        Bag(Writer::new(std::io::Cursor::new(Vec::new())).unwrap())
    }

    fn put(&mut self, topic: &str, schema: &str, encoding: &str, ns: u64, data: &[u8]) {
        let schema = self.0.add_schema(schema, "ros2msg", b"").unwrap();
        let channel_id = self.0.add_channel(schema, topic, encoding, &BTreeMap::new()).unwrap();
        let header = MessageHeader { channel_id, sequence: 0, log_time: ns, publish_time: ns };
        self.0.write_to_known_channel(&header, data).unwrap();
    }

    fn cdr<T: Serialize>(&mut self, topic: &str, schema: &str, ns: u64, message: &T) {
        let body = re_cdr::to_vec::<T, re_cdr::LittleEndian>(message).unwrap();
        self.put(topic, schema, "cdr", ns, &[&[0, 1, 0, 0], &body[..]].concat());
    }

    fn states(&mut self, ns: u64, names: &[&str], position: &[f64]) {
        let m: JointState = (((0, 0), ""), names.to_vec(), position.to_vec(), vec![], vec![]);
        self.cdr("/joint_states", "sensor_msgs/msg/JointState", ns, &m);
    }

    fn read(mut self, mapping: &str) -> Result<(Log, Vec<Warning>), IoError> {
        self.0.finish().unwrap();
        let bytes = self.0.into_inner().into_inner();
        mcap::read(Path::new("bag.mcap"), &bytes[..], &toml::from_str(mapping).unwrap())
    }
}

fn text(log: &Log, channel: &str) -> String {
    format!("{:?}", log.values(channel).unwrap())
}

#[test]
fn joints_are_matched_by_name_and_missing_ones_are_nan() {
    let mut bag = Bag::new();
    bag.states(1_000_000_000, &["hip", "knee"], &[1.0, 2.0]);
    bag.states(2_000_000_000, &["knee", "hip"], &[4.0, 3.0]);
    bag.states(3_000_000_000, &["gripper"], &[9.0]);
    let (log, warnings) = bag.read("").unwrap();
    assert_eq!(log.clock_s(), [1.0, 2.0, 3.0]);
    assert_eq!(text(&log, "q_hip"), "[1.0, 3.0, NaN]");
    assert_eq!(text(&log, "q_knee"), "[2.0, 4.0, NaN]");
    assert_eq!(text(&log, "q_gripper"), "[NaN, NaN, 9.0]");
    assert_eq!(log.channels().len(), 3, "no velocity and no effort");
    assert_eq!(warnings, []);
}

#[test]
fn commands_are_held_and_unknown_before_the_first() {
    let mut bag = Bag::new();
    for i in 0..5 {
        bag.states(i * 10, &["hip"], &[0.0]);
    }
    for (ns, goal) in [(15, 1.0), (30, 2.0)] {
        bag.cdr("/goals", "std_msgs/msg/Float64MultiArray", ns, &((Vec::<u8>::new(), 0_u32), vec![goal]));
    }
    let (log, _) = bag.read(r#"topics.arrays = { "/goals" = ["cmd_hip"] }"#).unwrap();
    assert_eq!(text(&log, "cmd_hip"), "[NaN, NaN, 1.0, 2.0, 2.0]");
    assert_eq!(log.channel("cmd_hip").unwrap().role, Role::Command);
}

#[test]
fn a_trajectory_is_followed_until_the_next_one_replaces_it() {
    const SECOND: u64 = 1_000_000_000;
    type Point = (Vec<f64>, [Vec<f64>; 3], Stamp);
    let point = |x: f64, sec: i32| -> Point { (vec![x], Default::default(), (sec, 0)) };
    let mut bag = Bag::new();
    for i in 0..6 {
        bag.states(i * SECOND, &["hip"], &[0.0]);
    }
    for (ns, points) in [(0, vec![point(0.0, 0), point(4.0, 4)]), (2 * SECOND, vec![point(2.0, 0), point(0.0, 2)])] {
        let m = (((0, 0), ""), vec!["hip"], points);
        bag.cdr("/arm/trajectory", "trajectory_msgs/msg/JointTrajectory", ns, &m);
    }
    let (log, _) = bag.read(r#"topics.commands = "/arm/trajectory""#).unwrap();
    assert_eq!(text(&log, "cmd_hip"), "[0.0, 1.0, 2.0, 1.0, 0.0, 0.0]");
}

#[test]
fn json_is_read_like_cdr() {
    let mut bag = Bag::new();
    let json = |sec: u64, q: &str| {
        format!(
            r#"{{"header":{{"stamp":{{"sec":{sec},"nsec":500000000}}}},"name":["hip"],"position":[{q}],"effort":[2]}}"#
        )
    };
    for (sec, q) in [(3, "1.5"), (4, "null")] {
        bag.put("/joint_states", "sensor_msgs/JointState", "json", 0, json(sec, q).as_bytes());
    }
    let (log, _) = bag.read("").unwrap();
    assert_eq!(log.clock_s(), [3.5, 4.5]);
    assert_eq!((text(&log, "q_hip"), text(&log, "tau_hip")), ("[1.5, NaN]".into(), "[2.0, 2.0]".into()));
}

#[test]
fn what_cannot_be_read_is_skipped_and_told() {
    let mut bag = Bag::new();
    bag.states(10, &["hip"], &[1.0]);
    bag.states(10, &["hip"], &[2.0]);
    bag.states(20, &["hip", "knee"], &[1.0]);
    bag.put("/joint_states", "sensor_msgs/msg/JointState", "cdr", 30, &[0, 9, 0, 0, 1]);
    bag.put("/imu", "foxglove.Imu", "protobuf", 30, b"?");
    bag.put("/camera", "sensor_msgs/msg/Image", "cdr", 30, b"?");
    bag.put("/srv_Event", "x/srv/Y_Event", "cdr", 30, b"---");
    let (log, warnings) = bag.read("").unwrap();
    assert_eq!(text(&log, "q_hip"), "[1.0]");
    let told: Vec<String> = warnings.iter().map(Warning::to_string).collect();
    let expected = [
        "topic `/imu` is left out: messages encoded as `protobuf` are not read",
        "topic `/joint_states`: 2 messages could not be decoded (1 numbers for 2 names)",
        "`q_hip`: 1 samples with a repeated time are left out",
    ];
    assert_eq!(told, expected);
}

#[test]
fn a_file_without_joint_states_lists_its_topics() {
    let mut bag = Bag::new();
    bag.put("/arm/joint_states", "sensor_msgs/msg/JointState", "cdr", 0, b"");
    let error = bag.read("").unwrap_err();
    let expected =
        "bag.mcap: no joint states on `/joint_states`; topics: `/arm/joint_states (sensor_msgs/msg/JointState)`";
    assert_eq!(error.to_string(), expected);
    assert!(error.help().to_string().contains("states = "), "{}", error.help());
}

#[test]
fn clocks_since_1970_start_at_zero_to_the_nanosecond() {
    let mut bag = Bag::new();
    let start = 1_700_000_000_123_456_789;
    bag.states(start, &["hip"], &[1.0]);
    bag.states(start + 1, &["hip"], &[1.0]);
    let (log, warnings) = bag.read("").unwrap();
    assert_eq!(log.clock_s(), [0.0, 1e-9]);
    assert_eq!(warnings, [Warning::ClockShifted { start_ns: start }]);
}

#[test]
fn a_command_before_the_first_state_is_held_also_on_a_clock_since_1970() {
    let mut bag = Bag::new();
    let start = 1_700_000_000_000_000_000;
    let goal = |bag: &mut Bag, ns, goal: f64| {
        bag.cdr("/goals", "std_msgs/msg/Float64MultiArray", ns, &((Vec::<u8>::new(), 0_u32), vec![goal]));
    };
    goal(&mut bag, start - 1_000_000_000, 1.0);
    goal(&mut bag, start - 1, 2.0);
    bag.states(start, &["hip"], &[0.5]);
    goal(&mut bag, start + 5, 3.0);
    bag.states(start + 10, &["hip"], &[0.5]);
    let (log, _) = bag.read(r#"topics.arrays = { "/goals" = ["cmd_hip"] }"#).unwrap();
    assert_eq!(log.clock_s(), [0.0, 1e-8]);
    assert_eq!(text(&log, "cmd_hip"), "[2.0, 3.0]");
}

#[test]
fn a_message_per_motor_in_any_order_is_told_apart() {
    let mut bag = Bag::new();
    let (motors, ticks) = (1200_usize, 3_usize);
    let names: Vec<String> = (0..motors).map(|k| format!("m{k}")).collect();
    for tick in 0..ticks {
        for k in 0..motors {
            // Backwards every other time.
            let k = if tick % 2 == 0 { k } else { motors - 1 - k };
            bag.states(10 * tick as u64, &[&names[k]], &[(10 * k + tick) as f64]);
        }
    }
    let (log, _) = bag.read("").unwrap();
    for k in [0, 1, 17, 1023, 1024, 1199] {
        let told: Vec<f64> = (0..ticks).map(|tick| (10 * k + tick) as f64).collect();
        assert_eq!(log.values(&format!("q_m{k}")).unwrap(), told);
    }
}

#[test]
fn the_standard_topics_of_btr_hold_what_the_log_holds() {
    let log = walk(50);
    let mut bag = Bag::new();
    for message in MessageStream::new(&bytes(&log, &Meta::default())).unwrap().map(Result::unwrap) {
        if message.channel.topic != "/btr/channels" {
            let schema = &message.channel.schema.as_ref().unwrap().name;
            bag.put(&message.channel.topic, schema, "cdr", message.log_time, &message.data);
        }
    }
    // The first header's stamp is 0, which means none, so recording times count; both are the same here.
    let (read, warnings) = bag.read("").unwrap();
    assert_eq!(warnings, []);
    assert!(read.clock_s().iter().zip(log.clock_s()).all(|(a, b)| (a - b).abs() <= 0.5e-9));
    for name in
        ["cmd_hip", "cmd_knee", "q_hip", "q_knee", "dq_knee", "imu_acc_x", "imu_acc_z", "imu_gyro_x", "imu_gyro_z"]
    {
        assert_eq!(read.values(name).unwrap(), log.values(name).unwrap(), "{name}");
    }
}

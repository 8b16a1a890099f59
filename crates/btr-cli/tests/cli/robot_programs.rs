//! Programs that move a robot: however a run ends, they end with it, and no real test is lost or done twice.

use crate::lab::{Lab, text};
use std::collections::BTreeMap;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant, SystemTime};

const TWIN: &str = "kind = \"twin\"\nparameters = { \"mass@bob\" = 1.3, \"viscous_friction.coefficient@hinge\" = 0.3 }";
const ON_STOP: &str = "on_stop = [\"python3\", \"robot.py\", \"stop\"]\non_stop_timeout_s = 60.0";

/// An experiment of four real tests by the pretended robot.
fn lab(options: &[&str], settings: &str) -> Lab {
    let options: String = options.iter().map(|option| format!(", \"{option}\"")).collect();
    let run = format!("run = [\"python3\", \"robot.py\", \"{{references}}\", \"{{log}}\", \"{{trial}}\"{options}]");
    let lab = Lab::with(&[(TWIN, &format!("kind = \"command\"\n{run}\nstop_s = 0.3\n{settings}"))]);
    lab.write("robot.py", include_str!("robot.py"));
    lab
}

/// When a program drove the robot: time in s, group, test.
fn beats(lab: &Lab, name: &str) -> Vec<(f64, u32, String)> {
    let text = std::fs::read_to_string(lab.path(name)).unwrap_or_default();
    let fields = |line: &str| line.split(' ').map(str::to_owned).collect::<Vec<_>>();
    let beat = |line: Vec<String>| (line[0].parse().unwrap(), line[1].parse().unwrap(), line[2].clone());
    text.lines().map(|line| beat(fields(line))).collect()
}

/// The first and the last moment of each program, in order.
fn drives(lab: &Lab) -> Vec<(f64, f64, String)> {
    let mut of_group: BTreeMap<u32, (f64, f64, String)> = BTreeMap::new();
    for (time, group, test) in beats(lab, "beats") {
        let drive = of_group.entry(group).or_insert((time, time, test));
        *drive = (drive.0.min(time), drive.1.max(time), drive.2.clone());
    }
    let mut drives: Vec<_> = of_group.into_values().collect();
    drives.sort_by(|a, b| a.0.total_cmp(&b.0));
    drives
}

/// The tests in the order in which programs drove them, never two at once.
fn tests_driven(lab: &Lab) -> Vec<String> {
    let drives = drives(lab);
    assert!(drives.windows(2).all(|pair| pair[0].1 < pair[1].0), "two at once: {drives:?}");
    drives.into_iter().map(|drive| drive.2).collect()
}

fn wait_until(what: &str, is_so: impl Fn() -> bool) {
    let begun = Instant::now();
    while !is_so() {
        assert!(begun.elapsed() < Duration::from_secs(60), "waiting for: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Starts a run as a terminal does, in a group of its own, and waits until all three processes drive the robot.
fn driving(lab: &Lab, arguments: &str) -> Child {
    let mut command = lab.command(arguments);
    command.process_group(0).stdout(Stdio::piped()).stderr(Stdio::piped());
    let child = command.spawn().unwrap();
    wait_until("the robot moves", || beats(lab, "beats").len() > 5);
    child
}

/// Kills a run while the robot moves, which goes on until it is released.
fn killed(lab: &Lab) {
    lab.write("hold-0000", "");
    let run = driving(lab, "coevolve small.toml --out run");
    signal("KILL", i64::from(run.id()));
    run.wait_with_output().unwrap();
}

/// Lets the robot end its test.
fn release(lab: &Lab, test: &str) {
    std::fs::remove_file(lab.path(&format!("hold-{test}"))).unwrap();
}

/// Sends a signal; a negative number is a group's.
fn signal(name: &str, to: i64) {
    assert!(Command::new("kill").args(["-s", name, "--", &to.to_string()]).status().unwrap().success());
}

/// Waits for a run; nothing may drive the robot after it.
fn ended(lab: &Lab, run: Child) -> Output {
    let output = run.wait_with_output().unwrap();
    let before = beats(lab, "beats").len();
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!(beats(lab, "beats").len(), before, "the robot moves on");
    output
}

/// Resumes the run and checks that all four tests were done, each once.
fn resumes_to_the_end(lab: &Lab) {
    let document = lab.json("coevolve small.toml --out run --resume");
    assert_eq!((&document["real_tests"], &document["stop_reason"]), (&4.into(), &"iterations_done".into()));
    let done: Vec<String> = beats(lab, "done").into_iter().map(|(_, _, test)| test).collect();
    assert_eq!(done, ["0000", "0001", "0002", "0003"]);
    assert!(!lab.exists("run/transfers/0000/failed.txt") && !lab.exists("run/transfers/0000/running.toml"));
}

#[test]
fn an_interruption_ends_the_program_and_is_no_outcome() {
    // Once and twice Ctrl-C in a terminal; SIGTERM to btr alone.
    for (name, times, group) in [("INT", 1, true), ("INT", 2, true), ("TERM", 1, false)] {
        // With half a log, which is none.
        let lab = lab(&["stubborn", "early"], &format!("timeout_s = 60.0\nretries = 2\n{ON_STOP}"));
        lab.write("hold-0000", "");
        let run = driving(&lab, "coevolve small.toml --out run");
        let to = i64::from(run.id()) * if group { -1 } else { 1 };
        for _ in 0..times {
            signal(name, to);
            std::thread::sleep(Duration::from_millis(50));
        }
        let output = ended(&lab, run);
        assert_eq!(output.status.code(), Some(130), "{}", text(&output.stderr));
        assert_eq!((tests_driven(&lab).len(), beats(&lab, "stops").len()), (1, 1), "{name}: no retry, made safe once");
        assert!(lab.exists("run/transfers/0000/try-1.csv") && !lab.exists("run/transfers/0000/log.csv"));
        assert!(!lab.exists("run/transfers/0000/failed.txt"));
        release(&lab, "0000");
        resumes_to_the_end(&lab);
        assert_eq!(tests_driven(&lab), ["0000", "0000", "0001", "0002", "0003"]);
    }
}

#[test]
fn after_the_time_out_nothing_of_the_program_is_left_when_the_next_try_begins() {
    // Long enough for Python to start on a busy computer.
    let lab = lab(&["stubborn", "hang"], &format!("timeout_s = 5.0\nretries = 1\n{ON_STOP}"));
    let output = ended(&lab, driving(&lab, "coevolve small.toml --out run --set coevolve.transfer.count=1"));
    assert_eq!(output.status.code(), Some(1), "no real data");
    let (tests, stops) = (tests_driven(&lab), beats(&lab, "stops"));
    assert_eq!(tests, ["0000", "0000"]);
    // Made safe between the tries, and after the last one.
    let (drives, stopped) = (drives(&lab), stops.iter().map(|stop| stop.0).collect::<Vec<_>>());
    assert!(drives[0].1 < stopped[0] && stopped[0] < drives[1].0 && drives[1].1 < stopped[1], "{drives:?} {stops:?}");
    assert!(lab.read("run/transfers/0000/failed.txt").contains("took longer than 5 s"));
}

#[test]
fn what_a_program_leaves_behind_is_ended_and_told() {
    let lab = lab(&["leave", "drive=0.1"], "timeout_s = 60.0");
    let output = ended(&lab, driving(&lab, "coevolve small.toml --out run --set coevolve.iterations=1"));
    assert_eq!(output.status.code(), Some(0));
    assert!(text(&output.stderr).contains("the test's program has ended, but not processes "), "{output:?}");
    assert_eq!(tests_driven(&lab), ["0000", "0001"]);
}

#[test]
fn a_program_of_a_killed_run_is_waited_for_and_its_log_adopted() {
    let lab = lab(&[], "timeout_s = 60.0");
    killed(&lab);
    release(&lab, "0000");
    resumes_to_the_end(&lab);
    assert_eq!(tests_driven(&lab), ["0000", "0001", "0002", "0003"]);
}

#[test]
fn a_program_of_a_killed_run_that_does_not_end_is_named_and_no_second_one_started() {
    let lab = lab(&[], &format!("timeout_s = 60.0\n{ON_STOP}"));
    killed(&lab);
    // As if it had begun long ago.
    let record = std::fs::File::options().write(true).open(lab.path("run/transfers/0000/running.toml")).unwrap();
    record.set_modified(SystemTime::now() - Duration::from_secs(60)).unwrap();
    let group = drives_in_groups(&lab)[0];
    let told = lab.complaint("coevolve small.toml --out run --resume");
    assert!(told.contains("error: the program of real test 0, which a killed run started, still runs: "), "{told}");
    assert!(
        told.contains(&format!("`kill -- -{group}` ends it")) && told.contains("run again with --resume"),
        "{told}"
    );
    assert_eq!(tests_driven(&lab), ["0000"]);

    signal("KILL", -i64::from(group));
    release(&lab, "0000");
    resumes_to_the_end(&lab);
    assert_eq!(beats(&lab, "stops").len(), 1, "made safe before the test was repeated");
    assert_eq!(tests_driven(&lab), ["0000", "0000", "0001", "0002", "0003"]);
}

#[test]
fn ctrl_c_also_ends_the_program_of_a_killed_run() {
    let lab = lab(&[], "timeout_s = 60.0");
    killed(&lab);
    let mut command = lab.command("coevolve small.toml --out run --resume");
    let mut resumed = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    wait_until_said(&mut resumed, "still runs: processes ");
    signal("INT", i64::from(resumed.id()));
    assert_eq!(ended(&lab, resumed).status.code(), Some(130));
    assert!(!lab.exists("run/transfers/0000/running.toml"));
}

/// Reads a run's stderr until it holds these words.
fn wait_until_said(run: &mut Child, words: &str) {
    use std::io::{BufRead, BufReader};
    let stderr = BufReader::new(run.stderr.take().unwrap());
    assert!(stderr.lines().map_while(Result::ok).any(|line| line.contains(words)), "{words}");
}

fn drives_in_groups(lab: &Lab) -> Vec<u32> {
    let mut groups: Vec<u32> = beats(lab, "beats").into_iter().map(|beat| beat.1).collect();
    groups.dedup();
    groups
}

#[test]
fn one_run_at_a_time_works_in_a_folder() {
    let lab = lab(&[], "timeout_s = 60.0");
    lab.write("hold-0000", "");
    let first = driving(&lab, "coevolve small.toml --out run");
    for resume in ["", " --resume"] {
        let told = lab.complaint(&format!("coevolve small.toml --out run{resume}"));
        assert!(told.starts_with(&format!("error: run is in use by another run, process {}\n", first.id())), "{told}");
    }
    release(&lab, "0000");
    assert_eq!(ended(&lab, first).status.code(), Some(0));
    assert_eq!(tests_driven(&lab), ["0000", "0001", "0002", "0003"]);
}

#[test]
fn a_robot_that_could_not_be_made_safe_ends_the_run() {
    let on_stop = ON_STOP.replace("\"stop\"", "\"stop\", \"fail\"");
    let lab = lab(&["fail"], &format!("timeout_s = 60.0\nretries = 5\n{on_stop}"));
    let told = lab.complaint("coevolve small.toml --out run");
    assert!(told.contains("THE ROBOT MAY NOT BE SAFE: on_stop, `python3`, ended with exit status: 1"), "{told}");
    assert!(told.contains("help: see that the robot stands still, then run again with --resume"), "{told}");
    assert_eq!(tests_driven(&lab), ["0000"]);
    assert!(!lab.exists("run/transfers/0000/failed.txt"));
}

#[test]
fn a_run_whose_folder_is_gone_is_kept_beside_it() {
    let lab = lab(&["drive=0.1"], "timeout_s = 60.0");
    lab.write("hold-0001", "");
    let run = driving(&lab, "coevolve small.toml --out run");
    wait_until("a second test", || drives(&lab).len() == 2);
    std::fs::remove_dir_all(lab.path("run")).unwrap();
    release(&lab, "0001");
    let output = ended(&lab, run);
    let told = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{told}");
    assert!(told.contains("error: run is gone: the run and its real tests are kept in run.rescued"), "{told}");
    let document = lab.json("coevolve small.toml --out run.rescued --resume");
    assert_eq!((&document["real_tests"], &document["stop_reason"]), (&4.into(), &"iterations_done".into()));
    assert_eq!(beats(&lab, "done")[0].2, "0000");
    assert_eq!(beats(&lab, "done").iter().filter(|done| done.2 == "0000").count(), 1, "it was kept");
}

#[test]
fn output_is_bounded_and_litter_swept() {
    let lab = lab(&["noisy", "drive=0.3", "children=0"], "timeout_s = 60.0");
    lab.ok("coevolve small.toml --out run -q --set coevolve.iterations=1");
    for k in 0..2 {
        let size = std::fs::metadata(lab.path(&format!("run/transfers/000{k}/try-1.out"))).unwrap().len();
        assert!(1_000_000 < size && size < 1_100_000, "{size} bytes");
    }
    let litter = ["run/.checkpoint.bin.Ab3dEf.btr.tmp", "run/transfers/0001/.log.csv.0aB1cD.btr.tmp"];
    litter.iter().for_each(|name| lab.write(name, "half"));
    lab.ok("coevolve small.toml --out run -q --resume --set coevolve.iterations=1");
    assert!(litter.iter().all(|name| !lab.exists(name)));
}

//! Where the truth can come from: a person, a program, recorded logs.

use crate::lab::Lab;
use serde_json::Value;

const TWIN: &str = "kind = \"twin\"\nparameters = { \"mass@bob\" = 1.3, \"viscous_friction.coefficient@hinge\" = 0.3 }";
/// The robot that the tests pretend to have: the small model with other values.
const ROBOT: &str = "--set parameters.\"mass@bob\".value=1.3";

/// The small experiment with another reality.
fn lab(reality: &str) -> Lab {
    Lab::with(&[(TWIN, reality)])
}

/// Plays the references of a trial on the pretended robot.
fn play(lab: &Lab, folder: &str) {
    lab.write("drive.toml", &format!("[drive]\nkind = \"replay\"\nlog = \"{folder}/references.csv\"\n"));
    lab.ok(&format!("simulate small.toml -q {ROBOT} --drive drive.toml -o {folder}/log.csv"));
}

#[test]
fn a_person_gets_all_trials_of_an_iteration_and_the_run_waits_for_their_logs() {
    let lab = lab("kind = \"manual\"");
    let told = lab.ok("coevolve small.toml --out run");
    assert!(told.contains("waiting for a real test: run/transfers/0000: play references.csv on the robot"), "{told}");
    assert!(told.contains("--resume"), "{told}");
    for k in [0, 1] {
        let references = lab.read(&format!("run/transfers/000{k}/references.csv"));
        assert_eq!(references.lines().next(), Some("t,cmd_hinge"));
        assert_eq!(references.lines().count(), 52, "0.5 s at 100 Hz");
        assert!(lab.read(&format!("run/transfers/000{k}/trial.toml")).contains("\"amplitude@hinge\" = "));
    }
    assert!(!lab.exists("run/transfers/0002"));

    // One log is not enough; a reason for having none is a result too.
    play(&lab, "run/transfers/0000");
    let document = lab.json("coevolve small.toml --out run --resume");
    assert!(document["waiting_for"].as_str().unwrap().starts_with("run/transfers/0001: "), "{document}");
    assert_eq!((&document["real_tests"], &document["stop_reason"]), (&1.into(), &Value::Null));
    lab.write("run/transfers/0001/failed.txt", "the battery was empty\n");
    let document = lab.json("coevolve small.toml --out run --resume");
    assert!(document["waiting_for"].as_str().unwrap().starts_with("run/transfers/0002: "), "{document}");
    assert_eq!(document["tests"][1]["verdict"]["failed"]["why"], "the battery was empty");
    assert_eq!(document["iterations"].as_array().unwrap().len(), 1);

    for k in [2, 3] {
        play(&lab, &format!("run/transfers/000{k}"));
    }
    let document = lab.json("coevolve small.toml --out run --resume");
    assert_eq!((&document["stop_reason"], &document["real_tests"]), (&"iterations_done".into(), &4.into()));
    let mass = document["iterations"][1]["parameters"]["mass@bob"].as_f64().unwrap();
    assert!((mass - 1.3).abs() < 0.05, "{mass} kg");
}

#[test]
fn half_a_log_is_waited_for_until_it_is_whole() {
    let lab = lab("kind = \"manual\"");
    lab.ok("coevolve small.toml --out run -q");
    play(&lab, "run/transfers/0000");
    let whole = lab.read("run/transfers/0000/log.csv");
    lab.write("run/transfers/0000/log.csv", &whole[..whole.len() / 2]);
    let document = lab.json("coevolve small.toml --out run --resume");
    assert_eq!(document["real_tests"], 0);
    assert!(document["waiting_for"].as_str().unwrap().contains("truncated"), "{document}");
    lab.write("run/transfers/0000/log.csv", &whole);
    assert_eq!(lab.json("coevolve small.toml --out run --resume")["real_tests"], 1);
}

/// A reality that runs `robot.sh` with the references and the log to write.
fn with_script(script: &str, settings: &str) -> Lab {
    let run = "run = [\"sh\", \"robot.sh\", \"{references}\", \"{log}\", \"{trial}\"]";
    let lab = lab(&format!("kind = \"command\"\n{run}\ntimeout_s = 20.0\n{settings}"));
    let simulate = "printf '[drive]\\nkind = \"replay\"\\nlog = \"%s\"\\n' \"$PWD/$1\" > \"$2.toml\"\n\
        simulate() { \"$BTR\" simulate small.toml -q --set 'parameters.\"mass@bob\".value=1.3' --drive \"$2.toml\" -o \"$2\"; }\n";
    lab.write("robot.sh", &format!("{simulate}{script}\n"));
    lab
}

#[test]
fn a_program_runs_every_test() {
    for ending in ["csv", "mcap"] {
        let lab = with_script("test -f \"$3\" && simulate \"$1\" \"$2\"", &format!("log = \"{ending}\""));
        let document = lab.json("coevolve small.toml --out run");
        assert_eq!((&document["real_tests"], &document["stop_reason"]), (&4.into(), &"iterations_done".into()));
        assert!(lab.exists(&format!("run/transfers/0003/log.{ending}")));
        let mass = document["iterations"][1]["parameters"]["mass@bob"].as_f64().unwrap();
        assert!((mass - 1.3).abs() < 0.05, "{mass} kg");
    }
}

#[test]
fn a_program_that_fails_hangs_or_lies_costs_one_test_and_the_run_goes_on() {
    let bad = [
        ("echo broken >&2; exit 3", "ended with exit status: 3; see try-1.err"),
        ("exec sleep 30", "took longer than 0.5 s"),
        ("exit 0", "try-1.csv: No such file or directory"),
        ("simulate \"$1\" \"$2\" && head -c 700 \"$2\" > half && mv half \"$2\"", "truncated"),
        ("printf 't,cmd_hinge,q_hinge\\n0.0,0.0,0.0\\n0.01,0.0,0.0\\n' > \"$2\"", "tau_<joint>"),
    ];
    for (fault, why) in bad {
        // Only the first trial meets the fault.
        let script = format!("case \"$1\" in *0000*) {fault};; *) simulate \"$1\" \"$2\";; esac");
        let lab = with_script(&script, "");
        let timeout = if fault.contains("sleep") { "0.5" } else { "20.0" };
        let document = lab.json(&format!("coevolve small.toml --out run --set reality.timeout_s={timeout}"));
        let told = document["tests"][0]["verdict"]["failed"]["why"].as_str().unwrap_or_default().to_owned();
        assert!(told.contains(why), "{fault}: {told}");
        assert_eq!((&document["real_tests"], &document["stop_reason"]), (&4.into(), &"iterations_done".into()));
        assert!(lab.read("run/transfers/0000/failed.txt").contains(why) && !lab.exists("run/transfers/0000/log.csv"));
    }
}

#[test]
fn a_failed_try_is_repeated_and_its_traces_are_kept() {
    let lab = with_script("if [ -f tried ]; then simulate \"$1\" \"$2\"; else touch tried; exit 1; fi", "retries = 1");
    let document = lab.json("coevolve small.toml --out run");
    assert!(document["tests"][0]["verdict"]["done"]["fitness"].is_number(), "{}", document["tests"][0]);
    for name in ["try-1.err", "try-2.err", "log.csv"] {
        assert!(lab.exists(&format!("run/transfers/0000/{name}")), "{name}");
    }
}

/// The clock of a log, changed line by line.
fn stamped(csv: &str, stamp: impl Fn(usize, f64) -> f64) -> String {
    let mut lines = csv.lines();
    let head = lines.next().unwrap().to_owned();
    let rows = lines.enumerate().map(|(k, line)| {
        let (t, rest) = line.split_once(',').unwrap();
        format!("\n{},{rest}", stamp(k, t.parse().unwrap()))
    });
    std::iter::once(head).chain(rows).collect::<String>() + "\n"
}

#[test]
fn recorders_may_count_from_any_epoch_and_stamp_a_little_late() {
    let logs = "kind = \"logs\"\nfiles = [\"log.csv\"]";
    let changes = [(TWIN, logs), ("search = \"all\"", "set = { \"amplitude@hinge\" = 0.5 }")];
    let phi = |stamp: &dyn Fn(usize, f64) -> f64| {
        let lab = Lab::with(&changes);
        lab.ok(&format!("simulate small.toml -q {ROBOT} -o clean.csv"));
        lab.write("log.csv", &stamped(&lab.read("clean.csv"), stamp));
        let document = lab.json("coevolve small.toml --out run --set coevolve.iterations=1");
        document["iterations"][0]["phi"].as_f64().unwrap()
    };
    let (clean, epoch) = (phi(&|_, t| t), phi(&|_, t| t + 1.7e9));
    assert!((epoch - clean).abs() < 1e-3, "{clean} {epoch}");
    let late = phi(&|k, t| t + if k % 3 == 1 { 4e-4 } else { 0.0 });
    assert!((late - clean).abs() < 0.02, "{clean} {late}");
}

#[test]
fn without_a_tick_of_its_own_the_model_takes_that_of_the_logs() {
    let logs = "kind = \"logs\"\nfiles = [\"log.csv\"]";
    let lab = Lab::with(&[(TWIN, logs), ("search = \"all\"", "set = { \"amplitude@hinge\" = 0.5 }")]);
    lab.ok(&format!("simulate small.toml -q {ROBOT} -o log.csv"));
    let experiment = lab.read("small.toml");
    assert!(experiment.contains("control_s = 0.01"), "{experiment}");
    let iterations = |text: &str, out: &str| {
        lab.write("small.toml", text);
        lab.json(&format!("coevolve small.toml --out {out} --set coevolve.iterations=1"))["iterations"].clone()
    };
    let (told, found) =
        (iterations(&experiment, "told"), iterations(&experiment.replace("control_s = 0.01", ""), "found"));
    assert_eq!(told, found);
}

#[test]
fn a_program_that_is_not_there_ends_the_run_without_data() {
    let lab = lab("kind = \"command\"\nrun = [\"no-such-robot\"]\ntimeout_s = 1.0");
    let told = lab.exits("coevolve small.toml --out run", 1);
    assert!(told.contains("stopped: no real test gave data"), "{told}");
    assert!(lab.read("run/transfers/0000/failed.txt").contains("`no-such-robot` does not start"));
}

#[test]
fn recorded_logs_are_learnt_from_and_held_out_ones_only_judged() {
    let logs = "kind = \"logs\"\nfiles = [\"slow.csv\"]\nheld_out = [\"fast.csv\"]";
    let lab = Lab::with(&[(TWIN, logs), ("search = \"all\"", "set = { \"amplitude@hinge\" = 0.5 }")]);
    for (name, omega) in [("slow", 6.0), ("fast", 12.0)] {
        lab.ok(&format!("simulate small.toml -q {ROBOT} --set drive.omega_rad_s={omega:?} -o {name}.csv"));
    }
    let document = lab.json("coevolve small.toml --out run --set coevolve.iterations=1");
    assert_eq!(document["real_tests"], 1, "the held-out log is never asked for");
    let scores = document["logs"].as_array().unwrap();
    assert_eq!(scores.len(), 2);
    for (score, (name, held_out)) in scores.iter().zip([("slow", false), ("fast", true)]) {
        assert_eq!((&score["log"], &score["held_out"]), (&name.into(), &held_out.into()));
        let mean = |when: &str| score[when]["mean_abs"].as_f64().unwrap();
        assert!(mean("after") < 0.3 * mean("before"), "{score}");
    }
}

#[test]
fn an_index_chooses_logs_and_tells_what_is_known_of_each() {
    let logs = "kind = \"logs\"\nindex = \"index.csv\"\nlearn = { drive = \"slow\" }\njudge = { drive = \"fast\" }\n\
        columns = { \"kp@hinge\" = { column = \"gain\", factor = 0.1 } }";
    let lab = Lab::with(&[(TWIN, logs), ("search = \"all\"", "set = { \"amplitude@hinge\" = 0.5 }")]);
    lab.write("index.csv", "file,drive,gain\nslow.csv,slow,80\nfast.csv,fast,120\nother.csv,none,0\n");
    for (name, omega, kp) in [("slow", 6.0, 8.0), ("fast", 12.0, 12.0)] {
        let settings = format!("--set drive.omega_rad_s={omega:?} --set actuators.hinge.kp={kp:?}");
        lab.ok(&format!("simulate small.toml -q {ROBOT} {settings} -o {name}.csv"));
    }
    let document = lab.json("coevolve small.toml --out run --set coevolve.iterations=1");
    let mass = document["iterations"][0]["parameters"]["mass@bob"].as_f64().unwrap();
    assert!((mass - 1.3).abs() < 0.05, "{mass} kg: without the gains from the index it cannot be found");
    assert_eq!(document["logs"].as_array().unwrap().len(), 2);
}

#[test]
fn a_real_test_that_was_recorded_badly_is_told_at_once() {
    let lab = Lab::with(&[(TWIN, "kind = \"manual\""), ("duration_s = 0.5", "duration_s = 3.0")]);
    lab.ok("coevolve small.toml --out run -q");
    play(&lab, "run/transfers/0000");
    play(&lab, "run/transfers/0001");
    let good = lab.read("run/transfers/0000/log.csv");
    let column = good.lines().next().unwrap().split(',').position(|name| name == "q_hinge").unwrap();
    let changed = |change: &dyn Fn(f64) -> String| {
        let row = |row: &str| {
            let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
            cells[column] = cells[column].parse().map_or_else(|_| cells[column].clone(), change);
            cells.join(",") + "\n"
        };
        good.lines().map(row).collect::<String>()
    };
    lab.write("run/transfers/0000/log.csv", &changed(&|x| (57.3 * x).to_string()));
    lab.write("run/transfers/0001/log.csv", &changed(&|_| String::new()));
    let output = lab.run("coevolve small.toml --out run --resume");
    let told = crate::lab::text(&output.stderr);
    assert!(
        told.contains("warning: real test 0: dq_hinge is a 57th of the slope of q_hinge: is q_hinge in degrees?"),
        "{told}"
    );
    assert!(told.contains("warning: real test 1: its log has nothing that rmse could compare"), "{told}");
    let again = crate::lab::text(&lab.run("coevolve small.toml --out run --resume").stderr);
    assert!(!again.contains("warning: real test"), "told once: {again}");
    let document = lab.json("coevolve small.toml --out run --resume");
    let doubts = document["doubts"].as_array().unwrap();
    assert!(doubts.iter().any(|d| d["test"] == 0 && d["topic"] == "unit" && d["channel"] == "q_hinge"), "{document}");
    assert!(doubts.iter().any(|d| d["test"] == 1 && d["severity"] == "bad"), "{document}");
}

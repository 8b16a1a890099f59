//! Hostile and mistaken input: nothing aborts, hangs or fills the memory, and the complaint names file, key and limit.

use crate::lab::{Lab, SMALL, text};
use std::io::Write;
use std::process::Stdio;

/// What `btr` says about the small experiment with one setting.
fn complaint(lab: &Lab, verb: &str, setting: &str) -> String {
    let output = lab.command(verb).args(["--set", setting]).output().unwrap();
    let told = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{setting}: {told}");
    told
}

const DRY: &str = "coevolve small.toml --out run --dry-run";
const SIMULATE: &str = "simulate small.toml -o new.csv";

#[test]
fn simulations_that_would_never_end_are_refused() {
    let lab = Lab::new();
    let settings =
        ["duration_s=1e9", "control_s=1e-12", "duration_s=1e300", "steps_per_control=1000000", "max_steps=99"];
    let told = settings.map(|setting| {
        let setting = format!("simulation.{setting}");
        let (dry, simulated) = (complaint(&lab, DRY, &setting), complaint(&lab, SIMULATE, &setting));
        assert_eq!(dry, simulated);
        format!("{setting}\n{dry}")
    });
    insta::assert_snapshot!("endless_simulations", told.join("\n"));
    lab.ok(&format!("{SIMULATE} --set simulation.max_steps=100"));
}

#[test]
fn counts_that_would_fill_the_memory_are_refused() {
    let lab = Lab::new();
    let told = ["controllers.search.population", "controllers.search.tournament", "simulators.refine"]
        .map(|key| complaint(&lab, DRY, &format!("coevolve.{key}=1000000000000")));
    insta::assert_snapshot!("counts", told.join("\n"));
    for key in ["iterations", "real_tests"] {
        let told = complaint(&lab, DRY, &format!("coevolve.{key}=1000001"));
        assert!(told.contains("expected a count of 1000000 or less"), "{told}");
    }
}

#[test]
fn every_number_is_finite_and_has_its_sign() {
    let lab = Lab::new();
    let settings = [
        "noise.position_rad=inf",
        "noise.position_rad=-1",
        "noise.torque_n_m=nan",
        "noise.channels.q_hinge=-0.5",
        "reality.noise.gyro_rad_s=-1",
        "reality.spread=1.5",
        "drive.omega_rad_s=nan",
        "fitness.energy=inf",
        "robot.mass_kg=-1",
        "robot.length_m=0",
        "robot.height_m=nan",
        "simulation.gravity=inf",
        "simulation.ground_friction=-1",
        "simulation.ball={position_m=[0,nan],radius_m=0.1,mass_kg=1}",
        "simulation.ball={position_m=[0,0],radius_m=0,mass_kg=1}",
        "simulation.ball={position_m=[0,0],radius_m=0.1,mass_kg=-1}",
        "actuators.hinge.max_torque=-inf",
        "channels.channels.q_hinge={column=\"a\",factor=nan}",
    ];
    let told = settings.map(|setting| format!("{setting}\n{}", complaint(&lab, SIMULATE, setting)));
    insta::assert_snapshot!("numbers", told.join("\n"));
    // No limit is a limit.
    lab.ok(&format!("{SIMULATE} --set actuators.hinge.max_torque=inf"));
}

#[test]
fn a_motor_without_resistance_is_refused() {
    let lab =
        Lab::with(&[("kind = \"position\"\nkp = 10.0\nkd = 0.2", "kind = \"voltage\"\nkt = 1.0\nresistance = 0.0")]);
    let told = lab.complaint(SIMULATE);
    assert!(told.contains("small.toml:11:1: resistance must be positive"), "{told}");
}

#[test]
fn an_experiment_is_called_as_a_folder_can_be() {
    let lab = Lab::new();
    let names = ["", "..", "../../x", "/abs/olute", "a\\b", " . ", "a\u{1b}[31mb", &"n".repeat(101)];
    let told = names.map(|name| {
        lab.write("named.toml", &lab.read("small.toml").replace("\"small\"", &format!("{}", serde_json::json!(name))));
        lab.complaint("coevolve named.toml --dry-run")
    });
    insta::assert_snapshot!("folder_names", told.join("\n"));
    assert!(!lab.exists("runs"));
}

#[test]
fn names_do_not_control_the_terminal() {
    let lab = Lab::new();
    lab.write("log.csv", "t,q_\u{1b}[31mred,cmd_hinge\n0,1,0\n0.1,2,0\n");
    for arguments in ["info log.csv", "compare small.toml log.csv", "simulate small.toml --set \u{1b}[31m=1 -o out.csv"]
    {
        let output = lab.run(arguments);
        let told = text(&output.stdout) + &text(&output.stderr);
        assert!(told.contains("\\u{1b}[31m") && !told.contains('\u{1b}'), "{told}");
    }
}

#[test]
fn deep_robots_and_texts_do_not_overflow_the_stack() {
    let lab = Lab::with(&[("builtin = \"pendulum\"\nlength_m = 0.5", "urdf = \"deep.urdf\"")]);
    lab.write("deep.urdf", &format!("<robot name=\"r\">{}{}</robot>", "<a>".repeat(20_000), "</a>".repeat(20_000)));
    let told = lab.complaint(SIMULATE);
    assert!(told.contains("deep.urdf: more than 100 elements lie inside each other"), "{told}");
    for deep in
        [format!("x = {}{}", "[".repeat(50_000), "]".repeat(50_000)), format!("{} = 1", ["a"; 50_000].join("."))]
    {
        lab.write("deep.toml", &deep);
        lab.complaint("simulate deep.toml -o new.csv");
    }
    let law = format!("{}q{}", "(".repeat(50_000), ")".repeat(50_000));
    let formula = format!("[[effects]]\neffect = \"formula\"\nsite = \"hinge\"\non = \"torque\"\nlaw = \"{law}\"\n");
    lab.write("deep.toml", &format!("{}\n{formula}", crate::lab::SMALL));
    lab.complaint("simulate deep.toml -o new.csv");
}

#[test]
fn only_regular_files_are_read() {
    let lab = Lab::new();
    std::fs::create_dir(lab.path("folder.csv")).unwrap();
    std::fs::create_dir(lab.path("folder.toml")).unwrap();
    let mut told = vec![lab.complaint("compare small.toml folder.csv"), lab.complaint("check folder.toml folder.csv")];
    #[cfg(unix)]
    for name in ["zero.csv", "zero.toml"] {
        std::os::unix::fs::symlink("/dev/zero", lab.path(name)).unwrap();
        let other = if name == "zero.csv" { "compare small.toml zero.csv" } else { "simulate zero.toml -o new.csv" };
        told.push(lab.complaint(other));
    }
    // What a shell calls a pipe (`<(...)`) has no ending.
    #[cfg(unix)]
    assert!(lab.complaint("compare small.toml /dev/null").contains("or write `-` to read the standard input"));
    insta::assert_snapshot!("no_regular_files", told.join("\n"));
}

/// Runs `btr` with a text on its standard input: its output, exit code and complaints.
fn fed(lab: &Lab, arguments: &str, text: &[u8]) -> (String, i32, String) {
    let mut command = lab.command(arguments);
    let piped = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = piped.spawn().unwrap();
    // A program that refuses its input closes it.
    let _ = child.stdin.take().unwrap().write_all(text);
    let output = child.wait_with_output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (text(output.stdout), output.status.code().unwrap(), text(output.stderr))
}

#[test]
fn a_log_and_a_model_come_from_the_standard_input() {
    let lab = Lab::new();
    lab.ok("simulate small.toml -o log.csv");
    lab.ok("simulate small.toml -o log.mcap");
    let compare = |model: &str, log: &str| format!("--json compare {model} {log}");
    let of_files = lab.ok(&compare("small.toml", "log.csv"));
    let expected = of_files.replace(r#""log":"log""#, r#""log":"<stdin>""#);
    for log in ["log.csv", "log.mcap"] {
        let (told, code, _) = fed(&lab, &compare("small.toml", "-"), &std::fs::read(lab.path(log)).unwrap());
        assert_eq!((told, code), (expected.clone(), 0), "{log}");
    }
    let (told, code, _) = fed(&lab, &compare("-", "log.csv"), SMALL.as_bytes());
    assert_eq!((told, code), (of_files, 0));
    for verb in ["check small.toml -", "fit small.toml - -o fitted.toml", "info -", "convert - copy.csv"] {
        let (_, code, why) = fed(&lab, verb, lab.read("log.csv").as_bytes());
        assert_eq!(code, 0, "{verb}: {why}");
    }
    assert_eq!(lab.read("copy.csv"), lab.read("log.csv"));
}

#[test]
fn what_the_standard_input_cannot_give_is_told() {
    let lab = Lab::new();
    lab.ok("simulate small.toml -o log.csv");
    let told = |arguments: &str, text: &[u8]| {
        let (_, code, why) = fed(&lab, arguments, text);
        assert_eq!(code, 2, "{arguments}: {why}");
        why
    };
    let mut all = vec![
        told("compare - -", SMALL.as_bytes()),
        told("compare small.toml -", b""),
        told("compare small.toml -", b"t,q_hinge\n0,x\n"),
        told("compare small.toml -", &vec![b'1'; (1 << 24) + 100]),
        told("compare - log.csv", b"name = 3\n"),
        told("simulate - -o new.csv", &vec![b' '; (1 << 26) + 1]),
    ];
    all.push(told("compare small.toml -", b"\x89MCAP0\r\n"));
    insta::assert_snapshot!("standard_input", all.join("\n"));
}

#[test]
fn a_failed_simulation_names_its_model() {
    let lab = Lab::with(&[("duration_s = 0.5", "duration_s = 0.5\ngravity = -1e12")]);
    let told = lab.complaint(SIMULATE);
    assert!(told.starts_with("error: small.toml: the simulation diverged"), "{told}");
    // Also where a log is replayed.
    let rows: String = (0..30).map(|k| format!("{},{k},0\n", 0.01 * f64::from(k))).collect();
    lab.write("log.csv", &format!("t,cmd_hinge,q_hinge\n{rows}"));
    let told = lab.complaint("compare small.toml log.csv");
    assert!(told.contains("\nerror: small.toml: the simulation diverged"), "{told}");
}

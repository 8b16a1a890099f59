//! `btr studio`, which hands over to Python.

use crate::lab::{Lab, text};
use std::process::Output;

/// `btr studio` with a program in the place of Python.
fn studio(lab: &Lab, arguments: &str, python: &str) -> Output {
    lab.command(&format!("studio {arguments}")).env("BTR_PYTHON", python).output().unwrap()
}

/// A shell script in the place of Python; `$1` is `-c` where modules are imported and `-m` where one is run.
#[cfg(unix)]
fn script(lab: &Lab, lines: &str) -> String {
    use std::os::unix::fs::PermissionsExt;
    lab.write("python", &format!("#!/bin/sh\n{lines}\n"));
    std::fs::set_permissions(lab.path("python"), std::fs::Permissions::from_mode(0o755)).unwrap();
    lab.path("python").display().to_string()
}

#[test]
fn the_help_names_every_option() {
    insta::assert_snapshot!("studio_help", Lab::new().ok("studio --help"));
}

#[test]
fn without_python_it_says_what_to_install() {
    let output = studio(&Lab::new(), "small.toml log.csv", "gone-python");
    let told = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2));
    assert!(told.contains("the studio is served by Python, with btr and viser in it: gone-python"), "{told}");
    assert!(told.contains("help: pip install 'btr[studio]'"), "{told}");
}

#[test]
fn a_robot_s_file_is_told_before_what_python_lacks() {
    let lab = Lab::new();
    lab.write("arm.urdf", "<robot name=\"arm\"><link name=\"base\"/></robot>");
    let told = text(&studio(&lab, "arm.urdf log.csv", "gone-python").stderr);
    assert!(told.starts_with("error: arm.urdf: a robot's URDF, not a model file"), "{told}");
    assert!(!told.contains("gone-python"), "{told}");
}

#[test]
#[cfg(unix)]
fn without_a_package_it_says_what_to_install() {
    let lab = Lab::new();
    let python = script(&lab, "echo Traceback >&2; echo \"ModuleNotFoundError: No module named 'viser'\" >&2; exit 1");
    let output = studio(&lab, "small.toml log.csv", &python);
    let told = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2));
    assert!(told.contains("python: ModuleNotFoundError: No module named 'viser'"), "{told}");
    assert!(told.contains("help: pip install 'btr[studio]'"), "{told}");
}

#[test]
#[cfg(unix)]
fn arguments_and_the_exit_code_are_passed_on() {
    let lab = Lab::new();
    let python = script(&lab, "[ $1 = -c ] && exit 0; echo $RAYON_NUM_THREADS: \"$@\"; exit 7");
    let output = studio(&lab, "small.toml a.csv b.csv --port 0 --threads 3", &python);
    assert_eq!(output.status.code(), Some(7));
    assert_eq!(text(&output.stdout), "3: -m btr._studio small.toml a.csv b.csv --port 0\n");
    let all = "small.toml a.csv --host ::1 --folder made --no-browser --held-out b.csv c.csv";
    let output = studio(&lab, all, &python);
    let passed = "small.toml a.csv --held-out b.csv c.csv --folder made --host ::1 --no-browser";
    assert_eq!(text(&output.stdout), format!(": -m btr._studio {passed}\n"));
}

#[test]
#[cfg(unix)]
fn a_run_is_shown_by_its_folder() {
    let lab = Lab::new();
    let python = script(&lab, "[ $1 = -c ] && exit 0; echo \"$@\"");
    std::fs::create_dir(lab.path("empty")).unwrap();
    let told = text(&studio(&lab, "empty", &python).stderr);
    assert!(told.starts_with("error: empty contains no run of an experiment\nhelp: name the folder"), "{told}");
    lab.ok("coevolve small.toml --out run -q --set coevolve.iterations=1");
    let output = studio(&lab, "run --experiment small.toml --port 0", &python);
    assert_eq!(text(&output.stdout), "-m btr._studio run --experiment small.toml --port 0\n");
    std::fs::write(lab.path("run/checkpoint.bin"), "damaged").unwrap();
    let told = text(&studio(&lab, "run", &python).stderr);
    assert!(told.contains("cannot be used: it does not begin as a checkpoint"), "{told}");
}

#[test]
fn a_model_without_a_log_has_no_page() {
    let lab = Lab::new();
    for (arguments, help) in [("small.toml", "name at least one"), ("small.toml --held-out a.csv", "put the logs")] {
        let told = text(&studio(&lab, arguments, "gone-python").stderr);
        assert!(told.starts_with("error: no log is given\nhelp: ") && told.contains(help), "{told}");
    }
}

#[test]
#[cfg(unix)]
fn what_the_page_would_ignore_is_refused() {
    let lab = Lab::new();
    let python = script(&lab, "exit 0");
    for (option, name) in [("--set simulation.duration_s=1", "--set"), ("--seed 7", "--seed")] {
        let output = studio(&lab, &format!("small.toml log.csv {option}"), &python);
        let told = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{told}");
        assert!(told.starts_with(&format!("error: `btr studio` does nothing with {name}\n")), "{told}");
    }
}

/// Not an interrupt: jobs in the background of a shell ignore those, and so does what they start.
#[test]
#[cfg(unix)]
fn a_signal_reaches_python() {
    let lab = Lab::new();
    let python = script(&lab, "[ $1 = -c ] && exit 0; trap 'exit 5' TERM; echo > begun; while :; do sleep 0.05; done");
    let mut child = lab.command("studio small.toml log.csv").env("BTR_PYTHON", python).spawn().unwrap();
    while !lab.exists("begun") {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it began");
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    let told = std::process::Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
    assert!(told.success());
    assert_eq!(child.wait().unwrap().code(), Some(5));
}

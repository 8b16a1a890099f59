//! A folder to work in, a small experiment, and the program.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use tempfile::TempDir;

/// A driven pendulum whose mass and friction are free: a run of it takes a fraction of a second.
pub(crate) const SMALL: &str = r#"name = "small"
seed = 1

[robot]
builtin = "pendulum"
length_m = 0.5

[actuators.hinge]
kind = "position"
kp = 10.0
kd = 0.2

[simulation]
control_s = 0.01
steps_per_control = 2
sample_every = 2
duration_s = 0.5

[parameters]
"mass@bob" = { relative = [0.5, 1.5] }
"viscous_friction.coefficient@hinge" = { bounds = [0.0, 0.5] }

[drive]
kind = "sine"
omega_rad_s = 8.0
search = "all"

[fitness]
energy = 1.0

[reality]
kind = "twin"
parameters = { "mass@bob" = 1.3, "viscous_friction.coefficient@hinge" = 0.3 }

[coevolve]
iterations = 2
distance = { name = "rmse", channels = ["q_*"] }
controllers = { generations = 2, search = { algorithm = "ga", population = 6 } }
simulators = { generations = 8, search = { algorithm = "cma_es", population = 6 } }
transfer = { count = 2 }
"#;

/// Numbers of variance one that look random.
pub(crate) fn noise(i: u32, salt: f64) -> f64 {
    let even = |k: f64| (f64::from(i) * (12.9898 + k) + 78.233 * (salt + k)).sin() * 43758.5453;
    let even = |k: f64| even(k) - even(k).floor();
    (0..12).map(|k| even(f64::from(k))).sum::<f64>() - 6.0
}

/// A temporary folder with files in it, in which `btr` runs.
pub(crate) struct Lab {
    folder: TempDir,
}

impl Lab {
    /// With `small.toml` in it.
    pub(crate) fn new() -> Self {
        let lab = Lab { folder: tempfile::tempdir().unwrap() };
        lab.write("small.toml", SMALL);
        lab
    }

    /// With a `small.toml` in which each `(before, after)` is replaced; every `before` must be there.
    pub(crate) fn with(changes: &[(&str, &str)]) -> Self {
        let lab = Lab::new();
        let text = changes.iter().fold(SMALL.to_owned(), |text, (before, after)| {
            assert!(text.contains(before), "{before} is not in the small experiment");
            text.replace(before, after)
        });
        lab.write("small.toml", &text);
        lab
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    pub(crate) fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// A CSV log with its rows changed: the header is row 0, and rows for which `change` says no are left out.
    pub(crate) fn edit(&self, from: &str, to: &str, mut change: impl FnMut(usize, &mut Vec<String>) -> bool) {
        let text = self.read(from);
        let rows = text.lines().enumerate().filter_map(|(k, line)| {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            change(k, &mut cells).then(|| cells.join(","))
        });
        self.write(to, &rows.collect::<Vec<_>>().join("\n"));
    }

    pub(crate) fn exists(&self, name: &str) -> bool {
        self.path(name).exists()
    }

    /// `btr` with arguments separated by spaces, in this folder.
    pub(crate) fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_btr"));
        command.args(arguments.split_whitespace()).current_dir(self.folder.path()).env_remove("BTR_THREADS");
        command.env("BTR", env!("CARGO_BIN_EXE_btr"));
        command
    }

    pub(crate) fn run(&self, arguments: &str) -> Output {
        self.command(arguments).output().unwrap()
    }

    pub(crate) fn start(&self, arguments: &str) -> Child {
        self.command(arguments).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
    }

    /// What it prints when it succeeds.
    pub(crate) fn ok(&self, arguments: &str) -> String {
        self.exits(arguments, 0)
    }

    /// What it prints when it ends with this code.
    pub(crate) fn exits(&self, arguments: &str, code: i32) -> String {
        let output = self.run(arguments);
        let (stdout, stderr) = (text(&output.stdout), text(&output.stderr));
        assert_eq!(output.status.code(), Some(code), "btr {arguments}\n{stdout}\n{stderr}");
        stdout
    }

    /// The document it prints with `--json`.
    pub(crate) fn json(&self, arguments: &str) -> Value {
        serde_json::from_str(&self.ok(&format!("{arguments} --json"))).unwrap()
    }

    /// What it says on stderr when it refuses (exit code 2), with this folder called DIR.
    pub(crate) fn complaint(&self, arguments: &str) -> String {
        let output = self.run(arguments);
        let stderr = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "btr {arguments}\n{}\n{stderr}", text(&output.stdout));
        assert!(!stderr.contains("panicked"), "{stderr}");
        stderr.replace(&self.folder.path().display().to_string(), "DIR")
    }
}

pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// The workspace's `robots/`.
pub(crate) fn robots() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots")
}

/// `effect@site` of all that was named, sorted.
pub(crate) fn named(answer: &Value) -> Vec<String> {
    let sites = |effect: &Value| match &effect["site"] {
        Value::Array(sites) => sites.clone(),
        one => vec![one.clone()],
    };
    let effects = answer["effects"].as_array().unwrap().iter();
    let of = |effect: &Value| {
        let name = effect["effect"].as_str().unwrap().to_owned();
        sites(effect).into_iter().map(move |site| format!("{name}@{}", site.as_str().unwrap())).collect::<Vec<_>>()
    };
    let mut names: Vec<String> = effects.flat_map(of).collect();
    names.sort();
    names
}

//! Frozen results: the same files and seeds give the bits that they gave when this list was written.
//!
//! A change of shape keeps every line. A change of behaviour is shown by the benchmarks, and the list is accepted anew
//! with it (`INSTA_UPDATE=always`). Sentences in JSON and comments in TOML are left out: they may be worded better.
//!
//! Threads, interruptions and the number of vector lanes do not change a bit; other tests hold that. Two things outside
//! btr do: the elementary functions of the C library (`sin`, `exp`, `powf`: glibc has variants with and without FMA
//! that differ in the last bit) and the matrix products of `matrixmultiply`, which also picks a variant by CPU. The
//! hashes belong to one such set of variants, told by [`arithmetic`]; on another one this test says so and compares
//! nothing.

use crate::lab::{Lab, robots};
use serde_json::Value;
use std::fmt::Write;
use std::path::Path;

/// The variants that the hashes below were made with: glibc 2.36 on x86-64 with FMA.
const ARITHMETIC: u64 = 0xf311_c880_0ab6_69d9;

/// 64 bits of FNV-1a.
fn hash(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}

/// A fingerprint of the arithmetic that the CPU and the C library choose.
fn arithmetic() -> u64 {
    let functions: [fn(f64) -> f64; 9] = [
        f64::sin,
        f64::cos,
        f64::tan,
        f64::atan,
        f64::exp,
        f64::tanh,
        |x| x.abs().ln(),
        |x| x.abs().powf(1.7),
        |x| x.atan2(0.3),
    ];
    let points = (1..2000).map(|k| (f64::from(k) * 0.618_033_988).sqrt() * if k % 2 == 0 { 1.0 } else { -1.0 });
    let values = points.flat_map(|x| functions.map(|f| f(x)));
    let matrix = nalgebra::DMatrix::from_fn(40, 40, |i, j| 1.0 / (1.3 + i as f64 + 2.7 * j as f64));
    let product = &matrix * matrix.transpose();
    let bytes = |value: f64| value.to_bits().to_le_bytes();
    hash(&values.chain(product.iter().copied()).flat_map(bytes).collect::<Vec<u8>>())
}

/// A JSON document without how long it took, and without what is for people: conclusions, strings that hold a space.
fn without_sentences(document: &Value) -> Value {
    match document {
        Value::String(text) if text.contains(' ') => Value::Null,
        Value::Array(items) => items.iter().map(without_sentences).collect(),
        Value::Object(entries) => {
            let timeless = entries.iter().filter(|(key, _)| !["seconds", "conclusions"].contains(&key.as_str()));
            timeless.map(|(key, value)| (key.clone(), without_sentences(value))).collect()
        }
        other => other.clone(),
    }
}

/// The part of a file that is frozen.
fn frozen(name: &str, bytes: &[u8]) -> Vec<u8> {
    match name.rsplit('.').next() {
        Some("json") => without_sentences(&serde_json::from_slice(bytes).unwrap()).to_string().into_bytes(),
        Some("toml") => {
            let text = std::str::from_utf8(bytes).unwrap();
            text.lines().map(|line| line.split('#').next().unwrap().trim()).collect::<Vec<_>>().join("\n").into_bytes()
        }
        // The hashes are older than the checksums in a checkpoint's header; what is frozen is the state after it.
        Some("bin") => [b"btr-cp\x00\x06", &bytes[16..]].concat(),
        _ => bytes.to_vec(),
    }
}

/// The shipped robots in a folder of their own.
fn lab() -> Lab {
    let lab = Lab::new();
    let copy = |from: &Path, to: &str| {
        for entry in std::fs::read_dir(from).unwrap().map(Result::unwrap).filter(|entry| entry.path().is_file()) {
            let text = std::fs::read_to_string(entry.path()).unwrap();
            lab.write(&format!("{to}{}", entry.file_name().to_str().unwrap()), &text);
        }
    };
    copy(&robots(), "");
    std::fs::create_dir(lab.path("arm")).unwrap();
    copy(&robots().join("arm"), "arm/");
    lab
}

/// Runs all, and gives a line of name and hash for each result.
fn results() -> String {
    let (lab, mut lines) = (lab(), String::new());
    let mut line = |name: &str, bytes: &[u8]| writeln!(lines, "{:016x}  {name}", hash(&frozen(name, bytes))).unwrap();
    let read = |name: &str| std::fs::read(lab.path(name)).unwrap();
    for (experiment, code) in [("pendulum", 0), ("ant-series", 0), ("nao", 0), ("disengage", 1)] {
        lab.exits(&format!("coevolve {experiment}.toml --out {experiment} -q"), code);
        for file in ["history.json", "checkpoint.bin", "adapted.toml"] {
            line(&format!("{experiment}: {file}"), &read(&format!("{experiment}/{file}")));
        }
    }
    let logs = "arm/learn_1.csv arm/learn_2.csv arm/learn_3.csv arm/learn_4.csv";
    let held_out = "--held-out arm/held_out_1.csv arm/held_out_2.csv arm/held_out_3.csv";
    for (verb, options) in [("check", ""), ("compare", ""), ("diagnose", held_out), ("fit", held_out)] {
        line(&format!("arm: {verb}.json"), lab.ok(&format!("{verb} arm.toml {logs} {options} --json")).as_bytes());
    }
    for model in ["pendulum", "ant", "nao", "nao-kick", "quadruped"] {
        for engine in ["auto", "rapier"] {
            let options = format!("-o {model}-{engine}.csv --set simulation.engine=\"{engine}\"");
            lab.ok(&format!("simulate {model}.toml {options}"));
            line(&format!("{model}: rollout on {engine}.csv"), &read(&format!("{model}-{engine}.csv")));
        }
    }
    lab.ok("simulate arm.toml --log arm/learn_1.csv -o arm.csv");
    line("arm: replay on auto.csv", &read("arm.csv"));
    lines
}

/// A population is simulated in as many lanes as the machine has, or fewer.
#[test]
fn the_number_of_lanes_does_not_change_a_bit() {
    let lab = lab();
    let run = |lanes: &str| {
        let mut command = lab.command(&format!("coevolve ant-series.toml --out lanes-{lanes} -q --json"));
        assert!(command.env("BTR_LANES", lanes).output().unwrap().status.success(), "{lanes}");
        let file = |name: &str| std::fs::read(lab.path(&format!("lanes-{lanes}/{name}"))).unwrap();
        ["history.json", "adapted.toml"].map(|name| frozen(name, &file(name)))
    };
    let single = run("1");
    for lanes in ["2", "4", "8"] {
        assert!(run(lanes) == single, "{lanes} lanes");
    }
}

#[test]
fn results_have_the_bits_that_they_had() {
    if arithmetic() != ARITHMETIC {
        println!("skipped: the hashes are of arithmetic {ARITHMETIC:016x}, this is {:016x}", arithmetic());
        return;
    }
    insta::assert_snapshot!("frozen", results());
}

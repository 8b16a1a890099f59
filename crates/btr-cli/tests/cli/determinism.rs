//! Killed or not, on one thread or two: the same bytes.

use crate::lab::Lab;
use std::time::Duration;

/// More work than [`crate::lab::SMALL`]: a second or so.
fn longer() -> Lab {
    Lab::with(&[
        ("iterations = 2", "iterations = 5"),
        ("generations = 2", "generations = 6"),
        ("generations = 8", "generations = 25"),
        ("kind = \"twin\"", "kind = \"twin\"\nnoise = { position_rad = 0.001 }"),
    ])
}

const RESULTS: [&str; 3] = ["history.json", "adapted.toml", "checkpoint.bin"];

fn results(lab: &Lab, out: &str) -> Vec<Vec<u8>> {
    RESULTS.iter().map(|name| std::fs::read(lab.path(&format!("{out}/{name}"))).unwrap()).collect()
}

#[test]
fn a_run_killed_again_and_again_ends_like_one_that_was_not() {
    let lab = longer();
    lab.ok("coevolve small.toml --out whole -q -j 1");
    let (mut patience_ms, mut kills, mut mid_run) = (10.0, 0, 0);
    loop {
        let begun = lab.exists("killed/checkpoint.bin");
        let resume = if begun { "--resume" } else { "" };
        let mut child = lab.start(&format!("coevolve small.toml --out killed -q -j 2 {resume}"));
        std::thread::sleep(Duration::from_millis(patience_ms as u64));
        if let Some(status) = child.try_wait().unwrap() {
            assert!(status.success(), "{status}");
            break;
        }
        child.kill().unwrap();
        child.wait().unwrap();
        kills += 1;
        mid_run += usize::from(begun);
        patience_ms *= 1.35;
    }
    assert!(mid_run >= 1, "{kills} kills, {mid_run} of them after the first checkpoint");
    for (name, (killed, whole)) in RESULTS.iter().zip(results(&lab, "killed").iter().zip(&results(&lab, "whole"))) {
        assert!(killed == whole, "{name} differs after {kills} kills");
    }
}

#[test]
fn threads_do_not_matter_and_seeds_do() {
    let lab = Lab::new();
    for (out, options) in [("one", "-j 1"), ("two", "-j 2"), ("other", "-j 2 --seed 2")] {
        lab.ok(&format!("coevolve small.toml --out {out} -q {options}"));
    }
    assert!(results(&lab, "one") == results(&lab, "two"));
    assert_ne!(results(&lab, "one")[0], results(&lab, "other")[0]);
}

#[test]
fn a_finished_run_resumed_says_the_same_again() {
    let lab = Lab::new();
    lab.ok("coevolve small.toml --out run -q");
    let before = results(&lab, "run");
    lab.ok("coevolve small.toml --out run -q --resume");
    assert!(before == results(&lab, "run"));
}

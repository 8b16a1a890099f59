//! Damaged, foreign and missing files of a run: none is used, and what is lost is computed again or told.

use crate::lab::{Lab, text};
use std::process::{Command, Output};

const RESUME: &str = "coevolve small.toml --out run --resume";
const TWIN: &str = "kind = \"twin\"\nparameters = { \"mass@bob\" = 1.3, \"viscous_friction.coefficient@hinge\" = 0.3 }";

/// A finished run.
fn done() -> Lab {
    let lab = Lab::new();
    lab.ok("coevolve small.toml --out run -q");
    lab
}

fn bytes(lab: &Lab, name: &str) -> Vec<u8> {
    std::fs::read(lab.path(name)).unwrap()
}

/// What a run ends with.
fn results(lab: &Lab, out: &str) -> [Vec<u8>; 3] {
    ["history.json", "adapted.toml", "checkpoint.bin"].map(|name| bytes(lab, &format!("{out}/{name}")))
}

/// Flips a bit of a file in the middle; doing so again repairs it.
fn flip(lab: &Lab, name: &str) {
    let mut content = bytes(lab, name);
    let middle = content.len() / 2;
    content[middle] ^= 1;
    std::fs::write(lab.path(name), content).unwrap();
}

/// What `btr` says on stderr as it ends with this code.
fn said(lab: &Lab, arguments: &str, code: i32) -> String {
    let Output { status, stderr, .. } = lab.run(arguments);
    assert_eq!(status.code(), Some(code), "btr {arguments}\n{}", text(&stderr));
    text(&stderr)
}

#[test]
fn a_damaged_file_of_a_real_test_is_told_and_not_used() {
    let lab = done();
    let whole = results(&lab, "run");
    for name in ["trial.toml", "references.csv", "log.mcap", "checksums.sfv"] {
        let file = format!("run/transfers/0001/{name}");
        flip(&lab, &file);
        let told = said(&lab, RESUME, 2);
        assert!(
            told.contains("real test 1 is in the ledger but its log cannot be used: run/transfers/0001/"),
            "{told}"
        );
        assert!(name == "checksums.sfv" || told.contains(&format!("{file}: it does not match its checksum")), "{told}");
        assert!(told.contains("help: put the log back"), "{told}");
        assert!(results(&lab, "run") == whole);
        flip(&lab, &file);
        lab.ok(&format!("{RESUME} -q"));
    }
    // Nor is it used by a run that has not counted the test yet.
    std::fs::remove_file(lab.path("run/checkpoint.bin")).unwrap();
    flip(&lab, "run/transfers/0001/log.mcap");
    let told = said(&lab, "coevolve small.toml --out run", 1);
    assert!(told.contains("error: run/transfers/0001/log.mcap: it does not match its checksum"), "{told}");
    assert!(told.contains("help: put an undamaged file back"), "{told}");
    std::fs::remove_dir_all(lab.path("run/transfers/0001")).unwrap();
    lab.ok(&format!("{RESUME} -q"));
    assert!(results(&lab, "run") == whole, "a twin simulates the test again");
}

#[test]
fn a_log_that_a_person_recorded_is_kept_as_it_was_accepted() {
    let lab = Lab::with(&[(TWIN, "kind = \"manual\"")]);
    lab.ok("coevolve small.toml --out run -q");
    // Damaged references are written anew before anyone plays them.
    let references = bytes(&lab, "run/transfers/0000/references.csv");
    flip(&lab, "run/transfers/0000/references.csv");
    lab.ok(&format!("{RESUME} -q"));
    assert!(bytes(&lab, "run/transfers/0000/references.csv") == references);
    for k in 0..2 {
        let folder = format!("run/transfers/000{k}");
        lab.write("drive.toml", &format!("[drive]\nkind = \"replay\"\nlog = \"{folder}/references.csv\"\n"));
        lab.ok(&format!("simulate small.toml -q --drive drive.toml -o {folder}/log.csv"));
    }
    lab.ok(&format!("{RESUME} -q"));
    let log = "run/transfers/0001/log.csv";
    lab.write(log, &lab.read(log).replacen("0.1", "0.2", 1));
    let told = said(&lab, RESUME, 2);
    assert!(told.contains(&format!("{log}: it does not match its checksum in checksums.sfv")), "{told}");
    lab.write("run/transfers/0001/failed.txt", "the robot fell");
    std::fs::write(lab.path(log), "").unwrap();
    said(&lab, RESUME, 2);
    std::fs::remove_file(lab.path("run/transfers/0001/failed.txt")).unwrap();
    lab.ok("simulate small.toml -q --drive drive.toml --overwrite -o run/transfers/0001/log.csv");
    lab.ok(&format!("{RESUME} -q"));
    // Of a request that has no log, nothing can be used if it asks for something else.
    let trial = "run/transfers/0002/trial.toml";
    lab.write(trial, &lab.read(trial).replacen("number = 2", "number = 3", 1));
    let told = said(&lab, RESUME, 1);
    assert!(told.contains("error: run/transfers/0002 holds the result of another trial"), "{told}");
}

#[test]
fn a_log_changed_on_purpose_is_taken_without_its_checksums() {
    let lab = done();
    std::fs::copy(lab.path("run/transfers/0000/log.mcap"), lab.path("run/transfers/0001/log.mcap")).unwrap();
    assert!(said(&lab, RESUME, 2).contains("once checksums.sfv beside it is removed"));
    std::fs::remove_file(lab.path("run/transfers/0001/checksums.sfv")).unwrap();
    lab.ok(&format!("{RESUME} -q"));
    assert!(lab.read("run/transfers/0001/checksums.sfv").starts_with("trial.toml "));
}

#[test]
fn a_damaged_checkpoint_is_computed_again_from_the_real_tests() {
    let lab = done();
    lab.ok("coevolve small.toml --out other -q --seed 2");
    let (whole, checkpoint) = (results(&lab, "run"), bytes(&lab, "run/checkpoint.bin"));
    let tests = || (0..4).map(|k| bytes(&lab, &format!("run/transfers/000{k}/log.mcap"))).collect::<Vec<_>>();
    let before = tests();
    let mut flipped = checkpoint.clone();
    flipped[checkpoint.len() / 2] ^= 1;
    for (damage, why) in [
        (flipped, "its checksum does not match"),
        (checkpoint[..10].to_vec(), "it is cut off"),
        (checkpoint[..checkpoint.len() - 1].to_vec(), "its checksum does not match"),
        (Vec::new(), "it does not begin as a checkpoint"),
        (bytes(&lab, "other/checkpoint.bin"), "it belongs to another run"),
    ] {
        std::fs::write(lab.path("run/checkpoint.bin"), damage).unwrap();
        let told = said(&lab, RESUME, 0);
        assert!(
            told.contains(&format!("warning: run/checkpoint.bin is not used: {why}; the run is computed")),
            "{told}"
        );
        assert!(results(&lab, "run") == whole && tests() == before, "{why}");
    }
    // No robot is asked again for what it has done: a test that is damaged as well ends the run.
    flip(&lab, "run/checkpoint.bin");
    flip(&lab, "run/transfers/0002/log.mcap");
    assert!(said(&lab, RESUME, 1).contains("error: run/transfers/0002/log.mcap: it does not match"));
}

#[test]
fn a_damaged_experiment_is_written_again_or_refused() {
    let lab = done();
    let (whole, experiment) = (results(&lab, "run"), lab.read("run/experiment.toml"));
    flip(&lab, "run/experiment.toml");
    let told = said(&lab, RESUME, 0);
    assert!(told.contains("warning: run/experiment.toml was damaged and is written again"), "{told}");
    assert!(results(&lab, "run") == whole && lab.read("run/experiment.toml") == experiment);
    // Neither belongs to the other, nor is either what was asked for.
    flip(&lab, "run/experiment.toml");
    let told = said(&lab, &format!("{RESUME} --seed 2"), 2);
    assert!(
        told.contains("run/experiment.toml is not the experiment that run/checkpoint.bin was written for"),
        "{told}"
    );
    flip(&lab, "run/experiment.toml");
    // What was asked for is not what the damaged checkpoint began with.
    flip(&lab, "run/checkpoint.bin");
    let told = said(&lab, &format!("{RESUME} --seed 2"), 2);
    assert!(told.contains("run/checkpoint.bin cannot be used: its checksum does not match"), "{told}");
    assert!(told.contains("help: put the file back from a copy; or remove checkpoint.bin and start"), "{told}");
}

#[test]
fn a_checkpoint_of_another_version_is_refused() {
    let lab = done();
    let checkpoint = bytes(&lab, "run/checkpoint.bin");
    let old = [b"btr-cp\x00\x06".as_slice(), &checkpoint[16..]].concat();
    std::fs::write(lab.path("run/checkpoint.bin"), old).unwrap();
    let told = said(&lab, RESUME, 2);
    assert!(told.contains("run/checkpoint.bin was written by another version of btr (its format is 6)"), "{told}");
    assert!(
        told.contains("help: go on with that version; or remove checkpoint.bin and start without --resume"),
        "{told}"
    );
}

/// A run whose files may have at most this many blocks of 512 bytes.
#[cfg(unix)]
fn limited(lab: &Lab, blocks: usize) -> (Option<i32>, String) {
    let begin = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$BTR\" coevolve small.toml --out run -q");
    let mut command = Command::new("sh");
    command.args(["-c", &begin]).current_dir(lab.path("")).env("BTR", env!("CARGO_BIN_EXE_btr"));
    let output = command.output().unwrap();
    (output.status.code(), text(&output.stderr))
}

#[cfg(unix)]
#[test]
fn files_that_cannot_be_written_end_the_run_which_goes_on_later() {
    let whole = results(&done(), "run");
    // Too little for a log, and too little for the history of all.
    for (blocks, file) in [(8, "run/transfers/0000/log.mcap"), (24, "run/history.json")] {
        let lab = Lab::new();
        let (code, told) = limited(&lab, blocks);
        assert_eq!(code, Some(1), "{told}");
        assert!(told.contains(&format!("error: {file}: File too large")), "{told}");
        assert!(told.contains("room to write, then run again") || told.contains("make room or permit"), "{told}");
        lab.ok(&format!("{RESUME} -q"));
        assert!(results(&lab, "run") == whole);
    }
}

#[test]
fn a_run_whose_folder_is_gone_while_other_distances_identify_is_kept() {
    let lab = Lab::with(&[
        ("search = \"all\"\n", ""),
        ("controllers = { generations = 2, search = { algorithm = \"ga\", population = 6 } }\n", ""),
        ("transfer = { count = 2 }\n", "[[distances]]\nname = \"spectrum\"\nchannels = [\"q_*\"]\n"),
        ("generations = 8", "generations = 200"),
        ("iterations = 2", "iterations = 1"),
    ]);
    lab.ok("coevolve small.toml --out whole -q");
    let run = lab.start("coevolve small.toml --out run -q");
    let begun = std::time::Instant::now();
    while !lab.exists("run/by_distance/0_spectrum/checkpoint.bin") {
        assert!(begun.elapsed() < std::time::Duration::from_secs(60));
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    std::fs::rename(lab.path("run"), lab.path("gone")).unwrap();
    let output = run.wait_with_output().unwrap();
    let told = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{told}");
    assert!(told.contains("error: run is gone: the run and its real tests are kept in run.rescued"), "{told}");
    assert!(!lab.exists("run"));
    lab.ok("coevolve small.toml --out run.rescued -q --resume");
    assert!(results(&lab, "run.rescued") == results(&lab, "whole"));
}

#[test]
fn litter_of_a_run_that_was_killed_at_its_beginning_is_swept() {
    let lab = Lab::new();
    std::fs::create_dir_all(lab.path("run/transfers/0000")).unwrap();
    let (litter, foreign) = ("run/.checkpoint.bin.Ab3dEf.btr.tmp", "run/transfers/0000/.log.csv.Ab3dEf.tmp");
    [litter, foreign].iter().for_each(|name| lab.write(name, "half"));
    lab.ok("coevolve small.toml --out run -q");
    assert!(!lab.exists(litter) && lab.exists(foreign));
}

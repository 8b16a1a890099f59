//! The corpus, and a few mutations of it: everything is read or refused.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use btr_fuzz::driver::{Inputs, listen, save, tried};
use btr_fuzz::{TARGETS, Target, corpus};
use std::collections::BTreeSet;
use std::path::Path;

/// Whether an input is read. A finding fails the test, and is kept.
fn is_read(target: &Target, data: &[u8]) -> bool {
    tried(target, data).unwrap_or_else(|why| {
        save(target, data, &why).unwrap();
        panic!("{}: {why}", target.name);
    })
}

#[test]
fn every_input_of_the_corpus_is_read_or_refused() {
    listen();
    for target in TARGETS {
        let seeds = corpus::seeds(target.name);
        let read = seeds.iter().filter(|data| is_read(target, data)).count();
        // What is refused at once leads nowhere.
        assert!(3 * read >= seeds.len() && read > 0, "{}: {read} of {} are read", target.name, seeds.len());
    }
}

#[test]
fn a_few_mutations_are_read_or_refused() {
    listen();
    for target in TARGETS {
        let inputs = Inputs::new(target, 1);
        let read = (0..target.few).filter(|&number| is_read(target, &inputs.at(number))).count();
        assert!(read > 0, "{}: none of {} is read", target.name, target.few);
    }
}

/// libFuzzer has the same targets.
#[test]
fn cargo_fuzz_has_every_target() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz");
    let manifest: toml::Table = std::fs::read_to_string(folder.join("Cargo.toml")).unwrap().parse().unwrap();
    let binaries = manifest["bin"].as_array().unwrap().iter().map(|bin| bin["name"].as_str().unwrap().to_owned());
    let ours: BTreeSet<String> = TARGETS.iter().map(|target| target.name.to_owned()).collect();
    assert_eq!(binaries.collect::<BTreeSet<_>>(), ours);
    for name in ours {
        let text = std::fs::read_to_string(folder.join(format!("fuzz_targets/{name}.rs"))).unwrap();
        assert!(text.contains(&format!("::{name}")), "{name}.rs calls another target");
    }
}

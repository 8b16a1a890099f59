//! `adapted.toml`: the model of a run, driven by the best controller that was tried.

use crate::lab::{Lab, robots};
use btr_core::log::Log;
use btr_io::{Mapping, read_log};

/// A log, with the bits of its numbers.
fn bits(lab: &Lab, name: &str) -> Vec<(String, Vec<u64>)> {
    let log: Log = read_log(&lab.path(name), &Mapping::default()).unwrap().0;
    log.channels().map(|(name, c)| (name.to_owned(), c.values.iter().map(|x| x.to_bits()).collect())).collect()
}

/// Runs an experiment, simulates what it leaves, and compares with what the loop simulated for its best controller.
fn does_what_the_loop_simulated(lab: &Lab, experiment: &str, settings: &str) {
    let run = lab.json(&format!("coevolve {experiment} --out run {settings}"));
    lab.ok("simulate run/adapted.toml -q -o again.mcap");
    let again = bits(lab, "again.mcap");
    assert!(again.iter().any(|(_, values)| values.iter().any(|x| *x != values[0])), "{experiment} stands still");
    assert_eq!(again, bits(lab, "run/simulated_after.mcap"), "{experiment}");
    let adapted: toml::Table = toml::from_str(&lab.read("run/adapted.toml")).unwrap();
    assert!(adapted["drive"].get("search").is_none(), "{experiment}");
    for (name, value) in run["recommended"]["controller"].as_object().into_iter().flatten() {
        assert_eq!(adapted["drive"]["set"][name].as_float(), value.as_f64(), "{experiment}: {name}");
    }
}

fn shipped(name: &str) -> String {
    robots().join(name).display().to_string()
}

#[test]
fn a_pendulum_that_was_adapted_does_what_the_loop_simulated() {
    does_what_the_loop_simulated(&Lab::new(), &shipped("pendulum.toml"), "--set coevolve.simulators.generations=5");
}

#[test]
fn an_ant_that_was_adapted_does_what_the_loop_simulated() {
    does_what_the_loop_simulated(&Lab::new(), &shipped("ant-series.toml"), "--set coevolve.iterations=2");
}

#[test]
fn an_ant_with_a_policy_that_was_adapted_does_what_the_loop_simulated() {
    does_what_the_loop_simulated(&Lab::new(), &shipped("ant-policy.toml"), "--set coevolve.iterations=2");
}

#[test]
fn a_walk_that_was_adapted_does_what_the_loop_simulated() {
    let settings = "--set coevolve.iterations=1 --set coevolve.controllers.generations=2 \
                    --set coevolve.posterior.turns=2 --set simulation.duration_s=1.5";
    does_what_the_loop_simulated(&Lab::new(), &shipped("nao.toml"), settings);
}

#[test]
fn a_kick_that_was_adapted_does_what_the_loop_simulated() {
    let settings = "--set coevolve.iterations=1 --set coevolve.controllers.generations=2 \
                    --set coevolve.simulators.generations=3 --set simulation.duration_s=2.0";
    does_what_the_loop_simulated(&Lab::new(), &shipped("nao-kick.toml"), settings);
}

#[test]
fn what_a_drive_had_fixed_stays_beside_what_was_searched() {
    let lab = Lab::with(&[(
        "search = \"all\"",
        "set = { \"phase@hinge\" = 0.25 } # late\nsearch = { \"amplitude@hinge\" = [0.7, 0.9] }",
    )]);
    does_what_the_loop_simulated(&lab, "small.toml", "");
    let adapted: toml::Table = toml::from_str(&lab.read("run/adapted.toml")).unwrap();
    assert_eq!(adapted["drive"]["set"]["phase@hinge"].as_float(), Some(0.25));
    assert!(adapted["drive"]["set"]["amplitude@hinge"].as_float().unwrap() >= 0.7);
}

#[test]
fn an_adapted_model_is_judged_compared_diagnosed_and_fitted() {
    let lab = Lab::new();
    let run = lab.json("coevolve small.toml --out run");
    let simulated = lab.json("simulate run/adapted.toml -o log.csv");
    assert_eq!(simulated["fitness"].as_object().map(|terms| terms.contains_key("energy")), Some(true));
    let compared = lab.json("compare run/adapted.toml run/real.mcap");
    assert_eq!(compared["ok"], true);
    // The twin has nothing that its simulations lack.
    let diagnosed = lab.json("diagnose run/adapted.toml run/real.mcap");
    assert_eq!(diagnosed["verdict"], "nothing_missing", "{diagnosed}");
    lab.ok("fit run/adapted.toml run/real.mcap -o fitted.toml");
    let mass = |name: &str| {
        let model: toml::Table = toml::from_str(&lab.read(name)).unwrap();
        model["parameters"]["mass@bob"]["value"].as_float().unwrap()
    };
    let truth = run["revealed"]["parameters"]["mass@bob"].as_f64().unwrap();
    assert!((mass("fitted.toml") / truth - 1.0).abs() < 0.01, "{} for {truth}", mass("fitted.toml"));
}

//! The same bits for any number of threads and any interruption.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use btr_core::coevolve::{Coevolution, Environment, Plan, RunState, StepOutcome};
use btr_tests::{Hidden, Oscillator, finish, plan};

const METHODS: [&str; 6] = [
    "transfer = { rule = 'neighbourhood', count = 4 }\nmemory = { worst = 2 }\ninitial_simulation = 'random'",
    "transfer = { rule = 'disagreement', count = 2 }\ndistance = 'information'",
    "method = 'estimation_exploration'\ndistance = 'dtw'\ntransfer = { count = 1 }",
    "method = 'reality_only'\nreal_tests = 50",
    "distance = 'rmse'\nsimulators = { generations = 2, refine = 12, search = { algorithm = 'cma_es', population = 6 } }",
    "method = 'quality_diversity'\n\
        map = { generations = 4, population = 8, cells = 4, descriptors = { amplitude = [0.0, 2.0], phase = [-3.0, 3.0] } }",
];

fn small(changes: &str) -> Plan {
    let sizes = "iterations = 3\n\
        controllers = { generations = 3, search = { algorithm = 'ga', population = 8 } }\n";
    let simulators = "simulators = { generations = 4, search = { algorithm = 'cma_es', population = 6 } }\n";
    let simulators = if changes.contains("simulators") { "" } else { simulators };
    plan(&format!("{sizes}{simulators}{changes}")).unwrap()
}

fn world() -> Oscillator {
    Oscillator::new().unwrap().scenarios(2).refusing(|c| (c[0] * 1e4).fract() > 0.9)
}

fn reality() -> Hidden {
    Hidden::new(Oscillator::new().unwrap(), [2.2, 0.5]).failing(|trial| trial.number % 5 == 4)
}

/// State and history of a finished run, as bytes.
fn bytes(run: &Coevolution) -> (Vec<u8>, String) {
    (postcard::to_allocvec(run.state()).unwrap(), serde_json::to_string(run.history()).unwrap())
}

fn uninterrupted(plan: &Plan) -> (Vec<u8>, String) {
    let mut run = Coevolution::new(plan.clone(), 7, &world()).unwrap();
    finish(&mut run, &world(), &mut reality());
    bytes(&run)
}

#[test]
fn one_thread_and_two_give_the_same_bits() {
    for changes in METHODS {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| uninterrupted(&small(changes)))
        };
        let one = on(1);
        assert!(one == on(2) && one == on(3), "{changes}");
    }
}

#[test]
fn another_seed_gives_another_run() {
    let mut run = Coevolution::new(small(METHODS[0]), 8, &world()).unwrap();
    finish(&mut run, &world(), &mut reality());
    assert_ne!(bytes(&run).1, uninterrupted(&small(METHODS[0])).1);
}

/// Runs `every` steps at a time; in between only bytes survive, and reality keeps its logs.
fn interrupted(plan: &Plan, every: usize) -> (Vec<u8>, String) {
    let (world, mut reality, distance) = (world(), reality(), plan.distance.build());
    let mut run = Coevolution::new(plan.clone(), 7, &world).unwrap();
    loop {
        for _ in 0..every {
            let mut on = Environment { simulator: &world, distance: distance.as_ref(), reality: &mut reality };
            if let Ok(StepOutcome::Stopped(_)) = run.step(&mut on) {
                return bytes(&run);
            }
        }
        let written = postcard::to_allocvec(run.state()).unwrap();
        let state: RunState = postcard::from_bytes(&written).unwrap();
        run = Coevolution::resumed(plan.clone(), state, &world).unwrap();
        run.recall(&mut reality).unwrap();
    }
}

#[test]
fn interruptions_leave_no_trace() {
    for changes in METHODS {
        let plan = small(changes);
        let whole = uninterrupted(&plan);
        for every in [1, 2, 3, 5, 7] {
            assert!(interrupted(&plan, every) == whole, "every {every} steps\n{changes}");
        }
    }
}

#![allow(clippy::unwrap_used)]
use super::*;
use btr_core::random::stream;
use rand::RngExt;

const SIGMA: f64 = 1e-3;

/// Two joints that follow their commands; `error` is the measured minus the simulated knee.
fn logs(error: impl Fn(f64, f64) -> f64) -> (Log, Log) {
    let clock: Vec<f64> = (0..2000).map(|i| 0.005 * f64::from(i)).collect();
    let q = |t: f64| 0.5 * (2.0 * t).sin() + 0.2 * (3.7 * t).sin();
    let v = |t: f64| (2.0 * t).cos() + 0.74 * (3.7 * t).cos();
    let mut rng = stream(5, &[0]);
    let mut noise = || SIGMA * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0);
    let (mut real, mut sim) = (Log::new(clock.clone()).unwrap(), Log::new(clock.clone()).unwrap());
    for joint in ["hip", "knee"] {
        let off = |t: f64| if joint == "knee" { error(t, v(t)) } else { 0.0 };
        let (name, commands) = (format!("q_{joint}"), clock.iter().map(|t| q(*t)).collect::<Vec<_>>());
        real.insert(format!("cmd_{joint}"), "rad", Role::Command, commands.clone()).unwrap();
        real.insert(&name, "rad", Role::Measured, clock.iter().map(|t| q(*t) + off(*t) + noise()).collect()).unwrap();
        sim.insert(&name, "rad", Role::Measured, commands).unwrap();
    }
    (real, sim)
}

fn compared(real: &Log, simulated: &Log) -> Comparison {
    compare(&[LogPair { name: "log", real, simulated }], |_, _, _| Some(SIGMA))
}

#[test]
fn noise_alone_is_no_failure() {
    let (real, sim) = logs(|_, _| 0.0);
    let comparison = compared(&real, &sim);
    assert!(comparison.failures().is_empty(), "{:?}", comparison.failures());
    for channel in &comparison.channels {
        assert!((channel.chi - 1.0).abs() < 0.05 && channel.white && channel.independent, "{channel:?}");
        assert!(channel.fit_percent.unwrap() > 99.0 && channel.lag_s.unwrap().abs() < 5e-4, "{channel:?}");
    }
}

#[test]
fn an_error_with_the_sign_of_the_velocity_is_found_at_its_joint() {
    let (real, sim) = logs(|_, v| -4.0 * SIGMA * v.signum());
    let comparison = compared(&real, &sim);
    let worst = comparison.failures()[0];
    assert_eq!((worst.joint.as_str(), worst.clue.unwrap().clue), ("knee", Clue::SignOfVelocity));
    assert!(worst.clue.unwrap().correlation < -0.9 && worst.hint.contains("the sign of the velocity"), "{worst:?}");
    assert!(comparison.failures().iter().all(|cell| cell.joint == "knee"));
    let knee = comparison.worst().unwrap();
    assert!(knee.name == "q_knee" && !knee.white && (knee.chi - 17.0_f64.sqrt()).abs() < 0.1, "{knee:?}");
    let forward = comparison.cells.iter().find(|c| c.joint == "knee" && c.regime == Regime::Forward).unwrap();
    assert!((forward.bias + 4.0 * SIGMA).abs() < 0.2 * SIGMA && forward.clue.unwrap().clue == Clue::Constant);
}

#[test]
fn a_failure_names_its_time_and_a_lag_its_size() {
    let (real, sim) = logs(|t, _| if (6.0..6.5).contains(&t) { 0.02 } else { 0.0 });
    let comparison = compared(&real, &sim);
    let worst = comparison.failures()[0];
    assert!(worst.t0_s > 5.9 && worst.t1_s < 6.6 && worst.share > 0.5, "{worst:?}");

    let late = |t: f64| 0.5 * (2.0 * t).sin() + 0.2 * (3.7 * t).sin();
    let (real, sim) = logs(|t, _| late(t - 0.0137) - late(t));
    let knee = compared(&real, &sim).channels[1].clone();
    assert!((knee.lag_s.unwrap() - 0.0137).abs() < 5e-4, "{knee:?}");
}

#[test]
fn missing_samples_are_skipped() {
    let (mut real, sim) = logs(|_, _| 0.0);
    real.values_mut("q_knee").unwrap()[300..700].fill(f64::NAN);
    real.values_mut("cmd_knee").unwrap()[1000..1500].fill(f64::NAN);
    let comparison = compared(&real, &sim);
    assert_eq!(comparison.channels[1].samples, 1600);
    let of = |regime: Regime| comparison.cells.iter().find(|c| c.joint == "knee" && c.regime == regime).unwrap();
    assert_eq!((of(Regime::TorqueOff).samples, of(Regime::Throughout).samples), (500, 1600));
    let (forward, backward, hold) = (of(Regime::Forward), of(Regime::Backward), of(Regime::Hold));
    assert!(forward.samples + backward.samples + hold.samples <= 1100);
    // A simulation that ends early is not extended.
    let short = Log::new(sim.clock_s()[..1000].to_vec()).unwrap();
    let short = sim.channels().fold(short, |mut log, (name, c)| {
        log.insert(name, c.unit.clone(), c.role, c.values[..1000].to_vec()).unwrap();
        log
    });
    assert_eq!(compared(&real, &short).channels[0].samples, 1000);
}

#[test]
fn steps_and_limits_are_regimes() {
    let (mut real, sim) = logs(|_, _| 0.0);
    let n = real.len();
    let jumps: Vec<f64> = (0..n).map(|i| if (i / 400) % 2 == 0 { 0.3 } else { -0.3 }).collect();
    real.insert("cmd_hip", "rad", Role::Command, jumps).unwrap();
    let torque: Vec<f64> = (0..n).map(|i| (3.0 * (0.01 * i as f64).sin()).clamp(-2.0, 2.0)).collect();
    real.insert("tau_hip", "N·m", Role::Measured, torque).unwrap();
    let comparison = compared(&real, &sim);
    let share = |regime: Regime| {
        let cell = comparison.cells.iter().find(|c| c.joint == "hip" && c.regime == regime);
        cell.map_or(0.0, |cell| cell.samples as f64 / n as f64)
    };
    assert!((share(Regime::AfterStep) - 4.0 * 67.0 / n as f64).abs() < 0.01, "{}", share(Regime::AfterStep));
    assert!((share(Regime::Saturated) - 0.535).abs() < 0.02, "{}", share(Regime::Saturated));
}

/// The torque that a prescribed motion requires knows no motor.
#[test]
fn a_torque_that_is_compared_itself_has_no_limit() {
    let (mut real, mut sim) = logs(|_, _| 0.0);
    let clipped: Vec<f64> = (0..real.len()).map(|i| (3.0 * (0.01 * i as f64).sin()).clamp(-2.0, 2.0)).collect();
    for log in [&mut real, &mut sim] {
        log.insert("tau_hip", "N·m", Role::Measured, clipped.clone()).unwrap();
    }
    let logs = [LogPair { name: "log", real: &real, simulated: &sim }];
    let comparison = compare(&logs, |name, _, _| name.starts_with("tau_").then_some(SIGMA));
    let regimes: Vec<Regime> = comparison.cells.iter().map(|cell| cell.regime).collect();
    assert!(regimes.contains(&Regime::Throughout) && !regimes.contains(&Regime::Saturated), "{regimes:?}");
}

//! What is asked of every registered effect, newcomers included.

use btr_core::log::Log;
use btr_physics::ant;
use btr_physics::effect::{EFFECTS, Placed, find};
use btr_physics::sim::{Setup, simulate};

/// A walk in which everything happens: joints reverse, motors work hard, feet slip.
fn walk(effects: &[Placed]) -> Log {
    let setup = Setup { dt_s: 0.002, control_s: 0.01, duration_s: 0.6, ..Setup::default() };
    simulate(&ant::ant(), effects, &setup, &ant::tripod(), None).unwrap()
}

/// Bit patterns of every channel; missing values compare equal.
fn bits(log: &Log) -> Vec<(String, Vec<u64>)> {
    log.channels().map(|(n, c)| (n.to_owned(), c.values.iter().map(|v| v.to_bits()).collect())).collect()
}

#[test]
fn off_changes_no_bit() {
    let plain = bits(&walk(&[]));
    for &effect in EFFECTS {
        let name = effect.card().name;
        assert!(bits(&walk(&[Placed::off(effect, "*")])) == plain, "`{name}` acts although it is off");
    }
}

#[test]
fn planted_it_shows() {
    let plain = walk(&[]);
    for &effect in EFFECTS {
        let name = effect.card().name;
        let planted = walk(&[Placed::hinted(effect, "*")]);
        let worst = |channel: &str| {
            let pairs = plain.values(channel).unwrap().iter().zip(planted.values(channel).unwrap());
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        let seen = plain.channels().map(|(channel, _)| worst(channel)).fold(0.0, f64::max);
        assert!(seen > 1e-3, "`{name}` at its hint changes nothing by more than {seen}");
    }
}

#[test]
fn cards_are_complete() {
    for &effect in EFFECTS {
        let card = effect.card();
        let named = card.name.chars().all(|c| c.is_ascii_lowercase() || c == '_');
        assert!(named && !card.name.is_empty(), "`{}`", card.name);
        for (what, text) in [("law", card.law), ("cite", card.cite), ("tell", card.tell)] {
            assert!(text.len() > 5, "`{}` has no {what}", card.name);
        }
        assert!(!card.params.is_empty(), "`{}` has no parameters", card.name);
        for param in card.params {
            let (min, max) = param.bounds;
            assert!(min < max && min.is_finite() && max.is_finite(), "`{}.{}`: bounds", card.name, param.name);
            assert!((min..=max).contains(&param.hint), "`{}.{}`: hint", card.name, param.name);
            let off_is_special = !param.off.is_finite();
            assert!(off_is_special || (min..=max).contains(&param.off), "`{}.{}`: off", card.name, param.name);
            assert!(!param.unit.is_empty(), "`{}.{}`: unit", card.name, param.name);
        }
    }
}

#[test]
fn names_find_their_effects() {
    for (i, &effect) in EFFECTS.iter().enumerate() {
        let name = effect.card().name;
        assert_eq!(find(name).map(|found| found.card().name), Some(name));
        assert!(EFFECTS[..i].iter().all(|other| other.card().name != name), "`{name}` is there twice");
    }
    assert!(find("phlogiston").is_none());
}

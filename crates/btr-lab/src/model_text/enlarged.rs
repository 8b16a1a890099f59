//! Whether an experiment equals another one except for a larger S.

use toml::{Table, Value};

/// Keys that may change with S: the length of the run, and what it does when it stops.
const MAY_CHANGE: [&str; 3] = ["iterations", "real_tests", "self_augment"];

/// Whether `new` is the text of the experiment `old` with further parameters after the existing ones, and without any
/// other change that could affect earlier results.
pub fn enlarges(old: &str, new: &str) -> bool {
    let (Ok(mut old), Ok(mut new)) = (old.parse::<Table>(), new.parse::<Table>()) else { return false };
    let (fewer, more) = (parameters(&mut old), parameters(&mut new));
    for table in [&mut old, &mut new] {
        if let Some(Value::Table(plan)) = table.get_mut("coevolve") {
            MAY_CHANGE.iter().for_each(|key| _ = plan.remove(*key));
        }
    }
    let same = fewer.iter().zip(&more).all(|(a, b)| a == b);
    old == new && same && more.len() > fewer.len()
}

/// Removes the parameters from a file and returns them.
fn parameters(file: &mut Table) -> Table {
    match file.remove("parameters") {
        Some(Value::Table(parameters)) => parameters,
        _ => Table::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_further_parameters_and_a_longer_run_enlarge_an_experiment() {
        let old = "name = 'a'\n[parameters]\nx = { bounds = [0, 1] }\n[coevolve]\niterations = 2\ndistance = 'rmse'\n";
        let more = old.replace("[coevolve]", "y = { bounds = [0, 2] }\n[coevolve]");
        assert!(enlarges(old, &more) && enlarges(old, &more.replace("iterations = 2", "iterations = 9")));
        let before = old.replace("x =", "y = { bounds = [0, 2] }\nx =");
        for other in [old, &before, &more.replace("[0, 1]", "[0, 3]"), &more.replace("rmse", "fit"), "name = "] {
            assert!(!enlarges(old, other), "{other}");
        }
    }
}

//! By how much the error fell with a finding, by the steps of the error ladder.

use crate::table::number;
use btr_identify::LadderStep;
use btr_lab::verbs::{DiagnoseReport, ErrorUnit};

/// Separates what came in at a step from what it took the place of.
const FOR: &str = " for ";
/// Separates two of these.
const AND: &str = " + ";
/// Begins a step that drops something.
const GONE: &str = "- ";

/// "from 1.34 to 1.01 noise floors" at the step by which one of these names (`effect@site`) came in. `None` where the
/// ladder has no such step.
pub fn fell(report: &DiagnoseReport, names: &[String]) -> Option<String> {
    of_ladder(&report.error_ladder, ErrorUnit::of(&report.noise_floor), names)
}

fn of_ladder(ladder: &[LadderStep], unit: ErrorUnit, names: &[String]) -> Option<String> {
    let entered = entered(ladder, |word| names.iter().any(|name| name == word))?;
    let (before, after) = (&ladder[before(ladder, entered)?], &ladder[entered]);
    let learnt = format!("from {} to {} {}", number(before.train), number(after.train), unit.times());
    Some(match before.held_out.zip(after.held_out) {
        Some((before, after)) => format!("{learnt} (held out: from {} to {})", number(before), number(after)),
        None => learnt,
    })
}

/// The last step that brings one of these names in.
fn entered(ladder: &[LadderStep], is_meant: impl Fn(&str) -> bool) -> Option<usize> {
    let came =
        |step: &LadderStep| step.step.split(FOR).next().is_some_and(|came| came.split([' ', ',']).any(&is_meant));
    ladder.iter().rposition(|step| !step.step.starts_with(GONE) && came(step))
}

/// The step before one came in, or before what it took the place of did.
fn before(ladder: &[LadderStep], step: usize) -> Option<usize> {
    let gone = ladder[step].step.split_once(FOR).map(|(_, gone)| gone.split(AND));
    let replaced = gone.and_then(|gone| gone.filter_map(|name| entered(&ladder[..step], |word| word == name)).min());
    match replaced {
        Some(earlier) => before(ladder, earlier),
        None => step.checked_sub(1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_finding_has_the_fall_of_what_it_took_the_place_of() {
        let step = |step: &str, train, held_out| LadderStep { step: step.to_owned(), train, held_out, u: Vec::new() };
        let ladder = [
            step("model as it stands", 25.9, Some(25.6)),
            step("+ payload@hand", 1.34, Some(1.30)),
            step("+ asymmetric_friction@yaw", 1.02, None),
            step("coulomb_friction@yaw for asymmetric_friction@yaw", 1.01, Some(1.005)),
        ];
        let of = |name: &str| of_ladder(&ladder, ErrorUnit::NoiseFloor, &[name.to_owned()]);
        let coulomb = "from 1.340 to 1.010 noise floors (held out: from 1.300 to 1.005)";
        assert_eq!(of("coulomb_friction@yaw").as_deref(), Some(coulomb));
        assert_eq!(of("asymmetric_friction@yaw").as_deref(), Some("from 1.340 to 1.020 noise floors"));
        let both = [
            step("model as it stands", 9.0, None),
            step("+ length@arm, corrected", 1.2, None),
            step("- length@arm", 9.0, None),
            step("+ length@arm, corrected", 1.1, None),
            step("+ com_offset@arm", 1.05, None),
            step("tool_load@arm for length@arm + com_offset@arm", 1.0, None),
        ];
        let load = of_ladder(&both, ErrorUnit::NoiseFloor, &["tool_load@arm".to_owned()]);
        assert_eq!(load.as_deref(), Some("from 9.000 to 1.000 noise floors"));
        assert_eq!((of("payload@hand").is_some(), of("model"), of("backlash@yaw")), (true, None, None));
    }
}

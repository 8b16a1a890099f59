//! Findings that add to a quantity which is a free parameter as well: logs hardly tell the two apart.

use crate::identification::VerbInput;
use btr_identify::diagnose::MissingEffect;
use serde::Serialize;

/// Parameters of effects, and the quantity of a joint or link to which each adds.
const ADDED_TO: [(&str, &str); 5] = [
    ("payload.mass", "mass"),
    ("end_payload.mass", "mass"),
    ("tool_load.mass", "mass"),
    ("viscous_friction.coefficient", "damping"),
    ("coulomb_friction.torque", "friction"),
];

/// A parameter of a finding, and the free parameter that it adds to.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct AddsTo {
    /// The parameter of the finding.
    pub found: String,
    /// The free parameter.
    pub free: String,
}

/// The findings that add to a free parameter.
pub(super) fn adds_to(input: &VerbInput, found: &[MissingEffect]) -> Vec<AddsTo> {
    let parameters = input.problem.parameters();
    let is_free = |name: &String| input.problem.free().iter().any(|&k| parameters[k].name == *name);
    let free = |name: &str| {
        let (parameter, site) = name.split_once('@')?;
        let (_, quantity) = ADDED_TO.iter().find(|(known, _)| *known == parameter)?;
        let free = format!("{quantity}@{site}");
        is_free(&free).then(|| AddsTo { found: name.to_owned(), free })
    };
    found.iter().flat_map(|one| &one.parameters).filter_map(|estimate| free(&estimate.name)).collect()
}

#[cfg(test)]
mod tests {
    use super::ADDED_TO;
    use btr_physics::effects::find;

    #[test]
    fn the_parameters_exist() {
        for (name, _) in ADDED_TO {
            let (effect, parameter) = name.split_once('.').unwrap_or_default();
            let spec = find(effect).map(btr_physics::effects::Effect::spec);
            assert!(spec.is_some_and(|spec| spec.params.iter().any(|known| known.name == parameter)), "{name}");
        }
    }
}

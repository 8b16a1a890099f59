//! Simplification of an explanation: effects that are not needed are removed, and laws are replaced by simpler ones
//! that they contain.

use super::cause_search::{CauseSearch, TWO_SIDED_95};
use super::explanation::{ExplanationCost, PresentExplanation};
use super::extended::Added;
use btr_core::coevolve::{Cost, Posterior, Suspect};
use btr_core::space::Dim;
use btr_core::world::{Cancelled, Simulator};
use btr_identify::diagnose::MissingEffect;
use btr_physics::effects;

impl<'a> CauseSearch<'a> {
    /// Removes effects that the explanation does not need. An early effect may have compensated for a later one, and a
    /// late effect may only have led the estimate out of a local minimum.
    pub(super) fn pruned(
        &self,
        mut state: PresentExplanation<'a>,
        effects: &mut Vec<MissingEffect>,
        cost: &mut Cost,
    ) -> Result<PresentExplanation<'a>, Cancelled> {
        let mut k = 0;
        while k < state.added.len() {
            let tried = match self.without(&state, k) {
                Some((added, from)) => self.tried(&added, &from, cost)?,
                None => None,
            };
            match tried.filter(|tried| ExplanationCost::of(tried).less_than(ExplanationCost::of(&state)) > 0.0) {
                Some(tried) => {
                    effects.remove(k);
                    state = tried;
                }
                None => k += 1,
            }
        }
        Ok(state)
    }

    /// The effects of a state without the `k`th, and a belief to start from. `None` for the only effect, and for the
    /// last one if its interval excludes off: its round has already shown that the fit is worse without it.
    fn without(&self, state: &PresentExplanation, k: usize) -> Option<(Vec<Added>, Posterior)> {
        let mut added = state.added.clone();
        added.remove(k);
        let (known, belief) = (state.extended.simulations(), &state.fitted.estimated.belief);
        let from = match self.may_be_off(state, k) {
            true => belief.carried(known, self.extended(added.clone())?.simulations())?,
            false if k + 1 < state.added.len() => self.about(state, &added, None),
            false => return None,
        };
        (!added.is_empty()).then_some((added, from))
    }

    /// Whether all intervals of an effect contain its off value.
    fn may_be_off(&self, state: &PresentExplanation, k: usize) -> bool {
        let places = self.places(state, k);
        let known = &state.extended.simulations().dims()[places.clone()];
        let belief = &state.fitted.estimated.belief;
        let holds = |(place, dim): (usize, &Dim)| {
            dim.nominal
                .is_some_and(|off| (dim.to_unit(off) - belief.mean()[place]).abs() < TWO_SIDED_95 * belief.sd(place))
        };
        places.zip(known).all(holds)
    }

    /// Replaces laws by simpler ones nested in them where the cost decreases.
    pub(super) fn simplified(
        &self,
        mut state: PresentExplanation<'a>,
        effects: &mut [MissingEffect],
        cost: &mut Cost,
    ) -> Result<PresentExplanation<'a>, Cancelled> {
        for k in 0..state.added.len() {
            for (name, _) in state.added[k].effect.spec().nested {
                let Some(simpler) = effects::find(name) else { continue };
                let mut added = state.added.clone();
                added[k].effect = simpler;
                let from = self.about(&state, &added, Some(k));
                let Some(tried) = self.tried(&added, &from, cost)? else { continue };
                if ExplanationCost::of(&tried).less_than(ExplanationCost::of(&state)) > 0.0 {
                    (*name).clone_into(&mut effects[k].effect);
                    state = tried;
                    break;
                }
            }
        }
        Ok(state)
    }

    /// A belief to start from when some effects of a state remain: their parameters keep their values, and the
    /// parameters that take the place of the `replaced` effect's take over the value with the same unit.
    fn about(&self, state: &PresentExplanation, added: &[Added], replaced: Option<usize>) -> Posterior {
        let (known, mean) = (state.extended.simulations(), state.fitted.estimated.belief.mean());
        let base_len = self.model.simulations().len();
        let base = Posterior::of_bounds(&mean.as_slice()[..base_len]);
        let Some(extended) = self.extended(added.to_vec()) else { return base };
        let former = replaced.map(|k| format!("{}.", state.added[k].effect.spec().name));
        let start = extended.simulations().dims()[base_len..].iter().map(|dim| {
            let same = |other: &Dim| other.name == dim.name;
            let alike = |other: &Dim| {
                let site = dim.name.split_once('@').map(|(_, site)| site);
                let of_former = former.as_ref().is_some_and(|former| other.name.starts_with(former));
                of_former && other.name.split_once('@').map(|(_, site)| site) == site && other.unit == dim.unit
            };
            let place = known.dims().iter().position(same).or_else(|| known.dims().iter().position(alike));
            place.map_or(0.5, |place| dim.to_unit(known.dims()[place].from_unit(mean[place])))
        });
        let suspect = Suspect { extension: 0, start: start.collect(), left: 1.0 };
        self.abduction.beginning(&base, &suspect, &self.prior(extended.simulations()))
    }
}

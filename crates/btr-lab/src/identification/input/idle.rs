//! Effects that a fit has left at values at which they do nothing.

use super::VerbInput;
use btr_physics::effects::PlacedEffect;

/// A value at a bound is at the off value if it is no further from it than this share of its range.
const NEAR: f64 = 1e-3;

impl VerbInput {
    /// The parameters at a bound that physics sets, at these values: 0, for what a robot cannot have less than none of.
    pub(crate) fn at_limits<'a>(
        &self,
        values: impl Iterator<Item = (&'a str, f64)>,
        is_at_bound: impl Fn(&str) -> bool,
    ) -> Vec<String> {
        let model = self.problem.model();
        let is_limit = |(name, value): &(&str, f64)| {
            let Some(k) = model.simulations.index_of(name).filter(|_| is_at_bound(name)) else { return false };
            let dim = &model.simulations.dims()[k];
            let bound = if value - dim.min <= dim.max - value { dim.min } else { dim.max };
            bound.abs() <= 0.0
        };
        values.filter(is_limit).map(|(name, _)| name.to_owned()).collect()
    }

    /// The free effects that do nothing at these values of free parameters, as `effect@site`: what of them is at a
    /// bound is off there.
    pub(crate) fn idle_effects<'a>(
        &self,
        values: impl Iterator<Item = (&'a str, f64)>,
        is_at_bound: impl Fn(&str) -> bool,
    ) -> Vec<String> {
        let model = self.problem.model();
        let (mut s, dims) = (model.simulations.nominal(), model.simulations.dims());
        for (name, value) in values {
            let Some(k) = model.simulations.index_of(name) else { continue };
            let off = model.targets[k].of_effect().map(|(effect, param)| effect.spec().params[param].off);
            let near = NEAR * (dims[k].max - dims[k].min);
            s[k] = off.filter(|off| is_at_bound(name) && (value - off).abs() <= near).unwrap_or(value);
        }
        let is_free = |placed: &&PlacedEffect| {
            let (start, end) = (format!("{}.", placed.effect.spec().name), format!("@{}", placed.site));
            self.free_dims().any(|dim| dim.name.starts_with(&start) && dim.name.ends_with(&end))
        };
        let (_, effects, _) = model.at(&s, 0);
        let idle = effects.iter().filter(|placed| placed.is_off()).filter(is_free);
        idle.map(|placed| format!("{}@{}", placed.effect.spec().name, placed.site)).collect()
    }
}

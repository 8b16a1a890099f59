//! A model extended by effects: their parameters are further dimensions of S.

use crate::execution::ExecutionContext;
use crate::scales::RobotScales;
use btr_core::space::{Dim, Scale, Space, SpaceError};
use btr_core::world::{Behaviour, Job, Simulator, WorldError};
use btr_physics::effects::{Effect, EffectSpec, Param, PlacedEffect};
use btr_physics::model::Model;

/// Multiples of its typical size at which an amplitude is probed.
const AMPLITUDES: [f64; 2] = [0.5, 3.0];
/// Multiples of its typical size at which a limit is probed.
const LIMITS: [f64; 4] = [0.5, 1.0, 2.0, 4.0];
/// Multiples of the model's value at which a replacement value is probed.
const REPLACEMENTS: [f64; 2] = [0.6, 1.5];

/// An effect at a site.
#[derive(Clone)]
pub(super) struct Added {
    pub effect: &'static dyn Effect,
    pub site: String,
}

impl Added {
    /// `effect@site`.
    pub(super) fn name(&self) -> String {
        format!("{}@{}", self.effect.spec().name, self.site)
    }
}

/// A model with effects whose parameters are the last dimensions of its S.
pub(super) struct Extended<'a> {
    model: &'a Model,
    context: &'a ExecutionContext,
    added: Vec<Added>,
    space: Space,
}

impl<'a> Extended<'a> {
    pub(super) fn new(
        model: &'a Model,
        added: Vec<Added>,
        scales: &RobotScales,
        context: &'a ExecutionContext,
    ) -> Result<Self, SpaceError> {
        let of = |added: &Added| -> Vec<Dim> {
            let spec = added.effect.spec();
            spec.params.iter().map(|param| dim(spec, param, &added.site, scales, model)).collect()
        };
        let dims = model.simulations().dims().iter().cloned().chain(added.iter().flat_map(of)).collect();
        Ok(Extended { model, context, added, space: Space::new(dims)? })
    }

    pub(super) fn added(&self) -> &[Added] {
        &self.added
    }

    /// Points at which the last added effect is probed, in the units of its parameters.
    pub(super) fn probes(&self) -> Vec<Vec<f64>> {
        let Some(last) = self.added.last() else { return Vec::new() };
        let spec = last.effect.spec();
        let dims = &self.space.dims()[self.space.len() - spec.params.len()..];
        let shapes: Vec<Vec<f64>> = match spec.starts {
            [] => vec![spec.params.iter().filter(|param| param.shape).map(|param| param.hint).collect()],
            starts => starts.iter().map(|start| start.to_vec()).collect(),
        };
        shapes.iter().flat_map(|shapes| probes_at(spec, dims, shapes)).collect()
    }

    /// Splits a point into the base model's values and the effects with the remaining values.
    fn split<'s>(&self, s: &'s [f64]) -> (&'s [f64], Vec<PlacedEffect>) {
        let (base, mut rest) = s.split_at(self.model.simulations().len().min(s.len()));
        let mut placed = Vec::with_capacity(self.added.len());
        for Added { effect, site } in &self.added {
            let (values, others) = rest.split_at(effect.spec().params.len().min(rest.len()));
            rest = others;
            placed.push(PlacedEffect { effect: *effect, site: site.clone(), values: values.to_vec() });
        }
        (base, placed)
    }
}

impl Simulator for Extended<'_> {
    fn simulations(&self) -> &Space {
        &self.space
    }

    fn controllers(&self) -> &Space {
        self.model.controllers()
    }

    fn scenarios(&self) -> usize {
        self.model.scenarios()
    }

    fn run(&self, s: &[f64], c: &[f64], scenario: usize) -> Result<Behaviour, WorldError> {
        self.run_all(&[Job { s, c, scenario }]).remove(0)
    }

    fn side_by_side(&self) -> usize {
        self.model.side_by_side()
    }

    fn run_all(&self, jobs: &[Job]) -> Vec<Result<Behaviour, WorldError>> {
        if let Err(cancelled) = self.context.check_cancelled() {
            return jobs.iter().map(|_| Err(cancelled.into())).collect();
        }
        let split: Vec<(&[f64], Vec<PlacedEffect>)> = jobs.iter().map(|job| self.split(job.s)).collect();
        let requests = jobs
            .iter()
            .zip(&split)
            .map(|(job, (s, effects))| self.model.request(s, job.scenario).controller(job.c).effects(effects));
        self.model.behaviours(requests.collect())
    }
}

/// Dimension of an effect's parameter. Amplitudes are off at their nominal value; shapes and limits have no nominal
/// value.
fn dim(spec: &EffectSpec, param: &Param, site: &str, scales: &RobotScales, model: &Model) -> Dim {
    let scale = scales.of_unit(param.unit, site);
    let (least, most) = (param.bounds.0 * scale, param.bounds.1 * scale);
    let dim = Dim::new(format!("{}.{}@{site}", spec.name, param.name), param.unit, least, most);
    match param {
        p if p.shape || p.off.is_infinite() => dim.scale(if least > 0.0 { Scale::Log } else { Scale::Linear }),
        p if p.off.is_nan() => replaced_value(model)
            .filter(|replaced_value| (least..=most).contains(replaced_value))
            .map_or(dim.clone(), |replaced_value| dim.nominal(replaced_value)),
        p => Dim { min: least.min(0.0), ..dim }.nominal(p.off),
    }
}

/// The model's value that an effect would replace.
fn replaced_value(model: &Model) -> Option<f64> {
    model.setup.ground.map(|ground| ground.friction)
}

/// Probes with all amplitudes together at their sizes, then each amplitude alone, at these shapes.
fn probes_at(spec: &EffectSpec, dims: &[Dim], shapes: &[f64]) -> Vec<Vec<f64>> {
    let mut shapes = shapes.iter();
    // Shapes are at their starts; amplitudes are off.
    let off: Vec<f64> = (spec.params.iter().zip(dims))
        .map(|(param, dim)| match param {
            p if p.shape => shapes.next().copied().unwrap_or(p.hint).clamp(dim.min, dim.max),
            _ => dim.nominal.unwrap_or_else(|| dim.from_unit(0.5)),
        })
        .collect();
    let amplitudes: Vec<usize> = (0..dims.len()).filter(|&k| !spec.params[k].shape).collect();
    let at = |ks: &[usize], multiple: f64| {
        let mut probe = off.clone();
        ks.iter().for_each(|&k| probe[k] = size(&spec.params[k], &dims[k], multiple));
        probe
    };
    let multiples = |k: usize| multiples(&spec.params[k]);
    let first = amplitudes.first().copied().unwrap_or(0);
    let together = multiples(first).into_iter().map(|multiple| at(&amplitudes, multiple));
    let alone = |&k: &usize| multiples(k).into_iter().map(move |multiple| (k, multiple));
    let several = amplitudes.len() > 1;
    let alone = amplitudes.iter().filter(|_| several).flat_map(alone).map(|(k, multiple)| at(&[k], multiple));
    together.chain(alone).collect()
}

/// Multiples of its size at which a parameter is probed.
fn multiples(param: &Param) -> Vec<f64> {
    let signed = param.bounds.0 < 0.0;
    match param {
        p if p.off.is_infinite() => LIMITS.to_vec(),
        p if p.off.is_nan() => REPLACEMENTS.to_vec(),
        _ => AMPLITUDES.iter().flat_map(|&a| if signed { vec![a, -a] } else { vec![a] }).collect(),
    }
}

/// A multiple of a parameter's typical size, or of the model's value, clamped to the bounds.
fn size(param: &Param, dim: &Dim, multiple: f64) -> f64 {
    // Bounds and hints have the same scale.
    let scale = if param.bounds.1 == 0.0 { 1.0 } else { dim.max / param.bounds.1 };
    let value = match dim.nominal.filter(|_| param.off.is_nan()) {
        Some(replaced_value) => replaced_value * multiple,
        None => param.hint * scale * multiple,
    };
    value.clamp(dim.min, dim.max)
}

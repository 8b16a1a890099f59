//! Descriptors: the axes on which kinds of controllers differ.

use crate::coevolve::evaluate::{self, Cost};
use crate::distance::matches;
use crate::search::UnitPoint;
use crate::world::{Cancelled, Job, Measure, Output, OutputRequest, Simulator, WorldError};

/// An axis of a map.
pub(in crate::coevolve) struct DescriptorAxis {
    of: DescriptorQuantity,
    bounds: [f64; 2],
}

/// The quantity of an axis.
enum DescriptorQuantity {
    /// The mean of these parameters of the controller.
    Controller(Vec<usize>),
    /// A number that is read off a behaviour.
    Behaviour(Measure),
}

impl DescriptorAxis {
    /// From the axis' own unit to [0, 1] within its bounds.
    fn to_unit(&self, x: f64) -> f64 {
        let [least, most] = self.bounds;
        (x - least) / (most - least)
    }

    /// From [0, 1] to the axis' own unit.
    pub(super) fn value(&self, u: f64) -> f64 {
        let [least, most] = self.bounds;
        least + u * (most - least)
    }

    fn needs_behaviour(&self) -> bool {
        matches!(self.of, DescriptorQuantity::Behaviour(_))
    }

    /// Position of a controller and its output on the axis; `None` where it cannot be measured.
    fn place(&self, c: &[f64], output: &Output) -> Option<f64> {
        let x = match (&self.of, output) {
            (DescriptorQuantity::Controller(dims), _) => dims.iter().map(|&k| c[k]).sum::<f64>() / dims.len() as f64,
            (DescriptorQuantity::Behaviour(measure), Output::Behaviour(behaviour)) => measure(&behaviour.log).ok()?,
            (DescriptorQuantity::Behaviour(_), _) => return None,
        };
        Some(self.to_unit(x))
    }
}

/// The axis of this name: what the simulator measures under it, or parameters of the controller; `None` where it is
/// neither.
pub(super) fn axis(name: &str, bounds: [f64; 2], simulator: &dyn Simulator) -> Option<DescriptorAxis> {
    if let Some(measure) = simulator.measure(name) {
        return Some(DescriptorAxis { of: DescriptorQuantity::Behaviour(measure), bounds });
    }
    let dims = simulator.controllers().dims().iter().enumerate();
    let fitting: Vec<usize> = dims.filter(|(_, dim)| matches(name, &dim.name)).map(|(k, _)| k).collect();
    (!fitting.is_empty()).then_some(DescriptorAxis { of: DescriptorQuantity::Controller(fitting), bounds })
}

/// Of each controller in a simulation: the mean fitness over all scenarios, −∞ where one of them failed, and the mean
/// place on each axis, 0 and 1 at its bounds; no place where one of them failed.
pub(in crate::coevolve) fn judged(
    simulator: &dyn Simulator,
    s: &[f64],
    axes: &[DescriptorAxis],
    controllers: &[UnitPoint],
    cost: &mut Cost,
) -> Result<(Vec<f64>, Vec<Vec<f64>>), Cancelled> {
    let scenarios = simulator.scenarios();
    let points: Vec<Vec<f64>> = controllers.iter().map(|u| simulator.controllers().from_unit(u)).collect();
    let job = |k: usize| Job { s, c: &points[k / scenarios], scenario: k % scenarios };
    let jobs: Vec<Job> = (0..points.len() * scenarios).map(job).collect();
    let request = if axes.iter().any(DescriptorAxis::needs_behaviour) {
        OutputRequest::Behaviour
    } else {
        OutputRequest::Fitness
    };
    let outputs = evaluate::evaluate_all(simulator, &jobs, &vec![request; jobs.len()])?;
    cost.count(&outputs);
    let one = |(c, outputs): (&Vec<f64>, &[Result<Output, WorldError>])| {
        mean(c, axes, outputs).unwrap_or_else(|| (f64::NEG_INFINITY, Vec::new()))
    };
    Ok(points.iter().zip(outputs.chunks(scenarios)).map(one).unzip())
}

/// Means over the scenarios of one controller; `None` where one of them failed.
fn mean(c: &[f64], axes: &[DescriptorAxis], outputs: &[Result<Output, WorldError>]) -> Option<(f64, Vec<f64>)> {
    let (mut fitness, mut places) = (0.0, vec![0.0; axes.len()]);
    for output in outputs {
        let output = output.as_ref().ok()?;
        fitness += match output {
            Output::Behaviour(behaviour) => behaviour.fitness,
            Output::Fitness(fitness) => *fitness,
            Output::Distance(_) => return None,
        };
        for (place, axis) in places.iter_mut().zip(axes) {
            *place += axis.place(c, output)?;
        }
    }
    let scenarios = outputs.len() as f64;
    places.iter_mut().for_each(|place| *place /= scenarios);
    Some((fitness / scenarios, places)).filter(|(fitness, _)| fitness.is_finite())
}

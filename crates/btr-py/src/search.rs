//! Searches for any function of Python: what was asked, what was told, all of it as text.

use crate::error::{Raise, raised};
use crate::settings::{self, Settings};
use btr_core::random::stream;
use btr_core::search::cmaes::CmaStop;
use btr_core::search::{AnySearch, SEARCHES, Search as _, SearchSpec, UnitPoint};
use btr_core::space::{Dim, Scale, Space};
use numpy::PyArray1;
use pyo3::prelude::*;
use serde::{Deserialize, Serialize};

/// A search between its generations, or between asking and telling.
#[pyclass(module = "btr._btr")]
#[derive(Serialize, Deserialize)]
pub(crate) struct Search {
    space: Space,
    search: AnySearch,
    seed: u64,
    popsize: usize,
    iterations: u64,
    evaluations: u64,
    evals_best: u64,
    /// The population on the unit cube that nobody has told about yet. Kept, so that asking again gives the same
    /// points.
    asked: Option<Vec<UnitPoint>>,
}

type Point<'py> = Bound<'py, PyArray1<f64>>;

/// More numbers than this are not kept: neither a population nor a covariance.
const MOST_NUMBERS: usize = 100_000_000;

#[pymethods]
impl Search {
    /// A search by its name in experiment files, between bounds; `log` says of each dimension whether equal steps are
    /// equal ratios.
    #[new]
    fn new(
        algorithm: &str,
        settings: Settings<'_>,
        bounds: Vec<(f64, f64)>,
        log: Vec<bool>,
        x0: Option<Vec<f64>>,
        seed: u64,
    ) -> PyResult<Self> {
        let spec: SearchSpec = settings::read("algorithm", algorithm, &settings, |key| said(algorithm, key))?;
        let space = space(&bounds, &log)?;
        let popsize = spec.population(space.len());
        if space.len().saturating_mul(popsize.max(space.len())) > MOST_NUMBERS {
            let what = format!("{popsize} points in {} dimensions are too many to keep", space.len());
            return Err(raised(&what, Some("search in fewer dimensions, or with a smaller popsize".into())));
        }
        if let Some(x0) = &x0 {
            space.check(x0).map_err(Raise::raise)?;
        }
        let start = x0.map(|x0| space.to_unit(&x0));
        let search = spec.start(space.len(), start.as_deref());
        Ok(Search { space, search, seed, popsize, iterations: 0, evaluations: 0, evals_best: 0, asked: None })
    }

    /// The population to evaluate, within the bounds: the same until it has been told.
    fn ask<'py>(&mut self, py: Python<'py>) -> Vec<Point<'py>> {
        let asked = match self.asked.take() {
            Some(asked) => asked,
            None => self.search.ask(&mut stream(self.seed, &[self.iterations])),
        };
        let points = asked.iter().map(|unit| self.point(py, unit)).collect();
        self.asked = Some(asked);
        points
    }

    /// The population that was asked and not told yet.
    #[getter]
    fn asked<'py>(&self, py: Python<'py>) -> Option<Vec<Point<'py>>> {
        self.asked.as_ref().map(|asked| asked.iter().map(|unit| self.point(py, unit)).collect())
    }

    /// The costs of what was asked, in its order; what is no finite number has failed.
    fn tell(&mut self, costs: Vec<f64>) -> PyResult<()> {
        let awaited = self.asked.as_ref().map_or(0, Vec::len);
        if costs.len() != awaited {
            let what = format!("{} costs, but {awaited} solutions were asked", costs.len());
            return Err(raised(what, Some("give one cost for each solution, in the order of ask()".into())));
        }
        let Some(asked) = self.asked.take() else { return Ok(()) };
        let costs: Vec<f64> =
            costs.into_iter().map(|cost| if cost.is_finite() { cost } else { f64::INFINITY }).collect();
        let cost = |search: &AnySearch| search.best().map_or(f64::INFINITY, |(_, cost)| cost);
        let before = cost(&self.search);
        self.search.tell(&asked, &costs);
        let best = cost(&self.search);
        if best < before {
            let after = costs.iter().position(|cost| *cost <= best).unwrap_or(0) as u64;
            self.evals_best = self.evaluations + after + 1;
        }
        self.iterations += 1;
        self.evaluations += costs.len() as u64;
        Ok(())
    }

    /// How many points the first populations have.
    #[getter]
    fn popsize(&self) -> usize {
        self.popsize
    }

    /// Populations told.
    #[getter]
    fn iterations(&self) -> u64 {
        self.iterations
    }

    /// Costs told.
    #[getter]
    fn evaluations(&self) -> u64 {
        self.evaluations
    }

    /// The best point told, its cost, and which evaluation it was, counted from 1.
    #[getter]
    fn best<'py>(&self, py: Python<'py>) -> Option<(Point<'py>, f64, u64)> {
        let (unit, cost) = self.search.best()?;
        Some((self.point(py, unit), cost, self.evals_best))
    }

    /// The mean and the standard deviations of CMA-ES, these as they are at the mean where a scale is logarithmic.
    #[getter]
    fn distribution<'py>(&self, py: Python<'py>) -> Option<(Point<'py>, Point<'py>)> {
        let AnySearch::CmaEs(search) = &self.search else { return None };
        let (mean, deviations) = search.distribution();
        let mean = self.space.from_unit(&mean);
        let dims = self.space.dims().iter().zip(&mean).zip(deviations);
        let deviations: Vec<f64> = dims.map(|((dim, x), deviation)| deviation * slope(dim, *x)).collect();
        Some((PyArray1::from_vec(py, mean), PyArray1::from_vec(py, deviations)))
    }

    /// Why there is nothing more to find, under the name that pycma gives it.
    #[getter]
    fn ended(&self) -> Option<(&'static str, &'static str)> {
        let AnySearch::CmaEs(search) = &self.search else { return None };
        search.ended().map(|ended| match ended {
            CmaStop::SmallSteps => ("tolx", "the steps are too small to matter"),
            CmaStop::UnlikeAxes => ("tolconditioncov", "the axes of the distribution differ too much in length"),
            CmaStop::FlatCosts => ("tolfunhist", "the latest best costs are equal to 12 digits"),
            CmaStop::Stagnation => ("tolstagnation", "the latest best costs are no better than much older ones"),
            CmaStop::Failures => ("failures", "nothing succeeds"),
        })
    }

    /// All of it as text, for pickles.
    fn state(&self) -> PyResult<String> {
        serde_json::to_string(self).map_err(|error| raised(format!("the search cannot be kept: {error}"), None))
    }

    /// The search that `state` was written by.
    #[staticmethod]
    fn restored(state: &str) -> PyResult<Self> {
        serde_json::from_str(state)
            .map_err(|error| raised(format!("this is not a search of this version: {error}"), None))
    }
}

impl Search {
    fn point<'py>(&self, py: Python<'py>, unit: &[f64]) -> Point<'py> {
        PyArray1::from_vec(py, self.space.from_unit(unit))
    }
}

/// Every search: its name, what it is good for, and its settings with their defaults as JSON.
#[pyfunction]
pub(crate) fn searches() -> PyResult<Vec<(&'static str, &'static str, String)>> {
    let row = |&(name, what): &(&'static str, &'static str)| {
        let spec: SearchSpec = settings::read("algorithm", name, &vec![], str::to_owned)?;
        Ok((name, what, serde_json::json!(spec).to_string()))
    };
    SEARCHES.iter().map(row).collect()
}

/// What Python calls a setting: as pycma does where pycma has it.
fn said(algorithm: &str, setting: &str) -> String {
    match (algorithm, setting) {
        (_, "population") => "popsize",
        ("cma_es", "sigma") => "sigma0",
        _ => setting,
    }
    .to_owned()
}

fn space(bounds: &[(f64, f64)], log: &[bool]) -> PyResult<Space> {
    if bounds.is_empty() || bounds.len() != log.len() {
        let what = format!("{} bounds and {} scales", bounds.len(), log.len());
        return Err(raised(
            &what,
            Some("give bounds and a scale to every dimension, of which there is one at least".into()),
        ));
    }
    let dims = bounds.iter().zip(log).enumerate().map(|(i, (&(low, high), &log))| {
        let scale = if log { Scale::Log } else { Scale::Linear };
        Dim::new(format!("x[{i}]"), "1", low, high).scale(scale)
    });
    let space = Space::new(dims.collect()).map_err(Raise::raise)?;
    let endless = |dim: &&Dim| !slope(dim, dim.max).is_finite();
    match space.dims().iter().find(endless) {
        Some(dim) => Err(raised(format!("the bounds of {} are too far apart to compute with", dim.name), None)),
        None => Ok(space),
    }
}

/// How fast a value changes with its place between 0 and 1.
fn slope(dim: &Dim, value: f64) -> f64 {
    match dim.scale {
        Scale::Linear => dim.max - dim.min,
        Scale::Log => value * (dim.max / dim.min).ln(),
    }
}

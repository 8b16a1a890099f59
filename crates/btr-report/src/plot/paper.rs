//! A run as figures 3 and 5 of the paper show it (Zagal, Delpiano and Ruiz-del-Solar 2009): its progress, and how
//! joints follow their references.

use super::panel::{Ink, Mark, Panel, Series};

/// One generation of the search for controllers, or for simulations.
#[derive(Clone, Debug)]
pub(crate) struct GenerationTrace {
    /// The Back-to-Reality iteration it belongs to, from 1.
    pub(crate) iteration: usize,
    /// The best of the generation: largest fitness, or smallest phi.
    pub(crate) best: f64,
    /// The mean over the population.
    pub(crate) mean: f64,
}

/// One simulation that was evaluated.
#[derive(Clone, Debug)]
pub(crate) struct Individual {
    /// The generation of the search for simulations, counted over the whole run from 0.
    pub(crate) generation: usize,
    /// Its distance to reality.
    pub(crate) phi: f64,
    /// Its parameters, in the order of [`RunProgress::parameters`].
    pub(crate) values: Vec<f64>,
}

/// One searched parameter of the simulation.
#[derive(Clone, Debug)]
pub(crate) struct Parameter {
    /// Its name.
    pub(crate) name: String,
    /// Its unit, `1` for plain numbers.
    pub(crate) unit: String,
    /// Its value in reality, where that is known.
    pub(crate) truth: Option<f64>,
    /// 95 % intervals, where there is a posterior that explains the tests, with the generation after which they hold.
    pub(crate) intervals: Vec<(usize, [f64; 2])>,
}

/// The searches of a run.
#[derive(Clone, Debug)]
pub(crate) struct RunProgress {
    /// The search for controllers, generation by generation over the whole run.
    pub(crate) fitness: Vec<GenerationTrace>,
    /// What fitness is, with its unit.
    pub(crate) fitness_label: String,
    /// The search for simulations, generation by generation over the whole run.
    pub(crate) phi: Vec<GenerationTrace>,
    /// What phi is, with its unit.
    pub(crate) phi_label: String,
    /// The searched parameters.
    pub(crate) parameters: Vec<Parameter>,
    /// Every simulation that was evaluated.
    pub(crate) individuals: Vec<Individual>,
    /// Whether the individuals of a generation were sampled from a posterior.
    pub(crate) drawn: bool,
}

/// Steps of grey between the best and the worst of a generation.
const SHADES: usize = 8;

/// Fitness, phi, and each parameter over the generations; darker individuals have a smaller phi. The line is the best
/// of each generation, or the posterior's mean.
pub(crate) fn progress(data: &RunProgress) -> Vec<Panel> {
    let searches = [
        ("Fitness", &data.fitness_label, "max", &data.fitness),
        ("Distance to reality", &data.phi_label, "min", &data.phi),
    ];
    let searched = searches.into_iter().filter(|(.., generations)| !generations.is_empty());
    let mut panels: Vec<Panel> = searched.map(|(title, label, best, of)| trace(title, label, best, of)).collect();
    let ends = ends(&data.phi);
    panels.extend((0..data.parameters.len()).map(|i| parameter(data, i, &ends)));
    panels
}

fn trace(title: &str, label: &str, best: &str, generations: &[GenerationTrace]) -> Panel {
    let curve = |value: fn(&GenerationTrace) -> f64| {
        generations.iter().enumerate().map(|(i, g)| (i as f64, value(g))).collect::<Vec<_>>()
    };
    Panel {
        title: title.to_owned(),
        x_label: "generation".into(),
        y_label: label.to_owned(),
        series: vec![
            Series::new("mean", Ink::Second, Mark::Dashes, curve(|g| g.mean)),
            Series::new(best, Ink::Main, Mark::Line, curve(|g| g.best)),
        ],
        marks_x: ends(generations),
        ..Panel::default()
    }
}

/// Between the last generation of an iteration and the first of the next.
fn ends(generations: &[GenerationTrace]) -> Vec<f64> {
    let pairs = generations.windows(2).enumerate();
    pairs.filter(|(_, pair)| pair[0].iteration != pair[1].iteration).map(|(i, _)| i as f64 + 0.5).collect()
}

fn parameter(data: &RunProgress, index: usize, ends: &[f64]) -> Panel {
    let Parameter { name, unit, truth, intervals } = &data.parameters[index];
    let generations: Vec<Vec<&Individual>> = by_generation(&data.individuals);
    let mut shades: Vec<Vec<(f64, f64)>> = vec![Vec::new(); SHADES];
    let mut best = Vec::new();
    for (x, population) in generations.iter().enumerate() {
        // From the worst to the best, so that dark dots lie on top within a generation.
        for (rank, individual) in population.iter().enumerate() {
            let shade = rank * (SHADES - 1) / (population.len() - 1).max(1);
            shades[shade].push((x as f64, individual.values[index]));
        }
        let values = population.iter().map(|individual| individual.values[index]);
        let (mean, first) = (values.clone().sum::<f64>() / population.len() as f64, values.clone().next());
        best.extend(if data.drawn { Some((x as f64, mean)) } else { first.map(|value| (x as f64, value)) });
    }
    let mut series: Vec<Series> = Vec::new();
    for (shade, points) in shades.into_iter().enumerate().rev() {
        series.push(Series::nameless(Ink::Shade(shade as f64 / (SHADES - 1) as f64), Mark::Dots, points));
    }
    series.push(Series::new(if data.drawn { "estimate" } else { "best" }, Ink::Main, Mark::Line, best));
    if !intervals.is_empty() {
        let end = |k: usize| intervals.iter().map(|(generation, ends)| (*generation as f64, ends[k])).collect();
        series.push(Series::new("95 %", Ink::Third, Mark::Line, end(0)));
        series.push(Series::nameless(Ink::Third, Mark::Line, end(1)));
    }
    if let Some(truth) = truth {
        let last = generations.len().saturating_sub(1) as f64;
        series.push(Series::new("reality", Ink::Second, Mark::Dashes, vec![(0.0, *truth), (last, *truth)]));
    }
    let y_label = if unit == "1" { String::new() } else { unit.clone() };
    Panel {
        title: name.clone(),
        x_label: "generation".into(),
        y_label,
        series,
        marks_x: ends.to_vec(),
        ..Panel::default()
    }
}

/// The individuals of each generation, smallest phi first; those without a phi last.
fn by_generation(individuals: &[Individual]) -> Vec<Vec<&Individual>> {
    let count = individuals.iter().map(|i| i.generation + 1).max().unwrap_or(0);
    let mut generations: Vec<Vec<&Individual>> = vec![Vec::new(); count];
    for individual in individuals {
        generations[individual.generation].push(individual);
    }
    for population in &mut generations {
        population.sort_by(|a, b| a.phi.total_cmp(&b.phi));
    }
    generations
}

/// One joint over time.
#[derive(Clone, Debug)]
pub(crate) struct Tracking {
    /// The joint's name.
    pub(crate) joint: String,
    /// Of its positions.
    pub(crate) unit: String,
    /// In s.
    pub(crate) time_s: Vec<f64>,
    /// Its commands.
    pub(crate) reference: Vec<f64>,
    /// Its positions in reality.
    pub(crate) real: Vec<f64>,
    /// Its positions in the initial simulation.
    pub(crate) before: Vec<f64>,
    /// Its positions in the adapted simulation.
    pub(crate) after: Vec<f64>,
}

/// Reference, reality and simulation of each joint, before the search for simulations and after, in pairs; below each
/// pair the difference of reality and simulation, which shows where curves cover each other.
pub(crate) fn following(joints: &[Tracking]) -> Vec<Panel> {
    let of = |joint: &Tracking| {
        [joint.followed("before", &joint.before), joint.followed("after", &joint.after)]
            .into_iter()
            .chain([joint.missed("before", &joint.before), joint.missed("after", &joint.after)])
            .collect::<Vec<_>>()
    };
    joints.iter().flat_map(of).collect()
}

impl Tracking {
    fn followed(&self, when: &str, simulated: &[f64]) -> Panel {
        Panel {
            series: vec![
                Series::new("reference", Ink::Truth, Mark::Dashes, self.curve(&self.reference)),
                Series::new("real", Ink::Second, Mark::Line, self.curve(&self.real)),
                Series::new("simulated", Ink::Main, Mark::Line, self.curve(simulated)),
            ],
            show_y: self.before.iter().chain(&self.after).copied().collect(),
            ..self.panel(&format!("{}, {when}", self.joint), "position")
        }
    }

    fn missed(&self, when: &str, simulated: &[f64]) -> Panel {
        let errors = |simulated: &[f64]| self.real.iter().zip(simulated).map(|(a, b)| a - b).collect::<Vec<f64>>();
        Panel {
            series: vec![Series::nameless(Ink::Main, Mark::Line, self.curve(&errors(simulated)))],
            show_y: errors(&self.before).into_iter().chain(errors(&self.after)).collect(),
            ..self.panel(&format!("{}, real − simulated {when}", self.joint), "difference")
        }
    }

    fn panel(&self, title: &str, quantity: &str) -> Panel {
        let (title, y_label) = (title.to_owned(), format!("{quantity} ({})", self.unit));
        Panel { title, x_label: "time (s)".into(), y_label, over_log: Some(0), ..Panel::default() }
    }

    fn curve(&self, values: &[f64]) -> Vec<(f64, f64)> {
        self.time_s.iter().copied().zip(values.iter().copied()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_of_each_generation_is_the_one_with_the_smallest_phi() {
        let individual = |generation, phi, value| Individual { generation, phi, values: vec![value] };
        let individuals = vec![
            individual(0, 0.5, 1.0),
            individual(0, f64::NAN, 2.0),
            individual(1, 0.2, 3.0),
            individual(0, 0.1, 4.0),
        ];
        let parameters =
            vec![Parameter { name: "mass".into(), unit: "kg".into(), truth: Some(5.0), intervals: vec![] }];
        let (fitness, phi) = (Vec::new(), Vec::new());
        let (fitness_label, phi_label) = (String::new(), String::new());
        let mut data = RunProgress { fitness, fitness_label, phi, phi_label, parameters, individuals, drawn: false };
        let panel = parameter(&data, 0, &[]);
        let named =
            |name: &str| panel.series.iter().find(|s| s.name.as_deref() == Some(name)).map(|s| s.points.clone());
        assert_eq!(named("best"), Some(vec![(0.0, 4.0), (1.0, 3.0)]));
        assert_eq!(named("reality"), Some(vec![(0.0, 5.0), (1.0, 5.0)]));
        let darkest = panel.series.iter().find(|s| s.ink == Ink::Shade(0.0)).map(|s| s.points.clone());
        assert_eq!(darkest, Some(vec![(0.0, 4.0), (1.0, 3.0)]));
        // Samples of a posterior show its mean.
        data.drawn = true;
        let panel = parameter(&data, 0, &[]);
        let line = panel.series.iter().find(|s| s.name.as_deref() == Some("estimate")).map(|s| s.points.clone());
        assert_eq!(line, Some(vec![(0.0, 7.0 / 3.0), (1.0, 3.0)]));
    }

    #[test]
    fn what_curves_hide_is_drawn_below_them() {
        let (reference, real) = (vec![0.0; 3], vec![0.0, 1.0, 0.0]);
        let (before, after) = (vec![0.0; 3], vec![0.0, 0.999, 0.0]);
        let (joint, unit, time_s) = ("hip".to_owned(), "rad".to_owned(), vec![0.0, 0.1, 0.2]);
        let panels = following(&[Tracking { joint, unit, time_s, reference, real, before, after }]);
        assert_eq!(panels.len(), 4);
        let error = |panel: &Panel| panel.series[0].points[1].1;
        assert!((error(&panels[2]) - 1.0).abs() < 1e-12 && (error(&panels[3]) - 0.001).abs() < 1e-12);
        assert_eq!(panels[2].show_y, panels[3].show_y, "on one scale");
    }

    #[test]
    fn iterations_end_between_generations() {
        let generation = |iteration| GenerationTrace { iteration, best: 0.0, mean: 0.0 };
        assert_eq!(ends(&[1, 1, 2, 2, 3].map(generation)), [1.5, 3.5]);
    }
}

//! What came out of a diagnosis, and the tables over many.

use btr_identify::diagnose::thresholds::TIE;
use btr_identify::diagnose::{Diagnosis, Verdict};
use btr_identify::fit::{ComparisonMeasure, FitPoint, Objective, SearchBudget};
use btr_lab::identification::IdentificationProblem;
use btr_physics::effects::{PlacedEffect, find};

/// An effect that is there.
pub(crate) struct Planted {
    pub effect: String,
    pub site: String,
    /// Free parameters and their coordinates.
    pub coordinates: Vec<(usize, f64)>,
    /// The same by name, in SI units.
    pub values: Vec<(String, f64)>,
}

impl Planted {
    /// The effect itself.
    pub(crate) fn placed(&self, bare: &IdentificationProblem) -> Vec<PlacedEffect> {
        let mut u = vec![0.0; bare.parameters().len()];
        self.coordinates.iter().for_each(|(parameter, x)| u[*parameter] = *x);
        bare.placed(&u)
    }
}

/// A reality beside the model.
pub(crate) struct Case {
    pub name: String,
    pub seed: u64,
    pub planted: Vec<Planted>,
    /// Whether something is there that no effect of the library is.
    pub outside: bool,
    pub model: IdentificationProblem,
}

impl Case {
    /// What is hidden in it.
    pub(crate) fn describe(&self) -> String {
        let values = self.planted.iter().flat_map(|p| &p.values).map(|(name, x)| format!("{name} = {x:.4}"));
        values.collect::<Vec<_>>().join(", ")
    }
}

/// What was said about it.
pub(crate) struct Outcome {
    case: String,
    seed: u64,
    truth: Vec<String>,
    found: Vec<String>,
    verdict: Option<Verdict>,
    score: Score,
    before: f64,
    after: f64,
    /// What the error looks like where nothing explains it.
    law: String,
    /// Parameters of the planted effects with an interval, and those whose interval does not hold the truth.
    intervals: (usize, Vec<String>),
    rollouts: usize,
    seconds: f64,
}

/// Once the free parameters are fitted, an error below this is no evidence of anything.
const VISIBLE: f64 = 1.1;

/// How good that is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Score {
    /// Exactly what is there.
    Exact,
    /// A declared like of what is there, to which the criterion does not prefer that even when it is fitted from where
    /// it really is.
    Twin,
    /// What is there or what is declared to be its like.
    Equivalent,
    /// What is there, and something else.
    Extra,
    /// Some of what is there, and nothing that is not.
    Part,
    /// Some of what is there; of the rest there is nothing to be seen, as the free parameters make up for it.
    Rest,
    /// Nothing named, and nothing to be seen: the free parameters make up for it.
    Absorbed,
    /// Nothing named.
    Silent,
    /// Something that is not there, named as the explanation.
    Wrong,
    /// Rightly called unexplained.
    Unexplained,
}

impl Outcome {
    pub(crate) fn new(case: &Case, objective: &Objective, diagnosis: Option<Diagnosis>, seconds: f64) -> Self {
        let truth: Vec<String> = case.planted.iter().map(|p| format!("{}@{}", p.effect, p.site)).collect();
        let Some(diagnosis) = diagnosis else {
            let score = Score::Silent;
            let (found, nan) = (Vec::new(), f64::NAN);
            return Outcome {
                case: case.name.clone(),
                seed: case.seed,
                truth,
                found,
                verdict: None,
                law: String::new(),
                score,
                before: nan,
                after: nan,
                intervals: (0, Vec::new()),
                rollouts: 0,
                seconds,
            };
        };
        let found: Vec<String> = diagnosis.effects.iter().map(|f| format!("{}@{}", f.effect, f.site)).collect();
        let error = |step: Option<&btr_identify::LadderStep>| step.map_or(f64::NAN, |r| r.held_out.unwrap_or(r.train));
        let before = error(diagnosis.ladder.get(1).or(diagnosis.ladder.first()));
        let score = match score(case, objective, &truth, &found, &diagnosis) {
            Score::Silent if before < VISIBLE => Score::Absorbed,
            Score::Part if error(diagnosis.ladder.last()) < VISIBLE => Score::Rest,
            score => score,
        };
        Outcome {
            law: law(case, &diagnosis),
            score,
            before,
            intervals: intervals(case, &diagnosis),
            after: error(diagnosis.ladder.last()),
            verdict: Some(diagnosis.verdict),
            rollouts: diagnosis.rollouts,
            case: case.name.clone(),
            seed: case.seed,
            truth,
            found,
            seconds,
        }
    }

    /// One line.
    pub(crate) fn line(&self) -> String {
        format!(
            "{:<11} {:>5} {:<44} -> {:<60} {:6.2} -> {:5.2} sigma {:5} rollouts {:5.1} s{}",
            format!("{:?}", self.score).to_lowercase(),
            self.seed,
            if self.truth.is_empty() { self.case.clone() } else { self.truth.join(" + ") },
            if self.found.is_empty() { format!("{:?}", self.verdict) } else { self.found.join(" + ") },
            self.before,
            self.after,
            self.rollouts,
            self.seconds,
            self.law
        ) + &self.intervals.1.iter().map(|missed| format!("\n            {missed}")).collect::<String>()
    }
}

fn law(case: &Case, diagnosis: &Diagnosis) -> String {
    let Some(found) = &diagnosis.residual_law else { return String::new() };
    let Some((site, on, law)) = case.model.law(found) else { return String::new() };
    let explains = 100.0 * found.explains;
    let problem = if found.beside_effects { " beside those" } else { "" };
    format!("\n            law: {on:?} on {site}: {law}{problem}, explains {explains:.1} %")
}

fn score(case: &Case, objective: &Objective, truth: &[String], found: &[String], diagnosis: &Diagnosis) -> Score {
    if case.outside {
        return if admits(diagnosis) { Score::Unexplained } else { Score::Wrong };
    }
    let here = found.iter().filter(|f| truth.contains(f)).count();
    if here == truth.len() && found.len() == truth.len() {
        return if truth.is_empty() && diagnosis.verdict == Verdict::Unexplained { Score::Wrong } else { Score::Exact };
    }
    if found.is_empty() {
        return Score::Silent;
    }
    if here == truth.len() {
        return Score::Extra;
    }
    let like = |t: &String| {
        let named = |f: &str| {
            f == t
                || diagnosis
                    .effects
                    .iter()
                    .any(|e| e.alike.contains(t) || (format!("{}@{}", e.effect, e.site) == f && are_alike(f, t)))
        };
        found.iter().any(|f| named(f))
    };
    if here == found.len() {
        return Score::Part;
    }
    if truth.iter().all(like) && found.len() <= truth.len() {
        return if is_twin(case, objective, diagnosis) { Score::Twin } else { Score::Equivalent };
    }
    if admits(diagnosis) { Score::Unexplained } else { Score::Wrong }
}

/// Whether the diagnosis says that something is left that it does not explain.
fn admits(diagnosis: &Diagnosis) -> bool {
    matches!(diagnosis.verdict, Verdict::Unexplained | Verdict::PartlyExplained)
}

/// Whether the criterion does not prefer what is there to what was named, when that is fitted from where it really is.
fn is_twin(case: &Case, objective: &Objective, diagnosis: &Diagnosis) -> bool {
    let named = &diagnosis.fit;
    let mut u = named.u.clone();
    diagnosis
        .effects
        .iter()
        .flat_map(|e| case.model.candidates()[e.candidate].parameters())
        .for_each(|parameter| u[parameter] = 0.0);
    let planted: Vec<(usize, f64)> = case.planted.iter().flat_map(|p| p.coordinates.clone()).collect();
    planted.iter().for_each(|(parameter, x)| u[*parameter] = *x);
    let active = case.model.free().iter().copied().chain(planted.iter().map(|(parameter, _)| *parameter)).collect();
    let Ok(mut there) = FitPoint::at(objective, active, u, &named.step_error) else { return false };
    there.solve(objective, SearchBudget::FULL);
    let measure = ComparisonMeasure::of(objective, named);
    measure.criterion(&there) > measure.criterion(named) - TIE
}

/// Whether two effects are said to look alike and sit at the same place, as far as their places can be compared.
fn are_alike(a: &str, b: &str) -> bool {
    let (Some((a, here)), Some((b, there))) = (a.split_once('@'), b.split_once('@')) else { return false };
    let (Some(a), Some(b)) = (find(a).map(|e| e.spec()), find(b).map(|e| e.spec())) else { return false };
    let near = here == there || std::mem::discriminant(&a.site) != std::mem::discriminant(&b.site);
    near && (a.similar.contains(&b.name) || b.similar.contains(&a.name))
}

/// The intervals of what was planted, and those of them that miss the truth.
fn intervals(case: &Case, diagnosis: &Diagnosis) -> (usize, Vec<String>) {
    let (mut offered, mut missed) = (0, Vec::new());
    for (name, truth) in case.planted.iter().flat_map(|p| &p.values) {
        let estimates = diagnosis.effects.iter().flat_map(|f| &f.parameters);
        for [low, high] in estimates.filter(|e| e.name == *name).filter_map(|e| e.ci95) {
            offered += 1;
            if *truth < low || *truth > high {
                missed.push(format!("{name} = {truth:.5} is not in {low:.5} .. {high:.5}"));
            }
        }
    }
    (offered, missed)
}

/// Counts and medians.
pub(crate) fn summary(outcomes: &[Outcome]) -> String {
    let shows = |o: &&Outcome| !matches!(o.score, Score::Absorbed | Score::Rest);
    let seen: Vec<&Outcome> = outcomes.iter().filter(shows).collect();
    let n = seen.len();
    let mut text = format!("\n{} cases, {n} of them visible", outcomes.len());
    let named = |score: Score| outcomes.iter().filter(|o| o.score == score).count();
    for score in [
        Score::Exact,
        Score::Twin,
        Score::Equivalent,
        Score::Extra,
        Score::Part,
        Score::Rest,
        Score::Silent,
        Score::Absorbed,
        Score::Unexplained,
        Score::Wrong,
    ] {
        let count = named(score);
        if count > 0 {
            text += &format!(
                "\n  {:<12} {count:4}  {:5.1} %",
                format!("{score:?}").to_lowercase(),
                100.0 * count as f64 / n as f64
            );
        }
    }
    let twins = named(Score::Twin);
    if twins > 0 {
        let share = 100.0 * named(Score::Exact) as f64 / (n - twins).max(1) as f64;
        text += &format!("\nexact where the criterion would prefer what is there to what was named: {share:.1} %");
    }
    let median = |of: &dyn Fn(&Outcome) -> f64| {
        let mut values: Vec<f64> = seen.iter().map(|o| of(o)).collect();
        values.sort_by(f64::total_cmp);
        values.get(n / 2).copied().unwrap_or(f64::NAN)
    };
    let most = outcomes.iter().map(|o| o.rollouts).max().unwrap_or(0);
    let (offered, held) =
        outcomes.iter().fold((0, 0), |(a, b), o| (a + o.intervals.0, b + o.intervals.0 - o.intervals.1.len()));
    text += &format!(
        "\nheld-out error, median: {:.2} -> {:.3} sigma\nrollouts: median {:.0}, most {most}\nseconds: median {:.1}\n95 % intervals that hold the truth: {held} of {offered}",
        median(&|o| o.before),
        median(&|o| o.after),
        median(&|o| o.rollouts as f64),
        median(&|o| o.seconds)
    );
    text
}

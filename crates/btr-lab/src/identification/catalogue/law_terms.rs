//! Terms of laws for errors that no known effect explains, as formulas.

use crate::scales::RobotScales;
use btr_identify::residual_model::{FitParameter, Parametrisation};
use btr_physics::effects::{Effect, FormulaError, FormulaTarget, formula};

/// Bound and spread of a shape without prior knowledge.
const ANYWHERE: f64 = 1e4;
/// Reach of differences.
const REACH: f64 = 0.1;
/// Bound of an amplitude in typical sizes, and spread of its weak prior.
const MOST: f64 = 50.0;
const WEAK: f64 = 33.0;
/// Share of a joint's usual speed below which the smoothed sign is below one.
const SMOOTH: f64 = 0.01;
/// The usual speed of the robot to which scales refer, in rad/s.
const SPEED: f64 = 3.0;
/// Amplitudes of a term below this share of its largest are left out of the text.
const SEEN: f64 = 0.03;

/// Shape parameter of a term: `s` in its factors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum TermShape {
    /// A rate in rad/s, whose start comes from the error.
    Rate,
    /// An order, as of cogging.
    Order,
    /// A position beyond which the term acts.
    Threshold([f64; 2]),
}

/// A sum of factors, each with an amplitude.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TermDefinition {
    /// The quantity that it changes.
    pub on: FormulaTarget,
    /// Expressions in the variables of formulas and in `s`.
    factors: Vec<String>,
    /// The kind of `s`.
    pub shape: Option<TermShape>,
    /// Unit and typical size of its amplitudes.
    unit: &'static str,
    size: f64,
    /// For oscillating terms: the index of the steady term among the terms of the same joint.
    pub swings: Option<usize>,
}

/// The context of a joint's terms.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TermContext {
    /// Least and greatest position in the logs.
    pub q: (f64, f64),
    /// Length of the longest log in s.
    pub duration_s: f64,
    /// Whether the joint has a servo, so that commands and readings can be wrong.
    pub servo: bool,
    /// Whether laws may refer to a joint before it in the chain, and to one after it.
    pub parent: bool,
    pub child: bool,
}

impl TermDefinition {
    fn new(on: FormulaTarget, factor: &str, unit: &'static str, size: f64) -> Self {
        TermDefinition { on, factors: vec![factor.to_owned()], shape: None, unit, size, swings: None }
    }

    /// Sine and cosine of `s` times the variable `of`, times `factor`.
    fn pair(on: FormulaTarget, (factor, of): (&str, &str), shape: TermShape, unit: &'static str, size: f64) -> Self {
        let prefix = if factor == "1" { String::new() } else { format!("{factor}*") };
        let factors = ["sin", "cos"].iter().map(|f| format!("{prefix}{f}(s*{of})")).collect();
        TermDefinition { factors, shape: Some(shape), ..TermDefinition::new(on, factor, unit, size) }
    }

    /// Zero below a position and growing beyond it.
    fn hinge(factor: &str, start: [f64; 2], unit: &'static str, size: f64) -> Self {
        TermDefinition {
            shape: Some(TermShape::Threshold(start)),
            ..TermDefinition::new(FormulaTarget::Torque, factor, unit, size)
        }
    }

    /// The names of its parameters, amplitudes first.
    pub(crate) fn names(&self) -> Vec<&'static str> {
        ["a", "b"].into_iter().take(self.amplitudes()).chain(self.shape.map(|_| "s")).collect()
    }

    /// Number of amplitudes.
    pub(crate) fn amplitudes(&self) -> usize {
        self.factors.len()
    }

    /// The formula with free parameters.
    pub(crate) fn formula(&self) -> Result<&'static dyn Effect, FormulaError> {
        let names = self.names();
        let sum: Vec<String> = self.factors.iter().zip(&names).map(|(f, name)| format!("{name}*{f}")).collect();
        formula(self.on, &format!("{}{}", base(self.on, " + "), sum.join(" + ")), &names)
    }

    /// Its free parameters, in the order of its names.
    pub(crate) fn parameters(&self, joint: &str, scales: &RobotScales, context: &TermContext) -> Vec<FitParameter> {
        let parameter = |name: &str, unit: &str, (origin, size): (f64, f64), bounds, spread| FitParameter {
            name: format!("formula.{name}@{joint}"),
            unit: unit.to_owned(),
            origin,
            size,
            law: Parametrisation::Linear,
            bounds,
            spread,
            known: None,
            reach: REACH,
            amplitude: name != "s",
        };
        let size = self.size * scales.of_unit(self.unit, joint);
        let amplitude = |name: &&str| parameter(name, self.unit, (0.0, size), (-MOST, MOST), WEAK);
        let shape = self.shape.map(|shape| match shape {
            // An error of one size in the rate is an error of one radian at the end of the log.
            TermShape::Rate => parameter("s", "rad/s", (0.0, 1.0 / context.duration_s), (0.0, ANYWHERE), ANYWHERE),
            TermShape::Order => parameter("s", "1", (0.0, 1.0), (0.1, 40.0), ANYWHERE),
            TermShape::Threshold([start, _]) => {
                let range = (context.q.1 - context.q.0).max(f64::MIN_POSITIVE);
                parameter("s", "rad", (start, range), (-1.0, 1.0), ANYWHERE)
            }
        });
        self.names().iter().take(self.amplitudes()).map(amplitude).chain(shape).collect()
    }

    /// Initial values of its shape; none for rates, and one empty start without a shape.
    pub(crate) fn starts(&self) -> Vec<Vec<f64>> {
        match self.shape {
            None => vec![vec![]],
            Some(TermShape::Rate) => vec![],
            Some(TermShape::Order) => [1.0, 2.0, 4.0].map(|order| vec![order]).to_vec(),
            Some(TermShape::Threshold(starts)) => starts.map(|start| vec![start]).to_vec(),
        }
    }

    /// The term with these values, each part with its sign: ` - 0.31*sin(19*t)`.
    pub(crate) fn text(&self, values: &[f64]) -> String {
        let (amplitudes, shape) = values.split_at(self.amplitudes().min(values.len()));
        let largest = amplitudes.iter().fold(0.0, |most: f64, a| most.max(a.abs()));
        let seen = self.factors.iter().zip(amplitudes).filter(|(_, a)| a.abs() > SEEN * largest);
        seen.map(|(factor, a)| {
            let sign = if *a < 0.0 { '-' } else { '+' };
            let size = rounded(a.abs(), 2);
            match factor.as_str() {
                "1" => format!(" {sign} {size}"),
                _ => format!(" {sign} {size}*{}", substituted(factor, shape)),
            }
        })
        .collect()
    }
}

/// The text of a law: the terms with their values.
pub(crate) fn law(on: FormulaTarget, terms: &[(&TermDefinition, Vec<f64>)]) -> String {
    let sum: String = terms.iter().map(|(term, values)| term.text(values)).collect();
    let whole = format!("{}{sum}", base(on, ""));
    whole
        .strip_prefix(" - ")
        .map(|rest| format!("-{rest}"))
        .unwrap_or_else(|| whole.trim_start_matches(" + ").to_owned())
}

/// Base of a law: a command or a reading is changed, a torque is added.
fn base(on: FormulaTarget, joined: &str) -> String {
    match on {
        FormulaTarget::Torque => String::new(),
        FormulaTarget::Command => format!("cmd{joined}"),
        FormulaTarget::Reading => format!("q{joined}"),
    }
}

/// A factor with the value of its shape substituted for `s`.
fn substituted(factor: &str, shape: &[f64]) -> String {
    let Some(value) = shape.first() else { return factor.to_owned() };
    let number = if *value < 0.0 { format!("({})", rounded(*value, 4)) } else { rounded(*value, 4) };
    let characters: Vec<char> = factor.chars().collect();
    let letter = |i: Option<usize>| i.and_then(|i| characters.get(i)).is_some_and(|c| c.is_alphanumeric());
    let alone = |i: usize| characters[i] == 's' && !letter(i.checked_sub(1)) && !letter(Some(i + 1));
    (0..characters.len()).map(|i| if alone(i) { number.clone() } else { characters[i].to_string() }).collect()
}

/// Rounds to this many digits after the first.
fn rounded(x: f64, digits: usize) -> String {
    format!("{x:.digits$e}").parse::<f64>().map_or_else(|_| x.to_string(), |x| x.to_string())
}

/// All terms of a joint, grouped by the quantity that they change.
pub(crate) fn terms(joint: &str, scales: &RobotScales, context: &TermContext) -> Vec<TermDefinition> {
    let speed = SPEED * scales.of_unit("rad/s", joint);
    let sign = format!("tanh(dq/{})", rounded(SMOOTH * speed, 1));
    let mut all = torques(&sign, context);
    if context.servo {
        place(&mut all, commands(context));
        place(&mut all, readings(context));
    }
    all
}

/// Appends a group of terms and shifts its indices.
fn place(all: &mut Vec<TermDefinition>, terms: Vec<TermDefinition>) {
    let start = all.len();
    all.extend(terms.into_iter().map(|term| TermDefinition { swings: term.swings.map(|i| start + i), ..term }));
}

/// Oscillating versions of the first `count` steady terms.
fn swings(steady: &[TermDefinition], count: usize) -> Vec<TermDefinition> {
    let swing = |(i, term): (usize, &TermDefinition)| TermDefinition {
        swings: Some(i),
        ..TermDefinition::pair(term.on, (&term.factors[0], "t"), TermShape::Rate, term.unit, term.size)
    };
    steady.iter().enumerate().take(count).map(swing).collect()
}

fn torques(sign: &str, context: &TermContext) -> Vec<TermDefinition> {
    let torque = |factor: &str, unit, size| TermDefinition::new(FormulaTarget::Torque, factor, unit, size);
    let per_s = 1.0 / context.duration_s;
    let (low, range) = (context.q.0, context.q.1 - context.q.0);
    let (above, below) = ([0.5, 0.75].map(|x| low + x * range), [0.5, 0.25].map(|x| -(low + x * range)));
    let mut all = vec![
        torque("1", "N·m", 0.1),
        torque(sign, "N·m", 0.1),
        torque("dq", "N·m·s/rad", 0.05),
        torque("q", "N·m/rad", 0.3),
        torque("dq*abs(dq)", "N·m·s²/rad²", 0.03),
        torque("q*q", "N·m/rad", 0.3),
        torque("dq*max(0,q)", "N·m·s/rad", 0.1),
        torque("dq*max(0,-q)", "N·m·s/rad", 0.1),
        torque(&format!("abs(tau)*{sign}"), "1", 0.1),
        torque("ddq", "kg·m²", 0.003),
        torque("t", "N·m", 0.1 * per_s),
        torque(&format!("t*{sign}"), "N·m", 0.1 * per_s),
        torque("t*dq", "N·m·s/rad", 0.05 * per_s),
        TermDefinition::pair(FormulaTarget::Torque, ("1", "q"), TermShape::Order, "N·m", 0.1),
        TermDefinition::pair(FormulaTarget::Torque, ("t", "q"), TermShape::Order, "N·m", 0.1 * per_s),
        TermDefinition::hinge("max(0,q-s)", above, "N·m/rad", 0.5),
        TermDefinition::hinge("max(0,-q-s)", below, "N·m/rad", 0.5),
        TermDefinition::hinge("max(0,q-s)^2", above, "N·m/rad", 1.0),
        TermDefinition::hinge("max(0,-q-s)^2", below, "N·m/rad", 1.0),
    ];
    all.extend(swings(&all, 4));
    let neighbour = [("q", "N·m/rad", 0.3), ("dq", "N·m·s/rad", 0.05), ("tau", "1", 0.1)];
    all.extend(of_neighbours(FormulaTarget::Torque, &neighbour, context));
    // Motors that share a transmission rub where both turn; where a servo moves the joint, its command hides that.
    for side in sides(context).filter(|_| !context.servo) {
        let of = |speed: &str| torque(&sign.replace("dq", speed), "N·m", 0.1);
        all.extend([of(&format!("dq_{side}")), of(&format!("(dq+dq_{side})")), of(&format!("(dq-dq_{side})"))]);
    }
    all
}

fn commands(context: &TermContext) -> Vec<TermDefinition> {
    let command = |factor: &str, unit, size| TermDefinition::new(FormulaTarget::Command, factor, unit, size);
    let per_s = 1.0 / context.duration_s;
    let mut all = vec![
        command("1", "rad", 0.02),
        command("cmd", "1", 0.03),
        command("dq", "s", 0.01),
        command("tau", "1/(N·m)", 0.01),
        command("t", "rad", 0.02 * per_s),
        command("t*cmd", "1", 0.03 * per_s),
    ];
    all.extend(swings(&all, 2));
    // A belt that runs past the joint takes its servo along with the neighbour.
    all.extend(of_neighbours(FormulaTarget::Command, &[("q", "1", 0.03)], context));
    all
}

/// Terms in quantities of the neighbouring joints, each with the unit and size of its amplitude.
fn of_neighbours(
    on: FormulaTarget,
    quantities: &[(&str, &'static str, f64)],
    context: &TermContext,
) -> Vec<TermDefinition> {
    let term = |side| {
        quantities.iter().map(move |&(of, unit, size)| TermDefinition::new(on, &format!("{of}_{side}"), unit, size))
    };
    sides(context).flat_map(term).collect()
}

/// Which neighbours a joint has.
fn sides(context: &TermContext) -> impl Iterator<Item = &'static str> {
    let sides = [("parent", context.parent), ("child", context.child)].into_iter();
    sides.filter(|(_, present)| *present).map(|(side, _)| side)
}

fn readings(context: &TermContext) -> Vec<TermDefinition> {
    let reading = |factor: &str, unit, size| TermDefinition::new(FormulaTarget::Reading, factor, unit, size);
    let mut all = vec![
        reading("1", "rad", 0.02),
        reading("q", "1", 0.03),
        reading("q*q", "1/rad", 0.03),
        reading("t", "rad", 0.02 / context.duration_s),
        TermDefinition::pair(FormulaTarget::Reading, ("1", "q"), TermShape::Order, "rad", 0.02),
    ];
    all.extend(swings(&all, 1));
    all
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_text_of_a_law_is_a_plain_formula() {
        let swing = TermDefinition::pair(FormulaTarget::Torque, ("1", "t"), TermShape::Rate, "N·m", 1.0);
        let drag = TermDefinition::new(FormulaTarget::Torque, "dq*abs(dq)", "N·m·s²/rad²", 1.0);
        assert_eq!(law(FormulaTarget::Torque, &[(&swing, vec![-0.3104, 0.001, 19.0])]), "-0.31*sin(19*t)");
        let both = [(&swing, vec![0.5, -0.25, 19.0]), (&drag, vec![-0.2])];
        assert_eq!(law(FormulaTarget::Torque, &both), "0.5*sin(19*t) - 0.25*cos(19*t) - 0.2*dq*abs(dq)");
        let hinge = TermDefinition::hinge("max(0,q-s)^2", [0.0, 0.1], "N·m/rad", 1.0);
        assert_eq!(law(FormulaTarget::Torque, &[(&hinge, vec![-8.0, -0.2])]), "-8*max(0,q-(-0.2))^2");
        let offset = TermDefinition::new(FormulaTarget::Reading, "1", "rad", 1.0);
        assert_eq!(law(FormulaTarget::Reading, &[(&offset, vec![-0.05])]), "q - 0.05");
    }

    #[test]
    fn every_term_and_its_text_are_formulas() {
        let context = TermContext { q: (-0.8, 1.1), duration_s: 4.0, servo: true, parent: true, child: true };
        let scales = RobotScales::guess(&btr_physics::presets::pendulum::pendulum(
            1.0,
            0.5,
            btr_physics::robot::Actuator::Passive,
        ));
        for term in terms("hinge", &scales, &context) {
            let effect = term.formula().unwrap();
            assert_eq!(effect.spec().params.len(), term.parameters("hinge", &scales, &context).len());
            let values: Vec<f64> = term.names().iter().map(|_| -0.25).collect();
            formula(term.on, &law(term.on, &[(&term, values)]), &[]).unwrap();
        }
    }
}

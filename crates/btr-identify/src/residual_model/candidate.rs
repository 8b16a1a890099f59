//! What may be wrong with a model: effects that it lacks and values that it states; and the terms of laws.

/// What a candidate would change in the model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CandidateKind {
    /// It adds an effect.
    #[default]
    Effect,
    /// It corrects a value that the model states.
    Value,
}

/// Shapes that are the order and the phase of a ripple in a position: their starts come from the error as well.
#[derive(Clone, Debug, PartialEq)]
pub struct Ripple {
    /// Which of the candidate's shapes is the order.
    pub order: usize,
    /// Which of them is the phase, in rad.
    pub phase: usize,
    /// The channel of the position.
    pub channel: String,
}

/// What must have been found before a candidate is tried.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Needs {
    /// Nothing.
    Nothing,
    /// One of these candidates, whose action it only changes: it is their companion.
    OneOf(Vec<usize>),
    /// This candidate, of which it is a further instance.
    Instance(usize),
}

/// An effect that the model may lack at a site, or a value that it may state wrongly.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectCandidate {
    /// What it would change.
    pub kind: CandidateKind,
    /// The effect, or the value: a quantity of the robot, or an effect that the model has.
    pub effect: String,
    /// Where it sits.
    pub site: String,
    /// Its amplitudes: off at 0.
    pub amplitudes: Vec<usize>,
    /// Its other parameters.
    pub shapes: Vec<usize>,
    /// Start coordinates of the shapes: for each start, one per shape. At least one start, perhaps empty.
    pub starts: Vec<Vec<f64>>,
    /// The order among its shapes, if there is one.
    pub ripple: Option<Ripple>,
    /// Similar candidates at the same site, as indices.
    pub similar: Vec<usize>,
    /// Those of them that it equals at some values of its parameters.
    pub nested: Vec<usize>,
    /// What must have been found before.
    pub needs: Needs,
    /// Whether nearly every joint has it.
    pub is_usual: bool,
}

impl EffectCandidate {
    /// `effect@site`.
    pub fn name(&self) -> String {
        format!("{}@{}", self.effect, self.site)
    }

    /// The step of the error ladder that adds or corrects it.
    pub fn step(&self) -> String {
        match self.kind {
            CandidateKind::Effect => format!("+ {}", self.name()),
            CandidateKind::Value => format!("+ {}, corrected", self.name()),
        }
    }

    /// All its parameters.
    pub fn parameters(&self) -> impl Iterator<Item = usize> + '_ {
        self.amplitudes.iter().chain(&self.shapes).copied()
    }
}

/// A term of a law: tried where no effect explains the error.
#[derive(Clone, Debug, PartialEq)]
pub struct LawTerm {
    /// The quantity that it acts on at its site; all terms of a law act on the same one.
    pub on: String,
    /// Its parameters and site, as those of an effect.
    pub term: EffectCandidate,
    /// For a term that oscillates in time: the index of the same term without oscillation. Its only shape is the rate,
    /// without starts: these come from the error's spectrum.
    pub swings: Option<usize>,
    /// Names of the channels in which it shows, where the motion is prescribed; empty where it shows in all.
    pub channels: Vec<String>,
}

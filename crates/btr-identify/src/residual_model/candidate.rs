//! Effects that a model may lack, and the terms that laws are made of.

/// An effect at a site that the model may lack.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectCandidate {
    /// The effect.
    pub effect: String,
    /// Where it would sit.
    pub site: String,
    /// Its amplitudes: off at 0.
    pub amplitudes: Vec<usize>,
    /// Knobs that only shape it.
    pub shapes: Vec<usize>,
    /// Coordinates of the shapes from which it is worth trying, for each start one per shape. At least one, perhaps empty.
    pub starts: Vec<Vec<f64>>,
    /// Candidates at the same place that look alike, as indices.
    pub similar: Vec<usize>,
    /// Those of them that it becomes for some values of its numbers.
    pub nested: Vec<usize>,
}

impl EffectCandidate {
    /// `effect@site`.
    pub fn name(&self) -> String {
        format!("{}@{}", self.effect, self.site)
    }

    /// All its parameters.
    pub fn parameters(&self) -> impl Iterator<Item = usize> + '_ {
        self.amplitudes.iter().chain(&self.shapes).copied()
    }
}

/// A term that laws are made of: tried where no effect explains the error.
#[derive(Clone, Debug, PartialEq)]
pub struct LawTerm {
    /// What it acts on at its site; the terms of a law act on the same.
    pub on: String,
    /// Its parameters and site, as those of an effect.
    pub term: EffectCandidate,
    /// For a term that swings with time: the index of the same term without it. Its only shape is the rate, and has no
    /// starts: the error tells.
    pub swings: Option<usize>,
}

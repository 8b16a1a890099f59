//! Errors of an identification problem.

use crate::experiment::FileError;
use crate::model_text::AddError;
use crate::suggest::remedy;
use btr_core::text::{Mention, Text, Verb};
use btr_core::world::WorldError;
use btr_identify::quality::FEWEST_SAMPLES;

/// Why a model cannot be identified from logs.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ProblemError {
    /// The model file or a log is invalid.
    #[error(transparent)]
    File(#[from] FileError),
    /// The model cannot be simulated.
    #[error(transparent)]
    World(#[from] WorldError),
    /// An effect or a law cannot be added to the model.
    #[error(transparent)]
    Add(#[from] AddError),
    /// A pattern of parameters to freeze that matches none.
    #[error("`{pattern}` matches no free parameter of this model, so it freezes nothing")]
    FreezesNothing {
        /// The pattern.
        pattern: String,
        /// The names of the free parameters.
        known: Vec<String>,
    },
    /// A parameter to freeze that stands for several values of the model.
    #[error("`{0}` cannot be frozen: the model has no single value of it")]
    NoValueToFreeze(String),
    /// An effect of the model that a fit should begin with, which the fitted model lacks.
    #[error("{start} has `{effect}` with values of its own, and the model that is fitted lacks it")]
    StartHas {
        /// The model to begin with.
        start: String,
        /// `effect@site`.
        effect: String,
    },
    /// A model to begin with that states none of the parameters that are fitted.
    #[error("{0} states no value of any parameter that is fitted")]
    StartSaysNothing(String),
    /// Logs in which nothing moves.
    #[error("nothing moves in the training logs, so they contain no information about the model")]
    Still,
    /// Logs that are too short.
    #[error("the longest training log has {0} samples: too few for an estimate")]
    Short(usize),
    /// Logs without any measured position.
    #[error("no joint's position is measured in the training logs")]
    Blind,
    /// Base parameters of a robot of which some joint's motion is simulated.
    #[error("base parameters follow from torques that given motions require, and the motion of {} is simulated", .0.join(", "))]
    NotPrescribed(Vec<String>),
    /// Base parameters of a model of which a length is free.
    #[error("base parameters hold for links of given lengths, and `{0}` is a parameter")]
    FreeLength(String),
    /// Logs that have nothing in common with a simulation.
    #[error("no channel is both measured and simulated")]
    Nothing,
}

impl ProblemError {
    /// The remedy, for errors that do not come from a file.
    pub fn help(&self) -> Option<Text> {
        Some(match self {
            ProblemError::FreezesNothing { known, .. } if known.is_empty() => "the model has no free parameter".into(),
            ProblemError::FreezesNothing { pattern, known } => remedy(pattern, known.iter().map(String::as_str)),
            ProblemError::NoValueToFreeze(name) => {
                format!("give the value to keep: \"{name}\" = {{ value = ... }} in [parameters] of the model file")
                    .into()
            }
            ProblemError::StartHas { .. } => {
                Text::from("copy its [[effects]] section into the model, or ") + Mention::AddEffect
            }
            ProblemError::StartSaysNothing(_) => {
                "begin with a model that a diagnosis or a fit of this one wrote: it has the same names in [parameters]"
                    .into()
            }
            ProblemError::Still => {
                Text::from("record the joints while they are driven; ") + Verb::Check + " tells what is in a log"
            }
            ProblemError::NotPrescribed(_) => {
                "kind = \"prescribed\" under [actuators.\"*\"], and base = \"fixed\", compare torques instead".into()
            }
            ProblemError::FreeLength(_) => "fit lengths first, and state them in the robot's file".into(),
            ProblemError::Short(_) => {
                format!("record some seconds of motion, {FEWEST_SAMPLES} samples at the very least").into()
            }
            ProblemError::Nothing => {
                "the log needs a position q_<joint> for the model's joints; [channels] maps foreign names".into()
            }
            ProblemError::Blind => {
                "the logs need positions q_<joint>; [channels.channels] in the model file maps foreign names".into()
            }
            ProblemError::File(_) | ProblemError::World(_) | ProblemError::Add(_) => return None,
        })
    }
}

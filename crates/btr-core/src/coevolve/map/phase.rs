//! Settings of a map and their validation.

use super::descriptor::{self, DescriptorAxis};
use crate::search::MapElites;
use crate::search::map_elites::{Grid, Variation};
use crate::settings;
use crate::world::Simulator;
use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// An archive of diverse controllers, and how controllers are chosen from it for real tests (`method =
/// "quality_diversity"`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MapPhase {
    /// The axes of the map by descriptor, each with its least and its greatest value. A descriptor is a fitness term or
    /// a parameter of C; with a `*` for any characters it is the mean of the parameters that match.
    pub descriptors: IndexMap<String, [f64; 2]>,
    /// Cells along each axis; each keeps the fittest controller of its kind.
    #[serde(deserialize_with = "settings::at_least_one")]
    pub cells: usize,
    /// Generations of the search that fills the map.
    #[serde(deserialize_with = "settings::at_least_one")]
    pub generations: usize,
    /// Controllers per generation.
    #[serde(deserialize_with = "settings::at_least_one")]
    pub population: usize,
    /// Standard deviation of a mutation, as a share of each parameter's range.
    #[serde(deserialize_with = "settings::positive")]
    pub mutation: f64,
    /// Standard deviation of a step along the line to another controller of the map, as a share of the distance to it.
    #[serde(deserialize_with = "settings::not_negative")]
    pub line: f64,
    /// Length scale of the Gaussian process, where each axis of the map has length 1.
    #[serde(deserialize_with = "settings::positive")]
    pub length_scale: f64,
    /// Standard deviation of a real test's fitness over repetitions, as a share of the standard deviation between
    /// reality and the map.
    #[serde(deserialize_with = "settings::not_negative")]
    pub noise: f64,
    /// The next test is that of the controller with the largest predicted fitness plus this many standard deviations.
    #[serde(deserialize_with = "settings::not_negative")]
    pub explore: f64,
    /// The run is over once the best real fitness is at least this share of the largest predicted fitness.
    #[serde(deserialize_with = "settings::share")]
    pub enough: f64,
}

impl Default for MapPhase {
    fn default() -> Self {
        MapPhase {
            descriptors: IndexMap::new(),
            cells: 5,
            generations: 100,
            population: 200,
            mutation: 0.02,
            line: 0.2,
            length_scale: 0.4,
            noise: 0.03,
            explore: 0.5,
            enough: 0.9,
        }
    }
}

/// Error in the settings of a map.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MapError {
    /// A method that needs a map, without one.
    #[error("the method `quality_diversity` needs [coevolve.map]")]
    Missing,
    /// A map without axes.
    #[error("[coevolve.map] needs at least one descriptor")]
    NoDescriptors,
    /// An unknown axis.
    #[error("there is no descriptor `{name}`")]
    Unknown {
        /// The requested descriptor.
        name: String,
    },
    /// An axis without an extent.
    #[error("descriptor `{name}`: bounds [{least}, {most}] must be finite and least < most")]
    Bounds {
        /// The axis.
        name: String,
        /// Its lower end.
        least: f64,
        /// Its upper end.
        most: f64,
    },
    /// Too many cells.
    #[error("{cells} cells along each of {axes} axes are too many")]
    TooManyCells {
        /// Cells along each axis.
        cells: usize,
        /// Axes.
        axes: usize,
    },
    /// A posterior with a method whose simulation does not change.
    #[error("the method `quality_diversity` keeps its simulation and does not use [coevolve.posterior]")]
    Posterior,
}

impl MapPhase {
    /// Whether a map can be made of these settings.
    pub(in crate::coevolve) fn check(&self, simulator: &dyn Simulator) -> Result<(), MapError> {
        if self.descriptors.is_empty() {
            return Err(MapError::NoDescriptors);
        }
        for (name, &[least, most]) in &self.descriptors {
            if !(least.is_finite() && most.is_finite() && least < most) {
                return Err(MapError::Bounds { name: name.clone(), least, most });
            }
            if descriptor::axis(name, [least, most], simulator).is_none() {
                return Err(MapError::Unknown { name: name.clone() });
            }
        }
        let (cells, axes) = (self.cells, self.descriptors.len());
        Grid::new(axes, cells).map(|_| ()).ok_or(MapError::TooManyCells { cells, axes })
    }

    /// An empty map of controllers in `dims` dimensions.
    pub(in crate::coevolve) fn start(&self, dims: usize) -> Option<MapElites> {
        let variation = Variation { step: self.mutation, line: self.line };
        Some(MapElites::new(dims, Grid::new(self.descriptors.len(), self.cells)?, self.population, variation))
    }

    /// The axes, in their order.
    pub(in crate::coevolve) fn axes(&self, simulator: &dyn Simulator) -> Vec<DescriptorAxis> {
        self.descriptors.iter().filter_map(|(name, bounds)| descriptor::axis(name, *bounds, simulator)).collect()
    }
}

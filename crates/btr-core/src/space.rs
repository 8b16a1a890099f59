//! Spaces of parameters: names, units, bounds and scales of what is searched.
//!
//! A simulator is a family of models indexed by parameters, and a physical effect is a named group of parameters with
//! an off value. Fitting a mass, adding friction and re-parametrising the search space are therefore one operation on
//! one space.
//!
//! A [`Space`] is the paper's S (simulations) or C (controllers): an ordered list of named dimensions. Searches see
//! only the unit cube; [`Space::to_unit`] and [`Space::from_unit`] translate.

use serde::{Deserialize, Serialize};

/// Scale of a dimension between its bounds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Scale {
    /// Equal steps are equal differences.
    #[default]
    Linear,
    /// Equal steps are equal ratios; both bounds must be positive.
    Log,
}

/// One parameter: a name, a unit, bounds, and where the search starts from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Dim {
    /// Unique in its space, for instance `mass@RKneePitch`.
    pub name: String,
    /// SI unit as text, `1` for plain numbers.
    pub unit: String,
    /// Smallest allowed value.
    pub min: f64,
    /// Largest allowed value.
    pub max: f64,
    /// Linear or logarithmic.
    pub scale: Scale,
    /// The value a model has before anything is fitted; `None` when nothing is known.
    pub nominal: Option<f64>,
}

/// Error of a dimension or a point.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpaceError {
    /// Bounds that are not finite, or not in increasing order.
    #[error("parameter `{name}`: bounds [{min}, {max}] must be finite and min < max")]
    Bounds {
        /// The dimension.
        name: String,
        /// Its lower bound.
        min: f64,
        /// Its upper bound.
        max: f64,
    },
    /// A logarithmic dimension that touches zero.
    #[error("parameter `{name}`: a logarithmic scale needs positive bounds, not [{min}, {max}]")]
    LogBounds {
        /// The dimension.
        name: String,
        /// Its lower bound.
        min: f64,
        /// Its upper bound.
        max: f64,
    },
    /// Two dimensions with one name.
    #[error("parameter `{name}` is named twice")]
    Twice {
        /// The name.
        name: String,
    },
    /// A value outside its bounds (or NaN).
    #[error("parameter `{name}` = {value} lies outside its bounds [{min}, {max}]")]
    Outside {
        /// The dimension.
        name: String,
        /// The offending value.
        value: f64,
        /// Its lower bound.
        min: f64,
        /// Its upper bound.
        max: f64,
    },
    /// A point of another dimension than the space.
    #[error("the point has {got} values, but the space has {expected} dimensions")]
    Length {
        /// Dimensions of the space.
        expected: usize,
        /// Values of the point.
        got: usize,
    },
}

/// A value this share of the range beyond its bound is at it.
const ROUNDING: f64 = 1e-12;

impl Dim {
    /// A linear dimension without a nominal value.
    pub fn new(name: impl Into<String>, unit: impl Into<String>, min: f64, max: f64) -> Self {
        Dim { name: name.into(), unit: unit.into(), min, max, scale: Scale::Linear, nominal: None }
    }

    /// The same dimension with a nominal value.
    #[must_use]
    pub fn nominal(mut self, value: f64) -> Self {
        self.nominal = Some(value);
        self
    }

    /// The same dimension on another scale.
    #[must_use]
    pub fn scale(mut self, scale: Scale) -> Self {
        self.scale = scale;
        self
    }

    /// Bounds -> [0, 1].
    pub fn to_unit(&self, value: f64) -> f64 {
        let u = match self.scale {
            Scale::Linear => (value - self.min) / (self.max - self.min),
            Scale::Log => (value / self.min).ln() / (self.max / self.min).ln(),
        };
        u.clamp(0.0, 1.0)
    }

    /// [0, 1] -> bounds; exact at both ends.
    pub fn from_unit(&self, u: f64) -> f64 {
        let u = u.clamp(0.0, 1.0);
        let value = match self.scale {
            Scale::Linear => self.min + u * (self.max - self.min),
            Scale::Log => self.min * (self.max / self.min).powf(u),
        };
        value.clamp(self.min, self.max)
    }

    fn check(&self) -> Result<(), SpaceError> {
        let (name, min, max) = (self.name.clone(), self.min, self.max);
        if !(min.is_finite() && max.is_finite() && min < max) {
            return Err(SpaceError::Bounds { name, min, max });
        }
        if self.scale == Scale::Log && min <= 0.0 {
            return Err(SpaceError::LogBounds { name, min, max });
        }
        match self.nominal {
            Some(value) => self.check_value(value),
            None => Ok(()),
        }
    }

    fn check_value(&self, value: f64) -> Result<(), SpaceError> {
        // Bounds relative to a value are rounded, and are themselves inside.
        let rounding = ROUNDING * (self.max - self.min);
        if value >= self.min - rounding && value <= self.max + rounding {
            return Ok(());
        }
        Err(SpaceError::Outside { name: self.name.clone(), value, min: self.min, max: self.max })
    }
}

/// An ordered list of dimensions with unique names.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Space {
    dims: Vec<Dim>,
}

impl Space {
    /// Checks every dimension: finite bounds, unique names, nominal values inside.
    ///
    /// # Errors
    /// The first dimension that is not sound.
    pub fn new(dims: Vec<Dim>) -> Result<Self, SpaceError> {
        for (i, dim) in dims.iter().enumerate() {
            dim.check()?;
            if dims[..i].iter().any(|d| d.name == dim.name) {
                return Err(SpaceError::Twice { name: dim.name.clone() });
            }
        }
        Ok(Space { dims })
    }

    /// The dimensions in their order.
    pub fn dims(&self) -> &[Dim] {
        &self.dims
    }

    /// How many dimensions there are.
    pub fn len(&self) -> usize {
        self.dims.len()
    }

    /// True for the space of a single point (nothing to search).
    pub fn is_empty(&self) -> bool {
        self.dims.is_empty()
    }

    /// The position of a name.
    pub fn index_of(&self, name: &str) -> Option<usize> {
        self.dims.iter().position(|d| d.name == name)
    }

    /// A point of the unit cube, in physical units. Values outside [0, 1] land on the bound.
    pub fn from_unit(&self, unit: &[f64]) -> Vec<f64> {
        self.dims.iter().zip(unit).map(|(d, &u)| d.from_unit(u)).collect()
    }

    /// A point in physical units, on the unit cube.
    pub fn to_unit(&self, point: &[f64]) -> Vec<f64> {
        self.dims.iter().zip(point).map(|(d, &x)| d.to_unit(x)).collect()
    }

    /// The nominal point; the middle of the bounds where nothing is known.
    pub fn nominal(&self) -> Vec<f64> {
        self.dims.iter().map(|d| d.nominal.unwrap_or_else(|| d.from_unit(0.5))).collect()
    }

    /// Checks that a point has the right length and lies inside the bounds.
    ///
    /// # Errors
    /// The first value that is outside (NaN is outside).
    pub fn check(&self, point: &[f64]) -> Result<(), SpaceError> {
        if point.len() != self.len() {
            return Err(SpaceError::Length { expected: self.len(), got: point.len() });
        }
        self.dims.iter().zip(point).try_for_each(|(d, &x)| d.check_value(x))
    }
}

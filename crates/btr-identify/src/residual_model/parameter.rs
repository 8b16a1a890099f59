//! Free parameters and their normalised coordinates.

/// Largest logarithm of a factor by which a linear parameter is multiplied rather than added to.
const MULTIPLIED: f64 = 0.5;

/// How a parameter's coordinate becomes its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parametrisation {
    /// value = origin + size·u.
    Linear,
    /// value = origin·exp(size·u).
    Exponential,
    /// value = size/u: infinite, which is off, at u = 0. A limit: there is no response until it is reached.
    Inverse,
    /// The same for a stiffness: its inverse, the compliance, is felt from 0 on.
    Compliance,
    /// value = origin + size·u, of something that repeats itself, such as the steps of a quantised command: the cost is
    /// a stair in it, and small changes say nothing. It is searched in the error
    /// ([`ResidualModel::sizes`](super::ResidualModel::sizes)), not along derivatives.
    Stair,
    /// One of two values, origin and origin + size: the latter from u = 1/2 on. Searched like a stair.
    Switch,
}

/// A parameter that may be varied.
#[derive(Clone, Debug, PartialEq)]
pub struct FitParameter {
    /// Unique in its residual model: `mass@thigh`, `coulomb_friction.torque@knee`.
    pub name: String,
    /// SI unit as text.
    pub unit: String,
    /// The value at u = 0.
    pub origin: f64,
    /// A typical deviation; see [`Parametrisation`].
    pub size: f64,
    /// From the coordinate to the value.
    pub law: Parametrisation,
    /// Least and greatest coordinate.
    pub bounds: (f64, f64),
    /// How far from 0 the coordinate is expected to be (a standard deviation), before any log.
    pub spread: f64,
    /// The standard deviation that earlier logs leave, as a coordinate: the prior in the place of `spread`. `None`
    /// without such logs.
    pub known: Option<f64>,
    /// Reach of a finite difference.
    pub reach: f64,
    /// Whether it switches something on that is off at 0.
    pub amplitude: bool,
}

impl FitParameter {
    /// The value at a coordinate.
    pub fn value(&self, u: f64) -> f64 {
        match self.law {
            Parametrisation::Linear | Parametrisation::Stair => self.origin + self.size * u,
            Parametrisation::Switch => self.origin + if u < 0.5 { 0.0 } else { self.size },
            Parametrisation::Exponential => self.origin * (self.size * u).exp(),
            Parametrisation::Inverse | Parametrisation::Compliance => self.size / u,
        }
    }

    /// The coordinate of a value.
    pub fn coordinate(&self, value: f64) -> f64 {
        match self.law {
            Parametrisation::Linear | Parametrisation::Stair | Parametrisation::Switch => {
                (value - self.origin) / self.size
            }
            Parametrisation::Exponential => (value / self.origin).ln() / self.size,
            Parametrisation::Inverse | Parametrisation::Compliance => self.size / value,
        }
    }

    /// d value / d u.
    pub fn slope(&self, u: f64) -> f64 {
        match self.law {
            Parametrisation::Linear | Parametrisation::Stair | Parametrisation::Switch => self.size,
            Parametrisation::Exponential => self.size * self.value(u),
            Parametrisation::Inverse | Parametrisation::Compliance => -self.size / (u * u),
        }
    }

    /// Whether no derivative leads to its value: it is searched in the error.
    pub fn is_searched(&self) -> bool {
        matches!(self.law, Parametrisation::Stair | Parametrisation::Switch)
    }

    /// Standard deviation of its prior, as a coordinate.
    pub fn prior_sd(&self) -> f64 {
        self.known.unwrap_or(self.spread)
    }

    /// Whether its prior allows deviations by more than a factor of e.
    pub fn is_of_any_magnitude(&self) -> bool {
        self.law == Parametrisation::Exponential && self.size * self.prior_sd() > 1.0
    }

    /// d ln(value) / d u: infinite, or not a number, where the value is 0 or off.
    pub fn growth(&self, u: f64) -> f64 {
        self.slope(u) / self.value(u)
    }

    /// Whether its unit contains mass, as those of forces, stiffnesses and inertias are.
    pub fn scales_with_mass(&self) -> bool {
        self.unit.contains("kg") || self.unit.starts_with('N')
    }

    /// The coordinate after a step, within the bounds. A limit that is on is multiplied, like an exponential parameter.
    pub fn along(&self, u: f64, by: f64) -> f64 {
        let on = self.law == Parametrisation::Inverse && u > 0.0;
        self.clamp(if on { u * (by / u).exp() } else { u + by })
    }

    /// The same, but linear parameters are multiplied as well if the step is small relative to the value: thus a common
    /// factor of masses, gains, limits and friction is a straight line.
    pub fn in_proportion(&self, u: f64, by: f64) -> f64 {
        let growth = self.growth(u);
        let multiplied = self.law == Parametrisation::Linear && (by * growth).abs() <= MULTIPLIED;
        if multiplied && growth != 0.0 { self.clamp(u + (by * growth).exp_m1() / growth) } else { self.along(u, by) }
    }

    /// A coordinate within the bounds.
    pub fn clamp(&self, u: f64) -> f64 {
        u.clamp(self.bounds.0, self.bounds.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::parameter;

    #[test]
    fn a_limit_keeps_its_proportion_to_a_mass() {
        let (mass, limit) = (
            parameter(Parametrisation::Exponential, 2.0, 0.1),
            parameter(Parametrisation::Inverse, f64::INFINITY, 3.0),
        );
        // To first order, a tenth more of the mass is a tenth less of the limit's coordinate.
        let proportion = |by: f64| mass.value(mass.along(0.0, by)) / limit.value(limit.along(0.6, -0.06 * by));
        assert!((proportion(4.0) / proportion(0.0) - 1.0).abs() < 1e-12);
        assert!(limit.along(0.6, -5.0) > 0.0, "a limit does not go past infinity");
        assert!(limit.along(0.0, 0.5) > 0.4, "a limit that is off can come on");
    }

    #[test]
    fn a_friction_keeps_its_proportion_to_a_mass() {
        for friction in [
            parameter(Parametrisation::Linear, 0.0, 0.3),
            parameter(Parametrisation::Linear, -0.1, 0.3),
            parameter(Parametrisation::Linear, 0.0, -0.3),
        ] {
            let mass = parameter(Parametrisation::Exponential, 2.0, 0.1);
            let along = |by: f64| friction.in_proportion(1.4, by * mass.growth(0.0) / friction.growth(1.4));
            let proportion = |by: f64| mass.value(mass.in_proportion(0.0, by)) / friction.value(along(by));
            assert!((proportion(4.0) / proportion(0.0) - 1.0).abs() < 1e-12);
            // A value near zero, or zero, is not multiplied.
            assert!((friction.in_proportion(1.4, -1.6) - (1.4 - 1.6)).abs() < 1e-12);
        }
        assert!((parameter(Parametrisation::Linear, 0.0, 0.3).in_proportion(0.0, 0.5) - 0.5).abs() < 1e-12);
    }
}

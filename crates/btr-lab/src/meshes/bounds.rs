//! The box around points.

use nalgebra::Point3;

/// The smallest box along the axes that holds some points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds {
    pub(super) low: Point3<f64>,
    pub(super) high: Point3<f64>,
}

impl Bounds {
    /// The box around nothing.
    pub(super) fn none() -> Self {
        Bounds { low: [f64::INFINITY; 3].into(), high: [f64::NEG_INFINITY; 3].into() }
    }

    /// Makes the box hold a point as well.
    ///
    /// # Errors
    /// A point that has no place.
    pub(super) fn include(&mut self, point: &Point3<f64>) -> Result<(), String> {
        if !point.coords.iter().all(|x| x.is_finite()) {
            return Err("a vertex of it has no place".to_owned());
        }
        (self.low, self.high) = (self.low.inf(point), self.high.sup(point));
        Ok(())
    }

    /// The box, unless it is that around nothing.
    ///
    /// # Errors
    /// That there are no vertices.
    pub(super) fn known(self) -> Result<Self, String> {
        if self.low.x <= self.high.x { Ok(self) } else { Err("it has no vertices".to_owned()) }
    }
}

/// Three numbers of a text.
///
/// # Errors
/// Other words, or fewer.
pub(super) fn point<'a>(mut words: impl Iterator<Item = &'a str>) -> Result<Point3<f64>, String> {
    let mut number = || words.next().and_then(|word| word.parse::<f64>().ok());
    match (number(), number(), number()) {
        (Some(x), Some(y), Some(z)) => Ok(Point3::new(x, y, z)),
        _ => Err("a vertex of it has no three numbers".to_owned()),
    }
}

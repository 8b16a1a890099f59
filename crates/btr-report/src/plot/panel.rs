//! The parts of a figure: panels of series, each with an ink and a mark.

/// A colour by its role; all figures share them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Ink {
    /// The main curve: the best, the simulated.
    Main,
    /// A second curve: the mean, the measured.
    Second,
    /// A third curve: what was simulated before.
    Third,
    /// A fourth curve: what was simulated on the way from there.
    Fourth,
    /// A value at its bound.
    Alarm,
    /// References: the truth, commands, the noise floor.
    Truth,
    /// A grey between black (0, best) and pale (1, worst).
    Shade(f64),
}

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mark {
    /// A continuous line.
    Line,
    /// A broad, pale line, visible below a line on top of it.
    Broad,
    /// A dashed line.
    Dashes,
    /// A dot per point.
    Dots,
}

/// A data series. Points that are not finite are gaps.
#[derive(Clone, Debug)]
pub(crate) struct Series {
    /// Name in the legend; nameless series have no entry.
    pub(crate) name: Option<String>,
    /// Colour.
    pub(crate) ink: Ink,
    /// Line or dots.
    pub(crate) mark: Mark,
    /// x and y in the units of the axes.
    pub(crate) points: Vec<(f64, f64)>,
    /// What the series shows of the model's states, if it does.
    pub(crate) state: Option<ShownState>,
}

/// One of the states of a model between which the player of a page switches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ShownState {
    /// Its number.
    pub(crate) number: usize,
    /// Whether it is hidden until it is chosen.
    pub(crate) hidden: bool,
}

impl Series {
    /// A series with a name for the legend.
    pub(crate) fn new(name: &str, ink: Ink, mark: Mark, points: Vec<(f64, f64)>) -> Self {
        Series { name: Some(name.to_owned()), ink, mark, points, state: None }
    }

    /// A series without a legend entry.
    pub(crate) fn nameless(ink: Ink, mark: Mark, points: Vec<(f64, f64)>) -> Self {
        Series { name: None, ink, mark, points, state: None }
    }
}

/// A pair of axes with its series.
#[derive(Clone, Debug, Default)]
pub(crate) struct Panel {
    /// Above the panel.
    pub(crate) title: String,
    /// Below the x axis, with the unit.
    pub(crate) x_label: String,
    /// Beside the y axis, with the unit.
    pub(crate) y_label: String,
    /// Drawn in this order.
    pub(crate) series: Vec<Series>,
    /// Thin vertical lines, for instance where an iteration ends.
    pub(crate) marks_x: Vec<f64>,
    /// Values that the y axis includes, so that panels can be compared.
    pub(crate) show_y: Vec<f64>,
    /// The log whose time is the x axis, if that is what it is.
    pub(crate) over_log: Option<usize>,
}

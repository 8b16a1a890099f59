//! Back-to-Reality, generic over what is simulated.
//!
//! Controllers and simulations evolve against each other: controllers are found in a simulation, a few are tried in
//! reality, and the real behaviours are used to find a better simulation (Zagal, Delpiano and Ruiz-del-Solar,
//! "Self-modeling in humanoid soccer robots", Robotics and Autonomous Systems 57, 2009).
//!
//! This crate holds the ideas and does no I/O; it knows nothing of robots or physics engines:
//!
//! - [`space`]: parameters with name, unit, bounds and scale, as points of the unit cube
//! - [`log`]: time series of commands and measurements on one clock
//! - [`world`]: the interfaces of simulators and of reality
//! - [`signal`]: noise, smoothing, time shifts and spectra of series
//! - [`distance`]: how far two behaviours are apart, one file per distance
//! - [`search`]: ask-and-tell searches on the unit cube, one file per search; [`optimize`]: bounded least squares
//! - [`coevolve`]: the loop that puts them together
//! - [`text`]: messages in which every front end names its own commands
//! - [`random`], [`parallel`]: reproducible random streams, and batches of parallel work
//! - [`limits`]: how large inputs may be
//!
//! # Quick start
//! A search proposes points of the unit cube and learns from their costs; a [`space::Space`] gives the points their
//! units:
//!
//! ```
//! use btr_core::random::stream;
//! use btr_core::search::cmaes::CmaEsSettings;
//! use btr_core::search::{Search, SearchSpec};
//! use btr_core::space::{Dim, Space, SpaceError};
//!
//! let space = Space::new(vec![Dim::new("mass", "kg", 0.5, 2.0), Dim::new("friction", "N·m·s", 0.0, 0.4)])?;
//! let cost = |point: &[f64]| (point[0] - 1.2).powi(2) + (point[1] - 0.1).powi(2);
//!
//! let mut search = SearchSpec::CmaEs(CmaEsSettings::default()).start(space.len(), None);
//! for generation in 0..60 {
//!     let population = search.ask(&mut stream(1, &[generation]));
//!     let costs: Vec<f64> = population.iter().map(|unit| cost(&space.from_unit(unit))).collect();
//!     search.tell(&population, &costs);
//! }
//! let best = search.best().map(|(unit, _)| space.from_unit(unit)).unwrap_or_default();
//! assert!((best[0] - 1.2).abs() < 1e-3 && (best[1] - 0.1).abs() < 1e-3);
//! # Ok::<(), SpaceError>(())
//! ```
//!
//! A distance compares two behaviours, each a log with its fitness:
//!
//! ```
//! use btr_core::distance::{Distance, Rmse};
//! use btr_core::log::{Log, LogError, Role};
//! use btr_core::world::Behaviour;
//!
//! let swing = |amplitude: f64| -> Result<Behaviour, LogError> {
//!     let clock_s: Vec<f64> = (0..100).map(|k| 0.01 * f64::from(k)).collect();
//!     let angle = clock_s.iter().map(|t| amplitude * (6.0 * t).sin()).collect();
//!     let mut log = Log::new(clock_s)?;
//!     log.insert("q_knee", "rad", Role::Measured, angle)?;
//!     Ok(Behaviour { log, fitness: 0.0 })
//! };
//! let (real, close, far) = (swing(1.0)?, swing(1.1)?, swing(1.5)?);
//! let rmse = Rmse::default();
//! assert!(rmse.distance(&real, &close) < rmse.distance(&real, &far));
//! # Ok::<(), LogError>(())
//! ```
//!
//! # Reproducibility
//! The same input and seed give the same bits, for any number of threads and after any resume. Random numbers belong to
//! their consumer ([`random`]), populations are evaluated in parallel and collected in order, nothing iterates over a
//! hash map, and no wall-clock time enters a result.

pub mod coevolve;
pub mod distance;
pub mod limits;
pub mod log;
pub mod optimize;
pub mod parallel;
pub mod random;
pub mod search;
mod settings;
pub mod signal;
pub mod space;
pub mod text;
pub mod world;

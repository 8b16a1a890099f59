//! Time series on a clock: noise floors, smoothing and derivatives, time shifts, spectra, and what is missing in them.

pub mod fft;
pub mod lag;
pub mod missing;
pub mod noise;
pub mod smooth;
pub mod stats;
pub(crate) mod student;

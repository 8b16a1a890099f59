//! Time series on a clock: noise floors, smoothing and derivatives, time shifts, spectra, and what is missing in them.

pub mod fft;
pub mod lag;
pub mod noise;
pub mod silence;
pub mod smooth;
pub mod stats;

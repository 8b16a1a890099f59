//! Time series on a clock: noise floors, smoothing and derivatives, time shifts, dead times, spectra, ripples, where
//! a joint stands still, and what is missing in them.

pub mod dead_time;
pub mod fft;
pub mod glitch;
pub mod lag;
pub mod missing;
pub mod noise;
pub mod repeats;
pub mod ripple;
pub mod size;
pub mod smooth;
pub mod standstill;
pub mod stats;
pub mod student;

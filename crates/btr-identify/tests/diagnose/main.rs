//! The diagnosis of synthetic models, each with one difficulty of real ones.
#![allow(clippy::unwrap_used)]

mod again;
mod dead_end;
mod findings;
mod rivals;
mod synthetic;

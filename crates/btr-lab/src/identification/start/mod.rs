//! Where logs begin: what moves that, robots that stand before their log, and logs cut into windows.

pub(super) mod moved;
mod standing;
pub(super) mod windows;

//! The rows of a step: directions in which impulses act, grouped into blocks.

use crate::engine::articulated::linear_algebra::lanes::{Lanes, Mask};
use crate::engine::articulated::linear_algebra::spatial::Spatial;
use pulp::Simd;

/// All impulses of a step.
pub(in crate::engine::articulated) struct Impulses<S: Simd> {
    pub(super) simd: S,
    pub(super) blocks: Vec<ImpulseBlock>,
    pub(super) singles: Vec<Single<S>>,
    /// How many of them couple joints. They come first.
    pub(super) couples: usize,
    pub(super) contacts: Vec<Contact<S>>,
    /// The velocity along each row, with the impulses found so far; and the impulses.
    pub(super) speeds: Vec<Lanes<S>>,
    pub(super) impulses: Vec<Lanes<S>>,
    /// The directions, seen through half of the inverse inertia: their products are what rows do to each other.
    pub(super) halves: Vec<Lanes<S>>,
    /// The same of all pushes and turns on a body, and where those of each that is touched begin.
    pub(super) bases: Vec<Spatial<S>>,
    pub(super) pushed: Vec<(usize, usize)>,
    /// What every row does to every other one, in 1/kg or the like.
    pub(super) answers: Vec<Lanes<S>>,
    /// The last step's impulses of everything that can touch, where the sweeps begin; and those of this step.
    pub(super) known: Vec<[Lanes<S>; 3]>,
    pub(super) found: Vec<[Lanes<S>; 3]>,
    pub(super) change: Vec<Lanes<S>>,
    pub(super) guess: StickGuess<S>,
    /// For whom the sweeps did not end when they were needed last, and in this step.
    pub(super) hard: Mask<S>,
    pub(super) found_hard: Mask<S>,
}

/// Rows that belong together: the three of a contact, or a single one. They push everything on the ways to one or two
/// degrees of freedom.
#[derive(Clone, Copy)]
pub(super) struct ImpulseBlock {
    pub(super) row: usize,
    pub(super) rows: usize,
    /// Where each way leads, and where its part of the halves begins, in which the rows have their entries side by
    /// side.
    pub(super) ways: [Option<(usize, usize)>; 2],
}

/// A bounded impulse on one joint, or between two that are coupled.
#[derive(Clone, Copy)]
pub(super) struct Single<S: Simd> {
    pub(super) row: usize,
    /// The velocity that it tries to bring about.
    pub(super) wanted: Lanes<S>,
    pub(super) least: Lanes<S>,
    pub(super) most: Lanes<S>,
    /// What an impulse has to be to change the velocity by one.
    pub(super) stubborn: Lanes<S>,
}

/// A contact: one row along the normal and two across.
pub(super) struct Contact<S: Simd> {
    /// The first of its rows.
    pub(super) row: usize,
    pub(super) slot: usize,
    pub(super) law: ContactLaw<S>,
    /// Who touches there.
    pub(super) there: Mask<S>,
    /// What an impulse along the normal, and one across, have to be at least to change the speed there by one.
    pub(super) stubborn: Lanes<S>,
    pub(super) stubborn_across: Lanes<S>,
}

/// How two bodies that touch push each other.
#[derive(Clone, Copy)]
pub(in crate::engine::articulated) struct ContactLaw<S: Simd> {
    /// The speed of separation without an impulse, in m/s.
    pub(in crate::engine::articulated) wanted: Lanes<S>,
    /// How much of it an impulse costs, in 1/kg.
    pub(in crate::engine::articulated) softness: Lanes<S>,
    /// Coulomb's coefficient.
    pub(in crate::engine::articulated) friction: Lanes<S>,
}

/// Memory for that.
pub(super) struct StickGuess<S: Simd> {
    /// Whose impulse follows from the equations; all others stay.
    pub(super) free: Vec<Mask<S>>,
    /// The velocities without impulses, those to bring about, and what an impulse costs of it.
    pub(super) alone: Vec<Lanes<S>>,
    pub(super) wanted: Vec<Lanes<S>>,
    pub(super) costs: Vec<Lanes<S>>,
    /// Row by row the upper factor of the equations' matrix, and their solution.
    pub(super) factor: Vec<Lanes<S>>,
    pub(super) solution: Vec<Lanes<S>>,
}

impl<S: Simd> StickGuess<S> {
    pub(super) fn new() -> Self {
        let (free, alone, wanted, costs) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        StickGuess { free, alone, wanted, costs, factor: Vec::new(), solution: Vec::new() }
    }
}

impl<S: Simd> Impulses<S> {
    /// Room for contacts at so many places.
    pub(in crate::engine::articulated) fn new(simd: S, slots: usize) -> Self {
        Impulses {
            simd,
            blocks: Vec::new(),
            singles: Vec::new(),
            couples: 0,
            contacts: Vec::new(),
            speeds: Vec::new(),
            impulses: Vec::new(),
            halves: Vec::new(),
            bases: Vec::new(),
            pushed: Vec::new(),
            answers: Vec::new(),
            known: vec![[Lanes::zero(simd); 3]; slots],
            found: vec![[Lanes::zero(simd); 3]; slots],
            change: Vec::new(),
            guess: StickGuess::new(),
            hard: Lanes::zero(simd).less(Lanes::zero(simd)),
            found_hard: Lanes::zero(simd).less(Lanes::zero(simd)),
        }
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn clear(&mut self) {
        self.blocks.clear();
        self.singles.clear();
        self.couples = 0;
        self.contacts.clear();
        self.speeds.clear();
        self.halves.clear();
        self.bases.clear();
        self.pushed.clear();
    }

    #[inline(always)]
    pub(super) fn rows(&self) -> usize {
        self.speeds.len()
    }

    /// Who touches anything.
    #[inline(always)]
    pub(super) fn touching(&self) -> Mask<S> {
        let zero = Lanes::zero(self.simd);
        let mut touching = zero.less(zero);
        for contact in &self.contacts {
            touching = touching.or(contact.there);
        }
        touching
    }
}

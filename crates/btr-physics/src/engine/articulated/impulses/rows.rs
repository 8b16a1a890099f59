//! The rows of a step: directions in which impulses act, grouped into blocks.

use crate::engine::articulated::linear_algebra::lanes::{Lanes, Mask};
use crate::engine::articulated::linear_algebra::spatial::Spatial;
use pulp::Simd;

/// The constraint rows of a step and their impulses.
pub(in crate::engine::articulated) struct Impulses<S: Simd> {
    pub(super) simd: S,
    pub(super) blocks: Vec<ImpulseBlock>,
    pub(super) singles: Vec<Single<S>>,
    /// Number of singles that couple joints. They come first.
    pub(super) couplings: usize,
    pub(super) contacts: Vec<Contact<S>>,
    /// The velocity along each row with the current impulses; and the impulses.
    pub(super) speeds: Vec<Lanes<S>>,
    pub(super) impulses: Vec<Lanes<S>>,
    /// Half Jacobians J·L⁻¹ of the rows, with the inertia matrix LᵀL: their products are the Delassus matrix.
    pub(super) half_jacobians: Vec<Lanes<S>>,
    /// The same for unit forces and moments on a body, and the offsets of those of each body in contact.
    pub(super) bases: Vec<Spatial<S>>,
    pub(super) pushed: Vec<(usize, usize)>,
    /// Delassus matrix J·M⁻¹·Jᵀ: the velocity along each row per unit impulse along every other, in 1/kg or the like.
    pub(super) delassus: Vec<Lanes<S>>,
    /// The last step's impulses at every possible contact point, for the warm start; and those of this step.
    pub(super) warm_start: Vec<[Lanes<S>; 3]>,
    pub(super) found: Vec<[Lanes<S>; 3]>,
    pub(super) change: Vec<Lanes<S>>,
    pub(super) guess: StickGuess<S>,
    /// Candidates whose sweeps did not converge when they were last used, and in this step.
    pub(super) hard: Mask<S>,
    pub(super) found_hard: Mask<S>,
}

/// Rows that belong together: the three of a contact, or a single one. They act on all degrees of freedom on the paths
/// to one or two of them.
#[derive(Clone, Copy)]
pub(super) struct ImpulseBlock {
    pub(super) row: usize,
    pub(super) rows: usize,
    /// Last degree of freedom of each path, and the offset of its entries in the half Jacobians, where the rows'
    /// entries are interleaved.
    pub(super) paths: [Option<(usize, usize)>; 2],
}

/// The law of a bounded impulse: velocity = target − softness·impulse, within the bounds of the impulse.
#[derive(Clone, Copy)]
pub(in crate::engine::articulated) struct BoundedRow<S: Simd> {
    /// Target velocity.
    pub(in crate::engine::articulated) target: Lanes<S>,
    /// Softness: velocity per impulse.
    pub(in crate::engine::articulated) softness: Lanes<S>,
    pub(in crate::engine::articulated) lower: Lanes<S>,
    pub(in crate::engine::articulated) upper: Lanes<S>,
}

/// A bounded impulse on one joint, or between two coupled joints.
#[derive(Clone, Copy)]
pub(super) struct Single<S: Simd> {
    pub(super) row: usize,
    pub(super) law: BoundedRow<S>,
    /// Effective mass: impulse per unit change of the velocity.
    pub(super) effective_mass: Lanes<S>,
}

/// A contact: one row along the normal and two along tangents.
pub(super) struct Contact<S: Simd> {
    /// The first of its rows.
    pub(super) row: usize,
    pub(super) slot: usize,
    pub(super) law: ContactLaw<S>,
    /// Candidates that have this contact.
    pub(super) mask: Mask<S>,
    /// Effective mass along the normal, and the smallest one along any tangent.
    pub(super) effective_mass: Lanes<S>,
    pub(super) tangential_mass: Lanes<S>,
}

/// Contact law: separation speed = target − softness·normal impulse.
#[derive(Clone, Copy)]
pub(in crate::engine::articulated) struct ContactLaw<S: Simd> {
    /// Separation speed without an impulse, in m/s.
    pub(in crate::engine::articulated) target: Lanes<S>,
    /// Softness (constraint force mixing), in 1/kg.
    pub(in crate::engine::articulated) softness: Lanes<S>,
    /// Coulomb's coefficient.
    pub(in crate::engine::articulated) friction: Lanes<S>,
}

/// Working memory of the active-set method.
pub(super) struct StickGuess<S: Simd> {
    /// Rows whose impulse is an unknown of the equations; those of all others are fixed.
    pub(super) free: Vec<Mask<S>>,
    /// Velocities without impulses, target velocities, and the regularisation of the diagonal.
    pub(super) free_speeds: Vec<Lanes<S>>,
    pub(super) target: Vec<Lanes<S>>,
    pub(super) regularisation: Vec<Lanes<S>>,
    /// Upper factor of the equations' matrix, row-major, and their solution.
    pub(super) factor: Vec<Lanes<S>>,
    pub(super) solution: Vec<Lanes<S>>,
}

impl<S: Simd> StickGuess<S> {
    pub(super) fn new() -> Self {
        let (free, free_speeds, target, regularisation) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        StickGuess { free, free_speeds, target, regularisation, factor: Vec::new(), solution: Vec::new() }
    }
}

impl<S: Simd> Impulses<S> {
    /// Allocates for `slots` possible contact points.
    pub(in crate::engine::articulated) fn new(simd: S, slots: usize) -> Self {
        Impulses {
            simd,
            blocks: Vec::new(),
            singles: Vec::new(),
            couplings: 0,
            contacts: Vec::new(),
            speeds: Vec::new(),
            impulses: Vec::new(),
            half_jacobians: Vec::new(),
            bases: Vec::new(),
            pushed: Vec::new(),
            delassus: Vec::new(),
            warm_start: vec![[Lanes::zero(simd); 3]; slots],
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
        self.couplings = 0;
        self.contacts.clear();
        self.speeds.clear();
        self.half_jacobians.clear();
        self.bases.clear();
        self.pushed.clear();
    }

    #[inline(always)]
    pub(super) fn rows(&self) -> usize {
        self.speeds.len()
    }

    /// Candidates with any contact.
    #[inline(always)]
    pub(super) fn touching(&self) -> Mask<S> {
        let zero = Lanes::zero(self.simd);
        let mut touching = zero.less(zero);
        for contact in &self.contacts {
            touching = touching.or(contact.mask);
        }
        touching
    }
}

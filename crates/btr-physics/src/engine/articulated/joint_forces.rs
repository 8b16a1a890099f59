//! Joint-level forces: springs, dampers, friction, and motors with bounds.

use super::linear_algebra::lanes::Lanes;
use crate::engine::{Affine, Bounded, Dof};
use pulp::Simd;

/// Joint-level forces on one joint: [`Dof`] of every candidate.
#[derive(Clone, Copy)]
pub(super) struct JointForces<S: Simd> {
    pub(super) constant: Lanes<S>,
    pub(super) stiffness: Lanes<S>,
    pub(super) damping: Lanes<S>,
    pub(super) dry_friction: Lanes<S>,
    pub(super) armature: Lanes<S>,
}

/// A motor with bounds. Candidates without bounds have infinite ones.
pub(super) struct BoundedMotor<S: Simd> {
    /// Forces on the joint other than the motor's.
    rest: BoundedLaw<S>,
    wanted: BoundedLaw<S>,
    most: BoundedLaw<S>,
    least: BoundedLaw<S>,
    /// 1 where it is at `most`, -1 at `least`, 0 between them.
    pub(super) side: Lanes<S>,
    /// The last values set, lane by lane: `rest` and the motor.
    told: Vec<(Affine, Bounded)>,
}

/// [`Affine`] of every candidate.
#[derive(Clone, Copy)]
pub(super) struct BoundedLaw<S: Simd> {
    pub(super) constant: Lanes<S>,
    pub(super) stiffness: Lanes<S>,
    pub(super) damping: Lanes<S>,
}

/// No motor. Adding a negative zero leaves every number unchanged to the bit.
const NONE: Bounded = Bounded {
    wanted: Affine { constant: -0.0, stiffness: -0.0, damping: -0.0 },
    most: Affine { constant: f64::INFINITY, stiffness: 0.0, damping: 0.0 },
    least: Affine { constant: f64::NEG_INFINITY, stiffness: 0.0, damping: 0.0 },
};

/// Sets a candidate's motor bounds, or removes them. The first candidate with bounds allocates those of all; `inner`
/// holds the forces on the joints of the others.
pub(super) fn set<S: Simd>(motor: &mut Option<BoundedMotor<S>>, inner: &JointForces<S>, lane: usize, dof: &Dof) {
    let motor = motor.get_or_insert_with(|| BoundedMotor::none(inner));
    let to = (dof.torque, dof.motor.unwrap_or(NONE));
    let before = std::mem::replace(&mut motor.told[lane], to);
    motor.rest.update(lane, &to.0, &before.0);
    motor.wanted.update(lane, &to.1.wanted, &before.1.wanted);
    motor.most.update(lane, &to.1.most, &before.1.most);
    motor.least.update(lane, &to.1.least, &before.1.least);
}

impl<S: Simd> BoundedMotor<S> {
    /// No candidate has bounds.
    fn none(inner: &JointForces<S>) -> Self {
        let JointForces { constant, stiffness, damping, .. } = *inner;
        let all = |law: &Affine| BoundedLaw {
            constant: constant.like(law.constant),
            stiffness: constant.like(law.stiffness),
            damping: constant.like(law.damping),
        };
        let (wanted, most, least) = (all(&NONE.wanted), all(&NONE.most), all(&NONE.least));
        let rest = BoundedLaw { constant, stiffness, damping };
        let told = (0..S::F64_LANES).map(|lane| (rest.lane(lane), NONE)).collect();
        BoundedMotor { rest, wanted, most, least, side: constant.like(0.0), told }
    }

    /// Updates the side for this state, and returns whether it changed. A motor at one bound is never moved to the
    /// opposite bound at once, and is released only if `release` is set.
    #[inline(always)]
    pub(super) fn look(&mut self, q: Lanes<S>, u: Lanes<S>, let_go: bool) -> bool {
        let (zero, one) = (self.side.like(0.0), self.side.like(1.0));
        let wanted = self.wanted.at(q, u);
        let (most, least) = (self.most.at(q, u), self.least.at(q, u));
        let (above, below) = (most.less(wanted), wanted.less(least));
        let (high, low) = (zero.less(self.side), self.side.less(zero));
        let between = above.select(one, below.select(-one, zero));
        let freed = if let_go { high.and(wanted.less(most)).or(low.and(least.less(wanted))) } else { zero.less(zero) };
        let side = high.or(low).select(freed.select(zero, self.side), between);
        let changed = side.less(self.side).or(self.side.less(side)).any();
        self.side = side;
        changed
    }

    /// The law that acts on the joint with the motor on its current side.
    #[inline(always)]
    pub(super) fn law(&self) -> BoundedLaw<S> {
        let zero = self.side.like(0.0);
        let (high, low) = (zero.less(self.side), self.side.less(zero));
        let of = |most, least, wanted| high.select(most, low.select(least, wanted));
        BoundedLaw {
            constant: self.rest.constant + of(self.most.constant, self.least.constant, self.wanted.constant),
            stiffness: self.rest.stiffness + of(self.most.stiffness, self.least.stiffness, self.wanted.stiffness),
            damping: self.rest.damping + of(self.most.damping, self.least.damping, self.wanted.damping),
        }
    }
}

impl<S: Simd> BoundedLaw<S> {
    fn update(&mut self, lane: usize, law: &Affine, before: &Affine) {
        // Most of a motor's values never change, and storing into a lane is slow.
        let update = |lanes: &mut Lanes<S>, to: f64, before: f64| {
            if to.to_bits() != before.to_bits() {
                lanes.set(lane, to);
            }
        };
        update(&mut self.constant, law.constant, before.constant);
        update(&mut self.stiffness, law.stiffness, before.stiffness);
        update(&mut self.damping, law.damping, before.damping);
    }

    fn lane(&self, lane: usize) -> Affine {
        let [constant, stiffness, damping] = [self.constant, self.stiffness, self.damping].map(|law| law.lane(lane));
        Affine { constant, stiffness, damping }
    }

    #[inline(always)]
    fn at(&self, q: Lanes<S>, u: Lanes<S>) -> Lanes<S> {
        self.constant - self.stiffness * q - self.damping * u
    }
}

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
    /// [`Creep`](crate::engine::Creep): its rate and its time constant.
    pub(super) creep: [Lanes<S>; 2],
    pub(super) armature: Lanes<S>,
}

impl<S: Simd> JointForces<S> {
    /// What dry friction aims at in a step from the velocity `u`: a velocity u' = target − softness·impulse. Both are
    /// zero where it holds rigidly.
    ///
    /// [`Creep`](crate::engine::Creep)'s law over a step is time·(u' − u)/dt + h·u' + (1 − h)·u = −rate·impulse/dt. It
    /// is solved for the step's middle (h = 1/2), or for its end where it would oscillate.
    #[inline(always)]
    pub(super) fn held(&self, u: Lanes<S>, dt_s: f64) -> [Lanes<S>; 2] {
        let ([rate, time], zero) = (self.creep, u.like(0.0));
        let implicitness = u.like(0.5 * dt_s).less_or_equal(time).select(u.like(0.5), u.like(1.0));
        let spread = time + implicitness * dt_s;
        let kept = (time - (u.like(1.0) - implicitness) * dt_s) / spread;
        [zero.less(rate).select(u * kept, zero), rate / spread]
    }
}

/// A motor with bounds. Candidates without bounds have infinite ones.
pub(super) struct BoundedMotor<S: Simd> {
    /// Forces on the joint other than the motor's.
    rest: BoundedLaw<S>,
    requested: BoundedLaw<S>,
    upper: BoundedLaw<S>,
    lower: BoundedLaw<S>,
    /// 1 where it is at `upper`, -1 at `lower`, 0 between them.
    pub(super) side: Lanes<S>,
    /// The last values set, lane by lane: `rest` and the motor.
    last_set: Vec<(Affine, Bounded)>,
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
    requested: Affine { constant: -0.0, stiffness: -0.0, damping: -0.0 },
    upper: Affine { constant: f64::INFINITY, stiffness: 0.0, damping: 0.0 },
    lower: Affine { constant: f64::NEG_INFINITY, stiffness: 0.0, damping: 0.0 },
};

/// Sets a candidate's motor bounds, or removes them. The first candidate with bounds allocates those of all; `inner`
/// holds the forces on the joints of the others.
pub(super) fn set<S: Simd>(motor: &mut Option<BoundedMotor<S>>, inner: &JointForces<S>, lane: usize, dof: &Dof) {
    let motor = motor.get_or_insert_with(|| BoundedMotor::none(inner));
    let to = (dof.torque, dof.motor.unwrap_or(NONE));
    let before = std::mem::replace(&mut motor.last_set[lane], to);
    motor.rest.update(lane, &to.0, &before.0);
    motor.requested.update(lane, &to.1.requested, &before.1.requested);
    motor.upper.update(lane, &to.1.upper, &before.1.upper);
    motor.lower.update(lane, &to.1.lower, &before.1.lower);
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
        let (requested, upper, lower) = (all(&NONE.requested), all(&NONE.upper), all(&NONE.lower));
        let rest = BoundedLaw { constant, stiffness, damping };
        let last_set = (0..S::F64_LANES).map(|lane| (rest.lane(lane), NONE)).collect();
        BoundedMotor { rest, requested, upper, lower, side: constant.like(0.0), last_set }
    }

    /// Updates the side for this state, and returns whether it changed. A motor at one bound is never moved to the
    /// opposite bound at once, and is released only if `release` is set.
    #[inline(always)]
    pub(super) fn update_side(&mut self, q: Lanes<S>, u: Lanes<S>, release: bool) -> bool {
        let (zero, one) = (self.side.like(0.0), self.side.like(1.0));
        let requested = self.requested.at(q, u);
        let (upper, lower) = (self.upper.at(q, u), self.lower.at(q, u));
        let (above, below) = (upper.less(requested), requested.less(lower));
        let (high, low) = (zero.less(self.side), self.side.less(zero));
        let between = above.select(one, below.select(-one, zero));
        let freed =
            if release { high.and(requested.less(upper)).or(low.and(lower.less(requested))) } else { zero.less(zero) };
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
        let of = |upper, lower, requested| high.select(upper, low.select(lower, requested));
        BoundedLaw {
            constant: self.rest.constant + of(self.upper.constant, self.lower.constant, self.requested.constant),
            stiffness: self.rest.stiffness + of(self.upper.stiffness, self.lower.stiffness, self.requested.stiffness),
            damping: self.rest.damping + of(self.upper.damping, self.lower.damping, self.requested.damping),
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

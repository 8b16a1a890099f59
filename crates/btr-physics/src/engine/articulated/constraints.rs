//! Constraints: dry friction, joint limits, couplings, and contacts with the floor and the ball.

use super::contacts;
use super::contacts::Reach;
use super::impulses::{BoundedRow, ContactLaw};
use super::linear_algebra::lanes::{Lanes, Mask};
use super::state::{Articulated, Coupling, Floor};
use pulp::Simd;

/// A gap counts as a contact if it would close within half a step at this speed (m/s) beyond its unconstrained motion,
/// because other impulses may push it closed.
const PUSHED: f64 = 0.5;
/// Contacts that would need a higher speed than this (m/s) to close within a step are not considered.
const FASTEST: f64 = 20.0;

impl<S: Simd> Articulated<S> {
    /// Applies dry friction, joint limits, couplings and contacts as bounded impulses.
    #[inline(always)]
    pub(super) fn apply_constraints(&mut self) {
        self.impulses.clear();
        self.couple_followers(0.5 / self.dt_s);
        self.constrain_joints();
        self.equalise_implicitness();
        self.constrain_contacts();
        self.impulses.apply(&self.tree, &self.scratch.matrix, &mut self.scratch.next);
    }

    /// Couples joints that mimic others at the step's end. Position errors are corrected at `rate_per_s` (1/s).
    #[inline(always)]
    pub(super) fn couple_followers(&mut self, rate_per_s: f64) {
        for Coupling { joint, leader, ratio, offset } in &self.followers {
            let error = self.now.q[*joint] - *ratio * self.now.q[*leader] - *offset;
            let dofs = [self.root + joint, self.root + leader];
            let (tree, s) = (&self.tree, &self.scratch);
            self.impulses.add_coupling(dofs, [*ratio, error * -rate_per_s], tree, &s.matrix, &s.next);
        }
    }

    /// Gives a follower the same implicitness as its leader.
    #[inline(always)]
    fn equalise_implicitness(&mut self) {
        let (root, implicitness) = (self.root, &mut self.scratch.implicitness);
        for Coupling { joint, leader, .. } in &self.followers {
            implicitness[root + leader] = implicitness[root + leader].max(implicitness[root + joint]);
        }
        for Coupling { joint, leader, .. } in &self.followers {
            implicitness[root + joint] = implicitness[root + leader];
        }
    }

    /// Adds dry friction and joint limits as bounded impulses.
    #[inline(always)]
    fn constrain_joints(&mut self) {
        let (dt, s) = (self.dt_s, &mut self.scratch);
        let zero = Lanes::zero(self.simd);
        let (one, unbounded, per_s) = (zero.like(1.0), zero.like(f64::INFINITY), zero.like(dt.recip()));
        // Most steps of most robots have neither.
        let mut stopped = zero.less(zero);
        for i in 0..self.inner.len() {
            let (next, q, limits) = (s.next[self.root + i], self.now.q[i], self.limits[i]);
            let beyond = next.less((limits.0 - q) * per_s).or(((limits.1 - q) * per_s).less(next));
            stopped = stopped.or(beyond).or(zero.less(self.inner[i].dry_friction));
        }
        if !stopped.any() {
            return;
        }
        for i in 0..self.inner.len() {
            if self.prescribed[i].is_some() {
                continue;
            }
            let (d, q) = (self.root + i, self.now.q[i]);
            let (lower, upper) = ((self.limits[i].0 - q) * per_s, (self.limits[i].1 - q) * per_s);
            let limit = self.inner[i].dry_friction * dt;
            if zero.less(limit).any() {
                let [target, softness] = self.inner[i].held(self.now.u[d], dt);
                let law = BoundedRow { target, softness, lower: -limit, upper: limit };
                self.impulses.add_bounded(d, law, &self.tree, &s.matrix, &s.next);
            }
            let (below, above) = (s.next[d].less(lower), upper.less(s.next[d]));
            // The step must end at the limit, not halfway beyond it.
            s.implicitness[d] = below.or(above).select(one, s.implicitness[d]);
            if below.any() {
                let (target, upper) = (below.select(lower, zero), below.select(unbounded, zero));
                let law = BoundedRow { target, softness: zero, lower: zero, upper };
                self.impulses.add_bounded(d, law, &self.tree, &s.matrix, &s.next);
            }
            if above.any() {
                let (target, lower) = (above.select(upper, zero), above.select(-unbounded, zero));
                let law = BoundedRow { target, softness: zero, lower, upper: zero };
                self.impulses.add_bounded(d, law, &self.tree, &s.matrix, &s.next);
            }
        }
    }

    /// Adds the contacts with the floor and the ball.
    #[inline(always)]
    fn constrain_contacts(&mut self) {
        let Some(floor) = &self.floor else { return };
        let (dt, s, simd) = (self.dt_s, &mut self.scratch, self.simd);
        let zero = Lanes::zero(simd);
        let height = floor.friction.map(|_| -self.tree.origin.0[2]);
        let reach = Reach { floor: height, gap: zero.like(dt * FASTEST) };
        contacts::find(simd, &self.tree, &self.hulls, self.ball.as_ref(), reach, &mut s.contact_points);
        if s.contact_points.is_empty() {
            return;
        }
        let [free, now] = &mut s.motions;
        self.tree.motions(&s.next, free);
        if self.ball.is_some() {
            self.tree.motions(&self.now.u, now);
        }
        for contact in &s.contact_points {
            let separation = contact.in_contact_frame(simd, &contact.relative_velocity(free))[0];
            let mut mask = contact.mask.and(((separation - zero.like(PUSHED)) * (0.5 * dt)).less(contact.depth));
            let ball = self.ball.as_ref().filter(|ball| contact.body == ball.body || contact.other == Some(ball.body));
            let separated = contact.depth.less(zero);
            if let Some(ball) = ball {
                // A contact with restitution must not be slowed down before the bodies meet.
                mask = mask.and(separated.and(zero.less(ball.restitution)).not());
            }
            let (mut law, gives) = floor.law(contact.depth, dt);
            mask = mask.and(gives);
            if !mask.any() {
                continue;
            }
            law.friction = ball.map_or(floor.friction.unwrap_or(zero), |ball| ball.friction);
            if let Some(ball) = ball {
                let kept = -(ball.restitution * contact.in_contact_frame(simd, &contact.relative_velocity(now))[0]);
                // An impact is over within the step: the rebound speed must not load the spring.
                let bounces = zero.less(ball.restitution).and(law.target.less(kept));
                law.target = bounces.select(kept, law.target);
                law.softness = bounces.select(zero, law.softness);
            }
            self.impulses.add_contact(contact, law, mask, &self.tree, &s.matrix, free);
        }
    }

    /// Sums the normal impulses on the feet in the last step.
    #[inline(always)]
    pub(super) fn sum_foot_impulses(&mut self) {
        for contact in &self.scratch.contact_points {
            let hull = contact.hull.filter(|_| contact.other.is_none());
            if let Some(foot) = hull.and_then(|hull| self.hulls[hull].foot) {
                self.foot_impulses[foot] += self.impulses.normal(contact.slot);
            }
        }
    }
}

impl<S: Simd> Floor<S> {
    /// The contact law of a spring and a damper over a step, at a depth in the step's middle; and the mask of
    /// candidates whose floor has either.
    ///
    /// The force is k·(depth − dt/2·v') − d·v' at the separation speed v' at the step's end. While there is a gap, the
    /// law only keeps it from closing beyond contact.
    #[inline(always)]
    fn law(&self, depth: Lanes<S>, dt_s: f64) -> (ContactLaw<S>, Mask<S>) {
        let (zero, one) = (depth.like(0.0), depth.like(1.0));
        let resistance = self.damping + self.stiffness * (0.5 * dt_s);
        let gives = zero.less(resistance);
        let resistance = gives.select(resistance, one);
        let softness = (resistance * dt_s).recip();
        let pushed = self.stiffness * depth / resistance;
        let target = zero.less(depth).select(pushed, depth * (2.0 / dt_s));
        (ContactLaw { target, softness, friction: zero }, gives)
    }
}

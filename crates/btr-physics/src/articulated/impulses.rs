//! Impulses within bounds: dry friction in the joints, joint limits, contacts. Velocities at the step's end obey the laws
//! (time stepping after J. J. Moreau), and impulses are found one after the other, sweep by sweep (projected Gauss-Seidel) on
//! what each does to the others.
//!
//! Candidates side by side share their rows: a row is there if any of them needs it, and pushes nothing where it is not needed.
//! Each candidate's sweeps end when its own velocities have settled.

mod stick;

use super::lanes::{Lanes, Mask, V3};
use super::spatial::{push, solve_way, substitute};
use super::touch::Touch;
use super::tree::Tree;
use pulp::Simd;
use stick::Guess;

/// When the sweeps end where nothing touches: after so many, or when no velocity changes by a larger share of itself.
const IN_JOINTS: (usize, f64) = (60, 1e-13);
/// The same with contacts: far below what any sensor sees. A sole that slides flat on its corners may share its load among them
/// in many ways, and would be sorted out for ever.
const TOUCHING: (usize, f64) = (25, 1e-8);
/// Sweeps over the rows of one contact at a time.
const SWEEPS_ALONE: usize = 2;

/// All impulses of a step. Rows belong together: a contact has three.
pub(super) struct Impulses<S: Simd> {
    simd: S,
    rows: Vec<Row>,
    singles: Vec<Single<S>>,
    contacts: Vec<Contact<S>>,
    /// The velocity along each row, with the impulses found so far; and the impulses.
    speeds: Vec<Lanes<S>>,
    impulses: Vec<Lanes<S>>,
    /// The directions, seen through half of the inverse inertia: their products are what rows do to each other.
    halves: Vec<Lanes<S>>,
    /// What every row does to every other one, in 1/kg or the like.
    answers: Vec<Lanes<S>>,
    /// The last impulses of everything that can touch: where the sweeps begin.
    known: Vec<[Lanes<S>; 3]>,
    change: Vec<Lanes<S>>,
    guess: Guess<S>,
    /// For whom the sweeps do not end, or did not when they were needed last.
    hard: Mask<S>,
}

/// What a row pushes: everything on the ways to one or two degrees of freedom, none of which is on both.
#[derive(Clone, Copy)]
struct Row {
    /// Where each way leads, and where its part of the halves begins.
    ways: [Option<(usize, usize)>; 2],
}

/// A bounded impulse on one joint.
struct Single<S: Simd> {
    row: usize,
    /// The velocity that it tries to bring about.
    wanted: Lanes<S>,
    least: Lanes<S>,
    most: Lanes<S>,
}

/// A contact: one row along the normal and two across.
struct Contact<S: Simd> {
    /// The first of its rows.
    row: usize,
    slot: usize,
    law: Law<S>,
    /// Who touches there.
    there: Mask<S>,
    /// What an impulse along the normal, and one across, have to be at least to change the speed there by one.
    stubborn: Lanes<S>,
    stubborn_across: Lanes<S>,
}

/// How two bodies that touch push each other.
#[derive(Clone, Copy)]
pub(super) struct Law<S: Simd> {
    /// The speed of separation without an impulse, in m/s.
    pub(super) wanted: Lanes<S>,
    /// How much of it an impulse costs, in 1/kg.
    pub(super) softness: Lanes<S>,
    /// Coulomb's coefficient.
    pub(super) friction: Lanes<S>,
}

impl<S: Simd> Impulses<S> {
    /// Room for contacts at so many places.
    pub(super) fn new(simd: S, slots: usize) -> Self {
        Impulses {
            simd,
            rows: Vec::new(),
            singles: Vec::new(),
            contacts: Vec::new(),
            speeds: Vec::new(),
            impulses: Vec::new(),
            halves: Vec::new(),
            answers: Vec::new(),
            known: vec![[Lanes::zero(simd); 3]; slots],
            change: Vec::new(),
            guess: Guess::new(),
            hard: Lanes::zero(simd).less(Lanes::zero(simd)),
        }
    }

    #[inline(always)]
    pub(super) fn clear(&mut self) {
        self.rows.clear();
        self.singles.clear();
        self.contacts.clear();
        self.speeds.clear();
        self.halves.clear();
    }

    /// Something that stops a joint as far as impulses between `least` and `most` can.
    #[inline(always)]
    pub(super) fn hold(
        &mut self,
        dof: usize,
        [wanted, least, most]: [Lanes<S>; 3],
        tree: &Tree<S>,
        factor: &[Lanes<S>],
        u: &[Lanes<S>],
    ) {
        let (way, begin) = (&tree.ways[dof], self.halves.len());
        for &d in way {
            self.halves.push(Lanes::all(self.simd, if d == dof { 1.0 } else { 0.0 }));
        }
        solve_way(factor, tree.freedom(), way, &mut self.halves[begin..]);
        self.singles.push(Single { row: self.rows.len(), wanted, least, most });
        self.rows.push(Row { ways: [Some((dof, begin)), None] });
        self.speeds.push(u[dof]);
    }

    /// A contact.
    #[inline(always)]
    pub(super) fn touch(
        &mut self,
        touch: &Touch<S>,
        law: Law<S>,
        there: Mask<S>,
        tree: &Tree<S>,
        factor: &[Lanes<S>],
        u: &[Lanes<S>],
    ) {
        let row = self.rows.len();
        let side = across(self.simd, &touch.normal);
        let directions = [touch.normal, side, touch.normal.cross(&side)];
        for direction in &directions {
            let mut speed = Lanes::zero(self.simd);
            let own = self.aim(touch, touch.body, direction, tree, factor, u, &mut speed);
            let mut ways = [Some(own), None];
            if let Some(other) = touch.other {
                let away = V3::zero(self.simd) - *direction;
                ways[1] = Some(self.aim(touch, other, &away, tree, factor, u, &mut speed));
            }
            self.rows.push(Row { ways });
            self.speeds.push(speed);
        }
        let none = Lanes::zero(self.simd);
        self.contacts.push(Contact { row, slot: touch.slot, law, there, stubborn: none, stubborn_across: none });
    }

    /// What a push on a body does along the way to it, and how fast the way moves the body there.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    fn aim(
        &mut self,
        touch: &Touch<S>,
        body: usize,
        direction: &V3<S>,
        tree: &Tree<S>,
        factor: &[Lanes<S>],
        u: &[Lanes<S>],
        speed: &mut Lanes<S>,
    ) -> (usize, usize) {
        let (way, begin) = (tree.way_to(body), self.halves.len());
        let force = push(&touch.point, direction);
        for &d in way {
            let along = tree.axes[d].dot(&force);
            self.halves.push(along);
            *speed += along * u[d];
        }
        solve_way(factor, tree.freedom(), way, &mut self.halves[begin..]);
        (way[way.len() - 1], begin)
    }

    /// Finds the impulses and lets them change the velocities.
    #[inline(always)]
    pub(super) fn act(&mut self, tree: &Tree<S>, factor: &[Lanes<S>], u: &mut [Lanes<S>]) {
        let zero = Lanes::zero(self.simd);
        if self.rows.is_empty() {
            self.known.fill([zero; 3]);
            self.hard = zero.less(zero);
            return;
        }
        self.prepare(tree);
        let hard = self.hard.and(self.touching());
        let stuck = if hard.any() { self.stick(hard) } else { hard };
        self.begin(stuck, hard);
        self.hard = stuck.or(self.sweep_until_settled(stuck.not()));
        self.known.fill([zero; 3]);
        for contact in &self.contacts {
            for k in 0..3 {
                self.known[contact.slot][k] = self.impulses[contact.row + k];
            }
        }
        self.change.clear();
        self.change.resize(u.len(), zero);
        for (row, &impulse) in self.rows.iter().zip(&self.impulses) {
            for &(last, begin) in row.ways.iter().flatten() {
                let way = &tree.ways[last];
                for (&d, &half) in way.iter().zip(&self.halves[begin..begin + way.len()]) {
                    self.change[d] += half * impulse;
                }
            }
        }
        substitute(factor, &tree.ways, &mut self.change);
        for (u, change) in u.iter_mut().zip(&self.change) {
            *u += *change;
        }
    }

    /// The normal impulse of the last step at a slot, in N·s.
    #[inline(always)]
    pub(super) fn normal(&self, slot: usize) -> Lanes<S> {
        self.known[slot][0]
    }

    /// What rows do to each other.
    #[inline(always)]
    fn prepare(&mut self, tree: &Tree<S>) {
        let (rows, zero) = (self.rows.len(), Lanes::zero(self.simd));
        self.answers.clear();
        self.answers.resize(rows * rows, zero);
        for i in 0..rows {
            for j in 0..=i {
                let mut answer = zero;
                for &(a, own) in self.rows[i].ways.iter().flatten() {
                    for &(b, others) in self.rows[j].ways.iter().flatten() {
                        let shared = shared(&tree.ways[a], &tree.ways[b]);
                        answer += dot(&self.halves[own..own + shared], &self.halves[others..others + shared], zero);
                    }
                }
                self.answers[i * rows + j] = answer;
                self.answers[j * rows + i] = answer;
            }
        }
        self.impulses.clear();
        self.impulses.resize(rows, zero);
        for contact in &mut self.contacts {
            let row = contact.row;
            let (a, b, c) = (
                self.answers[(row + 1) * rows + row + 1],
                self.answers[(row + 1) * rows + row + 2],
                self.answers[(row + 2) * rows + row + 2],
            );
            contact.stubborn = (self.answers[row * rows + row] + contact.law.softness).recip();
            let apart = ((a - c) * (a - c) * 0.25 + b * b).sqrt();
            contact.stubborn_across = ((a + c) * 0.5 + apart).recip();
        }
    }

    /// Where the sweeps begin for all who have not settled, whether that was tried or not: at the last impulses.
    #[inline(always)]
    fn begin(&mut self, settled: Mask<S>, tried: Mask<S>) {
        let (rows, zero) = (self.rows.len(), Lanes::zero(self.simd));
        if !settled.not().any() {
            return;
        }
        if tried.any() {
            for (speed, alone) in self.speeds.iter_mut().zip(&self.guess.alone) {
                *speed = settled.select(*speed, *alone);
            }
            for single in &self.singles {
                self.impulses[single.row] = settled.select(self.impulses[single.row], zero);
            }
        }
        for contact in &self.contacts {
            for k in 0..3 {
                let row = contact.row + k;
                let known = contact.there.select(self.known[contact.slot][k], zero);
                self.impulses[row] = settled.select(self.impulses[row], known);
                let impulse = settled.select(zero, known);
                let answers = &self.answers[row * rows..(row + 1) * rows];
                for (speed, &answer) in self.speeds.iter_mut().zip(answers) {
                    *speed += answer * impulse;
                }
            }
        }
    }

    /// Who touches anything.
    #[inline(always)]
    fn touching(&self) -> Mask<S> {
        let zero = Lanes::zero(self.simd);
        let mut touching = zero.less(zero);
        for contact in &self.contacts {
            touching = touching.or(contact.there);
        }
        touching
    }

    /// Sweeps for each candidate until it has settled or may sweep no more; gives back for whom there was no end.
    #[inline(always)]
    fn sweep_until_settled(&mut self, mut moving: Mask<S>) -> Mask<S> {
        let zero = Lanes::zero(self.simd);
        let touching = self.touching();
        let settled = touching.select(zero.like(TOUCHING.1), zero.like(IN_JOINTS.1));
        let sweeps = touching.select(zero.like(TOUCHING.0 as f64), zero.like(IN_JOINTS.0 as f64));
        let (mut sweep, mut endless) = (0.0, zero.less(zero));
        while moving.any() {
            let largest = self.sweep(moving);
            sweep += 1.0;
            moving = moving.and(largest.at_most(settled).not());
            let last = sweeps.at_most(zero.like(sweep));
            endless = endless.or(moving.and(last));
            moving = moving.and(last.not());
        }
        endless
    }

    /// Takes the impulse of every joint and those of every contact to where they should be if the others stay, for those that still
    /// are moving; gives back the largest relative change of a velocity.
    #[inline(always)]
    fn sweep(&mut self, moving: Mask<S>) -> Lanes<S> {
        let (rows, zero) = (self.rows.len(), Lanes::zero(self.simd));
        let mut largest = zero;
        for k in 0..self.singles.len() {
            let Single { row, wanted, least, most } = self.singles[k];
            let own = self.answers[row * rows + row];
            let to = (self.impulses[row] + (wanted - self.speeds[row]) / own).clamp(least, most);
            let change = moving.select(to - self.impulses[row], zero);
            self.impulses[row] += change;
            for (speed, &answer) in self.speeds.iter_mut().zip(&self.answers[row * rows..(row + 1) * rows]) {
                *speed += answer * change;
            }
            largest = largest.max(relative(change * own, self.speeds[row]));
        }
        for k in 0..self.contacts.len() {
            let row = self.contacts[k].row;
            let found = self.alone(&self.contacts[k]);
            let mut change = found;
            for k in 0..3 {
                change[k] = moving.select(found[k] - self.impulses[row + k], zero);
                self.impulses[row + k] += change[k];
            }
            let (first, rest) = self.answers[row * rows..(row + 3) * rows].split_at(rows);
            let (second, third) = rest.split_at(rows);
            for (((speed, &a), &b), &c) in self.speeds.iter_mut().zip(first).zip(second).zip(third) {
                *speed += a * change[0] + b * change[1] + c * change[2];
            }
            for k in 0..3 {
                let own = self.answers[(row + k) * rows + row + k];
                largest = largest.max(relative(change[k] * own, self.speeds[row + k]));
            }
        }
        largest
    }

    /// The impulses of a contact while all others stay: a few sweeps over its three rows, which lean on each other most.
    #[inline(always)]
    fn alone(&self, contact: &Contact<S>) -> [Lanes<S>; 3] {
        let (rows, row, Law { wanted, softness, friction }) = (self.rows.len(), contact.row, contact.law);
        let (zero, one) = (Lanes::zero(self.simd), Lanes::all(self.simd, 1.0));
        let mut own = [[zero; 3]; 3];
        for i in 0..3 {
            for j in 0..3 {
                own[i][j] = self.answers[(row + i) * rows + row + j];
            }
        }
        let mut speed = [self.speeds[row], self.speeds[row + 1], self.speeds[row + 2]];
        let mut impulse = [self.impulses[row], self.impulses[row + 1], self.impulses[row + 2]];
        for _ in 0..SWEEPS_ALONE {
            let missing = wanted - speed[0] - softness * impulse[0];
            let to = contact.there.select((impulse[0] + missing * contact.stubborn).max(zero), zero);
            let change = to - impulse[0];
            impulse[0] = to;
            for i in 0..3 {
                speed[i] += own[0][i] * change;
            }
            let most = friction * impulse[0];
            let tried =
                [impulse[1] - speed[1] * contact.stubborn_across, impulse[2] - speed[2] * contact.stubborn_across];
            let square = tried[0] * tried[0] + tried[1] * tried[1];
            let beyond = (most * most).less(square);
            let shrink = beyond.select(most / beyond.select(square, one).sqrt(), one);
            for k in 1..3 {
                let to = tried[k - 1] * shrink;
                let change = to - impulse[k];
                impulse[k] = to;
                for i in 0..3 {
                    speed[i] += own[k][i] * change;
                }
            }
        }
        impulse
    }
}

impl<S: Simd> Clone for Single<S> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<S: Simd> Copy for Single<S> {}

/// The speed at which two bodies separate where they touch.
#[inline(always)]
pub(super) fn separation<S: Simd>(touch: &Touch<S>, tree: &Tree<S>, u: &[Lanes<S>]) -> Lanes<S> {
    let force = push(&touch.point, &touch.normal);
    let mut speed = force.linear.0[0].like(0.0);
    for &d in tree.way_to(touch.body) {
        speed += tree.axes[d].dot(&force) * u[d];
    }
    if let Some(other) = touch.other {
        for &d in tree.way_to(other) {
            speed -= tree.axes[d].dot(&force) * u[d];
        }
    }
    speed
}

/// A direction across another: x for a vertical one.
#[inline(always)]
fn across<S: Simd>(simd: S, normal: &V3<S>) -> V3<S> {
    let (x, y) = (V3::axis(simd, 0), V3::axis(simd, 1));
    let steep = normal.0[0].abs().less(Lanes::all(simd, 0.7));
    let mut along = x;
    for k in 0..3 {
        along.0[k] = steep.select(x.0[k], y.0[k]);
    }
    let side = along - normal.times(normal.dot(&along));
    side.times(side.norm().recip())
}

/// How many steps two ways from the root have in common: all of them come first.
#[inline(always)]
fn shared(a: &[usize], b: &[usize]) -> usize {
    if a[a.len() - 1] == b[b.len() - 1] {
        return a.len();
    }
    let mut steps = 0;
    while steps < a.len() && steps < b.len() && a[steps] == b[steps] {
        steps += 1;
    }
    steps
}

/// In four sums at once.
#[inline(always)]
fn dot<S: Simd>(a: &[Lanes<S>], b: &[Lanes<S>], zero: Lanes<S>) -> Lanes<S> {
    let mut sums = [zero; 4];
    let whole = a.len() & !3;
    let mut at = 0;
    while at < whole {
        for k in 0..4 {
            sums[k] += a[at + k] * b[at + k];
        }
        at += 4;
    }
    while at < a.len() {
        sums[0] += a[at] * b[at];
        at += 1;
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}

/// A change of a velocity beside that velocity.
#[inline(always)]
fn relative<S: Simd>(change: Lanes<S>, speed: Lanes<S>) -> Lanes<S> {
    change.abs() / (speed.like(1.0) + speed.abs())
}

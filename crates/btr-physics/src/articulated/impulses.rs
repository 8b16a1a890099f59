//! Impulses within bounds: dry friction in the joints, joint limits, contacts. Velocities at the step's end obey the laws
//! (time stepping after J. J. Moreau), and impulses are found one after the other, sweep by sweep (projected Gauss-Seidel) on
//! what each does to the others.

use super::spatial::{push, solve_way, substitute};
use super::touch::Touch;
use super::tree::Tree;
use nalgebra::Vector3;

/// When the sweeps end where nothing touches: after so many, or when no velocity changes by a larger share of itself.
const IN_JOINTS: (usize, f64) = (60, 1e-13);
/// The same with contacts: far below what any sensor sees. A sole that slides flat on its corners may share its load among them
/// in many ways, and would be sorted out for ever.
const TOUCHING: (usize, f64) = (25, 1e-8);
/// Sweeps over the rows of one contact at a time.
const SWEEPS_ALONE: usize = 2;

/// All impulses of a step. Rows belong together: a contact has three.
#[derive(Default)]
pub(super) struct Impulses {
    singles: Vec<Single>,
    contacts: Vec<Contact>,
    /// The velocity along each row, with the impulses found so far; and the impulses.
    speeds: Vec<f64>,
    impulses: Vec<f64>,
    /// Row by row the directions, seen through half of the inverse inertia: their products are what rows do to each other.
    halves: Vec<f64>,
    /// What every row does to every other one, in 1/kg or the like.
    answers: Vec<f64>,
    /// The last impulses of everything that can touch: where the sweeps begin.
    known: Vec<[f64; 3]>,
    change: Vec<f64>,
}

/// A bounded impulse on one joint.
struct Single {
    row: usize,
    /// The velocity that it tries to bring about.
    wanted: f64,
    least: f64,
    most: f64,
}

/// A contact: one row along the normal and two across.
struct Contact {
    /// The first of its rows.
    row: usize,
    slot: usize,
    law: Law,
    /// What an impulse along the normal, and one across, have to be at least to change the speed there by one.
    stubborn: f64,
    stubborn_across: f64,
}

/// How two bodies that touch push each other.
#[derive(Clone, Copy)]
pub(super) struct Law {
    /// The speed of separation without an impulse, in m/s.
    pub(super) wanted: f64,
    /// How much of it an impulse costs, in 1/kg.
    pub(super) softness: f64,
    /// Coulomb's coefficient.
    pub(super) friction: f64,
}

impl Impulses {
    /// Room for contacts at so many places.
    pub(super) fn new(slots: usize) -> Self {
        Impulses { known: vec![[0.0; 3]; slots], ..Impulses::default() }
    }

    pub(super) fn clear(&mut self) {
        self.singles.clear();
        self.contacts.clear();
        self.speeds.clear();
        self.halves.clear();
    }

    /// Something that stops a joint as far as impulses between `least` and `most` can.
    pub(super) fn hold(&mut self, dof: usize, [wanted, least, most]: [f64; 3], tree: &Tree, factor: &[f64], u: &[f64]) {
        let row = self.speeds.len();
        self.speeds.push(u[dof]);
        let half = room(&mut self.halves, tree.freedom());
        half[dof] = 1.0;
        solve_way(factor, &tree.above, dof, half);
        self.singles.push(Single { row, wanted, least, most });
    }

    /// A contact.
    pub(super) fn touch(&mut self, touch: &Touch, law: Law, tree: &Tree, factor: &[f64], u: &[f64]) {
        let row = self.speeds.len();
        let side = across(&touch.normal);
        for direction in [touch.normal, side, touch.normal.cross(&side)] {
            let half = room(&mut self.halves, tree.freedom());
            let mut speed = 0.0;
            aim(touch, &direction, tree, |d, along| {
                half[d] += along;
                speed += along * u[d];
            });
            self.speeds.push(speed);
            solve_way(factor, &tree.above, tree.last(touch.body), half);
            if let Some(other) = touch.other {
                solve_way(factor, &tree.above, tree.last(other), half);
            }
        }
        self.contacts.push(Contact { row, slot: touch.slot, law, stubborn: 0.0, stubborn_across: 0.0 });
    }

    /// Finds the impulses and lets them change the velocities.
    pub(super) fn act(&mut self, tree: &Tree, factor: &[f64], u: &mut [f64]) {
        if self.speeds.is_empty() {
            self.known.fill([0.0; 3]);
            return;
        }
        self.prepare(u.len());
        let (sweeps, settled) = if self.contacts.is_empty() { IN_JOINTS } else { TOUCHING };
        for _ in 0..sweeps {
            if self.sweep() <= settled {
                break;
            }
        }
        self.known.fill([0.0; 3]);
        for contact in &self.contacts {
            self.known[contact.slot].copy_from_slice(&self.impulses[contact.row..contact.row + 3]);
        }
        self.change.clear();
        self.change.resize(u.len(), 0.0);
        for (impulse, half) in self.impulses.iter().zip(self.halves.chunks_exact(u.len())) {
            add(&mut self.change, half, *impulse);
        }
        substitute(factor, &tree.above, &mut self.change);
        add(u, &self.change, 1.0);
    }

    /// The normal impulse of the last step at a slot, in N·s.
    pub(super) fn normal(&self, slot: usize) -> f64 {
        self.known[slot][0]
    }

    /// What rows do to each other, and the impulses to begin with.
    fn prepare(&mut self, n: usize) {
        let rows = self.speeds.len();
        self.answers.clear();
        self.answers.resize(rows * rows, 0.0);
        for (i, a) in self.halves.chunks_exact(n).enumerate() {
            for (j, b) in self.halves.chunks_exact(n).enumerate().take(i + 1) {
                let answer = dot(a, b);
                self.answers[i * rows + j] = answer;
                self.answers[j * rows + i] = answer;
            }
        }
        self.impulses.clear();
        self.impulses.resize(rows, 0.0);
        for contact in &mut self.contacts {
            let answer = |i: usize, j: usize| self.answers[(contact.row + i) * rows + contact.row + j];
            let (a, b, c) = (answer(1, 1), answer(1, 2), answer(2, 2));
            contact.stubborn = (answer(0, 0) + contact.law.softness).recip();
            contact.stubborn_across = (0.5 * (a + c) + (0.25 * (a - c) * (a - c) + b * b).sqrt()).recip();
            for (k, &impulse) in self.known[contact.slot].iter().enumerate() {
                let row = contact.row + k;
                self.impulses[row] = impulse;
                add(&mut self.speeds, &self.answers[row * rows..(row + 1) * rows], impulse);
            }
        }
    }

    /// Takes the impulse of every joint and those of every contact to where they should be if the others stay; gives back the
    /// largest relative change of a velocity.
    fn sweep(&mut self) -> f64 {
        let rows = self.speeds.len();
        let mut largest = 0.0f64;
        for k in 0..self.singles.len() {
            let Single { row, wanted, least, most } = self.singles[k];
            let missing = (wanted - self.speeds[row]) / self.answers[row * rows + row];
            let to = (self.impulses[row] + missing).clamp(least, most);
            largest = largest.max(self.set(row, to));
        }
        for k in 0..self.contacts.len() {
            let row = self.contacts[k].row;
            let found = self.alone(&self.contacts[k]);
            for (k, to) in found.into_iter().enumerate() {
                largest = largest.max(self.set(row + k, to));
            }
        }
        largest
    }

    /// Sets an impulse; gives back the relative change of its own velocity.
    fn set(&mut self, row: usize, to: f64) -> f64 {
        let rows = self.speeds.len();
        let change = to - self.impulses[row];
        self.impulses[row] = to;
        let answers = &self.answers[row * rows..(row + 1) * rows];
        add(&mut self.speeds, answers, change);
        (change * answers[row]).abs() / (1.0 + self.speeds[row].abs())
    }

    /// The impulses of a contact while all others stay: a few sweeps over its three rows, which lean on each other most.
    fn alone(&self, contact: &Contact) -> [f64; 3] {
        let (rows, row, Law { wanted, softness, friction }) = (self.speeds.len(), contact.row, contact.law);
        let answer = |i: usize, j: usize| self.answers[(row + i) * rows + row + j];
        let own: [[f64; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| answer(i, j)));
        let [mut speed, mut impulse] = [&self.speeds, &self.impulses].map(|all| [all[row], all[row + 1], all[row + 2]]);
        let push = |k: usize, to: f64, speed: &mut [f64; 3], impulse: &mut [f64; 3]| {
            let change = to - impulse[k];
            impulse[k] = to;
            speed.iter_mut().zip(&own[k]).for_each(|(speed, answer)| *speed += answer * change);
        };
        for _ in 0..SWEEPS_ALONE {
            let missing = wanted - speed[0] - softness * impulse[0];
            let to = (impulse[0] + missing * contact.stubborn).max(0.0);
            push(0, to, &mut speed, &mut impulse);
            let most = friction * impulse[0];
            let tried = [1, 2].map(|k| impulse[k] - speed[k] * contact.stubborn_across);
            let square = tried[0] * tried[0] + tried[1] * tried[1];
            let shrink = if square > most * most { most / square.sqrt() } else { 1.0 };
            for k in [1, 2] {
                push(k, tried[k - 1] * shrink, &mut speed, &mut impulse);
            }
        }
        impulse
    }
}

/// The speed at which two bodies separate where they touch.
pub(super) fn separation(touch: &Touch, tree: &Tree, u: &[f64]) -> f64 {
    let mut speed = 0.0;
    aim(touch, &touch.normal, tree, |d, along| speed += along * u[d]);
    speed
}

/// Tells how much each degree of freedom moves what touches, along `direction`.
fn aim(touch: &Touch, direction: &Vector3<f64>, tree: &Tree, mut tell: impl FnMut(usize, f64)) {
    let force = push(&touch.point, direction);
    for (body, sign) in [(Some(touch.body), 1.0), (touch.other, -1.0)] {
        let mut at = body.map(|body| tree.last(body));
        while let Some(d) = at {
            tell(d, sign * tree.axes[d].dot(&force));
            at = tree.above[d];
        }
    }
}

/// A direction across another: x for a vertical one.
fn across(normal: &Vector3<f64>) -> Vector3<f64> {
    let along = if normal.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() };
    (along - normal * normal.dot(&along)).normalize()
}

/// `n` more zeros.
fn room(numbers: &mut Vec<f64>, n: usize) -> &mut [f64] {
    let row = numbers.len();
    numbers.resize(row + n, 0.0);
    &mut numbers[row..]
}

/// In four sums at once.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a, b) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
    let mut sums = [0.0; 4];
    for (a, b) in a.zip(b) {
        sums.iter_mut().zip(a).zip(b).for_each(|((sum, a), b)| *sum += a * b);
    }
    rest + (sums[0] + sums[1]) + (sums[2] + sums[3])
}

fn add(to: &mut [f64], direction: &[f64], size: f64) {
    for (to, direction) in to.iter_mut().zip(direction) {
        *to += direction * size;
    }
}

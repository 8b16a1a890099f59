//! Impulses within bounds: dry friction in the joints, joint limits, contacts. Velocities at the step's end obey the
//! laws (time stepping after J. J. Moreau), and impulses are found on what each does to the others: one after the
//! other, sweep by sweep (sweep.rs), or, for whom that takes for ever, all at once (stick.rs).
//!
//! Candidates side by side share their rows: a row is there if any of them needs it, and pushes nothing where it is not needed.
//! Each candidate's sweeps end when its own velocities have settled.

mod stick;
mod sweep;

use super::contacts::ContactPoint;
use super::lanes::{Lanes, Mask};
use super::spatial::{Spatial, solve_motions, solve_way, substitute};
use super::tree::Tree;
use pulp::Simd;
use stick::StickGuess;

/// All impulses of a step.
pub(super) struct Impulses<S: Simd> {
    simd: S,
    blocks: Vec<ImpulseBlock>,
    singles: Vec<Single<S>>,
    /// How many of them couple joints. They come first.
    couples: usize,
    contacts: Vec<Contact<S>>,
    /// The velocity along each row, with the impulses found so far; and the impulses.
    speeds: Vec<Lanes<S>>,
    impulses: Vec<Lanes<S>>,
    /// The directions, seen through half of the inverse inertia: their products are what rows do to each other.
    halves: Vec<Lanes<S>>,
    /// The same of all pushes and turns on a body, and where those of each that is touched begin.
    bases: Vec<Spatial<S>>,
    pushed: Vec<(usize, usize)>,
    /// What every row does to every other one, in 1/kg or the like.
    answers: Vec<Lanes<S>>,
    /// The last step's impulses of everything that can touch, where the sweeps begin; and those of this step.
    known: Vec<[Lanes<S>; 3]>,
    found: Vec<[Lanes<S>; 3]>,
    change: Vec<Lanes<S>>,
    guess: StickGuess<S>,
    /// For whom the sweeps did not end when they were needed last, and in this step.
    hard: Mask<S>,
    found_hard: Mask<S>,
}

/// Rows that belong together: the three of a contact, or a single one. They push everything on the ways to one or two
/// degrees of freedom.
#[derive(Clone, Copy)]
struct ImpulseBlock {
    row: usize,
    rows: usize,
    /// Where each way leads, and where its part of the halves begins, in which the rows have their entries side by side.
    ways: [Option<(usize, usize)>; 2],
}

/// A bounded impulse on one joint, or between two that are coupled.
#[derive(Clone, Copy)]
struct Single<S: Simd> {
    row: usize,
    /// The velocity that it tries to bring about.
    wanted: Lanes<S>,
    least: Lanes<S>,
    most: Lanes<S>,
    /// What an impulse has to be to change the velocity by one.
    stubborn: Lanes<S>,
}

/// A contact: one row along the normal and two across.
struct Contact<S: Simd> {
    /// The first of its rows.
    row: usize,
    slot: usize,
    law: ContactLaw<S>,
    /// Who touches there.
    there: Mask<S>,
    /// What an impulse along the normal, and one across, have to be at least to change the speed there by one.
    stubborn: Lanes<S>,
    stubborn_across: Lanes<S>,
}

/// How two bodies that touch push each other.
#[derive(Clone, Copy)]
pub(super) struct ContactLaw<S: Simd> {
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
    pub(super) fn clear(&mut self) {
        self.blocks.clear();
        self.singles.clear();
        self.couples = 0;
        self.contacts.clear();
        self.speeds.clear();
        self.halves.clear();
        self.bases.clear();
        self.pushed.clear();
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
        self.single([Some((dof, begin)), None], [wanted, least, most], u[dof]);
    }

    /// Something that lets one degree of freedom move at a ratio to another one and this much faster, whatever that takes.
    #[inline(always)]
    pub(super) fn couple(
        &mut self,
        [dof, leader]: [usize; 2],
        [ratio, wanted]: [Lanes<S>; 2],
        tree: &Tree<S>,
        factor: &[Lanes<S>],
        u: &[Lanes<S>],
    ) {
        let (zero, one) = (Lanes::zero(self.simd), Lanes::all(self.simd, 1.0));
        let mut ways = [None; 2];
        for (way, (last, along)) in ways.iter_mut().zip([(dof, one), (leader, -ratio)]) {
            let (all, begin) = (&tree.ways[last], self.halves.len());
            self.halves.extend(all.iter().map(|&d| if d == last { along } else { zero }));
            solve_way(factor, tree.freedom(), all, &mut self.halves[begin..]);
            *way = Some((last, begin));
        }
        let endless = one * f64::INFINITY;
        self.single(ways, [wanted, -endless, endless], u[dof] - ratio * u[leader]);
        self.couples += 1;
    }

    #[inline(always)]
    fn single(&mut self, ways: [Option<(usize, usize)>; 2], [wanted, least, most]: [Lanes<S>; 3], speed: Lanes<S>) {
        let row = self.rows();
        self.singles.push(Single { row, wanted, least, most, stubborn: Lanes::zero(self.simd) });
        self.blocks.push(ImpulseBlock { row, rows: 1, ways });
        self.speeds.push(speed);
    }

    #[inline(always)]
    fn rows(&self) -> usize {
        self.speeds.len()
    }

    /// A contact.
    #[inline(always)]
    pub(super) fn touch(
        &mut self,
        touch: &ContactPoint<S>,
        law: ContactLaw<S>,
        there: Mask<S>,
        tree: &Tree<S>,
        factor: &[Lanes<S>],
        motions: &[Spatial<S>],
    ) {
        let (row, zero, one) = (self.rows(), Lanes::zero(self.simd), Lanes::all(self.simd, 1.0));
        let mut ways = [Some(self.aim(touch, touch.body, one, tree, factor)), None];
        if let Some(other) = touch.other {
            ways[1] = Some(self.aim(touch, other, -one, tree, factor));
        }
        let speeds = touch.along(self.simd, &touch.apart(motions));
        self.blocks.push(ImpulseBlock { row, rows: 3, ways });
        self.speeds.extend_from_slice(&speeds);
        self.contacts.push(Contact { row, slot: touch.slot, law, there, stubborn: zero, stubborn_across: zero });
    }

    /// What pushes on a body along the normal and across, in this sense, do along the way to it.
    #[inline(always)]
    fn aim(
        &mut self,
        touch: &ContactPoint<S>,
        body: usize,
        sense: Lanes<S>,
        tree: &Tree<S>,
        factor: &[Lanes<S>],
    ) -> (usize, usize) {
        let (way, begin, basis) = (tree.way_to(body), self.halves.len(), self.solved(body, tree, factor));
        self.halves.resize(begin + 3 * way.len(), sense);
        for step in 0..way.len() {
            let along = touch.along(self.simd, &self.bases[basis + step].at(&touch.point));
            for k in 0..3 {
                self.halves[begin + 3 * step + k] = along[k] * sense;
            }
        }
        (way[way.len() - 1], begin)
    }

    /// Where the halves of all pushes and turns on a body begin: an entry for each step of the way to it.
    #[inline(always)]
    fn solved(&mut self, body: usize, tree: &Tree<S>, factor: &[Lanes<S>]) -> usize {
        for k in 0..self.pushed.len() {
            if self.pushed[k].0 == body {
                return self.pushed[k].1;
            }
        }
        let (way, begin) = (tree.way_to(body), self.bases.len());
        for &d in way {
            self.bases.push(tree.axes[d]);
        }
        solve_motions(factor, tree.freedom(), way, &mut self.bases[begin..]);
        self.pushed.push((body, begin));
        begin
    }

    /// Finds the impulses and lets them change the velocities.
    #[inline(always)]
    pub(super) fn act(&mut self, tree: &Tree<S>, factor: &[Lanes<S>], u: &mut [Lanes<S>]) {
        let zero = Lanes::zero(self.simd);
        if self.blocks.is_empty() {
            self.found.fill([zero; 3]);
            self.found_hard = zero.less(zero);
            return;
        }
        self.prepare(tree);
        // Joints that are coupled push each other: sweep by sweep that takes long, too.
        let all = zero.at_most(zero);
        let hard = if self.couples > 0 { all } else { self.hard.and(self.touching()) };
        let stuck = if hard.any() { self.stick(hard) } else { hard };
        self.begin(stuck, hard);
        self.found_hard = stuck.or(self.sweep_until_settled(stuck.not(), u));
        self.found.fill([zero; 3]);
        for contact in &self.contacts {
            for k in 0..3 {
                self.found[contact.slot][k] = self.impulses[contact.row + k];
            }
        }
        self.change.clear();
        self.change.resize(u.len(), zero);
        for block in 0..self.blocks.len() {
            match self.blocks[block].rows {
                3 => self.add_up::<3>(block, tree),
                _ => self.add_up::<1>(block, tree),
            }
        }
        substitute(factor, &tree.ways, &mut self.change);
        for (u, change) in u.iter_mut().zip(&self.change) {
            *u += *change;
        }
    }

    /// The step is done with what was found last. A step that is solved anew before begins where it began.
    #[inline(always)]
    pub(super) fn keep(&mut self) {
        std::mem::swap(&mut self.known, &mut self.found);
        self.hard = self.found_hard;
    }

    /// The normal impulse of the last step at a slot, in N·s.
    #[inline(always)]
    pub(super) fn normal(&self, slot: usize) -> Lanes<S> {
        self.known[slot][0]
    }

    /// Adds what a block's impulses do to the change.
    #[inline(always)]
    fn add_up<const ROWS: usize>(&mut self, block: usize, tree: &Tree<S>) {
        let ImpulseBlock { row, ways, .. } = self.blocks[block];
        for &(last, begin) in ways.iter().flatten() {
            for (step, &d) in tree.ways[last].iter().enumerate() {
                for k in 0..ROWS {
                    let half = self.halves[begin + step * ROWS + k];
                    self.change[d] = self.change[d].add_product(half, self.impulses[row + k]);
                }
            }
        }
    }

    /// What rows do to each other.
    #[inline(always)]
    fn prepare(&mut self, tree: &Tree<S>) {
        let (rows, zero) = (self.rows(), Lanes::zero(self.simd));
        // All that is read of it is written first.
        self.answers.resize(self.answers.len().max(rows * rows), zero);
        for i in 0..self.blocks.len() {
            for j in 0..=i {
                match (self.blocks[i].rows, self.blocks[j].rows) {
                    (3, 3) => self.answer::<3, 3>(i, j, tree),
                    (3, _) => self.answer::<3, 1>(i, j, tree),
                    (_, 3) => self.answer::<1, 3>(i, j, tree),
                    _ => self.answer::<1, 1>(i, j, tree),
                }
            }
        }
        self.impulses.clear();
        self.impulses.resize(rows, zero);
        for single in &mut self.singles {
            single.stubborn = self.answers[single.row * rows + single.row].recip();
        }
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

    /// What two blocks do to each other.
    #[inline(always)]
    fn answer<const OWN: usize, const OTHERS: usize>(&mut self, i: usize, j: usize, tree: &Tree<S>) {
        let (rows, one, other) = (self.rows(), self.blocks[i], self.blocks[j]);
        let mut sums = [[Lanes::zero(self.simd); OTHERS]; OWN];
        for &(a, own) in one.ways.iter().flatten() {
            for &(b, others) in other.ways.iter().flatten() {
                for step in 0..shared(&tree.ways[a], &tree.ways[b]) {
                    let own = &self.halves[own + step * OWN..][..OWN];
                    let others = &self.halves[others + step * OTHERS..][..OTHERS];
                    for k in 0..OWN {
                        for l in 0..OTHERS {
                            sums[k][l] = sums[k][l].add_product(own[k], others[l]);
                        }
                    }
                }
            }
        }
        for k in 0..OWN {
            for l in 0..OTHERS {
                self.answers[(one.row + k) * rows + other.row + l] = sums[k][l];
                self.answers[(other.row + l) * rows + one.row + k] = sums[k][l];
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

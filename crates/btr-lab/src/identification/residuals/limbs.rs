//! Limbs that do not act on each other: those of a robot whose base is held. What changes in one of them shows there
//! alone, so that changes in several limbs share a simulation.

use crate::identification::problem::{Change, IdentificationProblem};
use btr_physics::robot::Base;
use btr_physics::robot::site::instance;

impl IdentificationProblem {
    /// Parameters that act in a single limb, with the compared channels of that limb; none where limbs act on each
    /// other.
    pub(super) fn limb_parameters(&self) -> Vec<(usize, Vec<String>)> {
        if !self.has_separate_limbs() {
            return Vec::new();
        }
        let one = |links: &[usize]| {
            let mut limbs = links.iter().map(|&link| self.limb_of_link(link));
            let first = limbs.next()??;
            limbs.all(|limb| limb == Some(first)).then(|| self.compared_in(first))
        };
        let own = self.model.targets.iter().enumerate().filter_map(|(k, target)| Some((k, one(target.links())?)));
        let links = &self.model.robot.links;
        let offered = self.candidates.iter().flat_map(|candidate| {
            let (site, _) = instance(&candidate.site);
            let link = links.iter().position(|link| link.joint.name == site || link.name == site);
            let channels = link.and_then(|link| one(&[link]));
            candidate.parameters().filter_map(move |k| Some((k, channels.clone()?)))
        });
        own.chain(offered).collect()
    }

    /// The parameters of candidates that let limbs act on each other.
    pub(super) fn joining(&self) -> Vec<usize> {
        let joins = |change: &Change| matches!(change, Change::Effect(effect) if effect.joins_limbs());
        let joining = self.candidates.iter().zip(&self.changes).filter(|(_, change)| joins(change));
        joining.flat_map(|(candidate, _)| candidate.parameters()).collect()
    }

    /// The compared channels of a joint's limb, where limbs do not act on each other; otherwise none.
    pub(super) fn channels_beside(&self, joint: usize) -> Vec<String> {
        if self.has_separate_limbs() { self.compared_in(joint) } else { Vec::new() }
    }

    /// Whether the robot has several limbs on a held base, nothing of the model's own acts on two of them, and every
    /// compared channel is one of a joint.
    fn has_separate_limbs(&self) -> bool {
        let robot = &self.model.robot;
        let several = self.limbs.iter().any(|limb| *limb != self.limbs[0]);
        if robot.base != Base::Fixed || !several || self.model.has_contact() || self.is_chaotic() {
            return false;
        }
        let placed = self.model.effects.iter().map(|placed| placed.effect);
        let parameters = self.model.targets.iter().filter_map(|target| Some(target.of_effect()?.0));
        let joined = placed.chain(parameters).any(|effect| effect.joins_limbs());
        let linked = robot.followers().iter().any(|pair| self.limbs[pair.joint] != self.limbs[pair.leader]);
        let mut channels = self.logs.iter().flat_map(|log| &log.channels);
        !joined && !linked && channels.all(|channel| self.joint_of(&channel.name).is_some())
    }

    /// The joint whose channel this is: `dq_knee` is one of `knee`.
    fn joint_of(&self, channel: &str) -> Option<usize> {
        let (_, joint) = channel.split_once('_')?;
        self.model.robot.movable().position(|(_, link)| link.joint.name == joint)
    }

    /// A joint of the limb that a link is part of; `None` for what carries the limbs.
    fn limb_of_link(&self, link: usize) -> Option<usize> {
        let links = &self.model.robot.links;
        // A link that cannot move is part of the one that carries it.
        let mut chain = std::iter::successors(Some(link), |&link| links[link].parent);
        chain.find_map(|at| self.model.robot.movable().position(|(movable, _)| movable == at))
    }

    /// The compared channels of the limb of a joint, in the order of the logs.
    fn compared_in(&self, joint: usize) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for channel in self.logs.iter().flat_map(|log| &log.channels) {
            let inside = self.joint_of(&channel.name).is_some_and(|other| self.limbs[other] == self.limbs[joint]);
            if inside && !names.contains(&channel.name) {
                names.push(channel.name.clone());
            }
        }
        names
    }
}

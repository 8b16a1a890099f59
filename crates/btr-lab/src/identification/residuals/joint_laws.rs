//! What acts in the joints of a prescribed motion: torques that are added to what the links require.

use crate::identification::problem::{Change, IdentificationProblem};
use btr_identify::residual_model::{JointLaws, Parametrisation, ProportionalParameter};
use btr_physics::effects::{DryFriction, Effect, FormulaTarget, SiteKind, TorqueLaw};
use btr_physics::model::parameter::Target;
use btr_physics::robot::Joint;
use btr_physics::robot::site::matches;

/// Parameters of one placed effect: those that it is proportional to, and its shapes.
struct Group {
    law: TorqueLaw,
    amplitudes: Vec<usize>,
    shapes: Vec<usize>,
}

impl IdentificationProblem {
    /// What acts in the joints of a prescribed motion, joint by joint: frictions, rotors, springs, ripples and laws.
    /// None where an effect of the model depends on the torque of a neighbour, nor at a joint with an effect that
    /// depends on its own.
    pub(super) fn joint_laws(&self) -> Vec<JointLaws> {
        if !self.model.robot.is_prescribed() || self.model.effects.iter().any(|placed| reads_torques(placed.effect)) {
            return Vec::new();
        }
        let everywhere = self.acting_everywhere();
        let joints = self.model.robot.movable().map(|(link, of)| (link, &of.joint));
        joints.filter_map(|(link, joint)| self.laws_at(link, joint, &everywhere)).collect()
    }

    /// The parameters that change the inertias of links and nothing else, where the motion is prescribed.
    pub(super) fn inertial(&self) -> Vec<usize> {
        if !self.model.robot.is_prescribed() {
            return Vec::new();
        }
        let own = self.model.targets.iter().enumerate().filter(|(_, target)| target.is_inertial()).map(|(k, _)| k);
        let of_link = |change: &Change| match change {
            Change::Effect(effect) => effect.spec().site == SiteKind::Link,
            Change::Values(targets) => targets.iter().all(Target::is_inertial),
        };
        let candidates = self.candidates.iter().zip(&self.changes).filter(|(_, change)| of_link(change));
        own.chain(candidates.flat_map(|(candidate, _)| candidate.parameters())).collect()
    }

    /// All others but those of torques that depend on the motion alone.
    pub(super) fn inertial_unless(&self) -> Vec<usize> {
        let inertial = self.inertial();
        let joints = || self.model.robot.movable().map(|(link, of)| (link, [of.joint.compared()]));
        let groups = joints().flat_map(|(link, channels)| self.groups(link, &channels));
        let of_motion: Vec<usize> = groups
            .filter(|group| group.law != TorqueLaw::Other)
            .flat_map(|group| group.amplitudes.into_iter().chain(group.shapes))
            .collect();
        let other = |k: &usize| !inertial.contains(k) && !of_motion.contains(k);
        (0..self.parameters.len()).filter(other).collect()
    }

    fn laws_at(&self, link: usize, joint: &Joint, everywhere: &[usize]) -> Option<JointLaws> {
        let on_joints = self.model.effects.iter().filter(|placed| placed.effect.spec().site.is_on_joints());
        let here: Vec<&dyn Effect> =
            on_joints.filter(|placed| matches(&placed.site, &joint.name)).map(|placed| placed.effect).collect();
        let depends = |effect: &&dyn Effect| effect.torque_law() == TorqueLaw::Other && !effect.changes_readings();
        if here.iter().any(depends) {
            return None;
        }
        let changed = here.iter().any(|effect| effect.dry_friction() == DryFriction::Changes);
        let channels = vec![joint.compared()];
        let (others, laws): (Vec<Group>, Vec<Group>) =
            self.groups(link, &channels).into_iter().partition(|group| group.law == TorqueLaw::Other);
        let linear =
            |group: &Group| group.amplitudes.iter().all(|&k| self.parameters[k].law == Parametrisation::Linear);
        let (alone, together): (Vec<&Group>, Vec<&Group>) =
            laws.iter().partition(|group| group.law == TorqueLaw::Proportional && linear(group) && !changed);
        let proportional = |group: &&Group| {
            let of = |&parameter: &usize| ProportionalParameter { parameter, shapes: group.shapes.clone() };
            group.amplitudes.iter().map(of).collect::<Vec<_>>()
        };
        Some(JointLaws {
            channels,
            proportional: alone.iter().flat_map(proportional).collect(),
            together: together.iter().flat_map(|group| &group.amplitudes).copied().collect(),
            unless: everywhere.iter().chain(others.iter().flat_map(|group| &group.amplitudes)).copied().collect(),
            parameters: laws.iter().flat_map(|group| group.amplitudes.iter().chain(&group.shapes)).copied().collect(),
        })
    }

    /// Everything that may act at one joint alone.
    fn groups(&self, link: usize, channels: &[String]) -> Vec<Group> {
        let here = self.candidates.iter().zip(&self.changes).zip(&self.near).filter(|(_, near)| *near == channels);
        let candidates = here.map(|((candidate, change), _)| Group {
            law: match change {
                Change::Effect(effect) => effect.torque_law(),
                Change::Values(_) => TorqueLaw::Other,
            },
            amplitudes: candidate.amplitudes.clone(),
            shapes: candidate.shapes.clone(),
        });
        let terms = self.features.iter().zip(&self.terms).filter(|(feature, _)| feature.channels == channels);
        let laws = terms.map(|(feature, (term, effect))| Group {
            // A term is a sum of factors, each times an amplitude.
            law: match effect.torque_law() {
                TorqueLaw::OfMotion if term.on == FormulaTarget::Torque => TorqueLaw::Proportional,
                other => other,
            },
            amplitudes: feature.term.amplitudes.clone(),
            shapes: feature.term.shapes.clone(),
        });
        candidates.chain(laws).chain(self.own_groups(link)).collect()
    }

    /// The model's own parameters of effects at one joint alone. A shape among them makes its effect one that is
    /// simulated.
    fn own_groups(&self, link: usize) -> impl Iterator<Item = Group> {
        let targets = self.model.targets.iter().enumerate().filter(move |(_, target)| target.links() == [link]);
        targets.filter_map(|(k, target)| {
            let (effect, param) = target.of_effect()?;
            let shaped = effect.spec().params.iter().any(|param| param.shape);
            let law = if shaped && effect.torque_law() == TorqueLaw::Proportional {
                TorqueLaw::OfMotion
            } else {
                effect.torque_law()
            };
            (!effect.spec().params[param].shape && effect.spec().site == SiteKind::Joint).then(|| Group {
                law,
                amplitudes: vec![k],
                shapes: Vec::new(),
            })
        })
    }

    /// Parameters of effects that change what the encoders read, and with that all motion, that act in all joints, or
    /// that depend on the torque at another joint.
    fn acting_everywhere(&self) -> Vec<usize> {
        let acts = |effect: &dyn Effect| effect.changes_readings() || effect.spec().site.is_on_joints();
        let offered = self.candidates.iter().zip(&self.changes).zip(&self.near).filter(|(_, near)| near.is_empty());
        let of_candidates = offered.filter_map(|((candidate, change), _)| match change {
            Change::Effect(effect) => acts(*effect).then_some(&candidate.amplitudes),
            Change::Values(targets) => {
                let effects = targets.iter().filter_map(|target| target.of_effect());
                effects
                    .map(|(effect, _)| effect)
                    .any(|effect| effect.changes_readings())
                    .then_some(&candidate.amplitudes)
            }
        });
        let own = self.model.targets.iter().enumerate().filter_map(|(k, target)| {
            let effect = target.of_effect()?.0;
            let in_many = effect.torque_law() == TorqueLaw::Other && target.links().len() != 1;
            (effect.changes_readings() || in_many && acts(effect)).then_some(k)
        });
        let laws = self.features.iter().zip(&self.terms).filter(|(_, (_, effect))| reads_torques(*effect));
        let of_laws = laws.flat_map(|(feature, _)| &feature.term.amplitudes);
        of_candidates.flatten().chain(of_laws).copied().chain(own).collect()
    }
}

/// Whether an effect depends on the torque at a neighbouring joint.
fn reads_torques(effect: &dyn Effect) -> bool {
    effect.neighbours().iter().any(|quantity| quantity.is_torque())
}

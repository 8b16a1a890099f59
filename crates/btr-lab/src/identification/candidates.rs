//! What may be missing: every effect at every site, and what laws are made of.

use super::IdentificationProblem;
use super::law_terms;
use super::law_terms::{TermContext, TermDefinition};
use super::parameters::{knob, own};
use super::sites::sites;
use btr_core::world::WorldError;
use btr_identify::residual_model::{EffectCandidate, LawTerm};
use btr_physics::effects::{EFFECTS, Effect};
use btr_physics::robot::Actuator;

impl IdentificationProblem {
    /// Adds every effect at every site to what may be missing, but those named in `without`.
    pub(super) fn offer_effects(&mut self, without: &[&str]) {
        for effect in EFFECTS.iter().copied().filter(|effect| !without.contains(&effect.card().name)) {
            for site in sites(effect, &self.model) {
                self.offer(effect, site);
            }
        }
        self.introduce();
    }

    fn offer(&mut self, effect: &'static dyn Effect, site: String) {
        let card = effect.card();
        let (mut amplitudes, mut shapes) = (Vec::new(), Vec::new());
        for param in card.params {
            let list = if param.shape { &mut shapes } else { &mut amplitudes };
            list.push(self.knobs.len());
            let name = format!("{}.{}@{site}", card.name, param.name);
            let scale = self.scales.of_unit(param.unit, &site);
            self.knobs.push(knob(name, param, scale, own(param, &self.model.setup)));
        }
        let start =
            |values: &&[f64]| shapes.iter().zip(values.iter()).map(|(&k, v)| self.knobs[k].coordinate(*v)).collect();
        let mut starts: Vec<Vec<f64>> = card.starts.iter().map(start).collect();
        if starts.is_empty() {
            starts.push(vec![0.0; shapes.len()]);
        }
        self.near.push(self.limb_of(&site));
        let effect_name = card.name.to_owned();
        let (kin, contains) = (Vec::new(), Vec::new());
        self.candidates.push(EffectCandidate { effect: effect_name, site, amplitudes, shapes, starts, kin, contains });
        self.effects.push(effect);
    }

    /// The channels of the limb that a joint or a link belongs to; none where the robot is compared from beginning to end.
    fn limb_of(&self, site: &str) -> Vec<String> {
        if self.parts.iter().all(|part| part.windows.is_empty()) {
            return Vec::new();
        }
        let here = self.model.robot.movable().position(|(_, link)| link.joint.name == site || link.name == site);
        here.map_or_else(Vec::new, |joint| self.limbs[joint].clone())
    }

    /// Tells candidates who at the same place is said to look like them; a joint is at the place of the link that it moves.
    fn introduce(&mut self) {
        let links = &self.model.robot.links;
        let place =
            |site: &str| links.iter().find(|link| link.joint.name == site).map_or(site, |link| &link.name).to_owned();
        let places: Vec<String> = self.candidates.iter().map(|candidate| place(&candidate.site)).collect();
        let says = |a: usize, b: usize| self.effects[a].card().alike.contains(&self.effects[b].card().name);
        let alike = |a: usize, b: usize| places[a] == places[b] && (says(a, b) || says(b, a));
        let all = 0..self.candidates.len();
        let kin: Vec<Vec<usize>> = all.clone().map(|a| all.clone().filter(|b| alike(a, *b)).collect()).collect();
        for (a, kin) in kin.into_iter().enumerate() {
            let inside = |b: &&usize| {
                self.effects[a].card().contains.iter().any(|(name, _)| *name == self.effects[**b].card().name)
            };
            self.candidates[a].contains = kin.iter().filter(inside).copied().collect();
            self.candidates[a].kin = kin;
        }
    }

    /// Adds what laws are made of, for every driven joint.
    pub(super) fn offer_terms(&mut self) -> Result<(), WorldError> {
        let model = self.model.clone();
        for (_, link) in model.robot.movable() {
            let joint = &link.joint;
            let servo = match &joint.actuator {
                Actuator::Position { .. } => true,
                Actuator::Voltage { servo, .. } => servo.is_some(),
                Actuator::Passive | Actuator::Torque { .. } | Actuator::Prescribed => false,
            };
            let extent = TermContext { q: self.range(&joint.name), duration_s: self.longest_s(), servo };
            let first = self.features.len();
            for term in law_terms::terms(&joint.name, &self.scales, &extent) {
                self.offer_term(term, &joint.name, &extent, first)?;
            }
        }
        Ok(())
    }

    fn offer_term(
        &mut self,
        term: TermDefinition,
        joint: &str,
        extent: &TermContext,
        first: usize,
    ) -> Result<(), WorldError> {
        let effect = term.formula().map_err(|e| WorldError::Setup { what: e.to_string() })?;
        let knobs = term.knobs(joint, &self.scales, extent);
        let start = |values: Vec<f64>| knobs.iter().skip(term.amplitudes()).zip(values).map(|(k, v)| k.coordinate(v));
        let starts = term.starts().into_iter().map(|values| start(values).collect()).collect();
        let mut amplitudes: Vec<usize> = (self.knobs.len()..self.knobs.len() + knobs.len()).collect();
        let shapes = amplitudes.split_off(term.amplitudes());
        self.knobs.extend(knobs);
        let (name, site) = (effect.card().name.to_owned(), joint.to_owned());
        let (kin, contains) = (Vec::new(), Vec::new());
        let candidate = EffectCandidate { effect: name, site, amplitudes, shapes, starts, kin, contains };
        let swings = term.swings.map(|i| first + i);
        self.features.push(LawTerm { on: format!("{:?}", term.on).to_lowercase(), term: candidate, swings });
        self.terms.push((term, effect));
        Ok(())
    }
}

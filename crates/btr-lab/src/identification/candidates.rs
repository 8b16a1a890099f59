//! Candidates: every effect at every site, every value that the model states, and the terms of laws.

use super::catalogue::law_terms;
use super::catalogue::law_terms::{TermContext, TermDefinition};
use super::catalogue::parameters::{model_value, parameter, stair};
use super::catalogue::sites::{has_dry_friction, sites};
use super::catalogue::values::{Catalogue, StatedValue, similar_to_value};
use super::problem::{Change, IdentificationProblem};
use btr_core::world::WorldError;
use btr_identify::residual_model::{CandidateKind, EffectCandidate, FitParameter, LawTerm, Needs, Ripple};
use btr_physics::effects::{DryFriction, EFFECTS, Effect};
use btr_physics::robot::site::{instance, numbered};
use btr_physics::robot::{Actuator, Base, Joint};

impl IdentificationProblem {
    /// Adds every effect at every site and every stated value to the candidates, except those named in `without`.
    pub(super) fn offer_effects(&mut self, without: &[&str]) {
        // Values of laws that the model has come first: a value that explains as much as a further effect is named.
        let (laws, parts) = match Catalogue::of(&self.model, &self.scales) {
            Some(catalogue) => (catalogue.laws(), catalogue.parts()),
            None => (Vec::new(), Vec::new()),
        };
        self.offer_values(laws, without);
        let prescribed = self.model.robot.is_prescribed();
        let offered = |effect: &&dyn Effect| {
            let shows = if prescribed { !effect.is_of_motor() } else { !effect.is_for_prescribed_motion() };
            shows && effect.is_suspected() && !without.contains(&effect.spec().name)
        };
        for effect in EFFECTS.iter().copied().filter(offered) {
            for site in sites(effect, &self.model) {
                self.offer_instances(effect, &site);
            }
        }
        self.offer_values(parts, without);
        self.link_similar();
        self.link_dry_friction();
    }

    /// What changes dry friction needs an effect that adds some, unless the joint has some already.
    fn link_dry_friction(&mut self) {
        let relation = |change: &Change| match change {
            Change::Effect(effect) => effect.dry_friction(),
            Change::Values(_) => DryFriction::Unrelated,
        };
        let all = 0..self.candidates.len();
        for changes in all.clone().filter(|&c| relation(&self.changes[c]) == DryFriction::Changes) {
            let site = &self.candidates[changes].site;
            let adds =
                |c: &usize| relation(&self.changes[*c]) == DryFriction::Adds && self.candidates[*c].site == *site;
            if !has_dry_friction(&self.model, site) {
                self.candidates[changes].needs = Needs::OneOf(all.clone().filter(adds).collect());
            }
        }
    }

    fn offer_values(&mut self, values: Vec<StatedValue>, without: &[&str]) {
        let offered = values.into_iter().filter(|value| !without.contains(&&*value.name));
        offered.for_each(|value| self.offer_value(value));
    }

    fn offer_value(&mut self, value: StatedValue) {
        let StatedValue { name, site, targets, parameters } = value;
        let amplitudes = (self.parameters.len()..self.parameters.len() + parameters.len()).collect();
        self.parameters.extend(parameters);
        self.near.push(Vec::new());
        self.candidates.push(EffectCandidate {
            kind: CandidateKind::Value,
            effect: name,
            site,
            amplitudes,
            shapes: Vec::new(),
            starts: vec![Vec::new()],
            ripple: None,
            similar: Vec::new(),
            nested: Vec::new(),
            needs: Needs::Nothing,
            is_usual: false,
        });
        self.changes.push(Change::Values(targets));
    }

    /// The first instance of an effect that the model lacks at a site, and the further ones that it may have there:
    /// each needs the one before.
    fn offer_instances(&mut self, effect: &'static dyn Effect, site: &str) {
        let (place, first) = instance(site);
        for number in first..=effect.instances().max(first) {
            let needs = if number > first { Needs::Instance(self.candidates.len() - 1) } else { Needs::Nothing };
            self.offer(effect, numbered(place, number), needs);
        }
    }

    fn offer(&mut self, effect: &'static dyn Effect, site: String, needs: Needs) {
        let spec = effect.spec();
        let (mut amplitudes, mut shapes) = (Vec::new(), Vec::new());
        for param in spec.params {
            let list = if param.shape { &mut shapes } else { &mut amplitudes };
            list.push(self.parameters.len());
            let name = format!("{}.{}@{site}", spec.name, param.name);
            let scale = (self.scales.of_unit(param.unit, &site), self.scales.of_bounds(param.unit, &site));
            let parameter = parameter(name, param, scale, model_value(param, &self.model.setup));
            self.parameters.push(if effect.is_of_command() { stair(parameter) } else { parameter });
        }
        let coordinate = |(&shape, value): (&usize, &f64)| {
            let parameter: &FitParameter = &self.parameters[shape];
            parameter.clamp(parameter.coordinate(*value))
        };
        let start = |values: Vec<f64>| shapes.iter().zip(&values).map(coordinate).collect();
        let link = self.model.robot.link(&site).unwrap_or(0);
        let top_speed = self.scales.top_speed(&site);
        let starts = effect.starts(&self.model.robot, link, top_speed);
        let mut starts: Vec<Vec<f64>> = starts.into_iter().map(start).collect();
        if starts.is_empty() {
            starts.push(vec![0.0; shapes.len()]);
        }
        // Shapes of these names are the order and the phase of a ripple in the joint's position.
        let shape = |name: &str| spec.params.iter().filter(|param| param.shape).position(|param| param.name == name);
        let channel = format!("q_{}", instance(&site).0);
        let ripple = shape("order").zip(shape("phase")).map(|(order, phase)| Ripple { order, phase, channel });
        self.near.push(if effect.changes_readings() { Vec::new() } else { self.shows_in(&site) });
        let effect_name = spec.name.to_owned();
        let (similar, nested) = (Vec::new(), Vec::new());
        self.candidates.push(EffectCandidate {
            kind: CandidateKind::Effect,
            effect: effect_name,
            site,
            amplitudes,
            shapes,
            starts,
            ripple,
            similar,
            nested,
            needs,
            is_usual: effect.is_usual(),
        });
        self.changes.push(Change::Effect(effect));
    }

    /// The channels in which an effect at a joint or a link mainly shows; none if in all. With a prescribed motion, a
    /// joint's torque balances what acts in the joint; otherwise, in windows, those of the limb.
    fn shows_in(&self, site: &str) -> Vec<String> {
        let (site, _) = instance(site);
        if self.model.robot.is_prescribed() {
            let joint = self.model.robot.movable().map(|(_, link)| &link.joint).find(|joint| joint.name == site);
            return joint.map(Joint::compared).into_iter().collect();
        }
        if self.parts.iter().all(|part| part.windows.is_empty()) {
            return Vec::new();
        }
        let index = self.model.robot.movable().position(|(_, link)| link.joint.name == site || link.name == site);
        index.map_or_else(Vec::new, |joint| self.limbs[joint].clone())
    }

    /// Sets the similar and nested candidates of each candidate at the same place: a joint is at the place of the link
    /// that it moves, the end of a link at that of those which it carries, and a base that is fixed at that of the
    /// first link that moves.
    fn link_similar(&mut self) {
        let links = &self.model.robot.links;
        let is_fixed = self.model.robot.base == Base::Fixed;
        let first = self.model.robot.movable().next().map(|(index, _)| index).filter(|_| is_fixed);
        let link_at = |site: &str| {
            let (site, _) = instance(site);
            let named = links.iter().position(|link| link.joint.name == site || link.name == site);
            if site == "base" { first.or(named) } else { named }
        };
        let places: Vec<Option<usize>> = self.candidates.iter().map(|candidate| link_at(&candidate.site)).collect();
        let at_end = |a: usize| matches!(&self.changes[a], Change::Effect(effect) if effect.acts_at_end());
        let carries = |a: usize, b: usize| at_end(a) && places[b].is_some_and(|link| links[link].parent == places[a]);
        let same = |a: usize, b: usize| match (places[a], places[b]) {
            (None, None) => self.candidates[a].site == self.candidates[b].site,
            (one, other) => one == other,
        };
        let together = |a: usize, b: usize| same(a, b) || carries(a, b) || carries(b, a);
        let says = |a: usize, b: usize| {
            let similar = match &self.changes[a] {
                Change::Effect(effect) => effect.spec().similar,
                Change::Values(_) => similar_to_value(&self.candidates[a].effect),
            };
            similar.contains(&&*self.candidates[b].effect)
        };
        let alike = |a: usize, b: usize| together(a, b) && (says(a, b) || says(b, a));
        let all = 0..self.candidates.len();
        let similar: Vec<Vec<usize>> = all.clone().map(|a| all.clone().filter(|b| alike(a, *b)).collect()).collect();
        for (a, similar) in similar.into_iter().enumerate() {
            let nested = match &self.changes[a] {
                Change::Effect(effect) => effect.spec().nested,
                Change::Values(_) => &[],
            };
            let inside = |b: &&usize| nested.iter().any(|(name, _)| *name == self.candidates[**b].effect);
            self.candidates[a].nested = similar.iter().filter(inside).copied().collect();
            self.candidates[a].similar = similar;
        }
    }

    /// Adds the terms of laws for every driven joint.
    pub(super) fn offer_terms(&mut self) -> Result<(), WorldError> {
        let model = self.model.clone();
        for ((_, link), neighbours) in model.robot.movable().zip(model.robot.neighbours()) {
            let joint = &link.joint;
            let servo = match &joint.actuator {
                Actuator::Position { .. } => true,
                Actuator::Voltage { servo, .. } => servo.is_some(),
                Actuator::Passive | Actuator::Torque { .. } | Actuator::Prescribed => false,
            };
            // Only arms: their transmissions run past joints, and each term costs two rollouts.
            let prescribed = joint.actuator == Actuator::Prescribed;
            let coupled = (servo || prescribed) && model.robot.base == Base::Fixed;
            let context = TermContext {
                q: self.range(&joint.name),
                duration_s: self.longest_s(),
                servo,
                parent: coupled && neighbours.parent.is_some(),
                child: coupled && neighbours.child.is_some(),
            };
            let first = self.features.len();
            for term in law_terms::terms(&joint.name, &self.scales, &context) {
                self.offer_term(term, &joint.name, &context, first)?;
            }
        }
        Ok(())
    }

    fn offer_term(
        &mut self,
        term: TermDefinition,
        joint: &str,
        context: &TermContext,
        first: usize,
    ) -> Result<(), WorldError> {
        let effect = term.formula().map_err(|e| WorldError::Setup { what: e.to_string() })?;
        let parameters = term.parameters(joint, &self.scales, context);
        let start =
            |values: Vec<f64>| parameters.iter().skip(term.amplitudes()).zip(values).map(|(k, v)| k.coordinate(v));
        let starts = term.starts().into_iter().map(|values| start(values).collect()).collect();
        let mut amplitudes: Vec<usize> = (self.parameters.len()..self.parameters.len() + parameters.len()).collect();
        let shapes = amplitudes.split_off(term.amplitudes());
        self.parameters.extend(parameters);
        let (name, site) = (effect.spec().name.to_owned(), joint.to_owned());
        let (similar, nested) = (Vec::new(), Vec::new());
        let kind = CandidateKind::Effect;
        let candidate = EffectCandidate {
            kind,
            effect: name,
            site,
            amplitudes,
            shapes,
            starts,
            ripple: None,
            similar,
            nested,
            needs: Needs::Nothing,
            is_usual: false,
        };
        let swings = term.swings.map(|i| first + i);
        let channels = if self.model.robot.is_prescribed() { self.shows_in(joint) } else { Vec::new() };
        self.features.push(LawTerm { on: format!("{:?}", term.on).to_lowercase(), term: candidate, swings, channels });
        self.terms.push((term, effect));
        Ok(())
    }
}

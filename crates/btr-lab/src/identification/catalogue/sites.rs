//! Sites of effects.

use btr_physics::effects::{DryFriction, Effect, PlacedEffect, SiteKind};
use btr_physics::model::Model;
use btr_physics::robot::site::{instance, matches, numbered};
use btr_physics::robot::{JointKind, Link, Robot};

/// Sites at which an effect could act and is not yet present; where a joint may have several, the first instance that
/// is not.
pub(crate) fn sites(effect: &'static dyn Effect, model: &Model) -> Vec<String> {
    let spec = effect.spec();
    let taken = |site: &str| {
        let (name, number) = instance(site);
        let same = |pattern: &str| matches(pattern, name) && instance(pattern).1 == number;
        let here = |placed: &&PlacedEffect| placed.effect.spec().name == spec.name && same(&placed.site);
        let named = format!("{}.", spec.name);
        let free_parameter = model
            .simulations
            .dims()
            .iter()
            .any(|dim| dim.name.starts_with(&named) && same(dim.name.split_once('@').map_or("*", |(_, at)| at)));
        free_parameter || model.effects.iter().find(here).is_some_and(|placed| !placed.is_off())
    };
    let can_have = |link: &usize| effect.acts_on(&model.robot, *link);
    let joints = || model.robot.movable().filter(|(link, _)| can_have(link)).map(|(_, link)| link);
    let all: Vec<String> = match spec.site {
        SiteKind::Joint => {
            let all = (effect.is_common() && joints().count() > 1).then(|| "*".to_owned());
            joints().map(|link| link.joint.name.clone()).chain(all).collect()
        }
        SiteKind::Link => {
            let massive = |(index, link): &(usize, &Link)| link.mass_kg > 0.0 && can_have(index);
            model.robot.movable().filter(massive).map(|(_, link)| link.name.clone()).collect()
        }
        SiteKind::Base => vec!["base".to_owned()],
        SiteKind::Ground if model.setup.ground.is_none() => Vec::new(),
        SiteKind::Ground | SiteKind::Robot => vec!["*".to_owned()],
    };
    let first_free = |site: String| (1..=effect.instances()).map(|n| numbered(&site, n)).find(|site| !taken(site));
    all.into_iter().filter_map(first_free).collect()
}

/// Whether a joint of the model has dry friction.
pub(crate) fn has_dry_friction(model: &Model, joint: &str) -> bool {
    let adds = |placed: &PlacedEffect| placed.effect.dry_friction() == DryFriction::Adds;
    let here = |placed: &PlacedEffect| !placed.is_off() && matches(&placed.site, joint);
    model.robot.links.iter().any(|link| link.joint.name == joint && link.joint.dry_friction > 0.0)
        || model.effects.iter().any(|placed| adds(placed) && here(placed))
}

/// For each movable joint, the position channels of its limb: all joints that are connected to the root by the same
/// movable joint.
pub(in crate::identification) fn limbs(robot: &Robot) -> Vec<Vec<String>> {
    let moves = |link: usize| robot.links[link].parent.is_some() && robot.links[link].joint.kind != JointKind::Fixed;
    let limb = |link: usize| {
        let chain = std::iter::successors(Some(link), |&link| robot.links[link].parent);
        chain.filter(|&link| moves(link)).last().unwrap_or(link)
    };
    let limb_of_joint: Vec<usize> = robot.movable().map(|(link, _)| limb(link)).collect();
    let channel = |link: &Link| format!("q_{}", link.joint.name);
    let members = |limb: &usize| {
        robot
            .movable()
            .zip(&limb_of_joint)
            .filter(|(_, other)| *other == limb)
            .map(|((_, link), _)| channel(link))
            .collect()
    };
    limb_of_joint.iter().map(members).collect()
}

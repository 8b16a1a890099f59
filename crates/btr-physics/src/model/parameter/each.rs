//! A target for each site that a pattern matches.

use super::quantity::{Quantity, quantity};
use super::{ParameterError, Target};
use crate::robot::site::{instance, is_pattern, numbered};
use crate::robot::{Base, Robot};

impl Target {
    /// The targets of a name: one for each joint or link that its pattern matches and that has the value; of masses and
    /// inertias, those that can move. A name without a pattern, and a law's parameter, is a single target.
    ///
    /// # Errors
    /// See [`parse`](Self::parse); where several match, one that all of them cause.
    pub fn each(name: &str, robot: &Robot) -> Result<Vec<Target>, ParameterError> {
        let (what, site) = name.split_once('@').unwrap_or((name, "*"));
        let quantity = quantity(what)?;
        let sites = quantity.sites(robot).filter(|_| is_pattern(site) && !matches!(quantity, Quantity::Formula));
        let Some(sites) = sites else { return Ok(vec![Target::parse(name, robot)?]) };
        let links = quantity.links(site, robot)?;
        let is_inertial = matches!(quantity, Quantity::Mass | Quantity::Inertia);
        let matching = sites.iter().filter(|(link, _)| links.contains(link) && (!is_inertial || moves(*link, robot)));
        let names = matching.map(|(_, own)| format!("{what}@{}", numbered(own, instance(site).1)));
        let parsed: Vec<Result<Target, ParameterError>> = names.map(|name| Target::parse(&name, robot)).collect();
        if parsed.iter().any(Result::is_ok) {
            return Ok(parsed.into_iter().flatten().collect());
        }
        parsed.into_iter().next().unwrap_or_else(|| Target::parse(name, robot)).map(|target| vec![target])
    }
}

/// Whether a link is not bolted to the world.
fn moves(mut link: usize, robot: &Robot) -> bool {
    while let Some(parent) = robot.links[link].parent {
        if robot.movable().any(|(movable, _)| movable == link) {
            return true;
        }
        link = parent;
    }
    robot.base == Base::Floating
}

//! A floor that is more or less slippery than the model's.

use super::{Card, Effect, Param, SiteKind};
use crate::sim::Ground;

pub(super) struct GroundFriction;

static CARD: Card = Card {
    name: "ground_friction",
    law: "the floor's Coulomb coefficient is this instead of the model's",
    site: SiteKind::Ground,
    cite: "Coulomb, Théorie des machines simples, 1785",
    tell: "feet slip where they should not, or grip; the distance walked is wrong while the joints follow",
    params: &[Param { name: "coefficient", unit: "1", bounds: (0.0, 2.0), off: f64::NAN, hint: 0.5 }],
};

impl Effect for GroundFriction {
    fn card(&self) -> &'static Card {
        &CARD
    }

    fn contact(&self, p: &[f64], ground: &mut Ground) {
        if !p[0].is_nan() {
            ground.friction = p[0];
        }
    }
}

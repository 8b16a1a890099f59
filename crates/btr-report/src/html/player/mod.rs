//! The player of a report: logs and replays as moving robots, tied to the plots over time.
//!
//! A script makes it from a document of JSON beside it; without scripts, the page is as if it were not there.

mod drawing;
mod motion;

pub(super) use motion::{Replayed, ReplayedState};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use sha2::{Digest, Sha256};

/// The model's state before anything is changed in it.
pub(super) const AS_IT_STANDS: &str = "as it stands";

/// The look of the player.
pub(super) const STYLE: &str = include_str!("style.css");

/// The script: one function, so that its names are its own.
const SCRIPT: &str = concat!(
    "(() => {\n'use strict';\n",
    include_str!("space.js"),
    include_str!("shapes.js"),
    include_str!("renderer.js"),
    include_str!("robot.js"),
    include_str!("camera.js"),
    include_str!("plots.js"),
    include_str!("controls.js"),
    include_str!("player.js"),
    "})();\n"
);

/// A player in a page.
pub(super) struct Player {
    /// What it shows, as JSON without markup.
    document: String,
}

impl Player {
    /// The player of these logs; none if nothing moves in them.
    pub(super) fn of(replayed: &Replayed) -> Option<Player> {
        let document = serde_json::to_string(&replayed.motion()?).ok()?;
        Some(Player { document: without_markup(&document) })
    }

    /// The elements, where the player is to appear.
    pub(super) fn html(&self) -> String {
        let document = &self.document;
        format!("<script type=\"application/json\" id=\"motion-data\">{document}</script>\n<script>{SCRIPT}</script>\n")
    }

    /// The source that a content-security policy has to allow.
    pub(super) fn script_source() -> String {
        format!("'sha256-{}'", STANDARD.encode(Sha256::digest(SCRIPT)))
    }
}

/// JSON in which nothing can end the element around it: these characters stand in its strings alone.
fn without_markup(json: &str) -> String {
    json.replace('&', "\\u0026").replace('<', "\\u003c").replace('>', "\\u003e")
}

#[cfg(test)]
mod tests;

//! The distances by name, as experiment files choose them.

use super::{Channels, Distance, Dtw, FitnessDifference, Information, NormalisedRmse, Rmse, Spectrum, Whitened};
use indexmap::IndexMap;
use serde::de::value::{MapAccessDeserializer, MapDeserializer};
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Every distance: its name in experiment files, and what it compares.
pub const DISTANCES: &[(&str, &str)] = &[
    ("fitness", "the paper's phi_1: difference of fitness, in its unit; needs no log"),
    ("information", "the paper's phi_2: what each series leaves open about the other, in bits"),
    ("rmse", "root mean square error, channels scaled by the real channel's standard deviation"),
    ("normalised_rmse", "mean of 1 - fit/100 over the channels, as system identification reports it"),
    ("spectrum", "difference of amplitude spectra: blind to phase"),
    ("dtw", "root mean square error after warping time a little: forgives lag and haste"),
    ("whitened", "root mean square error in multiples of each sensor's noise: 1 is all that a simulation can reach"),
];

/// A distance and its settings: a plain name (`"rmse"`), or a table (`{ name = "information", bins = 16, channels =
/// ["q_*"] }`). What is left out has the default documented with it. `phi_1` and `phi_2` are other names of `fitness`
/// and `information`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(remote = "Self", tag = "name", rename_all = "snake_case")]
pub enum DistanceSpec {
    /// phi_1.
    #[serde(alias = "phi_1")]
    Fitness(FitnessDifference),
    /// phi_2.
    #[serde(alias = "phi_2")]
    Information(Information),
    /// Root mean square error.
    Rmse(Rmse),
    /// Normalised root mean square error.
    NormalisedRmse(NormalisedRmse),
    /// Amplitude spectra.
    Spectrum(Spectrum),
    /// Dynamic time warping.
    Dtw(Dtw),
    /// Errors in multiples of the noise.
    Whitened(Whitened),
}

impl DistanceSpec {
    /// The distance itself.
    pub fn build(&self) -> Box<dyn Distance> {
        match self.clone() {
            DistanceSpec::Fitness(distance) => Box::new(distance),
            DistanceSpec::Information(distance) => Box::new(distance),
            DistanceSpec::Rmse(distance) => Box::new(distance),
            DistanceSpec::NormalisedRmse(distance) => Box::new(distance),
            DistanceSpec::Spectrum(distance) => Box::new(distance),
            DistanceSpec::Dtw(distance) => Box::new(distance),
            DistanceSpec::Whitened(distance) => Box::new(distance),
        }
    }

    /// Sets the sensors' noise by channel pattern, for channels whose noise is not set yet.
    pub fn with_noise(&mut self, stated: &IndexMap<String, f64>) {
        if let DistanceSpec::Whitened(distance) = self {
            for (pattern, sigma) in stated {
                distance.noise.entry(pattern.clone()).or_insert(*sigma);
            }
        }
    }

    /// Its name in [`DISTANCES`].
    pub fn name(&self) -> &'static str {
        self.build().name()
    }

    /// The channels it is restricted to; `None` where no channel matters.
    pub fn channels(&self) -> Option<&Channels> {
        match self {
            DistanceSpec::Fitness(_) => None,
            DistanceSpec::Information(distance) => Some(&distance.channels),
            DistanceSpec::Rmse(distance) => Some(&distance.channels),
            DistanceSpec::NormalisedRmse(distance) => Some(&distance.channels),
            DistanceSpec::Spectrum(distance) => Some(&distance.channels),
            DistanceSpec::Dtw(distance) => Some(&distance.channels),
            DistanceSpec::Whitened(distance) => Some(&distance.channels),
        }
    }
}

impl schemars::JsonSchema for DistanceSpec {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Distance".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let names: Vec<&str> = DISTANCES.iter().map(|d| d.0).chain(["phi_1", "phi_2"]).collect();
        schemars::json_schema!({
            "description": "A distance by name, or a table with its name and settings",
            "anyOf": [
                { "enum": names },
                { "type": "object", "properties": { "name": { "enum": names } }, "required": ["name"] }
            ]
        })
    }
}

impl Serialize for DistanceSpec {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        DistanceSpec::serialize(self, serializer)
    }
}

impl<'de> Deserialize<'de> for DistanceSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NameOrTable)
    }
}

struct NameOrTable;

impl<'de> Visitor<'de> for NameOrTable {
    type Value = DistanceSpec;

    fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str("the name of a distance, or a table with its name and settings")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<DistanceSpec, E> {
        DistanceSpec::deserialize(MapDeserializer::new(std::iter::once(("name", name))))
    }

    fn visit_map<A: MapAccess<'de>>(self, table: A) -> Result<DistanceSpec, A::Error> {
        DistanceSpec::deserialize(MapAccessDeserializer::new(table))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[derive(Debug, Deserialize, Serialize)]
    struct Section {
        distance: DistanceSpec,
    }

    fn read(text: &str) -> Result<DistanceSpec, String> {
        toml::from_str::<Section>(text).map(|e| e.distance).map_err(|e| e.to_string())
    }

    #[test]
    fn names_and_tables_are_read_and_written() {
        for (name, _) in DISTANCES {
            let spec = read(&format!("distance = {name:?}")).unwrap();
            assert_eq!(spec.build().name(), *name);
            assert_eq!(read(&toml::to_string(&Section { distance: spec.clone() }).unwrap()).unwrap(), spec);
        }
        assert_eq!(read("distance = 'phi_1'").unwrap().build().name(), "fitness");
        let wanted = Information { bins: 8, channels: Channels(vec!["q_*".into()]) };
        let table = "distance = { name = 'phi_2', bins = 8, channels = ['q_*'] }";
        assert_eq!(read(table).unwrap(), DistanceSpec::Information(wanted));
    }

    #[test]
    fn mistakes_are_named() {
        for (text, hint) in [
            ("distance = 'rsme'", "normalised_rmse"),
            ("distance = { name = 'dtw', bandwidth = 1 }", "bandwidth"),
            ("distance = { name = 'dtw', band = 2.0 }", "up to 1, not 2.0"),
            ("distance = { name = 'information', bins = 1 }", "not 1"),
            ("distance = 3", "the name of a distance"),
        ] {
            let message = read(text).unwrap_err();
            assert!(message.contains(hint), "{message}");
        }
    }
}

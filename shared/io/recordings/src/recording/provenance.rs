//! What is needed to repeat a recorded run.

use std::collections::BTreeMap;

/// Name of the metadata record.
pub(super) const METADATA: &str = "kerbside";
/// Name of the attachment with the vehicle.
pub(super) const VEHICLE: &str = "vehicle.toml";
/// Name of the attachment with the stack's configuration.
pub(super) const STACK: &str = "stack.toml";
/// Key under which a file and its channels state the version of the layouts.
pub(super) const LAYOUT_KEY: &str = "layout_version";

/// Where a recording comes from. What a file does not state is none.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Provenance {
    /// Version of kerbside that recorded.
    pub version: Option<String>,
    /// Name of the instance.
    pub instance: Option<String>,
    /// Name of the scenario.
    pub scenario: Option<String>,
    /// Seed of whatever was random.
    pub seed: Option<u64>,
    /// Text of the vehicle's file.
    pub vehicle: Option<String>,
    /// Text of the stack's configuration.
    pub stack: Option<String>,
    /// Whatever else is worth keeping, by name.
    pub further: BTreeMap<String, String>,
}

impl Provenance {
    /// As the entries of a metadata record.
    pub(super) fn to_map(&self) -> BTreeMap<String, String> {
        let mut map = self.further.clone();
        let mut put = |key: &str, value: Option<String>| {
            if let Some(value) = value {
                map.insert(key.to_owned(), value);
            }
        };
        put("version", self.version.clone());
        put("instance", self.instance.clone());
        put("scenario", self.scenario.clone());
        put("seed", self.seed.map(|seed| seed.to_string()));
        map
    }

    /// Takes the entries of a metadata record.
    pub(super) fn take_map(&mut self, mut map: BTreeMap<String, String>) {
        map.remove(LAYOUT_KEY);
        self.version = map.remove("version");
        self.instance = map.remove("instance");
        self.scenario = map.remove("scenario");
        self.seed = map.remove("seed").and_then(|seed| seed.parse().ok());
        self.further = map;
    }

    /// Takes an attachment, if it is one of ours.
    pub(super) fn take_attachment(&mut self, name: &str, data: &[u8]) {
        let text = || Some(String::from_utf8_lossy(data).into_owned());
        match name {
            VEHICLE => self.vehicle = text(),
            STACK => self.stack = text(),
            _ => {}
        }
    }
}

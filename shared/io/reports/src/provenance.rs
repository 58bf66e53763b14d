//! Where a report comes from: what it takes to see the same again.

use crate::page::{Block, Section};

/// What it takes to repeat a result. What is empty is left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Provenance {
    /// Version of kerbside.
    pub version: String,
    /// Seed, where chance played.
    pub seed: Option<u64>,
    /// The command line that gave the result.
    pub command_line: String,
    /// Configuration files, in the order they were read.
    pub configuration: Vec<String>,
    /// Name of the instance.
    pub instance: String,
    /// Where the recording is.
    pub recording: String,
    /// What is known of the machine, as (name, value).
    pub machine: Vec<(String, String)>,
}

impl Provenance {
    pub(crate) fn section(&self) -> Section {
        let seed = self.seed.map_or_else(String::new, |seed| seed.to_string());
        let named = [
            ("Version", self.version.clone()),
            ("Seed", seed),
            ("Command", self.command_line.clone()),
            ("Configuration", self.configuration.join(", ")),
            ("Instance", self.instance.clone()),
            ("Recording", self.recording.clone()),
        ];
        let named = named.into_iter().map(|(name, value)| (name.to_owned(), value));
        let facts = named.chain(self.machine.iter().cloned()).filter(|fact| !fact.1.is_empty());
        let blocks = vec![Block::Facts(facts.collect())];
        Section::new("provenance", "Provenance", blocks)
            .with_lead("What it takes to see the same again.")
    }

    pub(crate) fn footer(&self) -> String {
        let version = if self.version.is_empty() { "" } else { " " };
        format!("Written by kerbside{version}{}. This file needs nothing else.", self.version)
    }
}

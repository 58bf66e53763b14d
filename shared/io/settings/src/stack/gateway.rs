//! The door for processes of other users.

use core::time::Duration;
use std::path::PathBuf;

use crate::declare::choices;

choices! {
    /// What a user may do through the gateway.
    pub enum Right {
        /// Ask for the status and subscribe to topics.
        Watch = "watch",
        /// Tell the estimator a pose.
        Fix = "fix",
        /// Inhibit motion.
        Inhibit = "inhibit",
        /// Ask the planner for a plan.
        Plan = "plan",
        /// Permit motion for the next plan.
        Arm = "arm",
        /// Stop the vehicle.
        Stop = "stop",
    }
}

impl Right {
    /// Every right.
    pub const ALL: [Self; 6] =
        [Self::Watch, Self::Fix, Self::Inhibit, Self::Plan, Self::Arm, Self::Stop];
}

/// The gateway: where it listens, what a client may cost, and who may do what.
#[derive(Clone, Debug, PartialEq)]
pub struct GatewaySettings {
    /// Whether there is one.
    pub enabled: bool,
    /// Its socket; none: `NAME.gateway` where other users look for it.
    pub socket: Option<PathBuf>,
    /// Most clients at once.
    pub clients: u32,
    /// Most clients of one user at once.
    pub clients_per_user: u32,
    /// Longest line of a client \[byte\].
    pub line_length: u32,
    /// Most requests of a user a second, all of its clients together \[Hz\].
    pub request_rate: f64,
    /// Most samples of a topic that a client gets a second \[Hz\].
    pub sample_rate: f64,
    /// Longest time a client may take for what it is sent.
    pub patience: Duration,
    /// Longest inhibit of one request.
    pub inhibit: Duration,
    /// Who has each right, in the order of [`Right::ALL`]: see [`GatewaySettings::holders`].
    pub(in crate::stack) holders: [Vec<String>; Right::ALL.len()],
}

impl GatewaySettings {
    /// Users and groups that have a right, as the configuration names them: a user, an `@group`, or `*`.
    #[must_use]
    pub fn holders(&self, right: Right) -> &[String] {
        &self.holders[right as usize]
    }
}

impl Default for GatewaySettings {
    fn default() -> Self {
        Self {
            enabled: false,
            socket: None,
            clients: 16,
            clients_per_user: 4,
            line_length: 16_384,
            request_rate: 20.0,
            sample_rate: 50.0,
            patience: Duration::from_secs(2),
            inhibit: Duration::from_secs(10),
            holders: Default::default(),
        }
    }
}

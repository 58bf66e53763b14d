//! What a configuration may set of the planner.

/// Of the planner.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannerSettings {
    /// Share of `limits.acceleration` a plan uses to speed up.
    pub acceleration_share: f64,
    /// Share of `limits.deceleration` a plan uses to slow down; at most 0.5, so that a late stop ramp still fits.
    pub deceleration_share: f64,
    /// Share of `limits.steering_rate` a plan uses.
    pub steering_rate_share: f64,
    /// Time between the points of a plan \[s\]; longer where a plan would need too many.
    pub interval: f64,
    /// Pause at each change of direction besides the steering's own time \[s\].
    pub pause: f64,
    /// Nodes the search may open before it gives up.
    pub search_nodes: u32,
}

impl Default for PlannerSettings {
    fn default() -> Self {
        Self {
            acceleration_share: 0.5,
            deceleration_share: 0.5,
            steering_rate_share: 0.8,
            interval: 0.02,
            pause: 0.3,
            search_nodes: 200_000,
        }
    }
}

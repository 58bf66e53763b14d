//! What a configuration may set of the planner.

/// Of the planner.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannerSettings {
    /// Share of `limits.acceleration` a plan uses to speed up.
    pub acceleration_share: f64,
    /// Share of `limits.deceleration` a plan uses to slow down; at most 0.5, so that a late stop
    /// ramp still fits.
    pub deceleration_share: f64,
    /// Share of `limits.steering_rate` a plan uses.
    pub steering_rate_share: f64,
    /// Time between the points of a plan \[s\]; longer where a plan would need too many.
    pub interval: f64,
    /// Pause at each change of direction besides the steering's own time \[s\].
    pub pause: f64,
    /// Window over which speed and steering ramps are averaged, so that their rates do not jump
    /// \[s\].
    pub smoothing: f64,
    /// Clearance that the search tries for first, in multiples of the request's; with a quarter of
    /// the nodes, and where start and goal have as much. 1 tries for no more than was asked.
    pub comfort: f64,
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
            smoothing: 0.2,
            comfort: 1.3,
            search_nodes: 100_000,
        }
    }
}

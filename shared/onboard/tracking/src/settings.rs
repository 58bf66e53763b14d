//! What a configuration may set of the tracker.

/// Of the tracker.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackerSettings {
    /// Gain of the error along the path \[1/s\].
    pub gain_along: f64,
    /// Spatial gain of the errors across the path and of heading \[1/m\]: both decay like
    /// exp(-gain * distance). For a vehicle of wheelbase L the shipped 1:6 value 2.5 scales as
    /// 1.25 / L.
    pub gain_across: f64,
    /// Greatest distance from the plan before the tracker stops \[m\].
    pub corridor: f64,
    /// Greatest heading error before the tracker stops \[rad\].
    pub corridor_yaw: f64,
    /// Greatest standard deviation of the position before the tracker stops \[m\].
    pub position_noise: f64,
    /// Greatest standard deviation of the heading before the tracker stops \[rad\].
    pub yaw_noise: f64,
    /// Error along the path at the end that is left alone \[m\].
    pub goal_distance: f64,
    /// Longest time for the end of the plan beyond its duration \[s\].
    pub goal_time: f64,
}

impl Default for TrackerSettings {
    fn default() -> Self {
        Self {
            gain_along: 1.0,
            gain_across: 2.5,
            corridor: 0.15,
            corridor_yaw: 0.35,
            position_noise: 0.05,
            yaw_noise: 0.10,
            goal_distance: 0.002,
            goal_time: 5.0,
        }
    }
}

//! Why there is no plan.

use kerbside_geometry::PolygonError;
use kerbside_messages::PlanVerdict;

use crate::world::Nearest;

/// Why a request was not answered with a plan.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlanFailure {
    /// The request cannot be worked on.
    #[error("malformed request: {0}")]
    Malformed(#[from] RequestFault),
    /// The footprint at the start lacks the clearance.
    #[error("the start {0}")]
    StartBlocked(Shortfall),
    /// The footprint at the goal lacks the clearance.
    #[error("the goal {0}")]
    GoalBlocked(Shortfall),
    /// The search ended without a path.
    #[error(
        "no path within {steering:.1} degrees of steering, {gear_changes} gear changes and \
         {clearance:.3} m of clearance: {nodes} nodes opened{}",
        if *.exhausted { ", none left" } else { "" }
    )]
    NoPath {
        /// Largest steering angle that was allowed \[degrees\].
        steering: f64,
        /// Gear changes that were allowed.
        gear_changes: u32,
        /// Clearance that was asked for \[m\].
        clearance: f64,
        /// Nodes the search opened.
        nodes: u32,
        /// Whether it ended for want of nodes rather than of leave to open more.
        exhausted: bool,
    },
    /// The plan needs more points than a message holds, even at the longest interval.
    #[error("the plan takes {duration:.1} s, a message holds at most {longest:.1} s")]
    TooLong {
        /// Its duration \[s\].
        duration: f64,
        /// The longest that fits \[s\].
        longest: f64,
    },
}

impl PlanFailure {
    /// The verdict that the answer carries.
    #[must_use]
    pub const fn verdict(&self) -> PlanVerdict {
        match self {
            Self::Malformed(_) => PlanVerdict::Malformed,
            Self::StartBlocked(_) => PlanVerdict::StartBlocked,
            Self::GoalBlocked(_) => PlanVerdict::GoalBlocked,
            Self::NoPath { .. } => PlanVerdict::NoPath,
            Self::TooLong { .. } => PlanVerdict::TooLong,
        }
    }
}

/// Clearance that a pose lacks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shortfall {
    /// What is too near.
    pub nearest: Nearest,
    /// Distance found \[m\]; 0 inside an obstacle, negative beyond the bounds.
    pub found: f64,
    /// Distance asked for \[m\].
    pub needed: f64,
}

impl core::fmt::Display for Shortfall {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { nearest, found, needed } = self;
        match nearest {
            Nearest::Bounds if *found < 0.0 => write!(f, "leaves the bounds by {:.3} m", -found),
            Nearest::Obstacle(index) if *found <= 0.0 => write!(f, "overlaps obstacle {index}"),
            _ => write!(f, "is {found:.3} m from {nearest}, {needed:.3} m are needed"),
        }
    }
}

/// What is wrong with a request.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RequestFault {
    /// A pose that is none.
    #[error("the {0} pose is not finite")]
    Pose(&'static str),
    /// A limit that leaves nothing to drive with.
    #[error("{field} is {value}, allowed is {allowed}")]
    Limit {
        /// Name of the field.
        field: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        allowed: &'static str,
    },
    /// Bounds that hold nothing.
    #[error("the bounds hold nothing: from ({}, {}) to ({}, {})", .0[0], .0[1], .0[2], .0[3])]
    Bounds([f64; 4]),
    /// More corners announced than a request has.
    #[error("the obstacles have {corners} corners, a request holds {most}")]
    Sizes {
        /// Corners announced.
        corners: usize,
        /// Corners a request holds.
        most: usize,
    },
    /// An obstacle that is no convex polygon.
    #[error("obstacle {index}: {cause}")]
    Obstacle {
        /// Its index.
        index: usize,
        /// What keeps it from being one.
        #[source]
        cause: PolygonError,
    },
}

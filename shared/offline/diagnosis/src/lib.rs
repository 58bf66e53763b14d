//! Where the gap between a simulator and a vehicle lies, which effect causes it, and how far it shrinks.

mod case;
mod verdict;

pub use case::{Allowance, Case, Run, Series, Wheels};
pub use verdict::{
    Alternative, Diagnosis, FoundEffect, FoundParameter, Interval, LinkGap, MapPoint, Mistake,
    Next, RegimePlot, Rival, RunPaths, Shrinkage, Verdict,
};

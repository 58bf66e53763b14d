//! What is diagnosed, and what a diagnosis says.

mod case;
mod chain;
mod verdict;

pub use case::{Allowance, Case, Run, Series, Wheels};
pub use chain::{Command, Link};
pub use verdict::{
    Alternative, Diagnosis, FoundEffect, FoundParameter, Interval, LinkGap, MapPoint, Mistake,
    Next, RegimePlot, Rival, RunPaths, Shrinkage, Verdict,
};

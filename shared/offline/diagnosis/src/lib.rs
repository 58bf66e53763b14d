//! Where the gap between a simulator and a vehicle lies, which effect causes it, and how far it shrinks.

mod analyse;
mod answer;
mod bench;
mod bins;
mod blocks;
mod candidate;
mod case;
mod decide;
mod diagnose;
mod fit;
mod floor;
mod folds;
mod follow;
mod gauge;
mod generic;
mod linear;
mod links;
mod mistakes;
mod moved;
mod noise;
mod nuisance;
mod oscillation;
mod outliers;
mod patch;
mod path;
mod pictures;
mod prepare;
mod rivals;
mod screen;
mod search;
mod shrink;
mod trust;
mod unseen;
mod verdict;
mod words;

pub use case::{Allowance, Case, Run, Series, Wheels};
pub use diagnose::{DiagnosisError, Manoeuvre, Settings, diagnose};
pub use verdict::{
    Alternative, Diagnosis, FoundEffect, FoundParameter, Interval, Judged, LinkGap, MapPoint,
    Mistake, Next, RegimePlot, Rival, RunPaths, Shrinkage, Verdict,
};

//! A drive through the stages in this process.

use std::time::Instant;

use kerbside_messages::{Odometry, Raw};

use super::chain::Chain;
use super::track::Track;
use crate::exit::Failure;
use crate::service::Service;

/// Readings between two looks at the clock: the clock must not be what is measured.
const BLOCK: usize = 1024;

/// What came of it.
#[derive(Debug)]
pub struct Pure {
    /// The odometry.
    pub track: Track,
    /// What each wheel had rolled with each sample \[m\].
    pub rolled: Vec<[f64; 4]>,
    /// What was refused, by reason.
    pub refusals: Vec<(&'static str, u64)>,
    /// Time spent in the stages and in the checks between them \[s\]; keeping and hashing what came of it is not in it.
    pub seconds: f64,
}

/// Runs `raws` through the stages of `service`'s instance.
///
/// # Errors
/// [`Failure`] where the vehicle has nothing to compute motion from.
pub fn run(service: &Service, raws: &[Raw]) -> Result<Pure, Failure> {
    let mut chain = Chain::new(service)?;
    let mut track = Track::with_capacity(raws.len());
    let mut rolled = Vec::with_capacity(raws.len());
    let mut block: Vec<Odometry> = Vec::with_capacity(BLOCK);
    let mut seconds = 0.0;
    for raws in raws.chunks(BLOCK) {
        block.clear();
        let begun = Instant::now();
        for raw in raws {
            if let Some(odometry) = chain.step(raw) {
                block.push(*odometry);
                rolled.push(chain.rolled());
            }
        }
        seconds += begun.elapsed().as_secs_f64();
        block.iter().for_each(|odometry| track.push(odometry));
    }
    Ok(Pure { track, rolled, refusals: chain.refusals(), seconds })
}

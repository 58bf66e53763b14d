//! Row 9: Figure 10 and Table 3 of the paper: a given path, tracked in closed loop by what the vehicle believes.

mod closed_loop;
mod driver;
mod figures;
mod plan;

use kerbside_geometry::Pose;

use crate::error::ReproductionError;
use crate::progress::Progress;
use crate::random::seed_of;
use closed_loop::Loop;
pub use driver::Driver;
use driver::setting;
pub(crate) use figures::figures;
use plan::Given;
pub use plan::Scene;

/// Readings, and steps of the loop, per second \[Hz\].
const RATE: f64 = 50.0;
/// Standing before the plan begins \[s\].
const WAIT: f64 = 1.0;
/// The arm under which everything is driven.
const ARM: u64 = 1;

/// True ends of many parkings.
#[derive(Clone, Debug, PartialEq)]
pub struct Parkings {
    /// What was driven.
    pub scene: Scene,
    /// By whom.
    pub driver: Driver,
    /// True end in the frame of the goal, x along the slot's axis \[m, m, rad\].
    pub ends: Vec<[f64; 3]>,
    /// In how many the tracker arrived.
    pub arrived: usize,
    /// True path of the first one.
    pub path: Vec<Pose>,
    /// The plan's.
    pub plan: Vec<Pose>,
    seed: u64,
}

fn park(
    scene: Scene,
    driver: Driver,
    (trials, seed): (usize, u64),
    progress: &mut Progress<'_>,
) -> Result<Parkings, ReproductionError> {
    let given = Given::new(scene);
    let mut parkings = Parkings {
        scene,
        driver,
        ends: Vec::new(),
        arrived: 0,
        path: Vec::new(),
        plan: given.points.iter().map(|point| Pose::new(point.x, point.y, point.yaw)).collect(),
        seed: seed_of(seed, 900, u64::MAX),
    };
    for trial in 0..trials {
        // The same errors for every driver: they are compared in pairs.
        let seed = seed_of(seed, 900 + scene as u64, trial as u64);
        let setting = setting(driver, &given, seed);
        let mut closed = Loop::new(&setting, &given, seed)?;
        let path = (trial == 0).then_some(&mut parkings.path);
        let arrived = closed.run(path);
        parkings.arrived += usize::from(arrived);
        let end = closed.plant.state().pose.seen_from(&given.goal);
        parkings.ends.push([end.x, end.y, end.yaw]);
        progress.step()?;
    }
    Ok(parkings)
}

/// Parks both scenes with every driver.
pub(crate) fn park_all(
    trials: usize,
    seed: u64,
    progress: &mut Progress<'_>,
) -> Result<Vec<Parkings>, ReproductionError> {
    let mut lines = Vec::new();
    for scene in Scene::ALL {
        for driver in Driver::ALL {
            lines.push(park(scene, driver, (trials, seed), progress)?);
        }
    }
    Ok(lines)
}

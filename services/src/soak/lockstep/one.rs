//! One manoeuvre of a soak in lockstep: its scene, its start, its faults, and what came of it.

use std::collections::BTreeMap;
use std::sync::Mutex;

use crate::vehicle::plant::Plant;
use kerbside_messages::{Nanos, Odometry, PlanRequest};

use crate::exit::Failure;
use crate::lockstep::{
    Broken, Checker, Plans, Schedule, Searching, Stop, Task, Watcher, World, drive,
};
use crate::manoeuvre::End;
use crate::park::scene::Start;
use crate::park::{self, Job, ParkArgs};
use crate::planner::Answered;
use crate::service::Service;

/// The scenes, as often as they come up.
const SCENES: [&str; 8] = [
    "garage",
    "parallel",
    "garage",
    "parallel",
    "garage",
    "parallel",
    "garage-full-size",
    "parallel-full-size",
];
/// Starts of each scene: few, so that a plan from there is searched once. Noise and faults are each seed's own.
const STARTS: u64 = 16;
/// Plans that are kept.
const KEPT: usize = 512;

/// The scenes, loaded once.
#[derive(Debug)]
pub struct Scenes(Vec<Job>);

impl Scenes {
    /// Loads all scenes with their shipped configuration, without real-time rights: a seed is the same on every machine.
    ///
    /// # Errors
    /// [`Failure`] where the configuration is refused.
    pub fn load() -> Result<Self, Failure> {
        SCENES.into_iter().map(job_of).collect::<Result<_, _>>().map(Self)
    }

    fn of(&self, seed: u64) -> &Job {
        &self.0[place(seed)]
    }

    /// Name of the scene that a seed drives in.
    #[must_use]
    pub fn name(&self, seed: u64) -> &str {
        &self.of(seed).scenario.name
    }
}

#[allow(clippy::cast_possible_truncation)] // below the number of scenes
fn place(seed: u64) -> usize {
    (seed % SCENES.len() as u64) as usize
}

fn job_of(scene: &str) -> Result<Job, Failure> {
    let args = ParkArgs { lockstep: true, rearm: true, ..ParkArgs::of(scene) };
    let mut job = park::job(&args, args.seed, std::path::Path::new(""))?;
    job.service.args.realtime = false;
    Ok(job)
}

/// Plans that were searched once.
#[derive(Debug, Default)]
pub struct Atlas(Mutex<BTreeMap<Place, Answered>>);

/// Scene, and where the search starts, to the last bit.
type Place = (String, [u64; 3]);

impl Atlas {
    fn find(&self, place: &Place) -> Option<Answered> {
        self.0.lock().ok()?.get(place).cloned()
    }

    fn keep(&self, place: Place, answered: &Answered) {
        if let Ok(mut known) = self.0.lock()
            && known.len() < KEPT
        {
            known.insert(place, answered.clone());
        }
    }
}

/// Looks plans up before it searches; only those of a manoeuvre's beginning come up again, so only those are kept.
struct Looking<'a> {
    atlas: &'a Atlas,
    scene: &'a str,
    first: bool,
}

impl Plans for Looking<'_> {
    fn answer(
        &mut self,
        service: &Service,
        request: &PlanRequest,
        odometry: Option<&Odometry>,
    ) -> Answered {
        let first = core::mem::replace(&mut self.first, false);
        let Some(at) = odometry.filter(|odometry| first && odometry.standstill == 1) else {
            return Searching.answer(service, request, odometry);
        };
        let place = (self.scene.to_owned(), [at.x, at.y, at.yaw].map(f64::to_bits));
        let Some(mut known) = self.atlas.find(&place) else {
            let answered = Searching.answer(service, request, odometry);
            self.atlas.keep(place, &answered);
            return answered;
        };
        known.search_seconds = 0.0;
        known.answer.id = request.id;
        if let Some((head, _)) = &mut known.plan {
            (head.id, head.arm) = (request.id, request.arm);
            (head.header.stamp, head.header.origin) = (at.header.stamp, at.header.origin);
        }
        known
    }
}

/// What came of a manoeuvre.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Its seed.
    pub seed: u64,
    /// Its scene.
    pub scene: String,
    /// How it ended; none where a broken invariant ended it.
    pub end: Option<End>,
    /// Simulated time \[ns\].
    pub elapsed: Nanos,
    /// Faults that began.
    pub faults: Schedule,
    /// The invariant that was broken.
    pub broken: Option<Broken>,
    /// Stops that were seen.
    pub stops: Vec<Stop>,
    /// Times until the stack was whole again \[s\].
    pub recoveries: Vec<f64>,
    /// Least distance to anything solid \[m\].
    pub clearance: f64,
    /// Wall time of searches \[s\].
    pub search_seconds: f64,
}

/// Drives the manoeuvre of `seed` under `schedule`.
///
/// # Errors
/// [`Failure`] where the vehicle has nothing to compute motion from.
pub fn manoeuvre(
    scenes: &Scenes,
    atlas: &Atlas,
    seed: u64,
    schedule: &Schedule,
) -> Result<Outcome, Failure> {
    manoeuvre_in(scenes, atlas, seed, schedule, |_| {})
}

/// The same in a world that `prepare` has changed.
fn manoeuvre_in(
    scenes: &Scenes,
    atlas: &Atlas,
    seed: u64,
    schedule: &Schedule,
    prepare: impl FnOnce(&mut World),
) -> Result<Outcome, Failure> {
    let job = scenes.of(seed);
    let start = Start::draw(&job.scenario, seed / SCENES.len() as u64 % STARTS);
    let task = Task {
        service: &job.service,
        scenario: &job.scenario,
        start: &start,
        plant: &Plant::as_described(&job.service),
        seed,
        rearm: true,
    };
    let mut world = task.world(schedule.clone())?;
    prepare(&mut world);
    let mut checker = Checker::new(&task, schedule);
    let mut plans = Looking { atlas, scene: &job.scenario.name, first: true };
    let end = drive(&task, &mut world, &mut plans, &mut checker);
    if let Some(End::TimedOut(what)) = end {
        checker.timed_out(&world, what);
    }
    // A manoeuvre may end before its vehicle stands: the stop belongs to it.
    while checker.waits() {
        world.tick(&mut plans);
        checker.tick(&world);
    }
    Ok(Outcome {
        seed,
        scene: job.scenario.name.clone(),
        end: end.filter(|_| checker.broken().is_none()),
        elapsed: world.elapsed(),
        faults: Schedule::new(world.begun().to_vec()),
        broken: checker.broken().cloned(),
        stops: checker.stops().to_vec(),
        recoveries: checker.recoveries().to_vec(),
        clearance: checker.clearance(),
        search_seconds: world.search_seconds,
    })
}

#[cfg(test)]
mod tests;

//! The parking report: from what was seen to what is drawn.

use kerbside_geometry::Pose;
use kerbside_messages::{EstimatorState, Mode, Odometry, Truth};
use kerbside_reports::{
    CommandSample, EstimateSample, Event, EventKind, Figures, Latency, Motion, Outcome, ParkReport,
    Phase, Plan, ProcessFigures, Provenance, Scene, svg::Tone,
};

use super::judge::Verdict;
use super::trace::{Followed, HappeningKind, Trace};
use super::{Job, Run};

/// The report of a run.
#[must_use]
pub fn of(job: &Job, run: &Run, verdict: &Verdict) -> ParkReport {
    let trace = &run.trace;
    ParkReport {
        scenario: job.scenario.name.clone(),
        vehicle: job.service.vehicle.name.clone(),
        run: job.run_in_words().to_owned(),
        outcome: Outcome {
            parked: verdict.parked,
            collision: verdict.collision,
            cause: Some(verdict.cause.clone()).filter(|cause| !cause.is_empty()),
            judged_on: verdict.judged_on,
        },
        scene: scene(job),
        figures: figures(trace, verdict),
        latency: latency(job, trace),
        plans: trace.plans.iter().map(|plan| plan_of(trace, plan)).collect(),
        estimate: located(trace).map(|odometry| estimate_of(trace, odometry)).collect(),
        truth: trace.truth.iter().map(|truth| truth_of(trace, truth)).collect(),
        commands: trace.commands.iter().map(|command| command_of(trace, command)).collect(),
        phases: phases(trace),
        events: events(trace),
        processes: processes(trace),
        provenance: provenance(job, run),
    }
}

fn scene(job: &Job) -> Scene {
    let scenario = &job.scenario;
    let (min, max) = (scenario.bounds.min, scenario.bounds.max);
    let tolerance = scenario.tolerance;
    Scene {
        bounds: [min[0], min[1], max[0], max[1]],
        obstacles: scenario
            .obstacles
            .iter()
            .map(|obstacle| obstacle.outline.corners().to_vec())
            .collect(),
        // What surrounds the slot is among the obstacles.
        slot: Vec::new(),
        start: scenario.start,
        goal: scenario.goal,
        tolerance: Pose::new(tolerance.position, tolerance.position, tolerance.yaw),
        footprint: job.service.vehicle.footprint,
    }
}

fn figures(trace: &Trace, verdict: &Verdict) -> Figures {
    Figures {
        end_error: verdict.end_error,
        estimate_error: verdict.estimate_error,
        gear_changes: verdict.gear_changes,
        duration: verdict.duration,
        path_length: verdict.length,
        planned_clearance: trace.plans.last().map(|plan| plan.head.clearance),
        driven_clearance: verdict.clearance,
        deadline_misses: trace.misses(),
        restarts: trace.restarts(),
    }
}

#[allow(clippy::cast_precision_loss)] // microseconds far below 2^53
fn latency(job: &Job, trace: &Trace) -> Option<Latency> {
    if job.lockstep || trace.latency.is_empty() {
        return None;
    }
    let seconds = |micros: u64| micros as f64 * 1e-6;
    let at = |quantile| seconds(trace.latency.value_at_quantile(quantile));
    let recorded = trace.latency.iter_recorded();
    Some(Latency {
        p50: at(0.5),
        p99: at(0.99),
        p999: at(0.999),
        max: seconds(trace.latency.max()),
        deadline: Some(job.service.safety().timeouts.deadline.as_secs_f64()),
        counts: recorded
            .map(|value| (seconds(value.value_iterated_to()), value.count_at_value()))
            .collect(),
    })
}

fn plan_of(trace: &Trace, plan: &Followed) -> Plan {
    let begun = trace.time(plan.begun.unwrap_or(plan.head.header.sent));
    let motion = |point: &kerbside_messages::TrajectoryPoint| Motion {
        time: begun + point.time,
        pose: Pose::new(point.x, point.y, point.yaw),
        speed: point.speed,
        steering: point.steering,
    };
    Plan { points: plan.points.iter().map(motion).collect() }
}

/// The estimates from the first fix on: before it their frame is not the map's.
fn located(trace: &Trace) -> impl Iterator<Item = &Odometry> {
    trace.odometry.iter().skip_while(|odometry| odometry.state == EstimatorState::Unset.code())
}

fn estimate_of(trace: &Trace, odometry: &Odometry) -> EstimateSample {
    let motion = Motion {
        time: trace.time(odometry.header.stamp),
        pose: Pose::new(odometry.x, odometry.y, odometry.yaw),
        speed: odometry.speed,
        steering: odometry.steering,
    };
    EstimateSample { motion, covariance: odometry.covariance }
}

fn truth_of(trace: &Trace, truth: &Truth) -> Motion {
    Motion {
        time: trace.time(truth.header.stamp),
        pose: Pose::new(truth.x, truth.y, truth.yaw),
        speed: truth.speed,
        steering: truth.steering,
    }
}

fn command_of(trace: &Trace, command: &kerbside_messages::Command) -> CommandSample {
    CommandSample {
        time: trace.time(command.header.sent),
        speed: command.speed,
        steering: command.steering,
        error_along: command.error_along,
        error_across: command.error_across,
        error_yaw: command.error_yaw,
    }
}

/// Modes as stretches of time.
fn phases(trace: &Trace) -> Vec<Phase> {
    let mut phases: Vec<Phase> = Vec::new();
    let end = trace.state.map_or(0.0, |state| trace.time(state.header.sent));
    for happening in &trace.happenings {
        let (mode, tone) = match happening.kind {
            HappeningKind::Mode(mode) => (mode.name().to_owned(), tone_of(mode)),
            HappeningKind::Fault => {
                let mode = happening.text.split(':').next().unwrap_or_default();
                (mode.to_owned(), Tone::Bad)
            }
            _ => continue,
        };
        let start = trace.time(happening.at);
        if let Some(last) = phases.last_mut() {
            last.end = start;
        }
        phases.push(Phase { start, end: end.max(start), mode, tone });
    }
    phases
}

fn tone_of(mode: Mode) -> Tone {
    match mode {
        Mode::Driving => Tone::Plain,
        Mode::Done => Tone::Good,
        Mode::Stopping => Tone::Warn,
        Mode::Faulted => Tone::Bad,
        _ => Tone::Plain,
    }
}

fn events(trace: &Trace) -> Vec<Event> {
    let kind = |kind| match kind {
        HappeningKind::Mode(_) => EventKind::Mode,
        HappeningKind::Arm => EventKind::Arm,
        HappeningKind::Plan => EventKind::Plan,
        HappeningKind::Fault => EventKind::Fault,
        HappeningKind::Restart => EventKind::Restart,
        HappeningKind::Note => EventKind::Note,
    };
    let event = |happening: &super::trace::Happening| Event {
        time: trace.time(happening.at),
        kind: kind(happening.kind),
        text: happening.text.clone(),
    };
    trace.happenings.iter().map(event).collect()
}

#[allow(clippy::cast_precision_loss)] // steps far below 2^53
fn processes(trace: &Trace) -> Vec<ProcessFigures> {
    let figures = |(process, figures): &(kerbside_messages::Process, super::trace::Loop)| {
        let row = trace.state.and_then(|state| {
            state.rows().iter().find(|row| row.process == *process as u8).copied()
        });
        ProcessFigures {
            name: process.name().to_owned(),
            pid: Some(figures.pid).filter(|pid| *pid > 0),
            restarts: row.map_or(0, |row| row.restarts),
            misses: figures.misses.0 + figures.misses.1,
            work_mean: figures.work / figures.steps.max(1) as f64,
            work_max: figures.work_max,
        }
    };
    trace.loops.iter().map(figures).collect()
}

fn provenance(job: &Job, run: &Run) -> Provenance {
    Provenance {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        seed: Some(job.seed),
        command_line: job.command_line.clone(),
        configuration: job.configuration.clone(),
        instance: run.instance.clone().unwrap_or_default(),
        recording: run
            .recording
            .as_ref()
            .map_or_else(String::new, |path| path.display().to_string()),
        machine: crate::machine::facts(),
    }
}

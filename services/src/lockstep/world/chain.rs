//! The sample's way through a simulated world: each process takes what has come for it, and steps.

use kerbside_messages::{Nanos, Process, seal};
use kerbside_odometry::EstimatorInputs;
use kerbside_safety::GateInputs;
use kerbside_tracking::TrackerInputs;

use super::{EPOCH, PLAN, Plans, World};
use crate::interface::reading_to_raw;
use crate::life::nanos;

/// A pause of the simulated vehicle longer than this stops its time, as in the vehicle's own process \[ns\].
const PAUSE: Nanos = crate::vehicle::PAUSE;

impl World {
    pub(super) fn drive_vehicle(&mut self) {
        if self.is_stalled(Process::Vehicle) {
            return;
        }
        if let Some(span) = self.stall_over(Process::Vehicle) {
            self.vehicle_lag += if span > PAUSE { span } else { 0 };
            self.vehicle_due = self.now;
        }
        let time = self.now - EPOCH - self.vehicle_lag;
        if self.to_vehicle.is_due(self.now) {
            let mut bytes = core::mem::take(&mut self.buffer);
            self.to_vehicle.take(self.now, &mut bytes);
            self.hurt(super::super::Way::ToVehicle, &mut bytes);
            self.vehicle.receive(time, &bytes);
            self.buffer = bytes;
        }
        if self.now < self.vehicle_due {
            return;
        }
        self.vehicle_due += self.vehicle.period();
        let (now, line) = (self.now, &mut self.to_host);
        self.vehicle.tick(time, |frame| line.put(now, frame));
        self.vehicle.truth(now, &mut self.truth);
        self.fresh.truth = Some(self.truth);
    }

    /// The interface takes in what arrived; bytes that nobody reads are lost with the terminal.
    pub(super) fn hear_line(&mut self) {
        if self.is_stalled(Process::Interface) {
            return;
        }
        let came = self.to_host.is_due(self.now);
        if !came && self.trouble.is_empty() {
            return;
        }
        let mut bytes = core::mem::take(&mut self.buffer);
        self.to_host.take(self.now, &mut bytes);
        let hurt = self.hurt(super::super::Way::ToHost, &mut bytes);
        if self.stages.interface.is_some() && (came || hurt) {
            self.begin(Process::Interface, self.now);
            self.read(&bytes);
            self.checkpoints(Process::Interface, 2);
        }
        self.buffer = bytes;
    }

    fn read(&mut self, bytes: &[u8]) {
        let (now, raws, fresh) = (self.now, &mut self.topics.raw, &mut self.fresh);
        let Some(interface) = &mut self.stages.interface else { return };
        interface.receive(
            now,
            bytes,
            |reading, errors| {
                fresh.raw = raws.send(now, |raw| {
                    reading_to_raw(reading, errors, now, raw);
                    true
                });
            },
            |_| {},
        );
    }

    pub(super) fn step_ingest(&mut self) {
        if !self.works(Process::Ingest) {
            return;
        }
        let now = self.now;
        let mut newest = None;
        while let Some((raw, admitted)) = self.topics.raw.take(Process::Ingest, now) {
            let Some(ingest) = &mut self.stages.ingest else { return };
            self.topics.travel.send(now, |travel| {
                ingest.step(&raw, admitted.missing, admitted.new_epoch, travel);
                true
            });
            newest = newest.max(Some(raw.arrival));
        }
        self.stepped(Process::Ingest, newest);
    }

    pub(super) fn step_estimator(&mut self) {
        if !self.works(Process::Estimator) {
            return;
        }
        let now = self.now;
        self.topics.restore.update(Process::Estimator, now);
        let mut newest = None;
        while let Some((travel, admitted)) = self.topics.travel.take(Process::Estimator, now) {
            let fix = self.pending_fix.take();
            let Some(estimator) = &mut self.stages.estimator else { return };
            let inputs = EstimatorInputs {
                travel: &travel,
                missing: admitted.missing,
                fix: fix.as_ref(),
                restore: self.topics.restore.newest(Process::Estimator),
            };
            let sent = self.topics.odometry.send(now, |odometry| {
                estimator.step(inputs, odometry);
                true
            });
            self.fresh.odometry = sent;
            newest = newest.max(Some(travel.header.origin));
        }
        self.stepped(Process::Estimator, newest);
    }

    pub(super) fn step_tracker(&mut self) {
        if !self.works(Process::Tracker) {
            return;
        }
        let now = self.now;
        self.topics.permit.update(Process::Tracker, now);
        let mut newest = None;
        while let Some((odometry, _)) = self.topics.odometry.take(Process::Tracker, now) {
            let Some(tracker) = &mut self.stages.tracker else { return };
            let inputs = TrackerInputs {
                now,
                odometry: &odometry,
                plan: self.plan.as_ref().map(|(head, points)| (head, points.as_slice())),
                permit: self.topics.permit.newest(Process::Tracker),
            };
            let sent = self.topics.command.send(now, |command| tracker.step(inputs, command));
            self.fresh.command = sent.or(self.fresh.command.take());
            newest = newest.max(Some(odometry.header.origin));
        }
        self.stepped(Process::Tracker, newest);
    }

    /// The gate acts on each command, which puts off the tick, and at least every period without one.
    pub(super) fn pass_gate(&mut self, on_command: bool) {
        if !self.works(Process::Actuation) {
            return;
        }
        let now = self.now;
        let fresh = on_command && self.topics.command.update(Process::Actuation, now);
        let due = !on_command && now >= self.gate_due;
        if !due && !fresh {
            return;
        }
        self.topics.permit.update(Process::Actuation, now);
        self.gate_due = now + nanos(self.service.safety().actuation_period);
        let inhibit = self.pending_inhibit.take();
        let refused = self.topics.command.refusals(Process::Actuation);
        let invalid_command = core::mem::replace(&mut self.refused_commands, refused) != refused;
        let Some(gate) = &mut self.stages.gate else { return };
        let inputs = GateInputs {
            command: self.topics.command.newest(Process::Actuation),
            permit: self.topics.permit.newest(Process::Actuation),
            inhibit: inhibit.as_ref(),
            invalid_command,
        };
        self.fresh.actuator = self.topics.actuator.send(now, |actuator| {
            gate.step(now, inputs, actuator);
            true
        });
        self.stepped(Process::Actuation, Some(now));
    }

    /// The interface writes what is due, and opens a silent line anew.
    pub(super) fn tell_line(&mut self) {
        if !self.works(Process::Interface) {
            return;
        }
        let Some(interface) = &mut self.stages.interface else { return };
        let now = self.now;
        let timeouts = &self.service.safety().timeouts;
        let (freshness, silence) = (nanos(timeouts.freshness), nanos(timeouts.line_silence));
        self.topics.actuator.update(Process::Interface, now);
        let handshake = interface.pending();
        let newest = self.topics.actuator.newest(Process::Interface);
        let command = newest.and_then(|actuator| interface.command(now, actuator, freshness));
        self.fresh.delivered = newest.filter(|_| command.is_some()).copied();
        for frame in [handshake, command].into_iter().flatten() {
            self.to_vehicle.put(now, &frame);
        }
        if interface.is_lost(now, self.line_opened, silence) {
            interface.line_lost();
            self.line_opened = now;
        }
        let waits = interface.waits_for(now, silence);
        self.ready(Process::Interface, waits);
    }

    pub(super) fn work_on_plan(&mut self, plans: &mut dyn Plans) {
        if !self.works(Process::Planner) {
            return;
        }
        if let Some(request) = self.requested.take() {
            let answered = plans.answer(&self.service, &request, self.odometry());
            self.search_seconds += answered.search_seconds;
            self.planning = Some((self.now + PLAN, answered));
        }
        let due = self.planning.as_ref().is_some_and(|(due, _)| *due <= self.now);
        let Some((_, answered)) = self.planning.take_if(|_| due) else { return };
        if let Some((mut head, points)) = answered.plan {
            let sequence = head.id;
            seal(&mut head, bytemuck::cast_slice(&points), EPOCH, sequence, self.now);
            self.plan = Some((head, points));
        }
        self.planned = Some(answered.answer);
    }
}

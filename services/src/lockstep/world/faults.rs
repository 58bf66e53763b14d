//! What a schedule of faults does to a simulated world.

use kerbside_messages::{Nanos, Process};

use super::super::schedule::{Fault, Kind, LineMishap, Way, Wire};
use super::World;

/// Trouble on the line, under way.
#[derive(Clone, Debug)]
pub(super) struct LineTrouble {
    way: Way,
    mishap: LineMishap,
    until: Nanos,
}

impl World {
    pub(super) fn follow_schedule(&mut self) {
        while let Some(fault) = self.schedule.faults().get(self.begun) {
            if Self::time_of(fault) > self.now {
                return;
            }
            let fault = fault.clone();
            self.begun += 1;
            self.befall(&fault);
        }
    }

    fn befall(&mut self, fault: &Fault) {
        let until = Self::time_of(fault) + fault.kind.span();
        match &fault.kind {
            Kind::Kill(process) => self.kill(*process),
            Kind::Stall { process, .. } => self.stall(*process, until),
            Kind::Samples { wire, reader, mishap, .. } => {
                self.befall_samples(*wire, *reader, *mishap, until);
            }
            Kind::Line { way, mishap, .. } => {
                let mishap = mishap.clone();
                self.trouble.push(LineTrouble { way: *way, mishap, until });
            }
            Kind::Reboot => {
                self.boots += 1;
                self.vehicle.reboot(self.boots);
            }
            Kind::CounterReset => self.vehicle.reset_counters(),
            Kind::ClockStep(by) => self.vehicle.step_clock(*by),
            Kind::Inhibit(span) => self.inhibit(*span),
        }
    }

    fn befall_samples(
        &mut self,
        wire: Wire,
        reader: Option<Process>,
        mishap: super::super::Mishap,
        until: Nanos,
    ) {
        let topics = &mut self.topics;
        match wire {
            Wire::Raw => topics.raw.befall(mishap, reader, until),
            Wire::Travel => topics.travel.befall(mishap, reader, until),
            Wire::Odometry => topics.odometry.befall(mishap, reader, until),
            Wire::Command => topics.command.befall(mishap, reader, until),
            Wire::Permit => topics.permit.befall(mishap, reader, until),
            Wire::Actuator => topics.actuator.befall(mishap, reader, until),
            Wire::Heartbeat(process) => {
                let found = topics.heartbeats.iter_mut().find(|(known, _)| *known == process);
                if let Some((_, heartbeats)) = found {
                    heartbeats.befall(mishap, reader, until);
                }
            }
        }
    }

    /// Does to bytes on the line what is under way there; whether there was something.
    pub(super) fn hurt(&mut self, way: Way, bytes: &mut Vec<u8>) -> bool {
        if self.trouble.is_empty() {
            return false;
        }
        let now = self.now;
        let mut added = false;
        self.trouble.retain(|trouble| {
            if trouble.way != way {
                return trouble.until > now;
            }
            match &trouble.mishap {
                LineMishap::Silence if now < trouble.until => bytes.clear(),
                LineMishap::Hurt(which) if now < trouble.until && !bytes.is_empty() => {
                    let at = *which as usize % bytes.len();
                    bytes[at] = !bytes[at];
                }
                LineMishap::Garbage(garbage) => {
                    bytes.splice(0..0, garbage.iter().copied());
                    added = true;
                    return false;
                }
                _ => {}
            }
            trouble.until > now
        });
        added
    }
}

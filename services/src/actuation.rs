//! Actuation: the gate between command and vehicle.
//!
//! Topics in: `command`, `permit`, `inhibit`. Topics out: `actuator`, on each command and at least every period
//! without one: a stop ramp needs nobody's sample.

use kerbside_messages::{Actuator, Command, Permit};
use kerbside_runtime::{Newest, Ticker, now};
use kerbside_safety::{Gate, GateInputs};

use crate::exit::{Exit, Failure};
use crate::life::{Life, Service};

/// Runs actuation.
///
/// # Errors
/// [`Failure`] where the process cannot take part.
pub fn run(service: &Service) -> Result<Exit, Failure> {
    let mut life = Life::join(service, 1)?;
    let mut stage = Gate::new(&service.vehicle.limits, life.safety());
    let mut command = Newest::of(life.subscriber::<Command>(1)?);
    let mut permit = Newest::of(life.subscriber::<Permit>(1)?);
    let mut inhibits = life.subscriber::<kerbside_messages::Inhibit>(8)?;
    let mut actuator = life.publisher::<Actuator>()?;
    let listener = life.listener::<Command>()?;
    let mut tick = Ticker::new(life.safety().actuation_period);
    let mut refused = 0;
    life.waits_for(None);
    while life.goes_on() {
        listener.wait_until(tick.next());
        let woken = now();
        permit.update();
        let mut inhibited = false;
        while let Some(inhibit) = inhibits.receive() {
            stage.inhibit(&inhibit);
            inhibited = true;
        }
        let fresh = command.update();
        if !tick.due(woken) && !fresh && !inhibited {
            continue;
        }
        let arrival =
            command.get().filter(|_| fresh).map_or(woken, |command| command.header.origin);
        life.begin(arrival);
        let refusals = command.refusals().total();
        let invalid_command = core::mem::replace(&mut refused, refusals) != refusals;
        let sent = actuator.send(|out| {
            let inputs = GateInputs {
                command: command.get(),
                permit: permit.get(),
                inhibit: None,
                invalid_command,
            };
            stage.step(woken, inputs, out);
            true
        });
        if let Err(error) = sent {
            tracing::error!(%error, "actuator sample lost");
        }
        life.checkpoint(0);
        life.end();
        life.counts(command.refusals());
    }
    Ok(life.exit())
}

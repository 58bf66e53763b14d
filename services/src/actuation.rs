//! Actuation: the gate between command and vehicle.
//!
//! Topics in: `command`, `permit`, `inhibit`. Topics out: `actuator`, on each command and at least every period
//! without one: a stop ramp needs nobody's sample. Each command puts off the tick, and a tick between commands whose
//! output is the last one's is not published: as many wake-ups of gate and interface would say nothing new
//! (`kerbside bench pipeline`).
//!
//! It waits by polling its event's descriptor: a tick has to be kept to a tenth of a millisecond, and the bound of a
//! wait on the event itself is rounded up to the kernel's ticks, 5 ms to 12. What a poll costs more than such a wait
//! is within the noise (`kerbside bench transport`).

use kerbside_messages::{Actuator, Command, Permit};
use kerbside_runtime::{Newest, Publisher, Ticker, now};
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
    let mut last = Actuator::default();
    let mut commanded = false;
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
        if fresh {
            tick.restart(woken);
        }
        let arrival =
            command.get().filter(|_| fresh).map_or(woken, |command| command.header.origin);
        life.begin(arrival);
        let refusals = command.refusals().total();
        let invalid_command = core::mem::replace(&mut refused, refusals) != refusals;
        let inputs = GateInputs {
            command: command.get(),
            permit: permit.get(),
            inhibit: None,
            invalid_command,
        };
        let mut output = Actuator::default();
        stage.step(woken, inputs, &mut output);
        let idle = core::mem::replace(&mut commanded, fresh) && !fresh && !inhibited;
        if !(idle && says_the_same(&output, &last)) {
            last = output;
            publish(&mut actuator, &output);
        }
        life.checkpoint(0);
        life.end();
        life.counts(command.refusals());
    }
    Ok(life.exit())
}

fn says_the_same(output: &Actuator, last: &Actuator) -> bool {
    Actuator { header: last.header, ..*output } == *last
}

fn publish(publisher: &mut Publisher<Actuator>, output: &Actuator) {
    let sent = publisher.send(|out| {
        *out = *output;
        true
    });
    if let Err(error) = sent {
        tracing::error!(%error, "actuator sample lost");
    }
}

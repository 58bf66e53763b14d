//! Whether an instance runs with real-time rights: its time-outs follow from it, so it is decided once.

use kerbside_runtime::{RealtimeRequest, enter_realtime};
use kerbside_settings::{RealtimeMode, Stack};

use crate::exit::{Exit, Failure};

/// Whether real-time scheduling is asked for and granted.
///
/// # Errors
/// [`Failure`] where the configuration demands what the rights do not grant.
pub fn wanted(stack: &Stack) -> Result<bool, Failure> {
    match stack.realtime.enabled {
        RealtimeMode::Off => Ok(false),
        RealtimeMode::Auto => {
            let granted = try_it(stack).is_empty();
            tracing::info!(granted, "real-time rights");
            Ok(granted)
        }
        RealtimeMode::On => match try_it(stack)[..] {
            [] => Ok(true),
            ref refused => Err(Failure::with_help(
                Exit::Unavailable,
                format!("realtime.enabled = \"on\": {}", refused.join("; ")),
                "grant CAP_SYS_NICE or a real-time priority limit, or set realtime.enabled = \"auto\"",
            )),
        },
    }
}

/// Tries on a thread that ends at once; what was refused.
fn try_it(stack: &Stack) -> Vec<String> {
    let request = RealtimeRequest {
        priority: Some(stack.realtime.priority),
        lock_memory: false,
        cores: Vec::new(),
    };
    std::thread::scope(|scope| scope.spawn(|| enter_realtime(&request).refused).join())
        .unwrap_or_else(|_| vec!["the attempt ended badly".to_owned()])
}

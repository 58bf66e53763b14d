//! The payloads, in the order of a sample's way.

mod control;
mod filter;
mod motion;
mod planning;
mod replay;
mod supervision;
mod vehicle;

pub use control::{Actuator, AlterReason, Command, Inhibit, Permit, TrackingPhase, TrackingStop};
pub use filter::FilterState;
pub use motion::{
    EstimatorState, FilterKind, Fix, FixVerdict, Odometry, OdometryModel, ResetReason, Restore,
    Travel, WheelStatus, WheelUse,
};
pub use planning::{
    MAX_OBSTACLES, MAX_PLAN_POINTS, MAX_VERTICES, Plan, PlanAnswer, PlanRequest, PlanVerdict,
    TrajectoryPoint,
};
pub use replay::Uptake;
pub use supervision::{
    Cause, Heartbeat, MAX_ROWS, Mode, OperatorAnswer, OperatorRequest, ProcessRow, ProcessState,
    State, Verb,
};
pub use vehicle::{Raw, Truth, WHEELS};

use crate::Refusal;

/// Declares an enum that messages carry as its checked number.
macro_rules! codes {
    ($(#[doc = $doc:literal])+ pub enum $name:ident {
        $($(#[doc = $variant_doc:literal])+ $variant:ident = $code:literal $text:literal,)+
    }) => {
        $(#[doc = $doc])+
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[repr(u8)]
        pub enum $name {
            $($(#[doc = $variant_doc])+ $variant = $code,)+
        }

        impl $crate::layout::Meaningful for $name {
            const MEANING: $crate::layout::Meaning =
                $crate::layout::Meaning::Code(&$crate::layout::Enumeration {
                    name: stringify!($name),
                    doc: concat!($($doc),+),
                    variants: &[$($crate::layout::Variant {
                        name: stringify!($variant),
                        code: $code,
                        words: $text,
                    }),+],
                });
        }

        impl $name {
            /// Every variant.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// The number that messages carry.
            #[must_use]
            pub const fn code(self) -> u8 {
                self as u8
            }

            /// The variant of that number; none for a number that no build of this version sends.
            #[must_use]
            pub const fn from_code(code: u8) -> Option<Self> {
                match code {
                    $($code => Some(Self::$variant),)+
                    _ => None,
                }
            }

            /// The words used for it everywhere.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)+
                }
            }
        }

        impl core::fmt::Display for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.pad(self.name())
            }
        }
    };
}

use codes;

/// Positions, travels and the like beyond this are not from a parking vehicle \[m\].
const FAR: f64 = 1e8;

/// Every number finite.
fn finite(field: &'static str, values: &[f64]) -> Result<(), Refusal> {
    // Without an exit in each round the compiler compares many numbers at once: a plan has some ten thousand.
    let all = |some: &[f64]| some.iter().fold(true, |all, value| all & value.is_finite());
    if values.chunks(64).all(all) { Ok(()) } else { Err(Refusal::NotFinite { field }) }
}

/// Every number finite and at most `bound` in size.
fn within(field: &'static str, values: &[f64], bound: f64) -> Result<(), Refusal> {
    finite(field, values)?;
    if values.iter().all(|value| value.abs() <= bound) {
        Ok(())
    } else {
        Err(Refusal::OutOfRange { field })
    }
}

/// A number that stands for a variant.
fn known<T>(field: &'static str, variant: Option<T>) -> Result<(), Refusal> {
    variant.map(|_| ()).ok_or(Refusal::OutOfRange { field })
}

/// A symmetric 3x3 covariance, row by row, with a diagonal that is not negative.
fn covariance(field: &'static str, values: &[f64; 9]) -> Result<(), Refusal> {
    finite(field, values)?;
    let diagonal = [values[0], values[4], values[8]];
    let asymmetry = [values[1] - values[3], values[2] - values[6], values[5] - values[7]];
    let scale = diagonal.iter().fold(0.0_f64, |sum, value| sum + value.abs());
    if diagonal.iter().any(|value| *value < 0.0)
        || asymmetry.iter().any(|value| value.abs() > 1e-9 * scale)
    {
        return Err(Refusal::OutOfRange { field });
    }
    Ok(())
}

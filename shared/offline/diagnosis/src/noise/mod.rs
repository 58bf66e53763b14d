//! The noise floor as a state-space model: white and coloured errors of the sensors, small coloured disturbances of
//! motor, slip, curvature, side velocity, rack and wheels, and what differs from run to run. Its Kalman filter whitens
//! residuals and sensitivities alike, at a cost that is linear in the data.

mod coefficients;
mod draw;
mod filter;
mod fit;
mod level;

pub(crate) use coefficients::{Coefficients, OF_SLIP, OF_WHEEL};
pub(crate) use draw::{draw, normal};
pub(crate) use filter::Whitener;
pub(crate) use fit::{Evidence, fit};
pub(crate) use level::{Level, Noise};

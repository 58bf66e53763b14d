//! The report of a diagnosis: where the gap lies, which effect causes it, how far it shrinks, how sure that is, and
//! what to drive next.

mod data;
mod far;
mod map;
mod next;
mod page;
mod place;
mod sure;
mod which;

pub use data::DiagnoseReport;

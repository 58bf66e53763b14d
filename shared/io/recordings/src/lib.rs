//! Data in and out: run folders, MCAP recordings, and how far an estimate drifts from a reference.
//!
//! - [`run_folder`]: a recorded drive as text files, read strictly and written back.
//! - [`recording`]: what a running stack recorded, as MCAP: written so that a killed recorder
//!   leaves a readable file, read, checked and recovered.
//! - [`input`]: either of the two as a stream of [`kerbside_messages::Raw`], for replay.
//! - [`drift`]: the figures a replay prints, from estimates and a reference. Pure.

pub mod drift;
pub mod input;
pub mod recording;
pub mod run_folder;

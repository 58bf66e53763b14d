//! kerbside: parks a car-like vehicle from its own wheel encoders, as real-time processes on shared memory.

// The library is the executable's own, and is there for its tests: `pub` means the house, not the world.
#![allow(unreachable_pub)]

pub mod actuation;
pub mod bench;
pub mod bindings;
pub mod calibrate;
pub mod case_folder;
pub mod children;
pub mod commands;
pub mod compare;
pub mod configuration;
pub mod diagnose;
pub mod doctor;
pub mod estimator;
pub mod exit;
pub mod fields;
pub mod figures;
pub mod gateway;
pub mod ingest;
pub mod interface;
pub mod life;
pub mod lockstep;
pub mod logging;
pub mod machine;
pub mod manoeuvre;
pub mod output;
pub mod parent;
pub mod park;
pub mod planner;
pub mod realtime;
pub mod recorder;
pub mod replay;
pub mod reproduce;
pub mod service;
pub mod simulate;
pub mod soak;
pub mod supervisor;
pub mod tables;
pub mod tools;
pub mod tracker;
pub mod trial;
pub mod vehicle;

pub use commands::{Cli, asks_for_json, run};

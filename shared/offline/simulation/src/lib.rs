//! The nominal vehicle as a simulator.

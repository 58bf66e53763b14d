//! `trial`: cases whose causes are drawn in secret, diagnosed by a process that is given the data alone, and held against
//! what was put in.

pub mod folder;

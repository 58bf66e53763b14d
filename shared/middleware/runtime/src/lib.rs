//! Ports, waiting, heartbeats: the only crate that knows iceoryx2.

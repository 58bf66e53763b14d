//! The house keeps its rules: who may know whom, how sources look, and that the pages say what the code does.

// Tests may end loudly; so may what they call.
#![allow(clippy::expect_used, clippy::panic, clippy::unwrap_used)]

#[path = "house/pages.rs"]
mod pages;
#[path = "house/rooms.rs"]
mod rooms;
#[path = "house/source.rs"]
mod source;
#[path = "house/style.rs"]
mod style;

use std::path::{Path, PathBuf};

/// The repository's root.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("services lies in the root").to_owned()
}

/// Fails with every complaint, a line each.
fn assert_none(complaints: &[String]) {
    assert!(complaints.is_empty(), "\n{}\n", complaints.join("\n"));
}

//! How keys are declared: once, with type, unit, range, default and prose.
//!
//! A [`Schema`] is the list of a file's keys. Reading and checking, error texts,
//! [`crate::explain`], the reference page and `config show` all come from it, so that none of them
//! can disagree with another.

mod kind;
mod nearest;
mod reading;
mod schema;
mod show;
mod value;

pub(crate) use kind::number;
pub use kind::{Kind, Range};
pub(crate) use nearest::nearest;
pub(crate) use reading::{Reading, SourceFile};
pub use schema::{Declaration, Presence, SectionDeclaration};
pub(crate) use schema::{Key, Schema};
pub use show::{Loaded, Origin, Setting};
pub use value::Value;
pub(crate) use value::{Field, choices};

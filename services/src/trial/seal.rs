//! Labels under seal: a commitment is known before anything is diagnosed, and opening checks against it.
//!
//! A leaf is SHA-256 of a zero byte, the salt, the case's name and the label; a node is SHA-256 of a one byte and its two
//! children; a child without a sibling goes up as it is. The root commits to every label. A label says little and could
//! be guessed: the salt, from the seed and from the operating system, hides it.

use std::fs::{self, File};
use std::io::Read;
use std::path::Path;

use sha2::{Digest, Sha256};

use crate::exit::{Exit, Failure};
use crate::output;

/// Bytes of the salt that the operating system gives.
const CHANCE: usize = 32;

/// A label under seal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sealed {
    /// The case's name.
    pub name: String,
    /// Hexadecimal.
    pub salt: String,
    /// The label, as label.toml says it.
    pub label: String,
}

impl Sealed {
    /// Seals a label.
    ///
    /// # Errors
    /// [`Failure`] where the operating system gives no random bytes.
    pub fn new(name: &str, seed: u64, label: String) -> Result<Self, Failure> {
        let mut chance = [0; CHANCE];
        File::open("/dev/urandom")
            .and_then(|mut file| file.read_exact(&mut chance))
            .map_err(Failure::internal)?;
        let salt = Sha256::new()
            .chain_update(seed.to_le_bytes())
            .chain_update(name.as_bytes())
            .chain_update(chance)
            .finalize();
        Ok(Self { name: name.to_owned(), salt: hex(&salt), label })
    }

    /// The commitment.
    #[must_use]
    pub fn leaf(&self) -> [u8; 32] {
        Sha256::new()
            .chain_update([0])
            .chain_update(self.salt.as_bytes())
            .chain_update([0])
            .chain_update(self.name.as_bytes())
            .chain_update([0])
            .chain_update(self.label.as_bytes())
            .finalize()
            .into()
    }

    /// Keeps it in `folder`, which is no part of what a diagnosis is given.
    ///
    /// # Errors
    /// [`Failure`] where it cannot be written.
    pub fn keep(&self, folder: &Path) -> Result<(), Failure> {
        let beside = folder.join(format!("{}.part", self.name));
        output::write(&beside, &format!("{}\n{}", self.salt, self.label))?;
        fs::rename(&beside, folder.join(&self.name)).map_err(Failure::internal)
    }

    /// The label of `name` that is kept in `folder`, if it is there.
    #[must_use]
    pub fn kept(folder: &Path, name: &str) -> Option<Self> {
        let text = fs::read_to_string(folder.join(name)).ok()?;
        let (salt, label) = text.split_once('\n')?;
        Some(Self { name: name.to_owned(), salt: salt.to_owned(), label: label.to_owned() })
    }
}

/// The root over all labels, in the order given.
#[must_use]
pub fn root(sealed: &[Sealed]) -> String {
    let mut level: Vec<[u8; 32]> = sealed.iter().map(Sealed::leaf).collect();
    while level.len() > 1 {
        let join = |pair: &[[u8; 32]]| match pair {
            [left, right] => Sha256::new()
                .chain_update([1])
                .chain_update(left)
                .chain_update(right)
                .finalize()
                .into(),
            single => single.first().copied().unwrap_or_default(),
        };
        level = level.chunks(2).map(join).collect();
    }
    hex(&level.first().copied().unwrap_or_default())
}

/// What is published: a line per case, then the root.
#[must_use]
pub fn commitments(sealed: &[Sealed]) -> String {
    let lines = sealed.iter().map(|one| format!("{} {}\n", hex(&one.leaf()), one.name));
    format!("{}{} root\n", lines.collect::<String>(), root(sealed))
}

/// Checks labels against what was published.
///
/// # Errors
/// [`Failure`] naming the labels that are not what was committed to.
pub fn check(sealed: &[Sealed], published: &str) -> Result<(), Failure> {
    let now = commitments(sealed);
    if now == published {
        return Ok(());
    }
    let known: Vec<&str> = published.lines().collect();
    let changed: Vec<&str> = now
        .lines()
        .filter(|line| !known.contains(line))
        .filter_map(|line| line.split(' ').nth(1))
        .collect();
    Err(Failure::with_help(
        Exit::Data,
        format!("labels are not what was committed to: {}", changed.join(", ")),
        "nothing of this trial can be trusted; begin another one",
    ))
}

/// Hexadecimal.
#[must_use]
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn three() -> Vec<Sealed> {
        let label = |kind: &str| format!("kind = \"{kind}\"\n");
        ["null", "single", "null"]
            .iter()
            .enumerate()
            .map(|(i, kind)| Sealed::new(&format!("case{i}"), 7, label(kind)).unwrap())
            .collect()
    }

    #[test]
    fn a_changed_label_is_caught_and_named() {
        let mut sealed = three();
        let published = commitments(&sealed);
        assert!(check(&sealed, &published).is_ok());
        sealed[1].label = sealed[1].label.replace("single", "pair");
        let failure = check(&sealed, &published).unwrap_err();
        let text = failure.report.to_string();
        assert!(text.contains("case1") && !text.contains("case0"), "{text}");
    }

    #[test]
    fn labels_that_change_places_are_caught() {
        let mut sealed = three();
        let published = commitments(&sealed);
        let label = sealed[0].label.clone();
        sealed[0].label = core::mem::replace(&mut sealed[1].label, label);
        assert!(check(&sealed, &published).is_err());
    }

    #[test]
    fn equal_labels_have_different_commitments_and_any_of_them_moves_the_root() {
        let sealed = three();
        assert_ne!(sealed[0].leaf(), sealed[2].leaf());
        for index in 0..3 {
            let mut other = sealed.clone();
            other[index].salt.push('0');
            assert_ne!(root(&other), root(&sealed));
        }
    }

    #[test]
    fn what_is_kept_is_read_back() {
        let folder = tempfile::tempdir().unwrap();
        for one in three() {
            one.keep(folder.path()).unwrap();
            assert_eq!(Sealed::kept(folder.path(), &one.name), Some(one));
        }
        assert_eq!(Sealed::kept(folder.path(), "case9"), None);
    }
}

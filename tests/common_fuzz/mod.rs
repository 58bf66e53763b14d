//! What fuzz targets share: damage to good input, as a fuzzer's bytes say.
//!
//! A target examines each input as it is, and once more as a script of damage to one of its examples: random bytes get
//! behind the first check that way, and a fuzzer that watches coverage may choose either.

// Each target uses its part.
#![allow(dead_code)]

use std::path::Path;

/// Bytes of one step of damage.
const STEP: usize = 6;
/// Longest input that is made of an example.
const LONGEST: usize = 1 << 20;

/// What is hard to read, in text.
const NASTY: [&str; 20] = [
    "",
    "-",
    "nan",
    "inf",
    "-inf",
    "1e308",
    "1e-320",
    "-0.0",
    "18446744073709551616",
    "-1",
    "0",
    "1.7976931348623157e309",
    "\"",
    "[",
    "]",
    "\n",
    "\r\n",
    ",",
    "=",
    "\u{feff}",
];

/// One of `examples`, damaged as `script` says; the examples are not empty.
pub(crate) fn damaged(examples: &[Vec<u8>], script: &[u8]) -> Vec<u8> {
    let (first, script) = script.split_first().unwrap_or((&0, &[]));
    let mut bytes = examples[usize::from(*first) % examples.len()].clone();
    for step in script.chunks_exact(STEP) {
        let at = usize::from(u16::from_le_bytes([step[1], step[2]]));
        let at = at * (bytes.len() + 1) / (usize::from(u16::MAX) + 1);
        harm(&mut bytes, at, step, examples);
        bytes.truncate(LONGEST);
    }
    bytes
}

fn harm(bytes: &mut Vec<u8>, at: usize, step: &[u8], examples: &[Vec<u8>]) {
    let (a, b, c) = (step[3], step[4], step[5]);
    let end = (at + usize::from(a)).min(bytes.len());
    match step[0] % 9 {
        0 => bytes.truncate(at),
        1 => drop(bytes.drain(at..end)),
        2 => {
            let again = bytes[at..end].to_vec();
            let times = usize::from(b % 8);
            bytes.splice(at..at, again.repeat(times));
        }
        3 => {
            bytes.splice(at..at, [a, b, c]);
        }
        4 => {
            let other = &examples[usize::from(a) % examples.len()];
            let from = usize::from(b) * (other.len() + 1) / 256;
            let to = (from + usize::from(c)).min(other.len());
            bytes.splice(at..at, other[from..to].iter().copied());
        }
        5 => {
            // A number, or whatever stands there up to the next separator, becomes something nasty.
            let rest = bytes[at..].iter().position(|byte| b",\n=] ".contains(byte));
            let end = rest.map_or(bytes.len(), |rest| at + rest);
            let nasty = NASTY[usize::from(a) % NASTY.len()].as_bytes();
            bytes.splice(at..end, nasty.iter().copied());
        }
        6 => {
            for byte in bytes.iter_mut().skip(at).take(usize::from(a % 9)) {
                *byte = b;
            }
        }
        _ => {
            if let Some(byte) = bytes.get_mut(at) {
                *byte ^= 1 << (a % 8);
            }
        }
    }
}

/// The files of a target's corpus, as bolero finds them: `tests/__fuzz__/TARGET/corpus` of its crate.
pub(crate) fn corpus(manifest: &str, target: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(manifest).join("tests/__fuzz__").join(target).join("corpus");
    let mut paths: Vec<_> = std::fs::read_dir(&folder)
        .unwrap_or_else(|error| panic!("{}: {error}", folder.display()))
        .map(|entry| entry.unwrap().path())
        .collect();
    paths.sort();
    paths.iter().map(|path| std::fs::read(path).unwrap()).collect()
}

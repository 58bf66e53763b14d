//! Layouts are what they were, or their version is another.
//!
//! With `KERBSIDE_WRITE_PAGES=1` in the environment `layouts.txt` is written anew, unless something that was there
//! changed under the same version.

// A test that cannot go on panics: that is how it says so.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::collections::BTreeMap;
use std::path::Path;

use kerbside_messages::LAYOUT_VERSION;
use kerbside_messages::pins::pinned;

/// The blocks of a text by their first lines.
fn blocks(text: &str) -> BTreeMap<&str, &str> {
    text.split("\n\n").filter_map(|block| Some((block.lines().next()?, block.trim_end()))).collect()
}

/// What was there and is not as it was, in words.
fn changed(was: &str, is: &str) -> Vec<String> {
    let (was, is) = (blocks(was), blocks(is));
    let altered = |(name, block): (&&str, &&str)| match is.get(name) {
        None => Some(format!("{name} is gone")),
        Some(now) if now != block => Some(format!("{name} changed:\n{block}\n  is now\n{now}")),
        Some(_) => None,
    };
    was.iter().filter(|(name, _)| !name.starts_with("layout version")).filter_map(altered).collect()
}

/// What a person has to do; none where the text is up to date.
fn verdict(was: &str, is: &str) -> Result<(), String> {
    let same_version = was.lines().next() == is.lines().next();
    let changed = changed(was, is);
    if same_version && !changed.is_empty() {
        return Err(format!(
            "layouts changed, but LAYOUT_VERSION is still {LAYOUT_VERSION}: raise it in header.rs, so that processes \
             of both builds refuse each other\n{}",
            changed.join("\n")
        ));
    }
    Ok(())
}

#[test]
fn a_changed_layout_has_a_new_version() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("layouts.txt");
    let was = std::fs::read_to_string(&path).unwrap_or_default();
    let is = pinned();
    verdict(&was, &is).unwrap_or_else(|words| panic!("{words}"));
    if std::env::var_os("KERBSIDE_WRITE_PAGES").is_some() {
        std::fs::write(&path, is).unwrap();
    } else {
        let hint = "KERBSIDE_WRITE_PAGES=1 cargo test -p kerbside-messages --test layouts";
        assert!(was == is, "layouts.txt lacks what the code has; {hint} writes it anew");
    }
}

#[test]
fn what_changed_is_named_and_what_is_new_is_no_change() {
    let is = pinned();
    let field = "\n      0  header: Header";
    assert!(is.contains(field));
    let moved = is.replacen(field, "\n      8  header: Header", 1);
    let said = verdict(&moved, &is).unwrap_err();
    assert!(
        said.contains("LAYOUT_VERSION is still") && said.contains("8  header: Header"),
        "{said}"
    );
    let gone = format!("{is}\nstruct Gone\n  size 8, aligned to 8\n");
    assert!(verdict(&gone, &is).unwrap_err().contains("struct Gone is gone"));
    assert_eq!(verdict(&is, &gone), Ok(()), "what is new disturbs nobody");
    let renamed = is.replacen("topic raw", "topic row", 1);
    assert!(verdict(&renamed, &is).unwrap_err().contains("topic row is gone"));
    let version = format!("layout version {LAYOUT_VERSION}");
    let older = moved.replacen(&version, "layout version 2", 1);
    assert_eq!(verdict(&older, &is), Ok(()), "a new version may change anything");
}

#[test]
fn every_type_name_carries_the_version() {
    let suffix = format!(".v{LAYOUT_VERSION}");
    let text = pinned();
    let names: Vec<_> = text.lines().filter_map(|line| line.strip_prefix("  type name ")).collect();
    assert!(names.len() > 15 && names.iter().all(|name| name.ends_with(&suffix)), "{names:?}");
    assert!(kerbside_messages::TrajectoryPoint::TYPE_NAME.ends_with(&suffix));
}

//! Rust sources, cut into code and comments: enough of the language for rules about words and lengths.

use std::fs;
use std::path::{Path, PathBuf};

use crate::root;

/// A source file.
pub(crate) struct Source {
    /// Path below the repository's root.
    pub(crate) path: String,
    /// The whole text.
    pub(crate) text: String,
    /// The text with comments and the contents of literals blanked out; lines stay where they are.
    pub(crate) code: String,
}

impl Source {
    fn read(path: &Path) -> Self {
        let text = fs::read_to_string(path).expect("a readable source");
        let below = path.strip_prefix(root()).expect("below the root");
        Self { path: below.display().to_string(), code: blank(&text), text }
    }

    /// Whether the file is a test or belongs to one, as a whole.
    pub(crate) fn is_test(&self) -> bool {
        let mut parts = self.path.split('/');
        parts.any(|part| matches!(part, "tests" | "tests.rs" | "benches" | "examples"))
    }

    /// The code without its test modules.
    pub(crate) fn code_of_work(&self) -> String {
        if self.is_test() {
            return String::new();
        }
        let mut code = self.code.clone();
        while let Some(at) = code.find("#[cfg(test)]") {
            let end = item_end(&code, at);
            let kept: String = code[at..end].chars().filter(|letter| *letter == '\n').collect();
            code.replace_range(at..end, &kept);
        }
        code
    }
}

/// Every source of the repository, in the order of their paths.
pub(crate) fn all() -> Vec<Source> {
    let mut paths = Vec::new();
    for folder in ["services", "shared", "tests"] {
        collect(&root().join(folder), &mut paths);
    }
    paths.sort();
    paths.iter().map(|path| Source::read(path)).collect()
}

fn collect(folder: &Path, paths: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a readable folder").flatten() {
        let path = entry.path();
        if path.is_dir() {
            collect(&path, paths);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            paths.push(path);
        }
    }
}

/// End of the item that begins at or behind `at`: its closing brace, or its semicolon.
pub(crate) fn item_end(code: &str, at: usize) -> usize {
    let mut depth = 0_usize;
    for (index, letter) in code[at..].char_indices() {
        match letter {
            '{' => depth += 1,
            '}' if depth <= 1 => return at + index + 1,
            '}' => depth -= 1,
            ';' if depth == 0 => return at + index + 1,
            _ => {}
        }
    }
    code.len()
}

/// Number of the line that the byte `at` is in, from 1.
pub(crate) fn line_of(code: &str, at: usize) -> usize {
    1 + code[..at].matches('\n').count()
}

/// Where `word` stands by itself, not within another word.
pub(crate) fn words<'a>(code: &'a str, word: &'a str) -> impl Iterator<Item = usize> + 'a {
    let is_part = |letter: char| letter.is_alphanumeric() || letter == '_';
    code.match_indices(word).map(|(at, _)| at).filter(move |at| {
        let before = code[..*at].chars().next_back();
        let behind = code[at + word.len()..].chars().next();
        !before.is_some_and(is_part) && !behind.is_some_and(is_part)
    })
}

/// Blanks comments and the contents of literals.
fn blank(text: &str) -> String {
    let mut code = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let length = literal(rest, code.chars().next_back());
        let end = length.unwrap_or(first.len_utf8());
        let (piece, behind) = rest.split_at(end);
        match length {
            // A byte for a byte, so that places in the code are places in the text.
            Some(_) => {
                code.extend(piece.bytes().map(|byte| if byte == b'\n' { '\n' } else { ' ' }))
            }
            None => code.push(first),
        }
        rest = behind;
    }
    code
}

/// Length of the comment or literal that `rest` begins with, if it begins with one.
fn literal(rest: &str, before: Option<char>) -> Option<usize> {
    let in_word = before.is_some_and(|letter| letter.is_alphanumeric() || letter == '_');
    if rest.starts_with("//") {
        return Some(rest.find('\n').unwrap_or(rest.len()));
    }
    if rest.starts_with("/*") {
        return Some(rest.find("*/").map_or(rest.len(), |end| end + 2));
    }
    if rest.starts_with('"') {
        return Some(quoted(rest, '"'));
    }
    if rest.starts_with('r') && !in_word {
        return raw(rest);
    }
    if rest.starts_with('\'') { character(rest) } else { None }
}

/// Length of a literal in `quote`s, in which a backslash takes the next letter with it.
fn quoted(rest: &str, quote: char) -> usize {
    let mut letters = rest.char_indices().skip(1);
    while let Some((at, letter)) = letters.next() {
        if letter == '\\' {
            letters.next();
        } else if letter == quote {
            return at + letter.len_utf8();
        }
    }
    rest.len()
}

fn raw(rest: &str) -> Option<usize> {
    let hashes = rest[1..].chars().take_while(|letter| *letter == '#').count();
    if !rest[1 + hashes..].starts_with('"') {
        return None;
    }
    let closing = format!("\"{}", "#".repeat(hashes));
    let begin = 2 + hashes;
    Some(rest[begin..].find(&closing).map_or(rest.len(), |end| begin + end + closing.len()))
}

/// A character; a lifetime is none.
fn character(rest: &str) -> Option<usize> {
    let mut letters = rest.chars().skip(1);
    let first = letters.next()?;
    if first == '\\' || letters.next() == Some('\'') { Some(quoted(rest, '\'')) } else { None }
}

#[test]
fn comments_and_literals_are_no_code() {
    let text = "let a = \"unsafe \\\" {\"; // unsafe\nlet b = 'x'; /* { */ r#\"}\"# 'life fn";
    let code = blank(text);
    assert_eq!(code.len(), text.len());
    assert_eq!(words(&code, "unsafe").count(), 0);
    assert!(!code.contains(['{', '}', 'x']));
    assert!(code.contains("'life fn"));
    assert_eq!(words("unsafe_code unsafe", "unsafe").collect::<Vec<_>>(), [12]);
}

#[test]
fn test_modules_are_no_work() {
    let text = "fn a() {}\n#[cfg(test)]\nmod tests { fn b() { c(); } }\nfn d() {}".to_owned();
    let source = Source { path: "a.rs".to_owned(), code: blank(&text), text };
    assert_eq!(source.code_of_work(), "fn a() {}\n\n\nfn d() {}");
}

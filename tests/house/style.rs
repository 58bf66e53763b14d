//! What sources may say, and how long they may be.

use crate::assert_none;
use crate::source::{Source, all, item_end, line_of, words};

/// Lines of a file.
const FILE: usize = 600;
/// Lines of a function.
const FUNCTION: usize = 70;

/// Crates that may hold `unsafe`; and the one test that must count what the allocator does.
const UNSAFE: [&str; 3] =
    ["shared/middleware/messages/", "shared/middleware/runtime/", "tests/allocation.rs"];

/// Folders of pure crates.
const PURE: [&str; 4] = [
    "shared/middleware/messages/",
    "shared/middleware/line/",
    "shared/onboard/",
    "shared/offline/",
];

/// The one door to transcendental functions.
const MATH: &str = "shared/onboard/geometry/src/math.rs";

/// Methods whose last bits depend on the C library.
const TRANSCENDENTAL: [&str; 22] = [
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sin_cos", "sinh", "cosh", "tanh", "exp",
    "exp2", "exp_m1", "ln", "ln_1p", "log", "log2", "log10", "powf", "cbrt", "hypot",
];

/// What a pure crate has no business with; maps in an order of chance among it.
const WORLD: [&str; 16] = [
    "std::env",
    "std::fs",
    "std::io",
    "std::net",
    "std::os",
    "std::process",
    "std::sync",
    "std::thread",
    "std::time",
    "Instant",
    "SystemTime",
    "RandomState",
    "HashMap::new",
    "HashSet::new",
    "println",
    "eprintln",
];

/// Notes to oneself, and sleeps that guess.
const NEVER: [&str; 6] =
    ["todo!", "unimplemented!", "dbg!", "thread::sleep", "time::sleep", "sleep_ms"];

/// Notes to oneself in comments.
const NOTES: [&str; 4] = ["TODO", "FIXME", "XXX", "HACK"];

fn starts_with_any(path: &str, prefixes: &[&str]) -> bool {
    prefixes.iter().any(|prefix| path.starts_with(prefix))
}

/// A complaint for each place in `code` where one of `words` stands by itself.
fn complain(source: &Source, code: &str, banned: &[&str]) -> Vec<String> {
    let place = |word: &str, at: usize| format!("{}:{}: {word}", source.path, line_of(code, at));
    banned.iter().flat_map(|word| words(code, word).map(|at| place(word, at))).collect()
}

#[test]
fn files_are_read_in_one_sitting() {
    let sources = all();
    assert!(sources.len() > 200, "{} sources: this test looks at nothing", sources.len());
    let lines = |source: &Source| source.text.lines().count();
    let long = sources.iter().filter(|source| lines(source) > FILE);
    let complaints: Vec<_> =
        long.map(|source| format!("{}: {} lines", source.path, lines(source))).collect();
    assert_none(&complaints);
}

#[test]
fn functions_fit_a_screen() {
    let of_source = |source: &Source| {
        let length = |at: usize| {
            line_of(&source.code, item_end(&source.code, at)) - line_of(&source.code, at) + 1
        };
        let long = words(&source.code, "fn").filter(|at| length(*at) > FUNCTION);
        long.map(|at| {
            let (path, line) = (&source.path, line_of(&source.code, at));
            format!("{path}:{line}: a function of {} lines", length(at))
        })
        .collect::<Vec<_>>()
    };
    assert_none(&all().iter().flat_map(of_source).collect::<Vec<_>>());
}

#[test]
fn nothing_is_left_to_do_and_nothing_sleeps() {
    let in_code = |source: &Source| complain(source, &source.code, &NEVER);
    let mut complaints: Vec<_> = all().iter().flat_map(in_code).collect();
    let others = all();
    let others = others.iter().filter(|source| !source.path.ends_with("house/style.rs"));
    complaints.extend(others.flat_map(|source| complain(source, &source.text, &NOTES)));
    assert_none(&complaints);
}

#[test]
fn unsafe_code_is_where_it_belongs_and_says_why_it_holds() {
    let mut complaints = Vec::new();
    let mut found = 0;
    for source in all() {
        let lines: Vec<_> = source.text.lines().collect();
        // What a trait's own unsafe method asks of its callers is said by the trait.
        let method = |at: &usize| source.code[*at..].starts_with("unsafe fn");
        for at in words(&source.code, "unsafe").filter(|at| !method(at)) {
            found += 1;
            let line = line_of(&source.code, at);
            if !starts_with_any(&source.path, &UNSAFE) {
                complaints.push(format!("{}:{line}: unsafe does not belong here", source.path));
            } else if !is_justified(&lines, line - 1) {
                complaints.push(format!("{}:{line}: no SAFETY comment above", source.path));
            }
        }
    }
    assert!(found > 0, "no unsafe code anywhere: this test looks at nothing");
    assert_none(&complaints);
}

/// Whether a comment with `SAFETY:` (or a doc comment with `# Safety`) stands above the statement of that line.
fn is_justified(lines: &[&str], line: usize) -> bool {
    let above = lines[..line].iter().rev().map(|line| line.trim_start());
    let mut until_statement =
        above.take_while(|line| !line.ends_with(['}', ';', '{']) || line.starts_with("//"));
    lines[line].contains("SAFETY:")
        || until_statement.any(|line| line.contains("SAFETY:") || line.contains("# Safety"))
}

#[test]
fn pure_crates_keep_from_the_world() {
    let sources = all();
    let pure = sources.iter().filter(|source| starts_with_any(&source.path, &PURE));
    let complaints: Vec<_> =
        pure.flat_map(|source| complain(source, &source.code_of_work(), &WORLD)).collect();
    assert_none(&complaints);
}

#[test]
fn bits_do_not_depend_on_a_c_library() {
    let of_source = |source: &Source| {
        let code = source.code_of_work();
        let called = |method: &&str| {
            let dotted = format!(".{method}(");
            let pathed = format!("f64::{method}");
            let dotted: Vec<_> = code.match_indices(&dotted).map(|(at, _)| at).collect();
            let pathed: Vec<_> = words(&code, &pathed).collect();
            [dotted, pathed].concat()
        };
        let place = |method: &str, at: usize| {
            format!(
                "{}:{}: .{method}() does not come through geometry::math",
                source.path,
                line_of(&code, at)
            )
        };
        TRANSCENDENTAL
            .iter()
            .flat_map(|method| called(method).into_iter().map(move |at| (method, at)))
            .map(|(method, at)| place(method, at))
            .collect::<Vec<_>>()
    };
    let sources = all();
    let pure = sources.iter().filter(|source| starts_with_any(&source.path, &PURE));
    let complaints: Vec<_> =
        pure.filter(|source| source.path != MATH).flat_map(of_source).collect();
    assert_none(&complaints);
}

//! The layouts as other languages see them: compiled, loaded, and in a stack of their own.

// The helpers of a test unwrap as its functions do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;
mod common_cli;

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use common::disturbance::end_if_stalled;
use common::{Sandbox, undisturbed};
use common_cli::{Running, Said, finish, is_documented, run, until_mode};
use kerbside_messages::pins::{enumerations, layouts, schema_hash};
use kerbside_messages::topics::{TABLE, type_name_of};
use kerbside_messages::{Fix, LAYOUT_VERSION, Plan, TrajectoryPoint, seal};

/// Whether a program is there; says that a test does without where it is not.
fn is_there(program: &str, arguments: &[&str]) -> bool {
    let status = Command::new(program)
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    let there = status.is_ok_and(|status| status.success());
    if !there {
        eprintln!("skipped: {program} {} does not work here", arguments.join(" "));
    }
    there
}

/// What the verb prints, written to a file of a fresh folder.
fn written(language: &str, name: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    let mut command = Command::new(env!("CARGO_BIN_EXE_kerbside"));
    command.args(["bindings", language, "--out"]).arg(&path);
    let said = finish(command);
    assert_eq!((said.code, said.stderr.as_str()), (Some(0), ""), "{said:?}");
    assert_eq!(said.stdout, format!("{}\n", path.display()));
    (folder, path)
}

fn compiles(compiler: &str, arguments: &[&str], file: &Path, out: Option<&Path>) {
    let mut command = Command::new(compiler);
    command.args(["-Wall", "-Wextra", "-Wpedantic", "-Werror"]).args(arguments).arg(file);
    match out {
        Some(out) => command.arg("-o").arg(out),
        None => command.arg("-fsyntax-only"),
    };
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// `WheelStatus` as the header has it: `wheel_status`.
fn snake(name: &str) -> String {
    let mut out = String::new();
    for letter in name.chars() {
        if letter.is_ascii_uppercase() && !out.is_empty() {
            out.push('_');
        }
        out.push(letter.to_ascii_lowercase());
    }
    out
}

/// A program that asserts every size, offset and number, and then verifies the messages in a file.
fn c_program() -> String {
    let mut text = String::from(
        "#include \"kerbside_messages.h\"\n#include <stdio.h>\n#include <string.h>\n#include <stdlib.h>\n",
    );
    for layout in layouts() {
        let name = snake(layout.name);
        for field in layout.fields {
            let (field, offset) = (field.name, field.offset);
            let _ = writeln!(
                text,
                "_Static_assert(offsetof(kerbside_{name}, {field}) == {offset}, \"{name}.{field}\");"
            );
        }
        let (size, alignment) = (layout.size, layout.alignment);
        let _ = writeln!(text, "_Static_assert(sizeof(kerbside_{name}) == {size}, \"{name}\");");
        let _ =
            writeln!(text, "_Static_assert(_Alignof(kerbside_{name}) == {alignment}, \"{name}\");");
    }
    for one in enumerations() {
        for variant in one.variants {
            let name = format!("KERBSIDE_{}_{}", snake(one.name), snake(variant.name));
            let name = name.to_uppercase();
            let _ = writeln!(text, "_Static_assert({name} == {}, \"{name}\");", variant.code);
        }
    }
    text.push_str("int main(int count, char **words)\n{\n    (void)count;\n");
    for topic in TABLE {
        let name = topic.name.to_uppercase();
        let (id, hash) = (topic.id, schema_hash(topic));
        let type_name = type_name_of(topic).unwrap();
        let _ = writeln!(text, "    if (KERBSIDE_TOPIC_{name} != {id}) return 10;");
        let _ = writeln!(
            text,
            "    if (strcmp(KERBSIDE_SERVICE_{name}, \"{}\")) return 11;",
            topic.name
        );
        let _ = writeln!(text, "    if (strcmp(KERBSIDE_TYPE_{name}, \"{type_name}\")) return 12;");
        let _ = writeln!(text, "    if (KERBSIDE_SCHEMA_{name} != UINT64_C({hash})) return 13;");
    }
    text.push_str(C_MAIN);
    text
}

/// Verifies a fix and a plan with its points; then that a changed bit is seen, and that sealing gives the same.
const C_MAIN: &str = r#"
    kerbside_fix fix, again;
    kerbside_plan plan;
    kerbside_trajectory_point points[3];
    FILE *file = fopen(words[1], "rb");
    if (!file || fread(&fix, sizeof fix, 1, file) != 1 || fread(&plan, sizeof plan, 1, file) != 1 ||
        fread(points, sizeof points, 1, file) != 1) return 20;
    fclose(file);
    if (!kerbside_verify(&fix, sizeof fix, NULL, 0, KERBSIDE_TOPIC_FIX, KERBSIDE_PROTECTED_FIX)) return 21;
    if (!kerbside_verify(&plan, sizeof plan, points, sizeof points, KERBSIDE_TOPIC_PLAN, 1)) return 22;
    again = fix;
    kerbside_seal(&again, sizeof again, NULL, 0, KERBSIDE_TOPIC_FIX, 1, 7, 9, 11);
    if (memcmp(&fix, &again, sizeof fix) != 0) return 23;
    points[2].y += 1.0;
    if (kerbside_verify(&plan, sizeof plan, points, sizeof points, KERBSIDE_TOPIC_PLAN, 1)) return 24;
    fix.header.version += 1;
    if (kerbside_verify(&fix, sizeof fix, NULL, 0, KERBSIDE_TOPIC_FIX, 1)) return 25;
    return 0;
}
"#;

/// Messages as this build seals them.
fn sealed() -> (Fix, Plan, [TrajectoryPoint; 3]) {
    let mut fix = Fix { x: 1.5, yaw: -0.25, ..Fix::default() };
    fix.source[..4].copy_from_slice(b"test");
    seal(&mut fix, &[], 7, 9, 11);
    let points = [TrajectoryPoint { x: 2.0, ..TrajectoryPoint::default() }; 3];
    let mut plan = Plan { id: 3, points: 3, ..Plan::default() };
    seal(&mut plan, bytemuck::cast_slice(&points), 7, 9, 11);
    (fix, plan, points)
}

fn sealed_bytes() -> Vec<u8> {
    let (fix, plan, points) = sealed();
    let parts =
        [bytemuck::bytes_of(&fix), bytemuck::bytes_of(&plan), bytemuck::cast_slice(&points)];
    parts.concat()
}

#[test]
fn a_c_compiler_agrees_about_every_offset_size_and_number() {
    if !is_there("cc", &["--version"]) {
        return;
    }
    let (folder, header) = written("c", "kerbside_messages.h");
    compiles("cc", &["-std=c99", "-x", "c"], &header, None);
    if is_there("c++", &["--version"]) {
        let unit = folder.path().join("unit.cpp");
        fs::write(&unit, "#include \"kerbside_messages.h\"\nint main() { return 0; }\n").unwrap();
        compiles("c++", &["-std=c++11", "-Wno-unused-function"], &unit, None);
    }
    let source = folder.path().join("agree.c");
    fs::write(&source, c_program()).unwrap();
    let program = folder.path().join("agree");
    compiles("cc", &["-std=c11"], &source, Some(&program));
    let messages = folder.path().join("messages");
    fs::write(&messages, sealed_bytes()).unwrap();
    let status = Command::new(&program).arg(&messages).status().unwrap();
    assert_eq!(status.code(), Some(0), "the line with this return code of the program");
}

/// Holds the module's classes against what this build says of them, line by line, and its functions against messages.
const PYTHON_MAIN: &str = r#"
import ctypes, sys
import kerbside_messages as m

for line in open(sys.argv[1]):
    kind, name, *rest = line.split()
    if kind == "layout":
        assert ctypes.sizeof(getattr(m, name)) == int(rest[0]), line
        assert ctypes.alignment(getattr(m, name)) == int(rest[1]), line
        assert len(getattr(m, name)._fields_) == int(rest[2]), line
    elif kind == "field":
        field = getattr(getattr(m, name), rest[0])
        assert (field.offset, field.size) == (int(rest[1]), int(rest[2])), line
    elif kind == "code":
        assert getattr(m, name)(int(rest[1])).name == rest[0], line
    elif kind == "topic":
        topic = m.TOPICS[name]
        assert (topic.number, topic.payload.type_name(), topic.schema) == (int(rest[0]), rest[1], int(rest[2])), line
        assert topic.protected == (rest[3] == "true") and topic.wakes == (rest[4] == "true"), line
assert m.LAYOUT_VERSION == int(sys.argv[3])
assert m.TrajectoryPoint.type_name() == sys.argv[4]

content = open(sys.argv[2], "rb").read()
fix = m.Fix.from_buffer_copy(content)
plan = m.Plan.from_buffer_copy(content, ctypes.sizeof(m.Fix))
points = content[ctypes.sizeof(m.Fix) + ctypes.sizeof(m.Plan):]
m.verify(m.TOPICS["fix"], fix)
m.verify(m.TOPICS["plan"], plan, points)
assert (fix.x, fix.yaw, m.text(fix.source)) == (1.5, -0.25, "test")
check_sum = fix.header.check_sum
m.set_text(fix.source, "test")
sent = fix.header.sent
m.seal(m.TOPICS["fix"], fix, 7, 9)
assert fix.header.sent != sent
fix.header.sent = sent
assert m.check_sum(fix) == check_sum
for change in ("check_sum", "version", "topic"):
    hurt = m.Fix.from_buffer_copy(content)
    setattr(hurt.header, change, getattr(hurt.header, change) + 1)
    try:
        m.verify(m.TOPICS["fix"], hurt)
    except ValueError:
        continue
    raise AssertionError(change)
m.set_text(fix.source, "ä" * 40)
assert m.text(fix.source) == "ä" * 16
"#;

/// What this build says of its layouts, a line each.
fn said() -> String {
    let mut text = String::new();
    for layout in layouts() {
        let (name, fields) = (layout.name, layout.fields);
        let (size, alignment, count) = (layout.size, layout.alignment, fields.len());
        let _ = writeln!(text, "layout {name} {size} {alignment} {count}");
        let ends = fields.iter().skip(1).map(|field| field.offset).chain([size]);
        for (field, end) in fields.iter().zip(ends) {
            let _ = writeln!(
                text,
                "field {name} {} {} {}",
                field.name,
                field.offset,
                end - field.offset
            );
        }
    }
    for one in enumerations() {
        for variant in one.variants {
            let name = snake(variant.name).to_uppercase();
            let _ = writeln!(text, "code {} {name} {}", one.name, variant.code);
        }
    }
    for topic in TABLE {
        let _ = writeln!(
            text,
            "topic {} {} {} {} {} {}",
            topic.name,
            topic.id,
            type_name_of(topic).unwrap(),
            schema_hash(topic),
            topic.protected,
            topic.wakes.is_some()
        );
    }
    text
}

#[test]
fn python_agrees_about_every_offset_size_and_number() {
    if !is_there("python3", &["-c", "import ctypes"]) {
        return;
    }
    let (folder, module) = written("python", "kerbside_messages.py");
    let file = |name: &str, content: &[u8]| {
        let path = folder.path().join(name);
        fs::write(&path, content).unwrap();
        path
    };
    let mut command = Command::new("python3");
    command
        .arg(file("agree.py", PYTHON_MAIN.as_bytes()))
        .arg(file("said", said().as_bytes()))
        .arg(file("messages", &sealed_bytes()))
        .args([&LAYOUT_VERSION.to_string(), TrajectoryPoint::TYPE_NAME])
        .env("PYTHONPATH", module.parent().unwrap());
    let ended = finish(command);
    assert_eq!((ended.code, ended.stderr.as_str()), (Some(0), ""));
}

#[test]
fn bindings_are_printed_and_told_as_json() {
    let sandbox = Sandbox::new();
    for (language, words) in [("c", "KERBSIDE_TOPIC_RAW 1u"), ("python", "class Odometry(")] {
        let printed = run(&sandbox, &["bindings", language]);
        assert_eq!((printed.code, printed.stderr.as_str()), (Some(0), ""));
        assert!(printed.stdout.contains(words), "{}", printed.stdout);
        let object = run(&sandbox, &["bindings", language, "--json"]).json();
        is_documented("bindings c", &object);
        assert_eq!(object["text"].as_str().unwrap(), printed.stdout);
        assert_eq!(
            (&object["language"], &object["layout_version"]),
            (&language.into(), &LAYOUT_VERSION.into())
        );
        run(&sandbox, &["bindings", language, "--out", "/proc/nothing"])
            .refuses(75, &["cannot write to /proc/nothing"]);
    }
    sandbox.assert_empty();
}

/// The Python that has the middleware's package: `KERBSIDE_PYTHON` where that is set, else `python3`.
fn python() -> Option<String> {
    let python = std::env::var("KERBSIDE_PYTHON").unwrap_or("python3".to_owned());
    let version =
        "import importlib.metadata as m, iceoryx2; assert m.version('iceoryx2') == '0.10.0'";
    is_there(&python, &["-c", version]).then_some(python)
}

#[test]
fn a_python_process_of_another_version_is_told_both_versions() {
    let Some(python) = python() else { return };
    let (folder, module) = written("python", "kerbside_messages.py");
    let instance = folder.path().join("kerbside/old");
    fs::create_dir_all(&instance).unwrap();
    let older = LAYOUT_VERSION - 1;
    let text =
        format!("# layout version {older}\n[global]\nroot-path = \"/x\"\nprefix = \"kb_\"\n");
    fs::write(instance.join("iox.toml"), text).unwrap();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy/examples/python");
    let mut command = Command::new(python);
    command
        .args([
            "-c",
            "import sys, kerbside_instance; kerbside_instance.Instance(sys.argv[1])",
            "old",
        ])
        .env("XDG_RUNTIME_DIR", folder.path())
        .env(
            "PYTHONPATH",
            std::env::join_paths([examples.as_path(), module.parent().unwrap()]).unwrap(),
        )
        .env("PYTHONDONTWRITEBYTECODE", "1");
    let said = finish(command);
    let words = format!(
        "instance old has layout version {older}, kerbside_messages.py has {LAYOUT_VERSION}\n"
    );
    assert_eq!((said.code, said.stderr), (Some(1), words));
}

/// Runs the example on a stack of its own.
fn close_the_loop(python: &str, module: &Path, arguments: &[&str]) -> Said {
    let sandbox = Sandbox::new();
    let instance = sandbox.instance();
    let name = instance.name();
    let up = ["up", "--simulate", "--start=-1.0,0.65,0", "--instance", name];
    let stack = Running::start(&sandbox, "up", &up);
    until_mode(&sandbox, "ready");
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy/examples/python");
    let mut command = sandbox.at_home(Command::new(python));
    command
        .arg(examples.join("closing_the_loop.py"))
        .args(["--instance", name])
        .args(arguments)
        .env("PYTHONPATH", module.parent().unwrap())
        .env("PYTHONDONTWRITEBYTECODE", "1");
    let said = finish(command);
    assert_eq!(run(&sandbox, &["down"]).code, Some(0));
    let log = stack.end();
    assert_eq!(log.code, Some(0), "{log:?}");
    sandbox.assert_empty();
    said
}

/// What stopped the car, in the stack's own words; nothing where nothing did.
fn cause_of(said: &str) -> &'static str {
    let rest = said.strip_prefix("stopped: ").unwrap_or_default();
    let name = rest.split_whitespace().next().unwrap_or_default().replace('_', "");
    let all = enumerations().into_iter().filter(|enumeration| enumeration.name == "Cause");
    let variants = all.flat_map(|enumeration| enumeration.variants);
    let found = variants.filter(|variant| variant.name.eq_ignore_ascii_case(&name));
    found.map(|variant| variant.words).next().unwrap_or_default()
}

#[test]
fn a_python_process_closes_the_loop_with_noisy_fixes() {
    let Some(python) = python() else { return };
    let (_folder, module) = written("python", "kerbside_messages.py");
    let error = |arguments: &[&str]| {
        let said = close_the_loop(&python, &module, arguments);
        end_if_stalled(cause_of(&said.stderr), None);
        assert_eq!((said.code, said.stderr.as_str()), (Some(0), ""), "{said:?}");
        let result: serde_json::Value = serde_json::from_str(&said.stdout).unwrap();
        println!("{arguments:?}: {result}");
        assert_eq!(result["refused"], 0, "{result}");
        let of = |key: &str| result[key]["position_m"].as_f64().unwrap();
        assert!((of("first_error") - 0.0424).abs() < 0.01, "{result}");
        assert_eq!(result["fixes"].as_u64().unwrap() == 0, arguments == ["--no-fixes"]);
        of("last_error")
    };
    undisturbed(|| {
        let (with, without) = (error(&[]), error(&["--no-fixes"]));
        assert!(without > 0.03, "nothing else corrects the estimate: {without} m");
        assert!(with < without / 2.0, "{with} m with fixes, {without} m without");
    });
}

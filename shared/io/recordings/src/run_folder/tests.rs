use std::path::Path;

use kerbside_messages::{Message, Raw};
use proptest::prelude::*;

use super::*;

fn parse<R: Row>(text: &str) -> Result<Table<R>, String> {
    let path = Path::new("case/runs/drive").join(R::FILE);
    Table::parse(&path, text.as_bytes()).map_err(|error| error.to_string())
}

fn refusal<R: Row + core::fmt::Debug>(text: &str) -> String {
    let refusal = parse::<R>(text).unwrap_err();
    let prefix = format!("case/runs/drive/{}", R::FILE);
    refusal.strip_prefix(&prefix).unwrap_or_else(|| panic!("no file in {refusal}")).to_owned()
}

#[test]
fn columns_come_in_any_order_and_number() {
    let table = parse::<CountRow>("rr,t,fl\n-5,0.5,7\n,1.25,123.0\n").unwrap();
    assert_eq!(table.columns, 0b1001);
    assert_eq!(table.rows[0], CountRow { t: 0.5, counts: [7, 0, 0, -5], mask: 0b1001 });
    assert_eq!(table.rows[1], CountRow { t: 1.25, counts: [123, 0, 0, 0], mask: 1 });
    let table = parse::<ReferenceRow>("t,x,y\n1,2,3\n2,,4\n").unwrap();
    assert_eq!(table.rows[0], ReferenceRow { t: 1.0, x: Some(2.0), y: Some(3.0), yaw: None });
    assert_eq!(table.rows[1].x, None);
}

#[test]
fn line_ends_and_byte_order_mark_do_not_matter() {
    let plain = parse::<SpeedRow>("t,fl,rl\n0,1.5,\n0.5,2,-3e-1\n").unwrap();
    for text in [
        "t,fl,rl\r\n0,1.5,\r\n0.5,2,-3e-1\r\n",
        "t,fl,rl\n0,1.5,\n0.5,2,-3e-1",
        "\u{feff}t,fl,rl\n0,1.5,\n0.5,2,-3e-1\n",
        "t,fl,rl\n\n0,1.5,\n\n0.5,\"2\",-3e-1\n\n",
    ] {
        assert_eq!(parse::<SpeedRow>(text).unwrap(), plain, "{text:?}");
    }
}

#[test]
fn further_columns_are_kept_and_written_again() {
    let text = "t,yaw_rate,ax,note\n0,1,0.25,\"left, slow\"\n1,,,\n2,3,nan,é\n";
    let table = parse::<GyroRow>(text).unwrap();
    assert_eq!(table.further[0].name, "ax");
    assert_eq!(table.further[1].field(0), "left, slow");
    assert_eq!(table.further[1].field(2), "é");
    assert_eq!(table.further[1].field(3), "");
    assert_eq!(table.to_text(), text);
}

#[test]
fn what_is_no_number_is_named_by_line_and_column() {
    assert_eq!(
        refusal::<CountRow>("t,fl,rl\n0,1,2\n1,3,4.5\n"),
        ":3: column rl: found \"4.5\"; allowed: a whole number of 64 bits, or nothing"
    );
    for found in ["nan", "inf", "-inf", "1e999", "1001", " 1", "1,", "one", "0x1f", "1.5.2"] {
        let text = format!("t,fl\r\n0,1\r\n\r\n1,\"{found}\"\r\n");
        let expected = format!(
            ":4: column fl: found {found:?}; allowed: a number from -1000 to 1000 m/s, or nothing"
        );
        assert_eq!(refusal::<SpeedRow>(&text), expected);
    }
    for text in ["\u{feff}t,fl\n0,\n1,a\n2,", "t,fl\r\n0,\r\n1,a", "t,fl\r0,\n\n1,a"] {
        let refusal = refusal::<CountRow>(text);
        assert!(refusal.starts_with(":3: column fl: found \"a\";"), "{text:?}: {refusal}");
    }
    assert_eq!(
        refusal::<SteeringRow>("t,angle\n0,3.2\n"),
        ":2: column angle: found \"3.2\"; allowed: a number from -3.141592653589793 to \
         3.141592653589793 rad, or nothing"
    );
}

#[test]
fn stamps_are_there_and_increase() {
    let allowed = "allowed: a number from -0.999 to 100000000 s";
    for found in ["", "nan", "-1", "12:30"] {
        let text = format!("t,angle\n0,0\n{found},0\n");
        let expected = format!(":3: column t: found {found:?}; {allowed}");
        assert_eq!(refusal::<SteeringRow>(&text), expected);
    }
    for (second, shown) in [("0.5", "0.5"), ("0.50", "0.5"), ("0.4", "0.4")] {
        let text = format!("yaw_rate,t\n1,0.5\n1,{second}\n");
        let expected = format!(
            ":3: t = {shown} does not follow t = 0.5 of the row before; allowed: stamps that \
             increase"
        );
        assert_eq!(refusal::<GyroRow>(&text), expected);
    }
}

#[test]
fn headers_name_what_is_needed_once() {
    assert_eq!(
        refusal::<CountRow>(""),
        ": empty; allowed: a header line naming t and fl, fr, rl, rr, then rows"
    );
    assert_eq!(refusal::<CountRow>("t,fl\n"), ": no rows after the header");
    assert_eq!(
        refusal::<CountRow>("t,FL\n0,1\n"),
        ":1: found the columns t, FL; needed: t and at least one of fl, fr, rl, rr"
    );
    assert_eq!(
        refusal::<CountRow>("time,fl\n0,1\n"),
        ":1: found the columns time, fl; needed: t and at least one of fl, fr, rl, rr"
    );
    assert_eq!(
        refusal::<CommandRow>("t,speed\n0,1\n"),
        ":1: found the columns t, speed; needed: t, speed, steering"
    );
    assert_eq!(
        refusal::<ReferenceRow>("t,x,yaw\n0,1,2\n"),
        ":1: found the columns t, x, yaw; needed: t, x, y"
    );
    assert_eq!(refusal::<GyroRow>("t,yaw_rate,t\n0,1,0\n"), ":1: column t is named twice");
    assert_eq!(
        refusal::<GyroRow>("t,yaw_rate\n0,1\n1\n"),
        ":3: found 1 fields; allowed: 2, as in the header"
    );
    assert_eq!(
        refusal::<GyroRow>("t,yaw_rate\n0,1,5\n"),
        ":2: found 3 fields; allowed: 2, as in the header"
    );
}

#[test]
fn text_is_utf8() {
    let path = Path::new("imu.csv");
    let error = Table::<GyroRow>::parse(path, b"t,yaw_rate,note\n0,1,a\n1,1,\xe9\n").unwrap_err();
    assert_eq!(error.to_string(), "imu.csv:3: not UTF-8; allowed: text in UTF-8");
}

/// A run with everything in it.
fn full_run() -> Run {
    Run {
        about: RunFile::parse(
            Path::new("run.toml"),
            "name = \"drive\"\nmanoeuvre = \"circle\"\n[start]\nx = 1\ny = -2.5\nyaw = 0.1\n"
                .into(),
        )
        .unwrap(),
        encoders: parse("t,fl,rl\n0,1,2\n0.01,3,\n0.02,5,6\n").ok(),
        wheels: None,
        steering: parse("t,angle\n0.01,0.1\n0.015,\n").ok(),
        gyro: parse("t,yaw_rate,ax\n0.005,0.5,9\n0.01,0.6,8\n").ok(),
        commands: parse("t,speed,steering\n0,0.1,-0.2\n").ok(),
        reference: parse("t,x,y,yaw\n0,1,-2.5,0.1\n").ok(),
    }
}

#[test]
fn rows_merge_by_time_and_ties_by_file() {
    let run = full_run();
    let raws: Vec<Raw> = run.raws().collect();
    assert_eq!(run.raws().len(), raws.len());
    let seen: Vec<_> = raws
        .iter()
        .map(|raw| {
            let t = (raw.header.stamp - BASE) / 1_000_000;
            (t, raw.counts_mask, raw.has_steering, raw.has_yaw_rate)
        })
        .collect();
    let expected = [
        (0, 0b101, 0, 0),
        (5, 0, 0, 1),
        (10, 0b001, 0, 0),
        (10, 0, 1, 0),
        (10, 0, 0, 1),
        (15, 0, 0, 0),
        (20, 0b101, 0, 0),
    ];
    assert_eq!(seen, expected);
    for (index, raw) in raws.iter().enumerate() {
        assert_eq!(raw.frame as usize, index + 1);
        assert_eq!((raw.boot, raw.arrival, raw.vehicle_time), (1, raw.header.stamp, raw.arrival));
        assert!(raw.validate().is_ok());
    }
    assert_eq!((raws[0].header.stamp, raws[0].counts), (1_000_000_000, [1, 0, 2, 0]));
    assert_eq!((raws[3].steering, raws[4].yaw_rate), (0.1, 0.6));
}

#[test]
fn speeds_are_streamed_where_there_are_no_counts() {
    let wheels = parse("t,rl,rr\n-0.5,1.5,2.5\n").ok();
    let mut run = Run { encoders: None, wheels, steering: None, gyro: None, ..full_run() };
    let raws: Vec<Raw> = run.raws().collect();
    assert_eq!((raws[0].speeds, raws[0].speeds_mask), ([0.0, 0.0, 1.5, 2.5], 0b1100));
    assert_eq!((raws.len(), raws[0].header.stamp), (1, 500_000_000));
    assert_eq!(run.notices(), Vec::<String>::new());
    run.encoders = full_run().encoders;
    assert!(run.raws().all(|raw| raw.speeds_mask == 0));
    assert_eq!(run.notices(), ["wheels.csv is not used: encoders.csv is there"]);
}

#[test]
fn a_run_comes_back_from_its_folder() {
    let case = tempfile::tempdir().unwrap();
    let folder = case.path().join("runs/drive");
    let run = full_run();
    run.write(&folder).unwrap();
    assert_eq!(Run::read(&folder).unwrap(), run);
    assert_eq!(run.notices(), ["imu.csv: column ax not used"]);
    assert_eq!(run.about.info.start, Some(kerbside_geometry::Pose::new(1.0, -2.5, 0.1)));
    assert_eq!(runs_of(case.path()).unwrap(), std::slice::from_ref(&folder));
    let vehicle = case.path().canonicalize().unwrap().join("vehicle.toml");
    assert_eq!(vehicle_of(&folder).unwrap(), vehicle);
    // Files of other names are nobody's business.
    std::fs::write(folder.join("motor.csv"), "rubbish").unwrap();
    assert_eq!(Run::read(&folder).unwrap(), run);
}

#[test]
fn a_made_up_name_comes_back() {
    for name in ["drive", "a \"quoted\" \\ name", "größer"] {
        let made = RunFile::new(name);
        assert_eq!(made.info.name, name);
        assert_eq!(RunFile::parse(Path::new("run.toml"), made.text.clone()).unwrap(), made);
    }
}

#[test]
fn a_run_needs_a_name_and_wheels() {
    let case = tempfile::tempdir().unwrap();
    let folder = case.path().join("runs/drive");
    let read = || {
        let error = Run::read(&folder).unwrap_err().to_string();
        error.replace(&folder.display().to_string(), "FOLDER")
    };
    assert_eq!(read(), "FOLDER: No such file or directory (os error 2)");
    full_run().write(&folder).unwrap();
    std::fs::remove_file(folder.join("encoders.csv")).unwrap();
    assert_eq!(
        read(),
        "FOLDER: neither encoders.csv nor wheels.csv is there; one of the two is required"
    );
    std::fs::write(folder.join("run.toml"), "name = \"other\"\n").unwrap();
    assert_eq!(
        read(),
        "FOLDER/run.toml: name = \"other\"; allowed: \"drive\", the name of the run's folder"
    );
    std::fs::write(folder.join("run.toml"), "name = 5\n").unwrap();
    assert!(read().contains("FOLDER/run.toml:1:8: name = 5: wrong type"), "{}", read());
    std::fs::remove_file(folder.join("run.toml")).unwrap();
    assert_eq!(read(), "FOLDER/run.toml: No such file or directory (os error 2)");
}

fn encoder_table() -> impl Strategy<Value = Table<CountRow>> {
    let row = (1_u32..100_000, any::<[i64; 4]>(), 0_u8..16);
    (prop::collection::vec(row, 1..50), 1_u8..16).prop_map(|(rows, columns)| {
        let mut t = -0.5;
        let rows = rows.into_iter().map(|(step, counts, mask)| {
            t += f64::from(step) * 1e-4;
            let mask = mask & columns;
            let read = |wheel: usize| if mask & (1 << wheel) != 0 { counts[wheel] } else { 0 };
            CountRow { t, counts: [read(0), read(1), read(2), read(3)], mask }
        });
        Table::new(rows.collect(), columns)
    })
}

proptest! {
    #[test]
    fn what_is_written_is_read_bit_for_bit(table in encoder_table()) {
        prop_assert_eq!(parse::<CountRow>(&table.to_text()).unwrap(), table);
    }

    #[test]
    fn no_text_makes_parsing_panic(text in "[-t0-9.,a-z\"\n\r]{0,80}") {
        let _ = parse::<CommandRow>(&text);
        let _ = parse::<CountRow>(&format!("t,fl\n{text}"));
    }
}

//! Writes made-up reports into a folder, to look at: `cargo run -p kerbside-reports --example
//! sample_reports DIR`.

#[path = "../tests/samples/mod.rs"]
mod samples;

use std::{env, error::Error, fs, path::PathBuf};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = env::args_os().nth(1).map_or_else(env::temp_dir, PathBuf::from);
    fs::create_dir_all(&folder)?;
    let files = [
        ("parked.html", samples::parked().render()?),
        ("broken-off.html", samples::broken_off().render()?),
        ("empty.html", samples::empty().render()?),
        ("not-numbers.html", samples::not_numbers().render()?),
        ("replayed.html", samples::replayed().render()?),
        ("refused.html", samples::refused().render()?),
        ("calibrated.html", samples::calibrated().render()?),
        ("not-calibrated.html", samples::uncalibrated().render()?),
        ("diagnosed.html", samples::diagnosed().render()?),
        ("ambiguous.html", samples::ambiguous().render()?),
        ("no-gap.html", samples::no_gap().render()?),
        ("unknown.html", samples::unknown().render()?),
        ("mistaken.html", samples::mistaken().render()?),
        ("parked.svg", samples::parked().picture()),
    ];
    for (name, text) in files {
        let path = folder.join(name);
        fs::write(&path, text)?;
        println!("{}", path.display());
    }
    Ok(())
}

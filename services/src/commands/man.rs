//! `man`: manual pages, from the same declaration as `--help`.

use std::path::{Path, PathBuf};

use clap::{Command, CommandFactory};
use clap_mangen::Man;
use serde_json::json;

use crate::exit::{Exit, Failure};
use crate::output;

/// What `man` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct ManArgs {
    /// Folder for a page per verb, `kerbside.1`, `kerbside-park.1` and so on; without it the first is printed.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// A manual page: the name of its file, and its text in roff.
struct Page {
    name: String,
    text: String,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where the folder cannot be written to.
pub fn run(args: &ManArgs) -> Result<Exit, Failure> {
    let mut command = super::Cli::command();
    command.build();
    let mut pages = Vec::new();
    collect(&command, "kerbside", &mut pages)?;
    if let Some(folder) = &args.out {
        let folder = output::folder(Some(folder), "man")?;
        pages.iter().try_for_each(|page| output::write(&folder.join(&page.name), &page.text))?;
        tell(args, &folder, &pages);
    } else if args.json {
        println!("{}", object(json!({ "page": pages[0].text })));
    } else {
        print!("{}", pages[0].text);
    }
    Ok(Exit::Good)
}

fn tell(args: &ManArgs, folder: &Path, pages: &[Page]) {
    let files: Vec<PathBuf> = pages.iter().map(|page| folder.join(&page.name)).collect();
    if args.json {
        println!("{}", object(json!({ "pages": files })));
    } else {
        println!("{} pages in {}", files.len(), folder.display());
    }
}

fn object(more: serde_json::Value) -> serde_json::Value {
    let mut object = json!({
        "schema": "kerbside.man.v1", "version": env!("CARGO_PKG_VERSION"), "seed": null, "passed": true,
        "figures": [],
    });
    if let (Some(object), serde_json::Value::Object(more)) = (object.as_object_mut(), more) {
        object.extend(more);
    }
    object
}

/// The page of `command`, which is called `name` with dashes between its words, and those of the verbs below it.
fn collect(command: &Command, name: &str, pages: &mut Vec<Page>) -> Result<(), Failure> {
    let mut roff = Vec::new();
    let source = concat!("kerbside ", env!("CARGO_PKG_VERSION"));
    let man = Man::new(command.clone()).title(name).manual("kerbside").source(source);
    man.render(&mut roff).map_err(Failure::internal)?;
    let text = String::from_utf8(roff).map_err(Failure::internal)?;
    pages.push(Page { name: format!("{name}.1"), text });
    for verb in command.get_subcommands() {
        if verb.get_name() != "help" && !verb.is_hide_set() {
            collect(verb, &format!("{name}-{}", verb.get_name()), pages)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_verb_has_a_page_with_its_options_and_an_example() {
        let mut command = super::super::Cli::command();
        command.build();
        let mut pages = Vec::new();
        collect(&command, "kerbside", &mut pages).unwrap();
        let named = |name: &str| pages.iter().find(|page| page.name == name).unwrap();
        assert!(named("kerbside.1").text.contains("kerbside\\-park(1)"));
        assert!(named("kerbside-park.1").text.contains("\\-\\-lockstep"));
        assert!(named("kerbside-recording-check.1").text.contains("recording.mcap"));
        for page in &pages {
            assert!(page.text.starts_with(".ie") || page.text.starts_with(".TH"), "{}", page.name);
            assert!(page.text.contains("Example"), "{}", page.name);
            assert!(
                !page.text.contains("\\-\\-with\\-parent"),
                "{} shows what is hidden",
                page.name
            );
        }
    }
}

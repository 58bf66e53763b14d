//! The executable; everything is in the library beside it, so that tests reach it too.

use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches};
use kerbside::Cli;

fn main() -> ExitCode {
    // Clap ends the process by itself: with code 2 on a wrong command line, 0 after --help.
    let matches = Cli::command().get_matches();
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let tell = |failure: kerbside::exit::Failure| failure.tell(kerbside::asks_for_json(&matches));
    kerbside::run(&cli).unwrap_or_else(tell).into()
}

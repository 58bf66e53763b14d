//! The executable; everything is in the library beside it, so that tests reach it too.

use std::process::ExitCode;

use clap::Parser;
use kerbside::exit::{Exit, Failure};

fn main() -> ExitCode {
    // Clap ends the process by itself: with code 2 on a wrong command line, 0 after --help.
    let cli = kerbside::Cli::parse();
    kerbside::run(&cli).unwrap_or_else(|failure| tell(&failure)).into()
}

fn tell(failure: &Failure) -> Exit {
    eprintln!("{:?}", failure.report);
    failure.exit
}

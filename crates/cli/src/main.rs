//! The program `moonmilk`: see the README and `moonmilk --help`.

mod args;
mod budget;
mod diff;
mod display;
mod failure;
mod job;
mod merge;
mod output;
mod progress;
mod render;
mod showcase;

use std::process::ExitCode;

use clap::Parser;
use tracing_subscriber::filter::LevelFilter;

use args::{Cli, Command, LogFormat};
use failure::Failure;

fn main() -> ExitCode {
    let cli = Cli::parse();
    start_logging(&cli);
    let result = match &cli.command {
        None => showcase::run(cli.quiet),
        Some(Command::Render(a)) => render::run(a, cli.quiet),
        Some(Command::Diff(a)) => diff::run(a),
        Some(Command::Merge(a)) => merge::run(a),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            failure.report(cli.log_format);
            failure.exit_code()
        }
    }
}

/// Sends messages to standard error, as lines or JSON; `NO_COLOR` is honoured.
fn start_logging(cli: &Cli) {
    let level = if cli.quiet { LevelFilter::ERROR } else { LevelFilter::INFO };
    let builder = tracing_subscriber::fmt().with_writer(std::io::stderr).with_max_level(level).with_target(false);
    match cli.log_format {
        LogFormat::Json => builder.json().init(),
        LogFormat::Text => {
            let color = std::env::var_os("NO_COLOR").is_none() && std::io::IsTerminal::is_terminal(&std::io::stderr());
            builder.without_time().with_ansi(color).init();
        }
    }
}

/// Kinds of failure, one per exit code.
pub(crate) type Outcome = Result<(), Failure>;

//! The program `moonmilk`: see the README and `moonmilk --help`.

mod args;
mod audit;
mod budget;
mod check;
mod compare;
mod diff;
mod display;
mod failure;
mod job;
mod lab_args;
mod material;
mod merge;
mod models;
mod output;
mod profile;
mod progress;
mod render;
mod replay;
mod report;
mod settings;
mod showcase;
mod simulate;
mod usage;
mod validate;
mod values;

use std::process::ExitCode;

use tracing_subscriber::filter::LevelFilter;

use args::{Command, LogFormat};
use failure::Failure;

fn main() -> ExitCode {
    let cli = match usage::parse() {
        Ok(cli) => cli,
        Err(code) => return code,
    };
    start_logging(cli.log_format, cli.quiet);
    // A bar amid JSON lines would spoil them.
    let bar = !cli.quiet && cli.log_format == LogFormat::Text;
    let result = match &cli.command {
        None => showcase::run(bar),
        Some(Command::Render(a)) => render::run(a, bar),
        Some(Command::Compare(a)) => compare::run(a, bar),
        Some(Command::Diff(a)) => diff::run(a),
        Some(Command::Merge(a)) => merge::run(a),
        Some(Command::Models(a)) => models::run(a),
        Some(Command::Material(a)) => material::run(a),
        Some(Command::Check(a)) => check::run(a, cli.log_format),
        Some(Command::Profile(a)) => profile::run(a),
        Some(Command::Simulate(a)) => simulate::run_command(a),
        Some(Command::Validate(a)) => validate::run(a),
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
fn start_logging(format: LogFormat, quiet: bool) {
    let level = if quiet { LevelFilter::ERROR } else { LevelFilter::INFO };
    let builder = tracing_subscriber::fmt().with_writer(std::io::stderr).with_max_level(level).with_target(false);
    match format {
        LogFormat::Json => builder.json().init(),
        LogFormat::Text => {
            let color = std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty())
                && std::io::IsTerminal::is_terminal(&std::io::stderr());
            builder.without_time().with_ansi(color).init();
        }
    }
}

/// Kinds of failure, one per exit code.
pub(crate) type Outcome = Result<(), Failure>;

//! What can go wrong, and the exit code it means.

use std::process::ExitCode;

use crate::args::LogFormat;

/// A failure of the program.
#[derive(Debug)]
pub enum Failure {
    /// Something failed at run time (exit code 1).
    Run(String),
    /// Arguments that do not fit together (2).
    Usage(String),
    /// The scene or another input is wrong (3).
    Input(String),
    /// An input is wrong, with the place shown (3).
    Report(miette::Report),
    /// A check found a difference (4).
    Check(String),
    /// Interrupted, the checkpoint is written (130).
    Interrupted(String),
}

impl Failure {
    /// Prints the failure on standard error.
    pub fn report(&self, format: LogFormat) {
        let text = match self {
            Self::Run(s) | Self::Usage(s) | Self::Input(s) | Self::Check(s) | Self::Interrupted(s) => s.clone(),
            Self::Report(r) if format == LogFormat::Json => r.to_string(),
            Self::Report(r) => {
                eprintln!("{r:?}");
                return;
            }
        };
        match format {
            LogFormat::Json => tracing::error!("{text}"),
            LogFormat::Text => eprintln!("moonmilk: {text}"),
        }
    }

    /// Returns the program's exit code.
    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(match self {
            Self::Run(_) => 1,
            Self::Usage(_) => 2,
            Self::Input(_) | Self::Report(_) => 3,
            Self::Check(_) => 4,
            Self::Interrupted(_) => 130,
        })
    }
}

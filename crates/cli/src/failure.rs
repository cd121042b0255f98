//! What can go wrong, and the exit code it means.

use std::process::ExitCode;

use moonmilk_io::pbrt::LoadError;

use crate::args::LogFormat;

/// Largest number of problems of a scene that are shown.
const SHOWN: usize = 20;

/// A failure of the program.
#[derive(Debug)]
pub enum Failure {
    /// Something failed at run time (exit code 1).
    Run(String),
    /// Arguments that do not fit together (2).
    Usage(String),
    /// The scene or another input is wrong (3).
    Input(String),
    /// A scene file is wrong, with the places shown (3).
    Scene(LoadError),
    /// A check found a difference (4).
    Check(String),
    /// Interrupted, the checkpoint is written (130).
    Interrupted(String),
}

impl Failure {
    /// Prints the failure on standard error.
    pub fn report(&self, format: LogFormat) {
        match (self, format) {
            (Self::Scene(e), LogFormat::Json) => {
                for p in e.problems() {
                    let place = p.place.as_ref().map(ToString::to_string);
                    tracing::error!(place, help = p.help, "{}", p.message);
                }
            }
            (Self::Scene(e), LogFormat::Text) => {
                for p in e.problems().iter().take(SHOWN) {
                    eprintln!("{:?}", miette::Report::new(p.clone()));
                }
                if e.problems().len() > SHOWN {
                    eprintln!("moonmilk: and {} more problems", e.problems().len() - SHOWN);
                }
            }
            (
                Self::Run(s) | Self::Usage(s) | Self::Input(s) | Self::Check(s) | Self::Interrupted(s),
                LogFormat::Json,
            ) => tracing::error!("{s}"),
            (
                Self::Run(s) | Self::Usage(s) | Self::Input(s) | Self::Check(s) | Self::Interrupted(s),
                LogFormat::Text,
            ) => eprintln!("moonmilk: {s}"),
        }
    }

    /// Returns the program's exit code.
    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(match self {
            Self::Run(_) => 1,
            Self::Usage(_) => 2,
            Self::Input(_) | Self::Scene(_) => 3,
            Self::Check(_) => 4,
            Self::Interrupted(_) => 130,
        })
    }
}

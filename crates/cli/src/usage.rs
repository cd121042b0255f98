//! Reading the command line, and help for those who mistype it.

use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{CommandFactory, Parser};

use crate::args::{Cli, LogFormat};
use crate::start_logging;

/// Commands of the design that are not in this version.
const PLANNED: &[&str] = &["solve", "fit"];

/// Returns the command line, or the exit code after help, version or an error was printed.
pub fn parse() -> Result<Cli, ExitCode> {
    let arguments: Vec<OsString> = std::env::args_os().collect();
    Cli::try_parse_from(&arguments).map_err(|e| {
        if matches!(e.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) {
            // A reader that has seen enough closes the pipe; that is no failure.
            let _ = e.print();
            return ExitCode::SUCCESS;
        }
        let words: Vec<String> = arguments[1..].iter().map(|a| a.to_string_lossy().into_owned()).collect();
        let advice = advice(&words);
        if wants_json(&words) {
            start_logging(LogFormat::Json, false);
            tracing::error!("{}", advice.unwrap_or_else(|| e.render().to_string().trim_end().to_owned()));
        } else if let Some(text) = advice {
            eprintln!("moonmilk: {text}");
        } else {
            let _ = e.print();
        }
        ExitCode::from(2)
    })
}

/// Returns whether JSON was asked for, in a command line that cannot be read as a whole.
fn wants_json(words: &[String]) -> bool {
    words.iter().any(|w| w == "--log-format=json") || words.windows(2).any(|w| w[0] == "--log-format" && w[1] == "json")
}

/// Returns a better sentence than the parser's for what newcomers try: a scene without a command, a command to come.
fn advice(words: &[String]) -> Option<String> {
    let known = |w: &String| Cli::command().get_subcommands().any(|c| c.get_name() == w) || w == "help";
    if words.iter().any(known) {
        return None;
    }
    if let Some(scene) = words.iter().find(|w| looks_like_a_scene(w)) {
        let quoted: Vec<String> =
            words.iter().map(|w| if w.contains([' ', '\'', '"']) { format!("{w:?}") } else { w.clone() }).collect();
        return Some(format!(
            "\"{scene}\" is a scene and not a command; to render it:\n\n    moonmilk render {}\n",
            quoted.join(" ")
        ));
    }
    let planned = words.iter().find(|w| PLANNED.contains(&w.as_str()))?;
    let available: Vec<String> = Cli::command().get_subcommands().map(|c| c.get_name().to_owned()).collect();
    Some(format!("`{planned}` is planned but not in this version; available: {}", available.join(", ")))
}

fn looks_like_a_scene(word: &str) -> bool {
    let path = Path::new(word);
    let by_name = [".pbrt", ".pbrt.gz"].iter().any(|e| word.to_ascii_lowercase().ends_with(e));
    !word.starts_with('-') && (by_name || path.is_file())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(s: &str) -> Vec<String> {
        s.split(' ').map(Into::into).collect()
    }

    #[test]
    fn scenes_without_a_command_are_told_how_to_be_rendered() {
        let text = advice(&words("--spp 4 ball.pbrt -o x.exr")).expect("advice");
        assert!(text.contains("moonmilk render --spp 4 ball.pbrt -o x.exr"), "{text}");
        assert!(advice(&words("solve heat.toml")).is_some_and(|t| t.contains("planned")));
        assert!(advice(&words("render ball.pbrt --spp x")).is_none() && advice(&words("rendr")).is_none());
    }
}

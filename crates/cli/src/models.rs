//! `models`: what models of subsurface scattering there are.

use std::io::{self, Write};

use moonmilk_optics::profile::{self, Info, Kind, MODELS};
use moonmilk_render::walks::{self, WALKS};

use crate::Outcome;
use crate::args::Models;
use crate::failure::Failure;

/// Prints the list, or one model.
pub fn run(a: &Models) -> Outcome {
    let text = match &a.name {
        None => list(),
        Some(name) => match walks::find(name) {
            Some(walk) => one(&walk.info),
            None => one(profile::find(name).map_err(|e| Failure::Usage(e.to_string()))?.info),
        },
    };
    // A reader that has seen enough closes the pipe; that is no failure.
    let _ = io::stdout().write_all(text.as_bytes());
    Ok(())
}

fn list() -> String {
    let mut text = String::new();
    let mut table = |title: &str, infos: &mut dyn Iterator<Item = &Info>| {
        text += &format!("{title:<24} {:<16} {}\n", "source", "what it is; where it is valid");
        for i in infos {
            text += &format!("{:<24} {:<16} {}\n{:<42}{}\n", i.name, i.source, i.summary, "", i.valid);
        }
    };
    table("walk", &mut WALKS.iter().map(|w| &w.info));
    table("\nmodel", &mut MODELS.iter().map(|m| m.info));
    text + "\n`moonmilk models NAME` says when to use one and when not; sources are keys of references.bib.\n"
}

fn one(i: &Info) -> String {
    let kind = match i.kind {
        Kind::Whole => "all reflected light",
        Kind::Part => "a part of the reflected light",
    };
    let rows = [
        ("what", i.summary),
        ("gives", kind),
        ("source", i.source),
        ("valid", i.valid),
        ("use", i.use_when),
        ("avoid", i.avoid_when),
    ];
    rows.iter().fold(format!("{}\n", i.name), |text, (k, v)| text + &format!("  {k:<8}{v}\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_model_is_listed_with_its_source() {
        let text = list();
        assert!(MODELS.iter().all(|m| text.contains(m.info.name) && text.contains(m.info.source)));
        assert!(WALKS.iter().all(|w| text.contains(w.info.name) && text.contains(w.info.source)));
        assert!(one(profile::find("dipole").expect("registered").info).contains("Jensen2001"));
    }
}

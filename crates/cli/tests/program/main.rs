//! The program as its users meet it: processes, files, signals, exit codes.
//!
//! Scenes are small texts written to temporary folders. `MOONMILK_SLOW=1` repeats what is random more often.
#![cfg(unix)]

mod common;

mod bodies;
mod budgets;
mod check;
mod compare;
mod display;
mod errors;
mod exactness;
mod honesty;
mod interruptions;
mod layers;
mod lecture;
mod profile;
mod simulate;
mod usage;

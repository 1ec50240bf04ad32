//! The machine and the build that the figures come from, as far as they are known.

use std::fs;
use std::process::Command;

/// Information about the machine for readers of the timings.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Machine {
    pub cpu: String,
    /// Number of hardware threads.
    pub threads: usize,
    pub system: String,
    /// The compiler that `make paper` used; otherwise what `rustc --version` reports now, which may differ.
    pub rustc: String,
    pub is_optimised: bool,
}

const UNKNOWN: &str = "n/a";

impl Machine {
    /// Queries this machine.
    pub fn here() -> Self {
        Self {
            cpu: cpu().unwrap_or_else(|| UNKNOWN.into()),
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            rustc: rustc().unwrap_or_else(|| UNKNOWN.into()),
            is_optimised: !cfg!(debug_assertions),
        }
    }
}

fn cpu() -> Option<String> {
    let info = fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = info.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().into())
}

fn rustc() -> Option<String> {
    if let Some(known) = option_env!("RUSTC_VERSION") {
        return Some(known.into());
    }
    let output =
        Command::new("rustc").arg("--version").output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().into())
}

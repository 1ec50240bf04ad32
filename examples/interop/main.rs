//! Surfaces from CUDA to Vulkan, through the host and without it: 512 fields are meshed on the card, and drawn to a
//! texture by plain wgpu out of three kinds of buffers, in turns. The pictures have to be the processor's, pixel by pixel.
//!
//! `cargo run --release --no-default-features --features interop --example interop [-- --help]`

#[cfg(target_os = "linux")]
mod painter;
#[cfg(target_os = "linux")]
mod roads;
#[cfg(target_os = "linux")]
mod scene;
#[cfg(target_os = "linux")]
#[path = "../../benches/edits/statistics.rs"]
#[allow(dead_code)]
mod statistics;

/// Times surfaces on their way from CUDA to Vulkan.
#[cfg(target_os = "linux")]
#[derive(clap::Parser)]
struct Arguments {
    /// Rounds that are timed; medians are printed.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u16).range(1..=1000))]
    rounds: u16,
    /// Where the picture goes; its folder is made.
    #[arg(long, value_name = "FILE", default_value = "out/interop.png")]
    picture: std::path::PathBuf,
    /// Draw the processor's surfaces only; needs no CUDA.
    #[arg(long)]
    reference: bool,
}

#[cfg(target_os = "linux")]
fn main() -> std::process::ExitCode {
    match roads::run(&clap::Parser::parse()) {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            std::process::ExitCode::FAILURE
        }
    }
}

#[cfg(not(target_os = "linux"))]
fn main() {
    eprintln!("memory is shared between CUDA and Vulkan on Linux only");
}

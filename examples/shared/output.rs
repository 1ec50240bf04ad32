//! Lines on standard output and standard error. Shared by examples, which include this file by path.

use std::fmt::Arguments;
use std::io::{self, ErrorKind, Write};
use std::process;

/// Writes a line. If the pipe is closed, as by `| head`, the program exits silently.
pub fn say(line: Arguments<'_>) {
    match writeln!(io::stdout(), "{line}") {
        Ok(()) => {}
        Err(error) if error.kind() == ErrorKind::BrokenPipe => process::exit(0),
        Err(error) => {
            complain(format_args!("standard output: {error}"));
            process::exit(1);
        }
    }
}

/// Writes a line on standard error; errors are ignored.
pub fn complain(line: Arguments<'_>) {
    let _ = writeln!(io::stderr(), "{line}");
}

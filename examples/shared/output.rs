//! Lines on standard output for whoever reads them. Examples write them in common; each takes this in by its path.

use std::fmt::Arguments;
use std::io::{self, ErrorKind, Write};
use std::process;

/// Writes a line. Where nobody reads any more, as behind `| head`, the program ends without a word.
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

/// Writes a line on standard error, if anybody reads that.
pub fn complain(line: Arguments<'_>) {
    let _ = writeln!(io::stderr(), "{line}");
}

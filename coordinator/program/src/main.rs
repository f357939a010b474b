//! The `murmuration` binary: the whole command line.

use std::process::ExitCode;

fn main() -> ExitCode {
    murmuration_program::main()
}

//! The `murmuration` binary: coordinator and command line.

use std::process::ExitCode;

fn main() -> ExitCode {
    murmuration_coordinator::cli::main()
}

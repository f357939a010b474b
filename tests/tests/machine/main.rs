//! Tests that need more than this repository: a browser, Python packages, permission to mount a file system. If the machine lacks
//! a requirement of a test, the test is ignored, and a line gives the reason.

mod browser;
mod data_directory;
mod outputs;
mod python;

use std::process::ExitCode;

fn main() -> ExitCode {
    let tests = [
        browser::tests(),
        data_directory::tests(),
        outputs::tests(),
        python::tests(),
    ];
    murmuration_tests::run(tests.into_iter().flatten().collect())
}

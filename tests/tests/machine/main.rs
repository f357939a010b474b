//! What needs more of the machine than this repository: a browser, Python packages, the right to mount a file system. Where
//! the machine lacks what a test needs, the test is ignored, and a line says why.

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

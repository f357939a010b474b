//! Tests that the command line works as the documents show. Every command of the README, of the pages in docs/ and of the help's
//! examples runs; `transcripts` checks the output of commands, word for word.
//!
//! Each page runs as a script in a folder of its own (`script.rs`).

mod documents;
mod examples;
mod script;
mod transcripts;

use murmuration_tests::{run, test};
use std::process::ExitCode;

fn main() -> ExitCode {
    let mut tests = vec![
        test!(examples::prose_flows_to_the_width_of_the_terminal),
        test!(examples::what_every_command_has_stands_after_its_own_options),
        test!(examples::every_example_is_of_a_group),
        test!(documents::of_the_readme),
        test!(documents::of_the_page_on_a_first_campaign),
        test!(documents::of_the_page_on_labelling),
        test!(documents::of_the_page_on_clusters),
        test!(documents::of_the_page_on_commands),
        test!(documents::of_the_page_on_operations),
        test!(documents::of_the_page_on_security),
        test!(documents::of_the_page_on_the_data_directory),
        test!(documents::of_the_page_on_exports),
        test!(documents::of_the_page_on_results),
        test!(documents::of_the_page_on_performance),
        test!(transcripts::of_one_campaign),
        test!(transcripts::of_refusals),
        test!(transcripts::of_a_coordinator_that_stays),
        test!(transcripts::of_help),
        test!(transcripts::of_schemas),
        test!(transcripts::every_command_and_every_kind_of_document_has_one),
    ];
    tests.extend(documents::of_other_pages());
    tests.extend(examples::tests());
    run(tests)
}

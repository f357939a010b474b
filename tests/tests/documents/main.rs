//! The README and the pages of docs/: their commands run, their links resolve, and their lists are complete.

mod arrows;
mod commands;
mod features;
mod fields;
mod help;
mod map;
mod options;
mod pages;
mod references;
mod robots;
mod script;

use murmuration_tests::{run_one_by_one, test};
use std::process::ExitCode;

fn main() -> ExitCode {
    // One after the other: the commands use what cores there are.
    run_one_by_one(vec![
        test!(arrows::rings_are_found),
        test!(arrows::no_crate_knows_one_of_its_floor_or_above),
        test!(arrows::no_modules_know_each_other_in_a_ring),
        test!(arrows::no_file_is_longer_than_450_lines),
        test!(map::every_crate_is_on_the_map_with_its_floor_and_its_public_modules),
        test!(features::programs_and_tests_are_built_with_the_same),
        test!(options::what_starts_a_service_is_an_environment_variable_too),
        test!(references::links_and_paths_lead_somewhere),
        test!(references::commands_that_are_mentioned_exist),
        test!(pages::every_block_says_what_it_is),
        test!(fields::every_field_of_a_campaign_file_is_in_a_table),
        test!(robots::every_drawing_is_of_the_description_above_it),
        test!(help::prose_flows_to_the_width_of_the_terminal),
        test!(help::what_every_command_has_stands_after_its_own_options),
        test!(help::every_example_works),
        test!(commands::of_the_readme),
        test!(commands::of_the_page_on_a_first_campaign),
        test!(commands::of_the_page_on_labelling),
        test!(commands::of_the_page_on_clusters),
        test!(commands::of_the_page_on_commands),
        test!(commands::of_the_page_on_operations),
        test!(commands::of_the_page_on_security),
        test!(commands::of_the_page_on_the_data_directory),
        test!(commands::of_the_page_on_exports),
        test!(commands::of_the_page_on_results),
        test!(commands::of_the_page_on_performance),
        test!(commands::of_every_other_page),
    ])
}

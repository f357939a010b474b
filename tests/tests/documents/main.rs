//! Checks the README and the pages of docs/: links must resolve, and lists must be complete. The tests in `command_line` run the
//! commands of these pages.

mod arrows;
mod fields;
mod map;
mod options;
mod references;
mod robots;

use murmuration_tests::{run, test};
use std::process::ExitCode;

fn main() -> ExitCode {
    run(vec![
        test!(arrows::rings_are_found),
        test!(arrows::no_crate_knows_one_of_its_floor_or_above),
        test!(arrows::no_modules_know_each_other_in_a_ring),
        test!(map::every_crate_is_on_the_map_with_its_floor_and_its_public_modules),
        test!(options::what_starts_a_service_is_an_environment_variable_too),
        test!(options::the_page_on_security_has_the_seats_of_each_class),
        test!(references::links_and_paths_lead_somewhere),
        test!(references::commands_that_are_mentioned_exist),
        test!(references::every_block_says_what_it_is),
        test!(references::the_certificate_has_the_name_by_which_keda_calls),
        test!(fields::every_field_of_a_campaign_file_is_in_a_table),
        test!(robots::every_drawing_is_of_the_description_above_it),
    ])
}

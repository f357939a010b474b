//! The pages in a real browser: what people do with keys and pointer, and what they see.
//!
//! Needs Chromium and its driver (`scripts/browser` installs them); without them the tests are ignored.
//! Screenshots of every page land in `target/screenshots`, for people to look at.

mod driver;
mod keys;
mod labelling;
mod learning;
mod leaving;
mod looks;
mod playing;
mod printing;
mod report;
mod scene;
mod scriptless;
mod selecting;

use murmuration_tests::{Requirement, Test, test};

/// Every test of the pages.
pub fn tests() -> Vec<Test> {
    let tests = [
        test!(async keys::answers_are_given_from_any_menu_and_box_and_these_keep_their_own_keys),
        test!(async keys::a_class_keeps_its_key_when_another_goes),
        test!(async keys::an_arrow_on_the_sheet_moves_the_motion_or_goes_to_another_cluster_never_both),
        test!(async labelling::thirty_are_labelled_two_undone_and_a_refresh_loses_nothing),
        test!(async labelling::two_who_label_at_once_are_never_asked_the_same),
        test!(async labelling::a_killed_coordinator_loses_no_answer),
        test!(async labelling::a_window_without_its_coordinator_says_so_where_it_is_seen),
        test!(async labelling::who_goes_on_after_the_goal_is_told_so),
        test!(async labelling::who_begins_sees_what_others_answered_as_theirs_and_no_empty_frames_before),
        test!(async labelling::a_name_that_was_typed_wrongly_is_exchanged_with_a_button),
        test!(async learning::what_was_said_is_learned_and_the_map_changes),
        test!(async learning::where_there_is_nothing_to_learn_from_the_page_says_so),
        test!(async leaving::who_logs_in_labels_and_who_logs_out_is_out),
        test!(async looks::every_page_is_readable_wide_and_narrow_light_and_dark),
        test!(async looks::a_word_of_a_class_is_not_broken),
        test!(async looks::long_names_many_classes_and_large_type_stay_within_the_page),
        test!(async playing::a_controller_is_changed_and_its_address_shows_the_same_again),
        test!(async playing::a_swarm_goes_on_pauses_and_grows),
        test!(async playing::a_robot_is_described_and_what_is_wrong_with_it_is_said),
        test!(async playing::what_a_swarm_is_like_is_shown_with_ways_to_see_it),
        test!(async playing::a_search_begins_with_the_controller_that_was_played_with),
        test!(async playing::where_nothing_can_be_compared_the_page_says_so),
        test!(async playing::the_page_fits_every_screen_and_rests_where_motion_is_not_wanted),
        test!(async printing::pins_stay_with_their_medoids_when_the_report_is_laid_out_for_paper),
        test!(async report::a_card_plays_pauses_and_rests_by_keyboard_in_a_file),
        test!(async report::a_pointer_on_the_map_tells_what_is_there),
        test!(async scriptless::a_page_without_scripts_says_what_it_needs_and_shows_what_it_has),
        test!(async selecting::ten_are_lassoed_on_the_map_and_named),
        test!(async selecting::a_cluster_is_named_but_for_those_that_differ),
        test!(async selecting::clusters_are_looked_at_while_the_archive_grows),
        test!(async selecting::medoids_are_named_and_the_report_is_taken_away),
    ];
    tests.map(|test| test.needs(Requirement::Chromium)).into()
}

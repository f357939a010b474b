//! Tests the pages in a real browser: keys, the pointer, and the resulting display.
//!
//! The tests need Chromium and its driver, which `scripts/browser` installs; on a machine without them, the tests are ignored.
//! The tests store screenshots of every page in `target/screenshots`.

mod axe;
mod driver;
mod exploring;
mod first_hour;
mod keys;
mod labelling;
mod learning;
mod leaving;
mod looks;
mod playing;
mod points;
mod printing;
mod report;
mod reviewing;
mod robots;
mod scene;
mod scriptless;
mod selecting;
mod starting;
mod steering;
mod studies;
mod taxonomy;

use murmuration_tests::{Requirement, Test, test};

/// Every test of the pages.
pub fn tests() -> Vec<Test> {
    let tests = [
        test!(async first_hour::at_a_wide_screen),
        test!(async first_hour::at_a_phone),
        test!(async first_hour::at_200_percent),
        test!(async first_hour::in_the_dark),
        test!(async keys::answers_are_given_from_any_menu_and_box_and_these_keep_their_own_keys),
        test!(async keys::a_class_keeps_its_key_when_another_goes),
        test!(async keys::an_arrow_on_the_sheet_moves_the_motion_or_goes_to_another_cluster_never_both),
        test!(async keys::keys_of_actions_are_chosen_and_a_clash_is_said),
        test!(async labelling::thirty_are_labelled_two_undone_and_a_refresh_loses_nothing),
        test!(async labelling::two_who_label_at_once_are_never_asked_the_same),
        test!(async labelling::a_killed_coordinator_loses_no_answer),
        test!(async labelling::a_window_without_its_coordinator_says_so_where_it_is_seen),
        test!(async labelling::an_answer_whose_reply_is_cut_off_is_sent_again),
        test!(async labelling::who_goes_on_after_the_goal_is_told_so),
        test!(async labelling::who_begins_sees_what_others_answered_as_theirs_and_no_empty_frames_before),
        test!(async labelling::a_motion_in_an_oblong_world_moves_nothing_when_it_arrives),
        test!(async labelling::a_name_that_is_given_on_another_page_holds_here),
        test!(async labelling::a_name_that_was_typed_wrongly_is_exchanged_with_a_button),
        test!(async learning::what_was_said_is_learned_and_the_map_changes),
        test!(async learning::where_there_is_nothing_to_learn_from_the_page_says_so),
        test!(async leaving::who_logs_in_labels_and_who_logs_out_is_out),
        test!(async leaving::a_page_that_was_left_listens_no_more_until_one_goes_back_to_it),
        test!(async looks::every_page_is_readable_wide_and_narrow_light_and_dark),
        test!(async looks::a_word_of_a_class_is_not_broken),
        test!(async looks::long_names_many_classes_and_large_type_stay_within_the_page),
        test!(async playing::a_controller_is_changed_and_its_address_shows_the_same_again),
        test!(async playing::a_swarm_goes_on_pauses_and_grows),
        test!(async playing::a_motion_is_scrubbed_without_requests_and_goes_on_from_there),
        test!(async playing::features_and_names_over_time_lead_to_moments_that_are_marked),
        test!(async playing::controllers_around_one_are_drawn_named_and_led_to),
        test!(async playing::a_robot_is_described_and_what_is_wrong_with_it_is_said),
        test!(async playing::what_a_swarm_is_like_is_shown_with_ways_to_see_it),
        test!(async playing::a_search_begins_with_the_controller_that_was_played_with),
        test!(async playing::a_search_and_a_sweep_take_the_robot_as_it_was_edited),
        test!(async playing::where_nothing_can_be_compared_the_page_says_so),
        test!(async playing::the_page_fits_every_screen_and_rests_where_motion_is_not_wanted),
        test!(async points::a_card_draws_the_points_as_the_script_does),
        test!(async printing::pins_stay_with_their_medoids_when_the_report_is_laid_out_for_paper),
        test!(async report::a_card_plays_pauses_and_rests_by_keyboard_in_a_file),
        test!(async report::a_pointer_on_the_map_tells_what_is_there),
        test!(async report::plots_tell_their_values_at_a_pointer_and_by_keys),
        test!(async reviewing::the_papers_classes_are_offered_and_keys_can_be_chosen),
        test!(async reviewing::every_page_with_keys_lists_them),
        test!(async reviewing::answers_are_looked_through_changed_and_withdrawn),
        test!(async reviewing::classes_are_changed_after_it_was_said_what_that_does),
        test!(async reviewing::who_names_on_the_map_first_stays_where_they_are_and_sees_a_part),
        test!(async reviewing::the_motion_stays_in_view_beside_a_long_sheet),
        test!(async scriptless::a_page_without_scripts_says_what_it_needs_and_shows_what_it_has),
        test!(async selecting::ten_are_lassoed_on_the_map_and_named),
        test!(async selecting::a_campaign_begins_from_a_point_of_the_map),
        test!(async selecting::the_map_zooms_hides_and_asks_before_it_replaces),
        test!(async selecting::what_is_hidden_stays_so_when_another_class_goes),
        test!(async exploring::what_the_map_shows_is_remembered_until_all_is_shown),
        test!(async exploring::the_map_goes_back_shows_paths_and_asks_before_one_answer_is_replaced),
        test!(async exploring::what_was_looked_at_shows_its_paths),
        test!(async selecting::a_cluster_is_named_but_for_those_that_differ),
        test!(async selecting::clusters_are_looked_at_while_the_archive_grows),
        test!(async selecting::medoids_are_named_and_the_report_is_taken_away),
        test!(async robots::a_sensor_is_dragged_and_its_text_follows),
        test!(async robots::what_an_editor_of_robots_cannot_show_is_kept),
        test!(async starting::campaigns_are_found_compared_and_deleted_after_a_question),
        test!(async starting::a_campaign_is_described_checked_and_started_once),
        test!(async steering::the_training_and_its_rounds_are_drawn_after_a_reload),
        test!(async steering::novelty_is_drawn_as_it_grows_and_cancelling_asks_first),
        test!(async steering::a_button_never_becomes_another_and_what_was_agreed_to_is_done),
        test!(async taxonomy::behaviours_are_merged_tried_learned_from_and_compared),
        test!(async studies::a_study_is_watched_while_it_runs_and_its_medoids_are_judged_again),
        test!(async studies::a_controller_of_an_atlas_is_chosen_and_its_motion_plays),
    ];
    tests.map(|test| test.needs(Requirement::Chromium)).into()
}

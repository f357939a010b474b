//! Tests of the data directory: disks that are full, failing or damaged, backups, the doctor, and restoring.

mod backup;
mod bucket;
mod checkpoint_store;
mod disk;
mod doctor;
mod unmounted;

pub use backup::MODEL;

use murmuration_tests::{Murmuration, Requirement, Test, longer_spec, test};
use serde_json::Value;
use std::path::Path;

pub fn tests() -> Vec<Test> {
    vec![
        test!(backup::a_backup_of_a_running_campaign_goes_on_to_the_same_digest),
        test!(backup::a_backup_makes_the_folders_above_it),
        test!(backup::a_backup_is_refused_where_it_cannot_be_kept),
        test!(backup::what_is_no_backup_is_not_put_back),
        test!(checkpoint_store::a_bucket_that_takes_nothing_is_named_before_anything_is_computed),
        test!(checkpoint_store::a_bucket_is_tried_out_and_left_as_it_was),
        test!(checkpoint_store::a_folder_that_cannot_be_made_is_named),
        test!(checkpoint_store::a_checkpoint_in_a_folder_elsewhere_is_acknowledged_once_it_is_on_disk),
        test!(disk::on_a_full_disk_a_campaign_waits_for_room).needs(Requirement::Mount),
        test!(disk::what_does_not_fit_on_a_disk_leaves_nothing_in_the_way).needs(Requirement::Mount),
        test!(disk::what_a_failing_disk_has_not_confirmed_is_not_acknowledged),
        test!(disk::a_read_only_disk_is_named).needs(Requirement::Mount),
        test!(disk::a_read_only_disk_can_be_read).needs(Requirement::Mount),
        test!(doctor::a_damaged_archive_is_named_and_left_as_it_is),
        test!(doctor::a_database_that_was_cut_off_is_named),
        test!(doctor::a_checkpoint_that_is_torn_is_named_and_one_that_is_gone_comes_back),
        test!(doctor::a_data_directory_in_use_is_left_alone),
        test!(unmounted::a_database_whose_volume_is_not_mounted_is_not_replaced),
    ]
}

/// The file of a campaign that takes some seconds, and the digest of the campaign's archive.
fn undisturbed(folder: &Path) -> (String, String) {
    let spec = longer_spec(folder);
    let murmuration = Murmuration::over(&folder.join("undisturbed"));
    let run = murmuration.run(&["run", &spec]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    (spec, murmuration.digest())
}

fn generations(campaign: &Value) -> u64 {
    campaign["generations_done"].as_u64().unwrap()
}

fn waits_for(campaign: &Value, what: &str) -> bool {
    campaign["waiting"].as_str().unwrap().contains(what)
}

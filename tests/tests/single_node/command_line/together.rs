//! Tests processes of a launcher that run a campaign together.

use crate::command_line::Desk;
use murmuration_tests::{Murmuration, Running, longer_spec};
use std::path::Path;

/// The tasks of a step of `srun` that run a campaign together, the process that coordinates first.
struct Tasks(Vec<Running>);

impl Tasks {
    fn start(murmuration: &Murmuration, job: &str, spec: &str, count: usize) -> Self {
        // The other processes can start first.
        let mut tasks: Vec<Running> = (0..count)
            .rev()
            .map(|number| task(murmuration, job, spec, number, count))
            .collect();
        tasks.reverse();
        Self(tasks)
    }

    /// Waits for the ends of all tasks; returns their exit codes.
    fn codes(self) -> Vec<Option<i32>> {
        self.0.into_iter().map(Running::wait).collect()
    }
}

fn task(murmuration: &Murmuration, job: &str, spec: &str, number: usize, count: usize) -> Running {
    let (number, count) = (number.to_string(), count.to_string());
    let variables = [
        ("SLURM_JOB_ID", job),
        ("SLURM_STEP_ID", "0"),
        ("SLURM_PROCID", &number),
        ("SLURM_STEP_NUM_TASKS", &count),
        ("MURMURATION_LAUNCH_CONTACT", "127.0.0.1"),
    ];
    murmuration.start_with(&["run", spec, "--workers", "1"], &variables)
}

fn alone(folder: &Path, spec: &str) -> String {
    let alone = Murmuration::over(&folder.join("alone"));
    let run = alone.run(&["run", spec, "--json"]);
    run.last_line()["digest"].as_str().unwrap().to_owned()
}

#[test]
fn tasks_of_a_launcher_run_one_campaign_and_all_end_with_it() {
    let desk = Desk::new();
    let spec = longer_spec(desk.folder.path());
    let undisturbed = alone(desk.folder.path(), &spec);
    let mut tasks = Tasks::start(&desk.murmuration, "42", &spec, 3);
    for worker in &mut tasks.0[1..] {
        worker.wait_until_joined();
    }
    // Commands of other machines find the process that coordinates by the data directory.
    desk.murmuration.latest_when(|latest| latest["workers"] == 3);
    assert_eq!(tasks.codes(), [Some(0); 3]);
    assert_eq!(desk.murmuration.digest().trim(), undisturbed);
    // A launch can run a second campaign.
    let other = desk.path("small.toml");
    let again = Tasks::start(&desk.murmuration, "42", &other, 2);
    assert_eq!(again.codes(), [Some(0); 2]);
    assert_eq!(desk.murmuration.run(&["list", "--json"]).lines().len(), 2);
    // The same campaign again is complete. Its other process waits for it, although the file says that the first launch has ended.
    let again = Tasks::start(&desk.murmuration, "42", &spec, 2);
    assert_eq!(again.codes(), [Some(0); 2]);
}

#[test]
fn a_job_that_is_queued_again_goes_on_with_its_campaign() {
    let desk = Desk::new();
    let spec = longer_spec(desk.folder.path());
    let undisturbed = alone(desk.folder.path(), &spec);
    let tasks = Tasks::start(&desk.murmuration, "43", &spec, 2);
    let under_way = |latest: &serde_json::Value| latest["generations_done"].as_u64().unwrap_or(0) > 5;
    desk.murmuration.latest_when(under_way);
    // The time limit is near: the tasks get SIGTERM.
    for task in &tasks.0 {
        task.signal("TERM");
    }
    assert_eq!(tasks.codes(), [Some(75); 2]);
    let tasks = Tasks::start(&desk.murmuration, "43", &spec, 2);
    desk.murmuration.latest_when(|latest| latest["workers"] == 2);
    // The node of the process that coordinates is lost, and the launcher ends the others.
    for task in tasks.0 {
        task.kill();
    }
    let done = desk.murmuration.latest();
    assert_eq!(done["state"], "running", "the campaign was over too early");
    let tasks = Tasks::start(&desk.murmuration, "43", &spec, 2);
    assert_eq!(tasks.codes(), [Some(0); 2]);
    assert_eq!(desk.murmuration.digest().trim(), undisturbed);
    assert_eq!(desk.murmuration.run(&["list", "--json"]).lines().len(), 1);
}

#[test]
fn a_launch_ends_if_its_campaign_cannot_begin() {
    let desk = Desk::new();
    let spec = desk.write("wrong.toml", "model = \"nothing\"\n");
    let tasks = Tasks::start(&desk.murmuration, "44", &spec, 2);
    assert_eq!(tasks.codes(), [Some(2); 2]);
    desk.check(
        &["run", &desk.path("small.toml"), "--together"],
        2,
        "no launcher has numbered this process",
    );
}

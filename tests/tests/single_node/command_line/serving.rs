//! Tests a running coordinator, and the commands that find it.

use crate::command_line::Desk;
use murmuration_tests::{Running, binary, small_latent_spec, start_trainer, start_worker, start_worker_with};
use serde_json::Value;
use std::{fs, process::Command, thread, time::Duration};

#[test]
fn a_second_process_is_told_who_holds_the_data_directory() {
    let desk = Desk::new();
    let (serving, url) = desk.murmuration.serve("127.0.0.1:0", &["--workers", "1"]);
    let spec = desk.path("small.toml");
    let refused = desk.murmuration.run(&["run", &spec, "--seed", "7"]);
    assert_eq!(refused.code, Some(1));
    let (_, told) = refused
        .stderr
        .split_once("to submit the campaign to that process: ")
        .unwrap();
    let told: Vec<&str> = told.split_whitespace().collect();
    assert_eq!(told, ["murmuration", "submit", &spec, "--seed", "7"]);
    desk.check(
        &told[1..],
        0,
        "campaign small-1 submitted; next: murmuration watch small-1",
    );
    desk.check(
        &["serve"],
        1,
        "only one coordinator can use a data directory: stop that process first",
    );
    desk.check(
        &["doctor"],
        1,
        "stop that process first; or back up the data directory while it is in use",
    );
    let copy = desk.path("copy");
    desk.check(&["backup", &copy], 0, "backed up");
    desk.check(&["doctor", "--data", &copy], 0, "");
    desk.check(
        &["quarantine", "--lift", "5f0c3a9e12d4b687"],
        1,
        "stop that process first, and start it again afterwards",
    );
    desk.check(
        &["watch", "small-1"],
        0,
        "campaign small-1 is completed; next: murmuration report small-1",
    );
    desk.check(&["report", "small-1"], 0, "");

    // Other commands find the coordinator through the data directory.
    let submitted = desk.murmuration.run(&["submit", &spec, "--json"]).last_line();
    assert_eq!(submitted["id"], "small-2");
    desk.check(&["watch", "small-2"], 0, "campaign small-2 is completed");
    let lines = desk
        .murmuration
        .run(&["watch", "small-2", "--json", "--coordinator", &url]);
    assert_eq!(lines.last_line()["state"], "completed");
    assert_eq!(serving.terminate(), Some(0));
}

/// An evaluation can take hours, and cannot be interrupted.
#[test]
fn a_second_signal_ends_what_the_first_waits_for() {
    let desk = Desk::new();
    let long = "name = \"long\"\nmodel = \"single-sensor\"\nmethod = \"hand-crafted\"\n\
                [world]\nagents = 200\nhorizon = 10_000_000\n[search]\npopulation = 2\ngenerations = 1\n\
                [taxonomy]\nmedoids = 1\n";
    let spec = desk.write("long.toml", long);
    let mut running = desk.murmuration.start(&["run", &spec, "--workers", "1"]);
    running.wait_for("0/2 evaluations");
    // Only a process with a running evaluation uses this much processor time.
    while running.cpu_time() < Duration::from_secs(2) {
        thread::sleep(Duration::from_millis(50));
    }
    running.signal("INT");
    running.wait_for("waiting for running evaluations");
    assert_eq!(running.terminate(), Some(130));
    desk.check(&["cancel", "long-1"], 0, "");
}

#[test]
fn pause_resume_and_cancel_survive_the_coordinator() {
    let desk = Desk::new();
    let spec = desk.path("small.toml");
    let (serving, url) = desk.murmuration.serve("127.0.0.1:0", &["--workers", "0"]);
    desk.check(
        &["submit", &spec],
        0,
        "campaign small-1 submitted; next: murmuration watch small-1",
    );
    desk.check(&["submit", &spec], 0, "campaign small-2 submitted");
    desk.check(
        &["pause", "small-1"],
        0,
        "campaign small-1 is paused; next: murmuration resume small-1",
    );
    desk.check(
        &["watch", "small-1"],
        0,
        "campaign small-1 is paused; next: murmuration resume small-1",
    );
    let half = desk.murmuration.run(&["digest", "small-1"]);
    assert_eq!((half.code, half.stdout.as_str()), (Some(1), ""));
    let expected = "campaign small-1 is paused, so its archive is not complete; for the digest of the archive so far: murmuration digest small-1 \
                --partial";
    assert!(half.stderr.contains(expected), "{}", half.stderr);
    let half = desk
        .murmuration
        .run(&["digest", "small-1", "--partial", "--json"]);
    assert_eq!(
        (half.code, &half.last_line()["complete"]),
        (Some(0), &false.into())
    );
    let expected = "campaign small-1 is paused: this is the digest of the";
    assert!(half.stderr.contains(expected), "{}", half.stderr);
    desk.check(&["cancel", "small-2"], 0, "campaign small-2 is cancelled");
    desk.check(
        &["watch", "small-2"],
        0,
        "campaign small-2 is cancelled; next: murmuration list",
    );
    desk.check(
        &["pause", "small-2"],
        1,
        "cannot pause campaign small-2: it was already cancelled",
    );
    serving.kill();

    let listed = desk.murmuration.run(&["list", "--json"]).lines();
    let states: Vec<Value> = listed.iter().map(|campaign| campaign["state"].clone()).collect();
    assert_eq!(states, ["paused", "cancelled"]);
    desk.check(&["list", "--coordinator", &url], 1, "no coordinator answers");
    desk.check(
        &["resume", "small-1"],
        0,
        "campaign small-1 continues with stage evolve after generation 0",
    );
    desk.check(&["watch", "small-1"], 0, "campaign small-1 is completed");
    let whole = desk.murmuration.run(&["digest", "small-1", "--json"]);
    assert_eq!(
        (whole.code, &whole.last_line()["complete"]),
        (Some(0), &true.into())
    );
    assert_eq!(whole.stderr, "");
}

#[test]
fn workers_of_their_own_processes_come_and_go() {
    let desk = Desk::new();
    let spec = desk.path("small.toml");
    let undisturbed = desk.murmuration.run(&["run", &spec, "--json"]).last_line()["digest"].clone();

    let (_serving, url) = desk.murmuration.serve("127.0.0.1:0", &["--workers", "0"]);
    let mut waits = desk.murmuration.start(&["report", "small-1"]);
    let told = waits.wait_for("waiting");
    assert!(
        told.contains("start one with `murmuration-worker --access FILE`"),
        "{told}"
    );
    let leaves = start_worker(&url);
    desk.check(&["submit", &spec], 0, "campaign small-2 submitted");
    desk.murmuration.latest_when(|latest| latest["workers"] == 1);
    assert_eq!(leaves.terminate(), Some(0));
    let killed = start_worker(&url);
    killed.kill();
    let _stays = start_worker(&url);
    desk.check(&["watch", "small-2"], 0, "campaign small-2 is completed");
    let digest = desk.murmuration.run(&["digest", "small-2"]);
    assert_eq!(digest.stdout.trim(), undisturbed);
}

#[test]
fn a_command_on_another_machine_is_told_where_the_coordinator_runs() {
    let desk = Desk::new();
    let (_serving, _) = desk.murmuration.serve("127.0.0.1:0", &["--workers", "0"]);
    // The data directory is on a file system that machines share: another machine wrote its name into the lock file.
    let lock = desk.path("data/lock.json");
    let mut holder: Value = serde_json::from_str(&fs::read_to_string(&lock).unwrap()).unwrap();
    assert!(!holder["machine"].as_str().unwrap().is_empty(), "{holder}");
    holder["machine"] = "node-7".into();
    fs::write(&lock, holder.to_string()).unwrap();
    let spec = desk.path("small.toml");
    for command in [
        ["list"].as_slice(),
        &["submit", &spec],
        &["run", &spec],
        &["health"],
    ] {
        desk.check(
            command,
            1,
            "runs on the machine node-7 and listens for that machine alone: use this command there",
        );
    }
}

#[test]
fn a_worker_leaves_when_it_is_told_to_beforehand() {
    let desk = Desk::new();
    let spec = desk.path("small.toml");
    let (serving, url) = desk.murmuration.serve("127.0.0.1:0", &["--workers", "0"]);
    let worker = |name: &str, value: &str| start_worker_with(&url, &[(name, value)]);
    // Work comes before the end, and the last results are sent.
    let mut idle = worker("MURMURATION_IDLE_TIMEOUT", "2s");
    idle.wait_until_joined();
    desk.check(&["submit", &spec], 0, "campaign small-1 submitted");
    desk.check(&["watch", "small-1"], 0, "campaign small-1 is completed");
    let told = idle.wait_for("no work for 2s, leaving");
    assert!(told.contains("INFO"), "{told}");
    assert_eq!(idle.wait(), Some(0));
    assert_eq!(worker("MURMURATION_LIFETIME", "1s").wait(), Some(0));
    // 15 s are kept for the last results.
    assert_eq!(worker("MURMURATION_TIME_LIMIT", "0-00:00:16").wait(), Some(0));
    let job = [
        ("SLURM_JOB_END_TIME", "1"),
        ("SLURM_JOB_ID", "42"),
        ("SLURM_PROCID", "0"),
    ];
    let mut of_job = start_worker_with(&url, &job);
    of_job.wait_for("the time limit is near");
    assert_eq!(of_job.wait(), Some(0));

    let script = format!("(\"$0\" --coordinator {url} --end-with-parent & sleep 1); exec sleep 60");
    let mut shell = Command::new("sh");
    shell.args(["-c", &script]).arg(binary("murmuration-worker"));
    Running::start(shell).wait_for("the process that started this one has ended, leaving");

    let lost = ["exit", "retry=1s"].map(|value| {
        let mut lost = worker("MURMURATION_ON_COORDINATOR_LOST", value);
        lost.wait_until_joined();
        lost
    });
    assert_eq!(serving.terminate(), Some(0));
    for mut lost in lost {
        lost.wait_for("the coordinator is lost, leaving");
        assert_eq!(lost.wait(), Some(0));
    }
    let mut never = worker("MURMURATION_ON_COORDINATOR_LOST", "retry=1s");
    let told = never.wait_for("error: no connection");
    assert!(told.contains("(--on-coordinator-lost)"), "{told}");
    assert_eq!(never.wait(), Some(1));
}

#[test]
fn a_campaign_says_who_is_missing_to_go_on() {
    let desk = Desk::new();
    let spec = desk.write("latent.toml", &small_latent_spec("").to_toml());
    let (serving, url) = desk.murmuration.serve("127.0.0.1:0", &["--workers", "0"]);
    desk.check(&["submit", &spec], 0, "campaign small-1 submitted");
    let page = |url: &str| murmuration_tests::page(&format!("{url}/campaigns/small-1"));
    let waits = |latest: &Value, program: &str| {
        let message = latest["waiting"].as_str().unwrap();
        message.contains(&format!("start one with `{program} --access FILE`"))
    };
    let mut workers = Vec::new();
    for (program, peer, comes) in [
        (
            "murmuration-worker",
            "no worker",
            start_worker as fn(&str) -> Running,
        ),
        ("murmuration-trainer", "no trainer", start_trainer),
    ] {
        desk.murmuration.latest_when(|latest| waits(latest, program));
        let shown = page(&url);
        assert!(
            shown.contains(">waiting</strong>") && shown.contains(program),
            "{shown}"
        );
        assert!(!shown.contains("0 of 0"), "{shown}");
        let told = desk.murmuration.run(&["show", "latest"]);
        assert!(told.stdout.contains(program), "{}", told.stdout);
        let listed = desk.murmuration.run(&["list"]);
        assert!(listed.stdout.contains("waiting"), "{}", listed.stdout);
        let mut watching = desk.murmuration.start(&["watch", "latest"]);
        let line = watching.wait_for("waiting");
        assert!(
            line.contains(peer) && line.contains(program) && !line.contains("0/0"),
            "{line}"
        );
        workers.push(comes(&url));
    }
    desk.check(
        &["watch", "latest"],
        0,
        "next: murmuration report small-1; to add labels: murmuration label small-1 --csv FILE (or --synthetic N)",
    );
    assert_eq!(desk.murmuration.latest()["waiting"], "");
    assert_eq!(serving.terminate(), Some(0));
}

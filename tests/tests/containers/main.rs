//! Tests the cluster of deploy/compose.yaml, built from deploy/Dockerfile, and the scripts of deploy/slurm on a Slurm cluster of
//! containers. The tests kill containers; the outcome must equal the outcome of `murmuration run` on this machine.
//!
//! The tests need a Docker engine, and base images from `tests/containers/base-images`, which `make test-containers` makes.

mod compose;
mod debian_source;
mod slurm;

use compose::{ComposeCluster, compose_file};
use murmuration_tests::{Murmuration, Requirement, run, test};
use std::{collections::BTreeSet, fs, process::ExitCode};

fn main() -> ExitCode {
    run(vec![
        test!(killed_containers_change_nothing)
            .needs(Requirement::Compose)
            .needs(Requirement::Containers),
        test!(slurm::campaigns_on_slurm_end_as_on_one_machine).needs(Requirement::Containers),
        test!(every_profile_is_valid_and_names_its_images).needs(Requirement::Compose),
        test!(debian_source::the_mirror_and_the_suite_are_those_of_apts_sources),
    ])
}

/// A campaign whose stages all last long enough to be observed, also on an idle machine.
const SPEC: &str = "name = \"contained\"\nmodel = \"single-sensor\"\nmethod = \"latent\"\n\
    [dataset]\ncontrollers = 4000\n[training.recipe.in-batch]\nepochs = 6\npatience = 6\n\
    [world]\nhorizon = 1600\n[search]\npopulation = 100\ngenerations = 120\n[taxonomy]\nmedoids = 8\n";

/// Compose can read the file without a Docker engine.
fn every_profile_is_valid_and_names_its_images() {
    let config = |arguments: &[&str]| {
        let output = compose_file()
            .args(arguments)
            .env("AWS_ACCESS_KEY_ID", "somebody")
            .env("AWS_SECRET_ACCESS_KEY", "something-long")
            .output()
            .unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{arguments:?}: {message}");
        String::from_utf8(output.stdout).unwrap()
    };
    for (profile, services) in [
        (None, vec!["certs", "coordinator", "trainer", "worker"]),
        (
            Some("s3"),
            vec!["certs", "coordinator", "s3", "trainer", "worker"],
        ),
        (
            Some("metrics"),
            vec![
                "certs",
                "coordinator",
                "grafana",
                "prometheus",
                "trainer",
                "worker",
            ],
        ),
    ] {
        let with = profile.map_or(vec![], |profile| vec!["--profile", profile]);
        let listed = config(&[&with[..], &["config", "--services"]].concat());
        // docker-compose 1.29 lists the services of every profile.
        let listed: BTreeSet<_> = listed.lines().collect();
        assert!(
            services.iter().all(|service| listed.contains(service)),
            "{listed:?}"
        );
        let whole = config(&[&with[..], &["config"]].concat());
        let images = whole
            .lines()
            .filter_map(|line| line.trim().strip_prefix("image: "));
        // Images that are not built here are fetched with an exact version.
        let fetched: Vec<_> = images.filter(|image| *image != "murmuration").collect();
        assert_eq!(fetched.len() + 4, listed.len(), "{fetched:?}");
        for image in fetched {
            let (_, version) = image.rsplit_once(':').unwrap();
            assert!(version.contains(|c: char| c.is_ascii_digit()), "{image}");
        }
        assert!(whole.contains("something-long"), "the keys do not arrive");
    }
}

fn killed_containers_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let spec = folder.path().join("contained.toml");
    fs::write(&spec, SPEC).unwrap();
    let spec = spec.to_str().unwrap();

    let cluster = ComposeCluster::up(3);
    cluster.wait_until_healthy();
    cluster.check_confined("coordinator");
    cluster.check_confined("worker");
    let submitted = cluster.murmuration(&["submit", spec]);
    assert_eq!(submitted.code, Some(0), "{}", submitted.stderr);

    cluster.wait_for("some of the dataset", |status| {
        status["stage"] == "dataset" && status["dataset_done"].as_u64() > Some(0)
    });
    cluster.kill_one("worker");
    cluster.wait_for("an epoch", |status| {
        status["stage"] == "pretrain" && status["training"]["epoch"].as_u64() > Some(0)
    });
    cluster.kill_one("trainer");
    for generations in [2, 40, 80] {
        cluster.wait_for("further generations", |status| {
            status["stage"] == "evolve" && status["generations_done"].as_u64() >= Some(generations)
        });
        cluster.kill_one("worker");
        cluster.kill_one("coordinator");
    }
    cluster.wait_for("the end", |status| status["state"] == "completed");
    let digest = cluster.murmuration(&["digest", "latest", "--json"]).last_line();

    let alone = Murmuration::over(&folder.path().join("alone"));
    let expected = alone.run(&["run", spec, "--json"]).last_line();
    assert_eq!(digest["digest"], expected["digest"]);
    assert_eq!(digest["evaluations"], 12_000);
}

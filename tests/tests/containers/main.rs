//! The cluster of deploy/compose.yaml, built from deploy/Dockerfile: containers are killed, and the outcome is that of
//! `murmuration run` on this machine.
//!
//! Needs a Docker engine, and base images from `tests/containers/base-images`; `make test-containers` has both made.

mod compose;

use compose::{Cluster, base_images};
use murmuration_tests::Murmuration;
use std::fs;

/// A campaign whose every stage takes long enough to be met in it, also on a machine that has nothing else to do.
const SPEC: &str = "name = \"contained\"\nmodel = \"single-sensor\"\nmethod = \"latent\"\n\
    [dataset]\ncontrollers = 4000\n[training.recipe.in-batch]\nepochs = 6\npatience = 6\n\
    [world]\nhorizon = 400\n[search]\npopulation = 100\ngenerations = 200\n[taxonomy]\nmedoids = 8\n";

#[test]
fn killed_containers_change_nothing() {
    let Some(bases) = base_images() else { return };
    let folder = tempfile::tempdir().unwrap();
    let spec = folder.path().join("contained.toml");
    fs::write(&spec, SPEC).unwrap();
    let spec = spec.to_str().unwrap();

    let cluster = Cluster::up(bases, 3);
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
    for generations in [2, 60, 120] {
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
    assert_eq!(digest["evaluations"], 20_000);
}

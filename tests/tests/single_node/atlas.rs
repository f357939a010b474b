//! Tests exhaustive campaigns and their atlases: workers judge every controller once, despite interruptions.

use murmuration_judge::{frames, judge};
use murmuration_proto::v1;
use murmuration_sim::{replay::replay_frames, simulate::Start};
use murmuration_swarm::{CampaignSpec, Controller, Enumeration, Starts, Verdict};
use murmuration_tests::{Cluster, Murmuration};
use std::{fs, path::Path};

const SPEC: &str = "name = \"atlas\"\nmodel = \"single-sensor\"\nmethod = \"exhaustive\"\n[controllers]\nstep = 0.5\n\
                    [world]\nhorizon = 170\n[evaluation]\nstarts = 2\n";

fn written(folder: &Path) -> String {
    let path = folder.join("atlas.toml");
    fs::write(&path, SPEC).unwrap();
    path.display().to_string()
}

fn table(folder: &Path) -> Vec<Vec<String>> {
    let text = fs::read_to_string(folder.join("atlas.csv")).unwrap();
    text.lines()
        .map(|line| line.split(',').map(str::to_owned).collect())
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn every_controller_is_evaluated_once_and_judged_as_its_motion_is() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start_without_trainer(folder.path(), 2).await;
    let spec = CampaignSpec::from_toml(SPEC).unwrap();
    let id = cluster.create(&spec).await;
    let last = cluster.finish(&id).await;
    assert_eq!(last.state(), v1::CampaignState::Completed, "{}", last.error);
    let archive = cluster.archive(&id).await;
    let all = Enumeration::of(spec.controllers(), spec.world()).unwrap();
    assert_eq!(archive.len() as u64, all.len());
    let world = spec.world();
    for individual in &archive {
        let controller = Controller::new(spec.model(), &individual.controller).unwrap();
        assert_eq!(controller, all.controller(individual.index));
        assert_eq!(individual.novelty, 0.0);
        let seeds = Starts::new("starts", 2).unwrap().seeds(individual.seed);
        let message = seeds.map(|seed| {
            let motion = replay_frames(&controller, world, &Start::seeded(seed), &frames(world));
            i32::from(judge(&motion.unwrap(), world).number())
        });
        assert_eq!(
            individual.verdicts,
            message.collect::<Vec<_>>(),
            "individual {}",
            individual.index
        );
    }
    let classes: std::collections::BTreeSet<_> = archive
        .iter()
        .flat_map(|individual| &individual.verdicts)
        .collect();
    assert!(classes.len() > 2, "{classes:?}");
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_space_that_is_too_large_is_sampled_evenly_and_other_methods_can_be_judged() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start_without_trainer(folder.path(), 2).await;
    let rest =
        "[world]\nhorizon = 170\n[search]\npopulation = 16\ngenerations = 2\n[taxonomy]\nmedoids = 3\n";
    for (method, judged) in [("exhaustive", ""), ("random", "[evaluation]\njudge = true\n")] {
        let text = format!("model = \"two-sensor\"\nmethod = \"{method}\"\n{rest}{judged}");
        let id = cluster.create(&CampaignSpec::from_toml(&text).unwrap()).await;
        let last = cluster.finish(&id).await;
        assert_eq!(last.state(), v1::CampaignState::Completed, "{}", last.error);
        let archive = cluster.archive(&id).await;
        assert_eq!(archive.len(), 32);
        for individual in archive {
            assert_eq!(individual.verdicts.len(), 1);
            Verdict::try_from(individual.verdicts[0]).unwrap();
        }
    }
    cluster.stop().await;
}

#[test]
fn an_atlas_that_is_killed_goes_on_to_the_same_digest_and_is_not_computed_again() {
    let folder = tempfile::tempdir().unwrap();
    let spec = written(folder.path());
    let atlas = |murmuration: &Murmuration, name: &str| {
        let out = folder.path().join(name).display().to_string();
        murmuration
            .run(&["lab", "atlas", &spec, "--out", &out, "--json"])
            .last_line()
    };
    let undisturbed = Murmuration::over(&folder.path().join("undisturbed"));
    let whole = atlas(&undisturbed, "whole");
    assert_eq!(whole["controllers"], 325);

    let killed = Murmuration::over(&folder.path().join("killed"));
    let mut process = killed.start(&["lab", "atlas", &spec, "--workers", "1"]);
    process.wait_for("generation");
    killed.latest_when(|latest| latest["generations_done"].as_u64() > Some(0));
    process.kill();
    let resumed = atlas(&killed, "resumed");
    assert_eq!(
        (&resumed["digest"], &resumed["campaign"]),
        (&whole["digest"], &whole["campaign"])
    );
    for name in [
        "atlas.csv",
        "atlas.png",
        "atlas.html",
        "atlas-poster.svg",
        "atlas-poster.png",
    ] {
        let [one, other] =
            ["whole", "resumed"].map(|of| fs::read(folder.path().join(of).join(name)).unwrap());
        assert!(one == other, "{name} differs");
    }
    assert!(folder.path().join("whole/pictures/tile-0-0.png").exists());
    // Running the same command again starts no second campaign.
    assert_eq!(atlas(&killed, "again"), {
        let mut again = resumed.clone();
        again["atlas"] = folder
            .path()
            .join("again/atlas.html")
            .display()
            .to_string()
            .into();
        again
    });
    assert_eq!(killed.run(&["list", "--json"]).lines().len(), 1);

    let rows = table(&folder.path().join("whole"));
    assert_eq!(rows.len(), 326);
    let coarse = folder.path().join("coarse").display().to_string();
    let coarser = killed
        .run(&["lab", "atlas", &spec, "--values", "3", "--out", &coarse, "--json"])
        .last_line();
    assert_eq!(coarser["controllers"], 45);
}

#[test]
fn what_no_atlas_can_be_made_of_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::with_campaign(folder.path());
    let check = |arguments: &[&str], expected: &str| {
        let refused = murmuration.run(arguments);
        assert_eq!(refused.code, Some(2), "{}", refused.stderr);
        assert!(
            refused.stderr.contains(expected),
            "{:?} does not say {expected:?}",
            refused.stderr
        );
    };
    check(
        &["lab", "atlas", "small-1"],
        "campaign small-1 has no verdicts to make an atlas of",
    );
    let small = folder.path().join("small.toml").display().to_string();
    check(&["lab", "atlas", &small], "has no verdicts to make an atlas of");
    let spec = written(folder.path());
    check(
        &["lab", "atlas", &spec, "--values", "4"],
        "--values 4: must be an odd number from 3 on",
    );
    check(
        &["lab", "atlas", "small-1", "--values", "5"],
        "--values: the campaign is there already",
    );
    check(&["lab", "atlas", "nowhere.toml"], "nowhere.toml");
}

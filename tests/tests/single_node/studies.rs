//! Tests studies: each cell runs once, a killed study continues, and the tables of a study equal the tables of its campaigns.

use murmuration_judge::{frames, judge};
use murmuration_proto::v1;
use murmuration_sim::{replay::replay_frames, simulate::Start};
use murmuration_swarm::{Class, Controller, Preset, World};
use murmuration_tests::{Murmuration, small_latent_spec};
use serde_json::Value;
use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

/// An embedder's ONNX file.
const MODEL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/models/small.onnx");

/// A study of two rows with two replicates each; campaigns have 200 steps and generations of 20.
const STUDY: &str = "name = \"pair\"\nseeds = 2\nbehaviours.generations = 3\n\
    axes = [{ name = \"filter\", values = [{ name = \"no\" }, { name = \"yes\", campaign.filter = true }] }]\n\
    [campaign]\nmodel = \"single-sensor\"\nmethod = \"hand-crafted\"\nworld.horizon = 200\n\
    search = { population = 20, generations = 5 }\ntaxonomy.medoids = 4\n";

fn written(folder: &Path, text: &str) -> String {
    let path = folder.join("study.toml");
    fs::write(&path, text).unwrap();
    path.display().to_string()
}

/// The output of `study run`.
#[track_caller]
fn run(murmuration: &Murmuration, file: &str) -> Value {
    murmuration
        .run(&["lab", "study", "run", file, "--json"])
        .last_line()
}

/// The ids of all campaigns.
fn campaigns(murmuration: &Murmuration) -> BTreeSet<String> {
    let listed = murmuration.run(&["list", "--json"]).lines().into_iter();
    listed
        .map(|line| line["id"].as_str().unwrap().to_owned())
        .collect()
}

/// Figures and digests of a study by cell, without the names of its campaigns.
fn measured(study: &Value) -> BTreeMap<String, (String, Value)> {
    let cells = study["measured"].as_array().unwrap().iter();
    cells
        .map(|cell| {
            let text = |field: &str| cell[field].as_str().unwrap().to_owned();
            (text("cell"), (text("archive_digest"), cell["figures"].clone()))
        })
        .collect()
}

/// The rows of a CSV file without quotes, by column.
fn rows(path: PathBuf) -> Vec<BTreeMap<String, String>> {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let row = |line: &str| {
        let cells = line.split(',').map(str::to_owned);
        header.iter().map(|&name| name.to_owned()).zip(cells).collect()
    };
    lines.map(row).collect()
}

#[test]
fn cells_run_once_and_a_changed_study_runs_only_what_is_new() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::over(&folder.path().join("data"));
    let first = run(&murmuration, &written(folder.path(), STUDY));
    assert_eq!((first["cells"].as_u64(), measured(&first).len()), (Some(4), 4));
    assert_eq!(campaigns(&murmuration).len(), 4);

    // A study with another name has the same cells.
    let renamed = STUDY.replace("\"pair\"", "\"other\"");
    let again = run(&murmuration, &written(folder.path(), &renamed));
    assert_eq!(measured(&again), measured(&first));
    assert_eq!(campaigns(&murmuration).len(), 4);

    let longer = run(
        &murmuration,
        &written(folder.path(), &STUDY.replace("seeds = 2", "seeds = 3")),
    );
    assert_eq!(campaigns(&murmuration).len(), 6);
    let (before, now) = (measured(&first), measured(&longer));
    assert_eq!(now.len(), 6);
    assert!(before.iter().all(|(cell, figures)| now[cell] == *figures));

    let listed = murmuration.run(&["lab", "study", "list", "--json"]).lines();
    let names: Vec<&str> = listed.iter().filter_map(|line| line["study"].as_str()).collect();
    assert_eq!(names, ["other", "pair"]);
}

#[test]
fn a_study_that_is_run_twice_at_once_begins_each_cell_once() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let murmuration = Murmuration::over(&data);
    let file = written(folder.path(), STUDY);
    let (server, _) = murmuration.serve("127.0.0.1:0", &["--workers", "1"]);
    let runs = [(); 2].map(|()| murmuration.start(&["lab", "study", "run", &file]));
    for run in runs {
        assert_eq!(run.wait(), Some(0));
    }
    assert_eq!(campaigns(&murmuration).len(), 4);
    drop(server);
}

#[test]
fn a_damaged_study_hides_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let murmuration = Murmuration::over(&data);
    // Earlier versions kept studies in folders. The coordinator imports these studies.
    let damaged = data.join("studies/damaged");
    fs::create_dir_all(&damaged).unwrap();
    fs::write(damaged.join("study.toml"), "seeds = \"many\"").unwrap();
    let file = written(folder.path(), STUDY);
    run(&murmuration, &file);
    let listed = murmuration.run(&["lab", "study", "list", "--json"]).lines();
    assert_eq!(listed.len(), 2);
    assert!(
        listed[0]["problem"]
            .as_str()
            .unwrap()
            .contains("the study damaged is damaged: the study's file: "),
        "{listed:?}"
    );
    assert_eq!(listed[1]["measured"], 4);
    let table = murmuration.run(&["lab", "study", "list"]);
    assert_eq!(table.code, Some(0));
    assert!(
        table.stdout.contains("pair") && table.stderr.contains("damaged is damaged"),
        "{}",
        table.stderr
    );
}

#[test]
fn nothing_is_reported_of_a_study_that_was_not_measured() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let murmuration = Murmuration::over(&data);
    assert_eq!(murmuration.run(&["checkpoints", "import", MODEL]).code, Some(0));
    let study = data.join("studies/pair");
    fs::create_dir_all(&study).unwrap();
    fs::write(study.join("study.toml"), STUDY).unwrap();
    let report = murmuration.run(&["lab", "study", "report", "pair"]);
    assert_eq!(report.code, Some(1), "{}", report.stderr);
    let expected = "nothing of the study pair has been measured: `murmuration lab study run`";
    assert!(report.stderr.contains(expected), "{}", report.stderr);
    assert!(!study.join("report.html").exists());
}

#[test]
fn a_campaign_that_was_run_by_hand_is_a_cell_too() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::over(&folder.path().join("data"));
    let file = written(folder.path(), &STUDY.replace("seeds = 2", "seeds = 1"));
    // The test runs the campaign of the first cell directly, under another name.
    let spec = folder.path().join("by-hand.toml");
    let (_, campaign) = STUDY.split_once("[campaign]\n").unwrap();
    fs::write(&spec, format!("name = \"by-hand\"\n{campaign}")).unwrap();
    assert_eq!(
        murmuration.run(&["run", &spec.display().to_string()]).code,
        Some(0)
    );
    let study = run(&murmuration, &file);
    assert_eq!(study["measured"][0]["campaign"], "by-hand-1");
    assert_eq!(study["measured"][1]["campaign"], "pair-2");
}

#[test]
fn tables_follow_from_the_files_of_the_report_and_those_from_the_campaigns() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::over(&folder.path().join("data"));
    let study = run(&murmuration, &written(folder.path(), STUDY));
    let page = PathBuf::from(study["report"].as_str().unwrap());
    let cells = rows(page.with_file_name("cells.csv"));
    let medoids = rows(page.with_file_name("medoids.csv"));
    for row in study["tables"][0]["rows"].as_array().unwrap() {
        let filter = row["values"]["filter"].as_str().unwrap();
        let of_row = cells.iter().filter(|cell| cell["filter"] == filter);
        let distinct: Vec<f64> = of_row.map(|cell| cell["distinct"].parse().unwrap()).collect();
        let mean = (distinct[0] + distinct[1]) / 2.0;
        let deviation = (distinct[0] - distinct[1]).abs() / 2.0_f64.sqrt();
        let figure = &row["figures"]["distinct"];
        assert_eq!(figure["mean"].as_f64(), Some(mean));
        assert!((figure["deviation"].as_f64().unwrap() - deviation).abs() < 1e-12);
    }
    for cell in &cells {
        let of_cell: Vec<_> = medoids
            .iter()
            .filter(|medoid| medoid["cell"] == cell["cell"])
            .collect();
        let [mut by_rules, mut by_second, mut by_both]: [BTreeSet<_>; 3] = Default::default();
        let mut generations = BTreeSet::new();
        for medoid in &of_cell {
            let (generation, class, second) =
                (&medoid["generation"], &medoid["class"], &medoid["second_class"]);
            generations.insert(generation.as_str());
            by_rules.insert((generation, class));
            by_second.insert((generation, second));
            if class == second {
                by_both.insert((generation, class));
            }
        }
        assert_eq!(generations.into_iter().collect::<Vec<_>>(), ["2", "3", "4"]);
        for (figure, distinct) in [
            ("distinct", by_rules),
            ("distinct_by_second_judge", by_second),
            ("distinct_by_both_judges", by_both),
        ] {
            let mean = distinct.len() as f64 / 3.0;
            assert_eq!(cell[figure].parse::<f64>().unwrap(), mean, "{figure}");
        }
        // The last taxonomy equals the campaign's.
        let last: BTreeSet<u64> = of_cell
            .iter()
            .filter(|medoid| medoid["generation"] == "4")
            .map(|medoid| medoid["index"].parse().unwrap())
            .collect();
        let report = folder.path().join(&cell["campaign"]);
        let written = murmuration.run(&[
            "report",
            &cell["campaign"],
            "--out",
            &report.display().to_string(),
        ]);
        assert_eq!(written.code, Some(0), "{}", written.stderr);
        let taxonomy = rows(report.join("taxonomy.csv"));
        let own: BTreeSet<u64> = taxonomy.iter().map(|row| row["index"].parse().unwrap()).collect();
        assert_eq!(last, own);
        let digest = murmuration.run(&["digest", &cell["campaign"]]);
        assert_eq!(digest.stdout.trim(), cell["archive_digest"]);
    }
}

#[test]
fn killed_and_run_again_it_comes_to_the_same_figures() {
    let folder = tempfile::tempdir().unwrap();
    let text = STUDY.replace("generations = 5", "generations = 200");
    let file = written(folder.path(), &text);
    let undisturbed = run(&Murmuration::over(&folder.path().join("undisturbed")), &file);

    let killed = Murmuration::over(&folder.path().join("killed"));
    for done in 0..2 {
        let mut process = killed.start(&["lab", "study", "run", &file, "--workers", "1", "--at-once", "2"]);
        process.wait_for("campaign pair-");
        killed.campaign_when("pair-2", |cell| cell["generations_done"].as_u64() > Some(done));
        process.kill();
    }
    let shown = killed
        .run(&["lab", "study", "show", "pair", "--json"])
        .last_line();
    assert!(measured(&shown).len() < 4, "it was killed too late");
    let again = run(&killed, &file);
    assert_eq!(measured(&again), measured(&undisturbed));
    assert_eq!(campaigns(&killed).len(), 4);
    assert_eq!(again["tables"], undisturbed["tables"]);
}

#[test]
fn replicates_that_share_an_embedder_have_its_checkpoint_and_the_archive_of_their_seed() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::over(&folder.path().join("data"));
    let campaign = small_latent_spec("seed = 1");
    let (_, fields) = campaign
        .to_toml()
        .split_once("seed = 1\n")
        .map(|(_, rest)| ((), rest.to_owned()))
        .unwrap();
    // A training without a seed of its own uses the campaign's seed.
    let fields = fields.replace("seed = 1\n", "");
    let mut lines = Vec::new();
    for line in fields.lines() {
        let section = line
            .strip_prefix('[')
            .map(|section| format!("[campaign.{section}"));
        lines.push(section.unwrap_or_else(|| line.to_owned()));
    }
    let text = format!(
        "name = \"shared\"\nseeds = 2\nembedders = 1\nmeasures = [\"search\"]\n[campaign]\n{}",
        lines.join("\n")
    );
    let study = run(&murmuration, &written(folder.path(), &text));
    let cells = study["measured"].as_array().unwrap();
    assert_eq!(cells.len(), 2);
    assert_eq!(cells[0]["checkpoint"], cells[1]["checkpoint"]);
    assert_eq!(campaigns(&murmuration).len(), 3, "two cells and the training");

    // A campaign that trains the same embedder itself has the same archive.
    let alone = Murmuration::over(&folder.path().join("alone"));
    let spec = folder.path().join("alone.toml");
    fs::write(&spec, campaign.to_toml()).unwrap();
    let trained = alone
        .run(&["run", &spec.display().to_string(), "--json"])
        .last_line();
    assert_eq!(trained["digest"], cells[0]["archive_digest"]);
    assert_ne!(cells[0]["archive_digest"], cells[1]["archive_digest"]);
}

/// A study of the paper's cyclic pursuit in small and in normal swarms, each from three starts.
const PHASE: &str = "name = \"phase\"\nmeasures = [\"shares\"]\nphase.x = \"robots\"\n\
    axes = [{ name = \"robots\", field = \"world.agents\", numbers = [4, 24] }]\n\
    [campaign]\nmodel = \"single-sensor\"\nmethod = \"hand-crafted\"\n\
    controllers.initial = [[-0.7, 0.3, 1.0, 1.0]]\nsearch = { population = 1, generations = 1 }\n\
    taxonomy.medoids = 1\nevaluation = { starts = 3, judge = true }\n";

#[test]
fn shares_are_of_what_workers_judged_of_that_controller_alone_and_diagrams_show_them() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::over(&folder.path().join("data"));
    let study = run(&murmuration, &written(folder.path(), PHASE));
    let page = PathBuf::from(study["report"].as_str().unwrap());
    let controller = Controller::new(Preset::SingleSensor, &[-0.7, 0.3, 1.0, 1.0]).unwrap();
    for cell in rows(page.with_file_name("cells.csv")) {
        assert_eq!(cell["evaluations"], "1");
        let out = folder.path().join(&cell["campaign"]);
        let report = murmuration.run(&["report", &cell["campaign"], "--out", &out.display().to_string()]);
        assert_eq!(report.code, Some(0), "{}", report.stderr);
        let world = World::try_from(v1::World {
            agents: Some(cell["robots"].parse().unwrap()),
            ..v1::World::default()
        });
        let world = world.unwrap();
        let trials = rows(out.join("trials.csv"));
        assert_eq!(trials.len(), 3);
        let mut shares = Class::ALL.map(|class| (class, 0.0));
        for trial in trials {
            let start = Start::seeded(trial["seed"].parse().unwrap());
            let motion = replay_frames(&controller, &world, &start, &frames(&world)).unwrap();
            shares[judge(&motion, &world).class() as usize].1 += 100.0 / 3.0;
        }
        for (class, share) in shares {
            let message: f64 = cell[&format!("share_{class}")].parse().unwrap();
            assert!((message - share).abs() < 1e-9, "{class}: {message}, not {share}");
        }
    }
    let picture = fs::read_to_string(page.with_file_name("phase.svg")).unwrap();
    assert!(picture.starts_with("<svg") && picture.contains("cyclic pursuit"));
    assert!(
        fs::read_to_string(&page).unwrap().contains(&picture),
        "the page has it too"
    );
}

/// A study of searches in small and in larger swarms.
const SEARCHES: &str = "name = \"searches\"\nmeasures = [\"shares\"]\nphase.x = \"robots\"\n\
    axes = [{ name = \"robots\", field = \"world.agents\", numbers = [4, 12] }]\n\
    [campaign]\nmodel = \"single-sensor\"\nmethod = \"hand-crafted\"\nworld.horizon = 200\n\
    search = { population = 20, generations = 2 }\ntaxonomy.medoids = 4\nevaluation.judge = true\n";

#[test]
fn a_phase_diagram_of_searches_shows_the_shares_of_their_archives() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::over(&folder.path().join("data"));
    let study = run(&murmuration, &written(folder.path(), SEARCHES));
    let page = PathBuf::from(study["report"].as_str().unwrap());
    let cells = rows(page.with_file_name("cells.csv"));
    assert_eq!(cells.len(), 2);
    for cell in cells {
        assert_eq!(cell["evaluations"], "40");
        let shares = Class::ALL.map(|class| cell[&format!("share_{class}")].parse::<f64>().unwrap());
        // The campaign has 40 individuals with one trial each, so shares are multiples of 2.5 %.
        assert!(
            shares.iter().all(|share| (share / 2.5).fract() == 0.0),
            "{shares:?}"
        );
        assert_eq!(shares.iter().sum::<f64>(), 100.0);
        let shown = murmuration.run(&["show", &cell["campaign"], "--taxonomy", "--json"]);
        assert_eq!(shown.last_line()["medoids"].as_array().unwrap().len(), 4);
    }
    let picture = fs::read_to_string(page.with_file_name("phase.svg")).unwrap();
    assert!(picture.starts_with("<svg"), "{picture}");
}

#[test]
fn shares_of_cells_that_nobody_judges_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::over(&folder.path().join("data"));
    let file = written(folder.path(), &PHASE.replace("judge = true", "judge = false"));
    let refused = murmuration.run(&["lab", "study", "run", &file]);
    assert_eq!(refused.code, Some(2));
    let expected = "the campaign with robots = 4, seed = 1: evaluation.judge = false: must be true";
    assert!(refused.stderr.contains(expected), "{}", refused.stderr);
    assert!(!folder.path().join("data").exists(), "nothing ran");
}

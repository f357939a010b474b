//! Tests recall: the share of an atlas's content that campaigns find.

use murmuration_model::study_records::{StudyRecord, StudyRecordKind};
use murmuration_store::{DataDirectory, Store};
use murmuration_tests::Murmuration;
use serde_json::Value;
use std::{collections::BTreeMap, fs, path::PathBuf};

/// A study of two searches with 60 evaluations each, over swarms of six robots, beside an atlas of 45 controllers.
const STUDY: &str = "name = \"found\"\nmeasures = [\"recall\", \"richness\"]\n\
    axes = [{ name = \"method\", values = [{ name = \"random\", campaign.method = \"random\" }, \
    { name = \"hand-crafted\", campaign.method = \"hand-crafted\" }] }]\n\
    [recall]\nat = [20, 60]\nniches = 12\n\
    [recall.atlas]\nmethod = \"exhaustive\"\ncontrollers.step = 1.0\nmodel = \"single-sensor\"\n\
    world = { horizon = 200, agents = 6 }\n\
    [campaign]\nmodel = \"single-sensor\"\nevaluation.judge = true\nworld = { horizon = 200, agents = 6 }\n\
    search = { population = 20, generations = 3 }\ntaxonomy.medoids = 4\n";

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

fn number(row: &BTreeMap<String, String>, column: &str) -> f64 {
    row[column].parse().unwrap()
}

fn run(murmuration: &Murmuration, file: &str) -> Value {
    murmuration
        .run(&["lab", "study", "run", file, "--json"])
        .last_line()
}

fn campaigns(murmuration: &Murmuration) -> usize {
    murmuration.run(&["list", "--json"]).lines().len()
}

#[test]
fn recall_is_measured_by_an_atlas_that_the_study_runs_or_finds() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::over(&folder.path().join("data"));
    // The test runs the atlas's campaign directly, under another name.
    let (_, atlas) = STUDY.split_once("[recall.atlas]\n").unwrap();
    let (atlas, _) = atlas.split_once("[campaign]").unwrap();
    let spec = folder.path().join("atlas.toml");
    fs::write(&spec, format!("name = \"by-hand\"\n{atlas}")).unwrap();
    assert_eq!(
        murmuration.run(&["run", &spec.display().to_string()]).code,
        Some(0)
    );

    let file = folder.path().join("study.toml");
    fs::write(&file, STUDY).unwrap();
    let file = file.display().to_string();
    let study = run(&murmuration, &file);
    assert_eq!(campaigns(&murmuration), 3, "the atlas is found again");

    let page = PathBuf::from(study["report"].as_str().unwrap());
    let niches = rows(page.with_file_name("niches.csv"));
    assert_eq!(niches.len(), 12);
    // The atlas has 81 controllers: 45 simulated controllers, and 36 mirror images that differ from their controllers.
    let members: f64 = niches.iter().map(|niche| number(niche, "members")).sum();
    assert_eq!(members, 81.0);

    let recall = rows(page.with_file_name("recall.csv"));
    assert_eq!(recall.len(), 2 * 2, "two campaigns at two numbers of evaluations");
    for stages in recall.chunks(2) {
        let [early, late] = [0, 1].map(|place| number(&stages[place], "niches_reached"));
        assert!(0.0 < early && early <= late && late <= 100.0, "{early} {late}");
        // The table shows the last number of evaluations.
        let table = study["tables"][0]["rows"].as_array().unwrap();
        let row = table
            .iter()
            .find(|row| row["values"]["method"] == stages[1]["method"].as_str());
        assert_eq!(row.unwrap()["figures"]["niches_reached"]["mean"], late);
    }
    let richness = rows(page.with_file_name("richness.csv"));
    assert!(
        richness.iter().all(|row| row["method"] == "random"),
        "the others' draws depend on each other"
    );
    assert_eq!(richness.len(), 2 * 2);
    for row in &richness {
        let [seen, chao1, low, high] = ["seen", "chao1", "low", "high"].map(|column| number(row, column));
        assert!(seen <= chao1 && seen <= low && low <= high, "{row:?}");
    }
    let of_niches = richness
        .iter()
        .find(|row| row["evaluations"] == "60" && row["of"] == "niches");
    let reached = number(&recall[1], "niches_reached") / 100.0 * 12.0;
    assert_eq!(number(of_niches.unwrap(), "seen"), reached.round());

    // A repeated run changes nothing, and the tables need no coordinator.
    assert_eq!(run(&murmuration, &file)["tables"], study["tables"]);
    assert_eq!(campaigns(&murmuration), 3);
    let shown = murmuration
        .run(&["lab", "study", "show", "found", "--json"])
        .last_line();
    assert_eq!(shown["tables"], study["tables"]);

    // The program makes a damaged record of the atlas's content again, although every cell is measured.
    let open = || Store::open(&DataDirectory::hold(&folder.path().join("data")).unwrap()).unwrap();
    let reference = |store: &Store| {
        let mut records = store.study_records("found").unwrap().into_iter();
        records
            .find(|record| record.kind == StudyRecordKind::Reference)
            .unwrap()
    };
    let intact = reference(&open());
    let damaged = StudyRecord {
        content: b"{".to_vec(),
        ..intact.clone()
    };
    let name = "found".to_owned().try_into().unwrap();
    open().keep_study(&name, None, &[damaged]).unwrap();
    assert_eq!(run(&murmuration, &file)["tables"], study["tables"]);
    assert_eq!(reference(&open()), intact);
    assert_eq!(campaigns(&murmuration), 3);
}

#[test]
fn a_cell_that_equals_the_atlas_is_its_campaign() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::over(&folder.path().join("data"));
    let (_, campaign) = STUDY.split_once("[campaign]\n").unwrap();
    let campaign = format!("method = \"random\"\n{campaign}");
    let file = folder.path().join("study.toml");
    let text = format!(
        "name = \"same\"\nmeasures = [\"recall\"]\n[recall]\nat = [60]\nniches = 12\n[recall.atlas]\nseed = 1\n{campaign}\
         [campaign]\n{campaign}"
    );
    fs::write(&file, text).unwrap();
    let study = run(&murmuration, &file.display().to_string());
    assert_eq!(campaigns(&murmuration), 1);
    // The campaign is the atlas, so it finds everything.
    let figures = &study["tables"][0]["rows"][0]["figures"];
    assert_eq!(figures["niches_reached"]["mean"], 100.0);
}

#[test]
fn maps_show_the_first_generation() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::over(&folder.path().join("data"));
    let (_, campaign) = STUDY.split_once("[campaign]\n").unwrap();
    let file = folder.path().join("maps.toml");
    let text = format!(
        "name = \"mapped\"\nmeasures = [\"maps\"]\n[campaign]\nmethod = \"hand-crafted\"\n{campaign}"
    );
    fs::write(&file, text).unwrap();
    let study = run(&murmuration, &file.display().to_string());
    let page = PathBuf::from(study["report"].as_str().unwrap());
    let mapped = rows(page.with_file_name("maps.csv"));
    let indices: Vec<u64> = mapped.iter().map(|row| row["index"].parse().unwrap()).collect();
    assert_eq!(indices, (0..20).collect::<Vec<u64>>());
    let maps = page.with_file_name("maps");
    let svg = fs::read_to_string(maps.join("1-mapped-behaviours.svg")).unwrap();
    // The legend's dots have a wider stroke (12) than the map's, so the count leaves them out.
    let paths = svg
        .split("<path ")
        .filter(|path| !path.contains("stroke-width=\"12\""));
    let points: usize = paths.map(|path| path.matches("h0").count()).sum();
    assert_eq!(points, 20, "a point for each");
    for file in ["1-mapped-behaviours.png", "1-mapped-controllers.png"] {
        assert!(
            fs::read(maps.join(file)).unwrap().starts_with(b"\x89PNG"),
            "{file}"
        );
    }
    let scores = fs::read_to_string(maps.join("1-mapped-scores.svg")).unwrap();
    assert!(scores.contains("cutoff of the filter"));
}

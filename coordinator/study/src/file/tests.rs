//! Study files, good and bad.

use crate::{Figure, Measure, RandomBatches, Study, cell_digest};
use murmuration_proto::Method;
use std::{collections::BTreeSet, num::NonZeroU32, path::Path};

const GOOD: &str = r#"
name = "s"
seeds = 3
measures = ["search", "behaviours"]

[campaign]
model = "single-sensor"
method = "latent"
search = { population = 20, generations = 5 }

[[axes]]
name = "method"
[[axes.values]]
name = "latent + filter"
campaign = { filter = true, dataset.controllers = 50 }
quick = { dataset.controllers = 10 }
[[axes.values]]
name = "hand-crafted"
campaign = { method = "hand-crafted" }

[[axes]]
name = "robots"
values = [{ name = "few", campaign.world.agents = 6 }, { name = "many" }]

[[published]]
source = "somebody"
where = { method = "hand-crafted" }
figures = { distinct = 5.5, milling = 2 }

[quick]
seeds = [7]
campaign = { search.generations = 2 }
"#;

fn read(text: &str, quick: bool) -> Result<Study, String> {
    Study::from_toml(text, Path::new("/folder"), quick).map_err(|error| error.to_string())
}

/// Replaces a part of the good file, and says what is wrong with it.
#[track_caller]
fn check(part: &str, by: &str, said: &str) {
    assert!(GOOD.contains(part), "{part}");
    let error = read(&GOOD.replacen(part, by, 1), false).unwrap_err();
    assert!(error.contains(said), "{error:?} does not say {said:?}");
}

#[test]
fn cells_are_the_product_of_values_and_seeds() {
    let study = read(GOOD, false).unwrap();
    assert_eq!(study.cells().len(), 2 * 2 * 3);
    assert_eq!(study.rows(), [[0, 0], [0, 1], [1, 0], [1, 1]]);
    let words: Vec<String> = study
        .cells()
        .iter()
        .map(|cell| study.cell_in_words(cell))
        .collect();
    assert_eq!(words[0], "latent + filter · few · seed 1");
    assert_eq!(words[11], "hand-crafted · many · seed 3");
    let different: BTreeSet<String> = study.cells().iter().map(|cell| cell_digest(&cell.spec)).collect();
    assert_eq!(different.len(), 12);
    let first = &study.cells()[0].spec;
    assert_eq!(
        (first.filter(), first.world().agents(), first.seed()),
        (true, 6, 1)
    );
    let last = &study.cells()[11].spec;
    assert_eq!(
        (last.method(), last.filter(), last.world().agents(), last.seed()),
        (Method::HandCrafted, false, 24, 3)
    );
    assert_eq!(last.search().generations(), 5);
}

#[test]
fn quick_lays_its_fields_over_all_others() {
    let study = read(GOOD, true).unwrap();
    assert_eq!(
        (study.name().as_str(), study.seeds()),
        ("s-quick", [7].as_slice())
    );
    let spec = v1_of(&study, 0);
    assert_eq!(spec.dataset.unwrap().controllers, Some(10));
    assert_eq!(spec.search.unwrap().generations, Some(2));
    let long = v1_of(&read(GOOD, false).unwrap(), 0);
    assert_eq!(long.dataset.unwrap().controllers, Some(50));
    let error = read(&GOOD[..GOOD.find("[quick]").unwrap()], true).unwrap_err();
    assert!(error.contains("quick = nothing"), "{error}");
}

fn v1_of(study: &Study, cell: usize) -> murmuration_proto::v1::CampaignSpec {
    (&study.cells()[cell].spec).into()
}

#[test]
fn measures_and_published_figures_are_read() {
    let study = read(GOOD, false).unwrap();
    assert_eq!(study.measures().which, [Measure::Behaviours, Measure::Search]);
    assert_eq!(study.measures().generations, NonZeroU32::new(10).unwrap());
    assert_eq!(study.measures().random, RandomBatches::Samples);
    assert_eq!(
        study.published(&[1, 0], Figure::Distinct),
        Some((5.5, "somebody"))
    );
    assert_eq!(study.published(&[0, 0], Figure::Distinct), None);
    assert_eq!(study.published(&[1, 0], Figure::Loss), None);
    let files = "measures = [\"accuracy\"]\n[accuracy]\nsingle-sensor = [\"../a.csv\"]";
    let study = read(
        &GOOD.replace("measures = [\"search\", \"behaviours\"]", files),
        false,
    )
    .unwrap();
    assert_eq!(
        study.measures().labelled["single-sensor"],
        [Path::new("/folder/../a.csv")]
    );
}

#[test]
fn embedders_are_those_of_the_first_trials() {
    let study = read(
        &GOOD.replace("seeds = 3", "seeds = [4, 5, 6]\nembedders = 2"),
        false,
    )
    .unwrap();
    let seeds: Vec<Option<u64>> = (0..3).map(|replicate| study.embedder_seed(replicate)).collect();
    assert_eq!(seeds, [Some(4), Some(5), Some(4)]);
    let trained: BTreeSet<String> = study
        .cells()
        .iter()
        .filter_map(|cell| study.embedder_of(cell).unwrap())
        .map(|spec| cell_digest(&spec))
        .collect();
    assert_eq!(trained.len(), 2 * 2, "two seeds in two worlds");
}

#[test]
fn a_bad_file_is_told_where_and_what_is_allowed() {
    check(
        "seeds = 3",
        "seeds = 0",
        "seeds = 0: must be a number of replicates, 1 to 1000",
    );
    check("seeds = 3", "seeds = [1, 1]", "or a list of different seeds");
    check("seeds = 3", "seeds = \"many\"", "line 3, column 9");
    check("seeds = 3", "seed = 3", "unknown field `seed`");
    check(
        "seeds = 3",
        "seeds = 3\nembedders = 4",
        "embedders = 4: must be 1 to 3",
    );
    check(
        "\"search\", ",
        "\"speed\", ",
        "measures = \"speed\": must be some of behaviours, accuracy, search",
    );
    check("\"search\", ", "\"accuracy\", ", "accuracy = nothing");
    check("name = \"s\"", "name = \"a b\"", "name = \"a b\"");
    check(
        "name = \"robots\"",
        "name = \"seed\"",
        "not the name of another column",
    );
    check(
        "name = \"robots\"",
        "name = \"milling\"",
        "not the name of another column",
    );
    check("name = \"robots\"", "name = \"method\"", "there once");
    check(
        "name = \"many\"",
        "name = \"few\"",
        "there once on the axis robots",
    );
    check(
        "figures = { distinct",
        "figures = { distnct",
        "must be one of distinct, cyclic_pursuit",
    );
    check("where = { method", "where = { way", "by the axes method, robots");
    check(
        "where = { method = \"hand-crafted\"",
        "where = { method = \"crafted\"",
        "published.where.method",
    );
}

#[test]
fn a_cell_that_is_no_campaign_is_named_with_its_field() {
    check(
        "population = 20",
        "population = 0",
        "the campaign with method = latent + filter, robots = few, seed = 1: search.population = 0",
    );
    check(
        "world.agents = 6",
        "world.agnets = 6",
        "unknown field `agnets` in [world]: did you mean `agents`?",
    );
    check(
        "campaign = { method = \"hand-crafted\" }",
        "campaign = { method = \"hand-crafted\", dataset.controllers = 50 }",
        "the campaign with method = hand-crafted, robots = few, seed = 1: dataset",
    );
    check(
        "model = \"single-sensor\"",
        "model = \"single-sensor\"\nseed = 4",
        "seed = given: must be absent: the study's `seeds` say it",
    );
    check(
        "model = \"single-sensor\"",
        "model = \"single-sensor\"\nname = \"x\"",
        "campaigns are named after their study",
    );
}

#[test]
fn a_grid_has_a_limit() {
    let values: Vec<String> = (0..11).map(|value| format!("{{ name = \"{value}\" }}")).collect();
    let text = format!(
        "name = \"s\"\nseeds = 1000\naxes = [{{ name = \"a\", values = [{}] }}]\n[campaign]\nmodel = \"single-sensor\"\n\
         method = \"random\"",
        values.join(", ")
    );
    let error = read(&text, false).unwrap_err();
    assert!(
        error.contains("the number of cells = 11000: must be at most 2000"),
        "{error}"
    );
}

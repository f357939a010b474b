//! Tests of valid and invalid study files.

mod recall;

use super::{axis_name, lay_over};
use crate::{
    Corrections, Figure, Measure, Outcome, RandomBatches, Study, cell_digest, map_files, recall_curve,
    written,
};
use murmuration_swarm::Method;
use std::{
    collections::BTreeSet,
    io::{self, Write},
    num::NonZeroU32,
    path::Path,
};
use toml::Table;

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

/// Replaces a part of the good file, and checks the error.
#[track_caller]
fn check(part: &str, by: &str, expected: &str) {
    assert!(GOOD.contains(part), "{part}");
    let error = read(&GOOD.replacen(part, by, 1), false).unwrap_err();
    assert!(error.contains(expected), "{error:?} does not say {expected:?}");
}

#[test]
fn cells_are_the_product_of_values_and_seeds() {
    let study = read(GOOD, false).unwrap();
    assert_eq!(study.cells.len(), 2 * 2 * 3);
    assert_eq!(study.rows(), [[0, 0], [0, 1], [1, 0], [1, 1]]);
    let words: Vec<String> = study.cells.iter().map(|cell| study.cell_in_words(cell)).collect();
    assert_eq!(words[0], "latent + filter · few · seed 1");
    assert_eq!(words[11], "hand-crafted · many · seed 3");
    let different: BTreeSet<String> = study.cells.iter().map(|cell| cell_digest(&cell.spec)).collect();
    assert_eq!(different.len(), 12);
    let first = &study.cells[0].spec;
    assert_eq!(
        (first.filter(), first.world().agents(), first.seed()),
        (true, 6, 1)
    );
    let last = &study.cells[11].spec;
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
        (study.name.as_str(), study.seeds.as_slice()),
        ("s-quick", [7].as_slice())
    );
    let spec = v1_of(&study, 0);
    assert_eq!(spec.dataset.unwrap().controllers, Some(10));
    assert_eq!(spec.search.unwrap().generations, Some(2));
    let long = v1_of(&read(GOOD, false).unwrap(), 0);
    assert_eq!(long.dataset.unwrap().controllers, Some(50));
    let error = read(&GOOD[..GOOD.find("[quick]").unwrap()], true).unwrap_err();
    assert!(error.contains("[quick] is missing"), "{error}");
}

fn v1_of(study: &Study, cell: usize) -> murmuration_proto::v1::CampaignSpec {
    (&study.cells[cell].spec).into()
}

#[test]
fn measures_and_published_figures_are_read() {
    let study = read(GOOD, false).unwrap();
    assert_eq!(study.measures.which, [Measure::Behaviours, Measure::Search]);
    assert_eq!(study.measures.generations, NonZeroU32::new(10).unwrap());
    assert_eq!(study.measures.random, RandomBatches::Samples);
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
        study.measures.labelled["single-sensor"],
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
        .cells
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
        "measures = \"speed\": must be some of behaviours, shares, accuracy, search",
    );
    check("\"search\", ", "\"accuracy\", ", "accuracy is missing");
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
        "must be one of distinct, distinct_by_second_judge, distinct_by_both_judges, cyclic_pursuit",
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
        "seed = given: must be absent: the study's `seeds` define it",
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

#[test]
fn shares_are_counted_of_cells_that_judge_alone() {
    let shares = GOOD.replacen(r#"["search", "behaviours"]"#, r#"["shares"]"#, 1);
    let error = read(&shares, false).unwrap_err();
    assert!(
        error.starts_with(
            "the campaign with method = latent + filter, robots = few, seed = 1: evaluation.judge"
        ),
        "{error}"
    );
    let judged = shares.replacen(
        "method = \"latent\"\n",
        "method = \"latent\"\nevaluation.judge = true\n",
        1,
    );
    assert_eq!(read(&judged, false).unwrap().measures.which, [Measure::Shares]);
}

const PHASE: &str = r#"
name = "p"
measures = ["shares"]
phase = { x = "robots", y = "noise" }

[campaign]
model = "single-sensor"
method = "random"
evaluation.judge = true

[[axes]]
name = "robots"
field = "world.agents"
numbers = [6, 12]

[[axes]]
name = "noise"
field = "world.noise.slip"
numbers = { from = 0, to = 0.4, count = 3 }

[[axes]]
name = "filter"
values = [{ name = "no" }]
"#;

#[test]
fn axes_of_numbers_set_their_fields_and_phase_diagrams_lie_over_them() {
    let study = read(PHASE, false).unwrap();
    let world = study.cells[5].spec.world();
    assert_eq!((study.cells.len(), world.agents()), (6, 12));
    assert_eq!(study.cell_in_words(&study.cells[5]), "12 · 0.4 · no · seed 1");
    assert_eq!(study.axes[1].numbers, [0.0, 0.2, 0.4]);
    let phase = study.phase.unwrap();
    assert_eq!((phase.x, phase.y), (0, Some(1)));
}

#[test]
fn the_example_lays_phase_diagrams_over_campaigns_with_taxonomies() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../studies/phase-taxonomy.toml");
    let text = std::fs::read_to_string(file).unwrap();
    for (quick, cells, individuals) in [(false, 12, 1000), (true, 4, 100)] {
        let study = read(&text, quick).unwrap();
        assert_eq!(study.cells.len(), cells);
        let phase = study.phase.unwrap();
        assert_eq!((phase.x, phase.y), (0, Some(1)));
        let is_search = |cell: &crate::Cell| {
            cell.spec.evaluations() == individuals && cell.spec.medoids() == 12 && cell.spec.judges()
        };
        assert!(study.cells.iter().all(is_search));
    }
}

#[test]
fn a_phase_diagram_without_numbers_or_shares_is_refused() {
    let refused = |part: &str, by: &str| read(&PHASE.replacen(part, by, 1), false).unwrap_err();
    assert!(refused("y = \"noise\"", "y = \"filter\"").starts_with("phase.y = \"filter\""));
    assert!(refused("y = \"noise\"", "y = \"robots\"").contains("another axis than phase.x"));
    assert!(refused("[\"shares\"]", "[\"behaviours\"]").starts_with("phase"));
    let cell = refused("numbers = [6, 12]", "numbers = [6, 12.5]");
    assert!(cell.contains("robots = 12.5") || cell.contains("12.5"), "{cell}");
}

#[test]
fn axes_that_set_one_field_and_names_like_formulas_are_refused() {
    let refused = |part: &str, by: &str| read(&PHASE.replacen(part, by, 1), false).unwrap_err();
    for field in ["world.agents", "world.agents.more", "world"] {
        let error = refused("field = \"world.noise.slip\"", &format!("field = \"{field}\""));
        assert!(
            error.contains("the axis robots does not set too"),
            "{field}: {error}"
        );
    }
    let error = refused("{ name = \"no\" }", "{ name = \"=1+1\" }");
    assert!(error.contains("no spreadsheet takes for a formula"), "{error}");
}

#[test]
fn quick_has_its_own_numbers() {
    let text = PHASE.replacen("numbers = [6, 12]", "numbers = [6, 12, 24]\nquick = [6, 24]", 1);
    let text = format!("{text}\n[quick]\nseeds = 1");
    let values = |quick| read(&text, quick).unwrap().axes[0].values.clone();
    assert_eq!((values(true).len(), values(false).len()), (2, 3));
    assert_eq!(values(true), ["6", "24"]);
}

#[test]
fn an_axis_of_numbers_says_its_field_once_and_has_no_values() {
    let refused = |by: &str, expected: &str| {
        let numbers = "field = \"world.agents\"\nnumbers = [6, 12]";
        assert!(PHASE.contains(numbers));
        let error = read(&PHASE.replacen(numbers, by, 1), false).unwrap_err();
        assert!(error.contains(expected), "{error:?} does not say {expected:?}");
    };
    refused("field = \"world.agents\"", "axes.numbers of robots");
    refused("numbers = [1]", "axes.field of robots");
    refused("quick = [1]", "axes.numbers of robots");
    refused(
        "field = \"a\"\nnumbers = [1]\nvalues = [{ name = \"b\" }]",
        "axes.values of robots",
    );
}

#[test]
fn no_axis_has_the_name_of_a_column_of_a_table() {
    let text = r#"
name = "s"
measures = ["behaviours", "shares", "search", "recall", "richness", "maps"]
recall = { atlas = { model = "single-sensor", method = "exhaustive" }, at = [10] }
axes = [{ name = "only-axis", values = [{ name = "one" }] }]
[campaign]
model = "single-sensor"
method = "random"
evaluation.judge = true
"#;
    let outcome = Outcome::new(read(text, false).unwrap(), Vec::new(), Corrections::default());
    type Writer = fn(&Outcome, &mut dyn Write) -> io::Result<()>;
    let tables: [Writer; 5] = [
        written::cells,
        written::medoids,
        recall_curve::recall_csv,
        recall_curve::richness_csv,
        map_files::csv,
    ];
    for table in tables {
        let mut written = Vec::new();
        table(&outcome, &mut written).unwrap();
        let mut table = csv::Reader::from_reader(written.as_slice());
        let columns = table.headers().unwrap();
        let different: BTreeSet<&str> = columns.iter().collect();
        assert_eq!(different.len(), columns.len(), "{columns:?}");
        for column in columns.iter().filter(|column| *column != "only-axis") {
            assert!(axis_name(column).is_err(), "an axis may be called {column}");
        }
    }
}

#[test]
fn tables_are_joined_and_other_values_replaced() {
    let table = |text: &str| text.parse::<Table>().unwrap();
    let mut base = table("a = 1\nb = [1, 2]\n[c]\nd = 1\ne = 2\n[c.f]\ng = 1");
    lay_over(&mut base, &table("b = [3]\n[c]\nd = 4\n[c.f]\nh = 5\n[i]\nj = 6"));
    let expected = "a = 1\nb = [3]\n[c]\nd = 4\ne = 2\n[c.f]\ng = 1\nh = 5\n[i]\nj = 6";
    assert_eq!(base, table(expected));
}

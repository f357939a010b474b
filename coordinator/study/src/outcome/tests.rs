//! Tables, compared with figures computed by hand.

use super::*;
use crate::{corrections::Corrections, report::write_report, sample};
use murmuration_files::Folder;
use std::collections::BTreeMap;

const MILLING: &str = "milling";
const RANDOM: &str = "random";

/// An outcome whose first row is complete, and whose second row lacks a replicate.
fn outcome(corrections: Corrections) -> Outcome {
    let study = sample::study();
    let measured = vec![
        Some(sample::measured(
            &study,
            0,
            &[&[MILLING, RANDOM], &[MILLING, MILLING]],
        )),
        Some(sample::measured(
            &study,
            1,
            &[&[RANDOM, "dispersal"], &[MILLING, RANDOM]],
        )),
        Some(sample::measured(&study, 2, &[&[RANDOM, RANDOM]])),
        None,
    ];
    Outcome::new(study, measured, corrections)
}

fn entry(outcome: &Outcome, table: usize, row: usize, figure: Figure) -> Entry {
    outcome.tables()[table].rows[row].entries[&figure].clone()
}

#[test]
fn figures_are_means_and_deviations_over_trials() {
    let outcome = outcome(Corrections::default());
    // Replicate 1 has 2 and 1 distinct classes, replicate 2 has 2 and 2.
    let distinct = entry(&outcome, 0, 0, Figure::Distinct);
    assert_eq!((distinct.count, distinct.mean), (2, 1.75));
    assert_eq!(distinct.deviation, Some((2.0 * 0.25 * 0.25_f64).sqrt()));
    assert_eq!(distinct.published, Some(3.5));
    assert_eq!(entry(&outcome, 0, 0, Figure::DistinctBySecond).mean, 1.75);
    assert_eq!(entry(&outcome, 0, 0, Figure::DistinctByBoth).mean, 1.75);
    // The taxonomies of replicate 1 have 1.5 milling medoids on average, the taxonomies of replicate 2 have 0.5.
    assert_eq!(entry(&outcome, 0, 0, Figure::Class(Class::Milling)).mean, 1.0);
    let alone = entry(&outcome, 0, 1, Figure::Distinct);
    assert_eq!(
        (alone.count, alone.mean, alone.deviation, alone.published),
        (1, 1.0, None, None)
    );
    assert_eq!(entry(&outcome, 2, 0, Figure::Loss).mean, 0.5);
}

#[test]
fn an_embedding_that_cells_share_counts_once() {
    let accuracy = entry(&outcome(Corrections::default()), 1, 0, Figure::Accuracy);
    assert_eq!(
        (accuracy.count, accuracy.mean, accuracy.deviation),
        (1, 83.25, None)
    );
}

#[test]
fn resampled_figures_are_reproducible_and_around_what_people_would_say() {
    let outcome = outcome(Corrections::default());
    let first = entry(&outcome, 0, 0, Figure::Class(Class::Milling))
        .resampled
        .unwrap();
    assert_eq!(
        Some(first),
        entry(&outcome, 0, 0, Figure::Class(Class::Milling)).resampled
    );
    assert!(first.low < first.mean && first.mean < first.high, "{first:?}");
    // Every medoid has a class in each resampling.
    let resampled = |class| {
        entry(&outcome, 0, 0, Figure::Class(class))
            .resampled
            .unwrap()
            .mean
    };
    let all: f64 = Class::ALL.into_iter().map(resampled).sum();
    assert!((all - 2.0).abs() < 1e-9, "{all}");
}

#[test]
fn what_a_person_said_replaces_the_judge_and_has_no_errors() {
    let study = sample::study();
    let cells: Vec<String> = study
        .cells
        .iter()
        .map(|cell| crate::cell_digest(&cell.spec))
        .collect();
    let mut text = "cell,index,class,by\n".to_owned();
    for cell in &cells[..2] {
        for index in 0..4 {
            text += &format!("{cell},{index},aggregation,ana\n");
        }
    }
    // The judge's own classes, as in medoids.csv, are not corrections.
    text += &format!("{},0,random,judge\n{},1,milling,judge\n", cells[2], cells[2]);
    let outcome = outcome(Corrections::parse(&text).unwrap());
    let distinct = entry(&outcome, 0, 0, Figure::Distinct);
    assert_eq!((distinct.mean, distinct.deviation), (1.0, Some(0.0)));
    let resampled = distinct.resampled.unwrap();
    assert_eq!((resampled.mean, resampled.low, resampled.high), (1.0, 1.0, 1.0));
    // The second judge's classes remain, and none of them is aggregation.
    assert_eq!(entry(&outcome, 0, 0, Figure::DistinctBySecond).mean, 1.75);
    assert_eq!(entry(&outcome, 0, 0, Figure::DistinctByBoth).mean, 0.0);
    assert_eq!(entry(&outcome, 0, 1, Figure::Distinct).mean, 2.0);
    let named: Vec<(String, usize)> = outcome.named_by().into_iter().collect();
    assert_eq!(
        named,
        [("a person", 1), ("ana", 8), ("judge", 1)].map(|(by, count)| (by.to_owned(), count))
    );
}

#[test]
fn what_people_say_on_a_page_is_kept_as_a_table_and_can_be_taken_back() {
    let study = sample::study();
    let cell = crate::cell_digest(&study.cells[0].spec);
    let mut given = Corrections::default();
    given
        .set(&cell, 0, Some(Class::Dispersal), " ana, of \"us\" ")
        .unwrap();
    given.set(&cell, 1, Some(Class::Dispersal), "ben").unwrap();
    given.set(&cell, 1, Some(Class::Aggregation), "cy").unwrap();
    given.set(&cell, 2, Some(Class::Milling), "ana").unwrap();
    given.set(&cell, 2, None, "ben").unwrap();
    given.set(&cell, 3, Some(Class::Milling), "=1+1").unwrap();
    assert!(
        given.to_csv().contains(",milling,'=1+1\n"),
        "a spreadsheet would compute it: {}",
        given.to_csv()
    );
    assert_eq!(Corrections::parse(&given.to_csv()).unwrap(), given);
    given.set(&cell, 3, None, "ana").unwrap();
    let outcome = outcome(given.clone());
    let measured = outcome.cells().next().unwrap().measured;
    assert_eq!(
        outcome.class_of(measured, 0),
        (Class::Dispersal, "ana, of \"us\"")
    );
    assert_eq!(outcome.class_of(measured, 1), (Class::Aggregation, "cy"));
    assert_eq!(outcome.class_of(measured, 2).1, "judge");
    let page = crate::tables_and_plots(&outcome).into_string();
    assert!(
        page.contains("Judged by: the rule-based judge; 1 of 10 medoids by ana"),
        "{page}"
    );
    for name in [
        "",
        " ",
        "Judge",
        "synthetic",
        "\u{200b}",
        "a\u{202e}b",
        "a\nb",
        &"x".repeat(65),
    ] {
        assert!(
            given.set(&cell, 0, Some(Class::Milling), name).is_err(),
            "{name:?}"
        );
    }
    // A file named on the command line takes precedence.
    let file = Corrections::parse(&format!("cell,index,class,by\n{cell},1,milling,dee\n")).unwrap();
    let both = file.or(given);
    assert_eq!(both.of(measured, 1), Some((Class::Milling, "dee")));
    assert_eq!(both.of(measured, 0).unwrap().0, Class::Dispersal);
}

#[test]
fn a_bad_file_of_classes_names_the_line() {
    let refused = |text: &str| Corrections::parse(text).unwrap_err().to_string();
    assert_eq!(refused("cell,index\n"), "line 1: there is no column \"class\"");
    assert!(
        refused("cell,index,class\nx,1,ring\n")
            .starts_with("line 2: class = \"ring\": must be one of cyclic_pursuit")
    );
    assert!(refused("cell,index,class\nx,one,milling\n").starts_with("line 2: index = \"one\""));
    let twice = refused("cell,index,class\nx,1,milling\nx,1,milling\nx,1,random\n");
    assert_eq!(
        twice,
        "line 4: individual 1 has the class random here, but milling in an earlier row: give it one class in all rows"
    );
    assert_eq!(
        Corrections::parse("cell,index,class\nx,1,\n").unwrap(),
        Corrections::default()
    );
}

#[test]
fn every_table_follows_from_the_files_of_the_report() {
    let outcome = outcome(Corrections::default());
    let folder = tempfile::tempdir().unwrap();
    let mut former = Folder::create(folder.path(), murmuration_files::Replaces::Unchanged).unwrap();
    former.text("maps/1-x-scores.svg", "of another study").unwrap();
    former.finish().unwrap();
    std::fs::write(folder.path().join("recall.csv"), "mine").unwrap();
    let page = write_report(
        &outcome,
        Folder::create(folder.path(), murmuration_files::Replaces::Unchanged).unwrap(),
    )
    .unwrap();
    assert!(!folder.path().join("maps").exists());
    assert!(folder.path().join("recall.csv").is_file());
    let mut distinct: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    let mut cells = csv::Reader::from_path(folder.path().join("cells.csv")).unwrap();
    for row in cells.deserialize::<BTreeMap<String, String>>() {
        let row = row.unwrap();
        let value = row["distinct"].parse().unwrap();
        distinct.entry(row["filter"].clone()).or_default().push(value);
    }
    assert_eq!(distinct["no"], [1.5, 2.0]);
    assert_eq!(distinct["yes"], [1.0]);
    let mut medoids = csv::Reader::from_path(folder.path().join("medoids.csv")).unwrap();
    let rows: Vec<BTreeMap<String, String>> = medoids.deserialize().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 4 + 4 + 2);
    let milling = rows
        .iter()
        .filter(|row| row["class"] == MILLING && row["seed"] == "1");
    // A replicate has two taxonomies.
    assert_eq!(milling.count() as f64 / 2.0, 1.5);
    let page = std::fs::read_to_string(&page).unwrap();
    for expected in [
        "3 of 4 campaigns measured so far",
        "published 3.5",
        "Published figures: them.",
    ] {
        assert!(page.contains(expected), "{expected}");
    }
    assert_eq!(page.matches("<img").count(), 2 + 2 + 2);
    assert!(!page.contains("://"), "it loads nothing");
}

#[test]
fn other_classes_come_to_the_same_as_if_all_were_computed_again() {
    let before = outcome(Corrections::default());
    let cell = before.cells().next().unwrap().measured.cell.clone();
    let mut classes = Corrections::default();
    classes.set(&cell, 0, Some(Class::Dispersal), "ann").unwrap();
    assert_eq!(before.tables().len(), 3);
    let after = before.with_corrections(classes.clone());
    assert_eq!(after.tables(), outcome(classes).tables());
    assert_ne!(after.tables()[0], before.tables()[0]);
}

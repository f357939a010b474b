//! The tables of a report.

use super::*;
use crate::TrialEntry;

#[test]
fn tables_hold_every_number_exactly() {
    let report = sample::report(&SMALL);
    let (_place, files) = written(&report);
    let table = |name: &str| -> Vec<Vec<String>> {
        let text = fs::read_to_string(files.page.with_file_name(name)).unwrap();
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .from_reader(text.as_bytes());
        reader
            .records()
            .map(|record| record.unwrap().iter().map(str::to_owned).collect())
            .collect()
    };
    let archive = table("archive.csv");
    assert_eq!(archive.len(), 1 + report.individuals.len());
    assert_eq!(archive[0][13..].join(","), "left_0,right_0,left_1,right_1,class");
    for (index, (row, entry)) in archive[1..].iter().zip(&report.individuals).enumerate() {
        let expected = [index as f64, f64::from(report.clusters[index] + 1)]
            .into_iter()
            .chain(report.map.points[index])
            .chain([
                f64::from(entry.generation),
                entry.seed as f64,
                entry.novelty_when_evaluated,
            ])
            .chain(entry.features)
            .chain(entry.controller.genes().iter().copied());
        let numbers = row[..row.len() - 1].iter().enumerate();
        assert_eq!(
            numbers
                .filter(|(column, _)| *column != 7)
                .map(|(_, cell)| cell.parse().unwrap())
                .collect::<Vec<f64>>(),
            expected.collect::<Vec<_>>()
        );
        assert_eq!(row[7], "", "robustness of one trial");
        let named = [0, 5, 7].contains(&index);
        assert_eq!(row.last().unwrap(), if named { "ring, or \"mill\"" } else { "" });
    }
    let taxonomy = table("taxonomy.csv");
    assert_eq!(taxonomy.len(), 4);
    assert_eq!(
        taxonomy[2][3].parse::<f64>().unwrap(),
        report.medoids[1].mean_distance
    );
    assert_eq!(taxonomy[2][5].parse::<f64>().unwrap(), report.medoids[1].novelty);
    assert_eq!(taxonomy[2][9].parse::<u64>().unwrap(), report.individuals[1].seed);
    assert_eq!(taxonomy[1].last().unwrap(), "ring, or \"mill\"");
    assert_eq!(
        table("classes.csv")[1..],
        [
            ["ring, or \"mill\"", "#1d96e6", "3", "4"],
            ["wall", "#e6861d", "0", "0"]
        ]
    );
    let generations = table("generations.csv");
    assert_eq!(generations.len(), 21);
    assert_eq!(
        generations[7][1].parse::<f64>().unwrap(),
        report.generations[6].best_novelty
    );
}

#[test]
fn robustness_and_trials_are_in_the_tables_and_on_the_page() {
    let mut report = sample::report(&Sample {
        spec: "model = \"single-sensor\"\nmethod = \"hand-crafted\"\n[taxonomy]\nmedoids = 3\n[world]\nagents = 6\n\
               horizon = 200\n[evaluation]\nstarts = 4",
        ..SMALL
    });
    for (place, entry) in report.individuals.iter_mut().enumerate() {
        entry.robustness = Some(0.25 * (place % 5) as f64);
        let trial = |seed| TrialEntry {
            seed,
            features: [seed as f64; 5],
            embedding: Vec::new(),
        };
        entry.trials = (0..4).map(trial).collect();
    }
    let (_place, files) = written(&report);
    let rows = |name: &str| -> Vec<csv::StringRecord> {
        let mut reader = csv::Reader::from_path(files.page.with_file_name(name)).unwrap();
        reader.records().map(Result::unwrap).collect()
    };
    let robustness = |row: &csv::StringRecord| -> f64 { row[7].parse().unwrap() };
    let archive = rows("archive.csv");
    let of_first: Vec<f64> = archive
        .iter()
        .filter(|row| &row[1] == "1")
        .map(robustness)
        .collect();
    let mean = of_first.iter().sum::<f64>() / of_first.len() as f64;
    assert_eq!(rows("taxonomy.csv")[0][4].parse::<f64>().unwrap(), mean);
    let trials = rows("trials.csv");
    assert_eq!(trials.len(), 4 * report.individuals.len());
    assert_eq!(trials[6].iter().take(4).collect::<Vec<_>>(), ["1", "2", "2", "2"]);
    let page = fs::read_to_string(&files.page).unwrap();
    assert!(
        page.contains("<dt>Robustness</dt><dd>0 of 4</dd>"),
        "of the first medoid"
    );
    assert!(page.contains("from 4 starts"), "no caution");
}

#[test]
fn no_name_in_a_table_is_a_formula() {
    let mut report = sample::report(&SMALL);
    let name: murmuration_model::labels::ClassName = "=HYPERLINK(1)".parse().unwrap();
    report.names.classes[0].name = name.clone();
    report.names.by_individual = [0, 5].map(|index| (index, given(&name))).into();
    let (_place, files) = written(&report);
    for name in ["archive.csv", "taxonomy.csv", "classes.csv"] {
        let text = fs::read_to_string(files.page.with_file_name(name)).unwrap();
        assert!(
            text.contains("'=HYPERLINK(1)") && !text.contains(",=") && !text.contains("\n="),
            "{text}"
        );
    }
}

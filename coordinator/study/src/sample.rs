//! A small study with measurements, for tests.

use crate::{
    AccuracyFigures, JudgedBehaviours, JudgedIndividual, Measured, MedoidsOf, SearchFigures, Study,
    cell_digest,
};
use std::path::Path;

/// A study of two rows with two replicates each.
pub(crate) fn study() -> Study {
    let text = "name = \"sample\"\nseeds = 2\nmeasures = [\"behaviours\", \"accuracy\", \"search\"]\n\
                accuracy.single-sensor = [\"a.csv\"]\n\
                axes = [{ name = \"filter\", values = [{ name = \"no\" }, { name = \"yes\", campaign.filter = true }] }]\n\
                published = [{ source = \"them\", where = { filter = \"no\" }, figures = { distinct = 3.5 } }]\n\
                [campaign]\nmodel = \"single-sensor\"\nmethod = \"hand-crafted\"\nworld.horizon = 20\nimage.window = 10";
    Study::from_toml(text, Path::new("/"), false).unwrap()
}

/// Measurements of a cell whose medoids have these classes, one list for each taxonomy. Indices begin at 0 and count through the
/// taxonomies.
pub(crate) fn measured(study: &Study, place: usize, taxonomies: &[&[&str]]) -> Measured {
    let cell = cell_digest(&study.cells[place].spec);
    let mut next = 0..;
    let mut behaviours = JudgedBehaviours {
        taxonomies: Vec::new(),
        individuals: std::collections::BTreeMap::new(),
    };
    for (generation, classes) in (0..).zip(taxonomies) {
        let medoids: Vec<u64> = next.by_ref().take(classes.len()).collect();
        for (&index, class) in medoids.iter().zip(*classes) {
            let individual = JudgedIndividual {
                seed: index,
                controller: vec![0.5, 1.0, -0.5, 0.0],
                class: (*class).to_owned(),
                pattern: String::new(),
                second_class: (*class).to_owned(),
            };
            behaviours.individuals.insert(index, individual);
        }
        behaviours.taxonomies.push(MedoidsOf { generation, medoids });
    }
    Measured {
        campaign: format!("sample-{place}"),
        archive_digest: format!("digest {place}"),
        measures: "so".to_owned(),
        checkpoint: String::new(),
        evaluations: 10_000,
        behaviours: Some(behaviours),
        shares: None,
        accuracy: Some(AccuracyFigures {
            embedding: "features".to_owned(),
            anchor_not_random: 83.25,
            every_anchor: 70.5,
        }),
        search: Some(SearchFigures {
            loss: place as f64,
            novelty: 0.5,
        }),
        recall: None,
        maps: None,
        cell,
    }
}

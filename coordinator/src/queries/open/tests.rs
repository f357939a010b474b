//! What is asked of an archive that grows and is answered about.

use super::*;
use crate::{
    campaign::{CampaignState, Weight},
    labels::{Action, Change},
    medoids::Clustering,
    store::{ArchivedIndividual, DataDirectory, GenerationRecord, Provenance},
};
use murmuration_proto::CampaignSpec;
use std::collections::BTreeSet;

/// A running campaign of generations of ten.
struct Campaign {
    _folder: tempfile::TempDir,
    store: Store,
    id: CampaignId,
    queries: Queries,
}

impl Campaign {
    fn new(generations: u32) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
        let text = "model = \"single-sensor\"\nmethod = \"hand-crafted\"\n[search]\npopulation = 10";
        let spec = CampaignSpec::from_toml(text).unwrap();
        let id = store.create_campaign(&spec, Weight::default(), 7).unwrap();
        let campaign = Self {
            _folder: folder,
            queries: Queries::new(store.clone()),
            store,
            id,
        };
        (0..generations).for_each(|generation| campaign.grow(generation));
        campaign
    }

    fn grow(&self, generation: u32) {
        let individual = |place| ArchivedIndividual {
            features: [f64::from(generation), place as f64, 0.0, 0.0, 0.0],
            ..ArchivedIndividual::still(u64::from(generation) * 10 + place, generation)
        };
        let record = GenerationRecord::of(generation, &[0.0], 0);
        let individuals: Vec<_> = (0..10).map(individual).collect();
        self.store
            .commit_generation(&self.id, &record, &individuals, &Provenance::default())
            .unwrap();
    }

    fn answer(&self, annotator: &str, index: usize, answer: &str) {
        let change = Change {
            annotator: annotator.parse().unwrap(),
            time_ms: 7,
            action: Action::Answer {
                index: index as u64,
                answer: answer.parse().unwrap(),
            },
        };
        let request = format!("{annotator}-{index}").parse().unwrap();
        self.store.add_labels(&self.id, &request, vec![change]).unwrap();
    }

    fn ask(&self, annotator: &str, strategy: Strategy, agreement: bool) -> BTreeSet<usize> {
        let wish = Wish {
            holder: Holder {
                annotator: annotator.parse().unwrap(),
                session: String::new(),
            },
            strategy,
            agreement,
            count: 1000,
            again: Vec::new(),
        };
        let asked = self.queries.next("latest", &wish, Instant::now()).unwrap();
        asked.queries.iter().map(|query| query.index).collect()
    }
}

#[test]
fn an_archive_is_ranked_anew_once_it_is_a_quarter_larger_or_the_search_has_stopped() {
    let campaign = Campaign::new(8);
    for strategy in [Strategy::Random, Strategy::Medoids] {
        assert_eq!(campaign.ask("ana", strategy, false).len(), 80);
    }
    campaign.grow(8);
    assert_eq!(campaign.ask("ana", Strategy::Random, false).len(), 80);
    campaign.grow(9);
    campaign.grow(10);
    assert_eq!(campaign.ask("ana", Strategy::Random, false).len(), 110);
    campaign.grow(11);
    campaign
        .store
        .set_state(&campaign.id, CampaignState::Paused, "")
        .unwrap();
    for strategy in [Strategy::Random, Strategy::Medoids] {
        assert_eq!(campaign.ask("ana", strategy, false).len(), 120);
    }
}

#[test]
fn clusters_are_there_while_the_archive_grows_and_are_the_taxonomys_in_the_end() {
    let campaign = Campaign::new(0);
    let clusters = || {
        let record = campaign.store.campaign("latest").unwrap();
        campaign.queries.clusters(&record).unwrap()
    };
    assert!(clusters().clustering.medoids.is_empty());
    (0..8).for_each(|generation| campaign.grow(generation));
    let first = clusters();
    assert_eq!((first.clustering.clusters.len(), first.is_taxonomy), (80, false));
    (8..10).for_each(|generation| campaign.grow(generation));
    assert!(Arc::ptr_eq(&clusters(), &first));
    // Questions by medoids begin with those that the sheet shows.
    let medoids: BTreeSet<usize> = first.clustering.medoids.iter().copied().collect();
    assert!(
        campaign
            .ask("ana", Strategy::Medoids, false)
            .is_superset(&medoids)
    );
    campaign.grow(10);
    let second = clusters();
    assert_eq!(
        (second.clustering.clusters.len(), second.is_taxonomy),
        (110, false)
    );
    let taxonomy = Clustering {
        medoids: vec![7],
        clusters: vec![0; 110],
        loss: 3.0,
    };
    campaign.store.complete(&campaign.id, &taxonomy).unwrap();
    let last = clusters();
    assert_eq!((&last.clustering, last.is_taxonomy), (&taxonomy, true));
}

#[test]
fn answers_of_any_kind_close_a_question_and_classes_open_it_for_agreement() {
    let campaign = Campaign::new(1);
    campaign.answer("ana", 3, "ring");
    campaign.answer("ana", 4, "skip");
    campaign.answer("ben", 5, "ring");
    let open = campaign.ask("ana", Strategy::Medoids, false);
    assert_eq!(open, [0, 1, 2, 6, 7, 8, 9].into());
    assert_eq!(campaign.ask("ana", Strategy::Medoids, true), [5].into());
    assert_eq!(campaign.ask("eva", Strategy::Medoids, true), [3].into());
}

#[test]
fn before_the_first_generation_there_is_nothing_to_ask() {
    let campaign = Campaign::new(0);
    for strategy in [Strategy::Random, Strategy::Medoids] {
        assert!(campaign.ask("ana", strategy, false).is_empty());
    }
}

#[test]
fn of_a_completed_campaign_the_medoids_of_its_taxonomy_are_asked_first() {
    let campaign = Campaign::new(1);
    let taxonomy = Clustering {
        medoids: vec![7, 2],
        clusters: vec![1, 1, 1, 1, 0, 0, 0, 0, 0, 0],
        loss: 3.0,
    };
    campaign.store.complete(&campaign.id, &taxonomy).unwrap();
    let record = campaign.store.campaign("latest").unwrap();
    let asked = campaign
        .queries
        .unanswered(&record, Strategy::Medoids, 2)
        .unwrap();
    assert_eq!(asked, [7, 2]);
}

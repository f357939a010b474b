//! Questions about an archive that grows and is labelled.

use super::*;
use murmuration_model::{
    CampaignState, Weight,
    labels::{Action, Change},
};
use murmuration_search::medoids::Clustering;
use murmuration_store::{ClusterMeasures, DataDirectory, GenerationRecord, Provenance, Trial};
use murmuration_swarm::CampaignSpec;
use std::collections::BTreeSet;

/// A running campaign with generations of ten individuals.
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
            queries: Queries::new(store.clone(), Spaces::new(store.clone()), Interrupt::default()),
            store,
            id,
        };
        (0..generations).for_each(|generation| campaign.grow(generation));
        campaign
    }

    fn grow(&self, generation: u32) {
        let individual = |place| {
            crate::still(u64::from(generation) * 10 + place, generation).with_trial(Trial {
                features: [f64::from(generation), place as f64, 0.0, 0.0, 0.0],
                ..Trial::default()
            })
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

    async fn ask(&self, annotator: &str, strategy: Strategy, agreement: bool) -> BTreeSet<usize> {
        let request = QueryRequest {
            holder: AnnotatorSession {
                token: None,
                annotator: annotator.parse().unwrap(),
                session: String::new(),
            },
            strategy,
            agreement,
            count: 1000,
            again: Vec::new(),
        };
        let asked = self
            .queries
            .next("latest", request, Instant::now())
            .await
            .unwrap();
        asked.queries.iter().map(|query| query.index).collect()
    }

    /// The questions after the new ranking is made.
    async fn ask_later(&self, strategy: Strategy) -> BTreeSet<usize> {
        self.ask("ana", strategy, false).await;
        let rankings = self.queries.rankings.of(&self.id);
        let ranking = Arc::clone(&lock(&rankings.0)[&strategy]);
        drop(ranking.making.lock().await);
        self.ask("ana", strategy, false).await
    }
}

#[tokio::test]
async fn an_archive_is_ranked_anew_once_it_is_a_quarter_larger_or_the_search_has_stopped() {
    let campaign = Campaign::new(8);
    let ask = async |strategy| campaign.ask("ana", strategy, false).await.len();
    for strategy in [Strategy::Random, Strategy::Medoids] {
        assert_eq!(ask(strategy).await, 80);
    }
    campaign.grow(8);
    assert_eq!(ask(Strategy::Random).await, 80);
    assert_eq!(campaign.ask_later(Strategy::Medoids).await.len(), 80);
    campaign.grow(9);
    campaign.grow(10);
    assert_eq!(ask(Strategy::Random).await, 110);
    // No request waits while the archive is clustered again.
    assert_eq!(ask(Strategy::Medoids).await, 80);
    assert_eq!(campaign.ask_later(Strategy::Medoids).await.len(), 110);
    campaign.grow(11);
    campaign
        .store
        .set_state(&campaign.id, CampaignState::Paused, "")
        .unwrap();
    assert_eq!(ask(Strategy::Random).await, 120);
    assert_eq!(campaign.ask_later(Strategy::Medoids).await.len(), 120);
}

#[tokio::test]
async fn what_was_rolled_back_is_not_asked_about() {
    let campaign = Campaign::new(8);
    assert_eq!(campaign.ask("ana", Strategy::Medoids, false).await.len(), 80);
    campaign
        .store
        .roll_back_generations(&campaign.id, 5, "generation 5 was wrong")
        .unwrap();
    let left: BTreeSet<usize> = (0..50).collect();
    assert_eq!(campaign.ask("ana", Strategy::Medoids, false).await, left);
    assert_eq!(campaign.ask_later(Strategy::Medoids).await, left);
}

#[tokio::test]
async fn clusters_are_there_while_the_archive_grows_and_are_the_taxonomys_in_the_end() {
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
    // Questions by medoids begin with the medoids on the contact sheet.
    let medoids: BTreeSet<usize> = first.clustering.medoids.iter().copied().collect();
    assert!(
        campaign
            .ask("ana", Strategy::Medoids, false)
            .await
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
    campaign
        .store
        .complete(&campaign.id, &taxonomy, &[ClusterMeasures::default()], &[], &[])
        .unwrap();
    let last = clusters();
    assert_eq!((&last.clustering, last.is_taxonomy), (&taxonomy, true));
}

#[tokio::test]
async fn answers_of_any_kind_close_a_question_and_classes_open_it_for_agreement() {
    let campaign = Campaign::new(1);
    campaign.answer("ana", 3, "ring");
    campaign.answer("ana", 4, "skip");
    campaign.answer("ben", 5, "ring");
    let ask = async |who, agreement| campaign.ask(who, Strategy::Medoids, agreement).await;
    assert_eq!(ask("ana", false).await, [0, 1, 2, 6, 7, 8, 9].into());
    assert_eq!(ask("ana", true).await, [5].into());
    assert_eq!(ask("eva", true).await, [3].into());
}

#[tokio::test]
async fn before_the_first_generation_there_is_nothing_to_ask() {
    let campaign = Campaign::new(0);
    for strategy in [Strategy::Random, Strategy::Medoids] {
        assert!(campaign.ask("ana", strategy, false).await.is_empty());
    }
    campaign.grow(0);
    for strategy in [Strategy::Random, Strategy::Medoids] {
        assert_eq!(campaign.ask("ana", strategy, false).await.len(), 10);
    }
}

#[tokio::test]
async fn of_a_completed_campaign_the_medoids_of_its_taxonomy_are_asked_first() {
    let campaign = Campaign::new(1);
    let taxonomy = Clustering {
        medoids: vec![7, 2],
        clusters: vec![1, 1, 1, 1, 0, 0, 0, 0, 0, 0],
        loss: 3.0,
    };
    campaign
        .store
        .complete(
            &campaign.id,
            &taxonomy,
            &[ClusterMeasures::default(); 2],
            &[],
            &[],
        )
        .unwrap();
    let record = campaign.store.campaign("latest").unwrap();
    let asked = campaign
        .queries
        .unanswered(&record, Strategy::Medoids, 2, campaign.queries.interrupt())
        .await
        .unwrap();
    assert_eq!(asked, [7, 2]);
}

#[tokio::test]
async fn what_was_forgotten_is_made_again_and_the_same_is_asked() {
    let mut campaign = Campaign::new(4);
    let spaces = Spaces::new(campaign.store.clone());
    let bound = 1;
    campaign.queries.clusters = Clusters::within(spaces, bound);
    campaign.queries.rankings = Arc::new(Kept::within(bound));
    let spec = campaign.store.campaign("latest").unwrap().spec;
    let other = campaign
        .store
        .create_campaign(&spec, Weight::default(), 8)
        .unwrap();
    let ids = [campaign.id.clone(), other];
    campaign.id = ids[1].clone();
    (0..3).for_each(|generation| campaign.grow(generation));
    let request = |who: &str| QueryRequest {
        holder: AnnotatorSession {
            token: None,
            annotator: who.parse().unwrap(),
            session: String::new(),
        },
        strategy: Strategy::Medoids,
        agreement: false,
        count: 2,
        again: Vec::new(),
    };
    let now = Instant::now();
    let ask = async |id: &CampaignId, who| {
        let asked = campaign
            .queries
            .next(id.as_str(), request(who), now)
            .await
            .unwrap();
        asked.queries
    };
    let clusters = |id: &CampaignId| {
        let record = campaign.store.campaign(id.as_str()).unwrap();
        campaign.queries.clusters(&record).unwrap()
    };
    let first = [ask(&ids[0], "ana").await, ask(&ids[1], "ana").await];
    let clustered = [clusters(&ids[0]), clusters(&ids[1])];
    for _ in 0..2 {
        for place in [0, 1] {
            // A holder keeps a question even if its ranking was forgotten.
            assert_eq!(ask(&ids[place], "ana").await, first[place]);
            assert!(
                ask(&ids[place], "ben")
                    .await
                    .iter()
                    .all(|query| !first[place].contains(query))
            );
            let again = clusters(&ids[place]);
            assert_eq!(again, clustered[place]);
            assert!(!Arc::ptr_eq(&again, &clustered[place]), "it was kept");
            // The bound is 1 byte, so each cache keeps at most its newest value.
            let heaviest = 40 * (5 * 8 + 4) + 40 * 8 + 256;
            assert!(campaign.queries.clusters.bytes() <= heaviest);
            assert!(campaign.queries.rankings.bytes() <= 40 * size_of::<Query>() + 256);
        }
    }
    assert_eq!(lock(&campaign.queries.leases).len(), 2);
    // Five minutes later all leases are over.
    let later = now + crate::queries::leases::QUERY_LEASE_TIME;
    campaign
        .queries
        .next(ids[0].as_str(), request("ana"), later)
        .await
        .unwrap();
    assert_eq!(lock(&campaign.queries.leases).len(), 1);
}

//! The first questions, and that each question comes once.

use super::*;
use murmuration_search::{interrupt::Interrupt, medoids};
use murmuration_swarm::Purpose;
use proptest::{prelude::*, strategy::Strategy};

fn stream() -> RandomStream {
    RandomStream::derive(1, Purpose::Query, 0)
}

fn behaviours(points: &[[f64; 2]]) -> Behaviours {
    let mut behaviours = Behaviours::new(2);
    for point in points {
        behaviours.push(point).unwrap();
    }
    behaviours
}

fn line(points: &[f64]) -> Behaviours {
    behaviours(&points.iter().map(|&x| [x, 0.0]).collect::<Vec<_>>())
}

fn indices(ranking: &[Query]) -> Vec<usize> {
    ranking.iter().map(|query| query.index).collect()
}

#[test]
fn medoids_come_first_then_uncertain_members_by_turns() {
    // Clusters about 1 (index 1) and about 10 (index 5).
    let points = line(&[0.0, 1.0, 1.5, 4.0, 7.0, 10.0, 10.5, 11.0, 12.0]);
    let clustering = Clustering {
        medoids: vec![5, 1],
        clusters: vec![1, 1, 1, 1, 0, 0, 0, 0, 0],
        loss: 0.0,
    };
    let ranking = by_uncertainty(&points, &clustering);
    assert_eq!(indices(&ranking), [5, 1, 4, 3, 8, 0, 7, 2, 6]);
    let reasons: Vec<String> = ranking.iter().map(|query| query.reason.to_string()).collect();
    assert_eq!(reasons[0], "medoid of cluster 1: the nearest to 5 behaviours");
    assert_eq!(
        &reasons[2..4],
        [
            "between cluster 1 and cluster 2",
            "between cluster 2 and cluster 1"
        ]
    );
}

#[test]
fn a_single_cluster_has_no_border() {
    let clustering =
        medoids::cluster(&line(&[0.0, 1.0, 5.0]), 1, &mut stream(), &Interrupt::default()).unwrap();
    let ranking = by_uncertainty(&line(&[0.0, 1.0, 5.0]), &clustering);
    assert_eq!(indices(&ranking), [1, 0, 2]);
    assert_eq!(ranking[2].reason.to_string(), "in cluster 1");
}

/// If this order changes, people get other questions.
#[test]
fn the_lot_is_the_same_for_ever() {
    assert_eq!(
        indices(&in_random_order(8, &mut stream())),
        [3, 4, 0, 5, 1, 2, 7, 6]
    );
}

fn points() -> impl Strategy<Value = Vec<[f64; 2]>> {
    // The coordinates have few distinct values, so that some points coincide.
    let coordinate = || (0..6i32).prop_map(f64::from);
    prop::collection::vec((coordinate(), coordinate()).prop_map(|(x, y)| [x, y]), 0..40)
}

proptest! {
    #[test]
    fn every_behaviour_is_ranked_once_and_always_alike(points in points(), k in 1usize..6) {
        let behaviours = behaviours(&points);
        let clustering = medoids::cluster(&behaviours, k, &mut stream(), &Interrupt::default()).unwrap();
        let rank = || [
            in_random_order(points.len(), &mut stream()),
            by_uncertainty(&behaviours, &clustering),
        ];
        for (ranking, again) in rank().iter().zip(rank()) {
            prop_assert_eq!(ranking, &again);
            let mut sorted = indices(ranking);
            sorted.sort_unstable();
            prop_assert_eq!(sorted, (0..points.len()).collect::<Vec<_>>());
        }
        let first = &indices(&rank()[1])[..clustering.medoids.len()];
        prop_assert_eq!(first, clustering.medoids);
    }
}

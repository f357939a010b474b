//! Compares medoids found among samples with medoids found among all points.

use super::*;
use crate::medoids::{centre, sampled::Sampling};
use rand::RngExt as _;
use std::cell::Cell;

/// Samples that are small enough for few points.
const FEW: Sampling = Sampling { size: 150, count: 2 };

fn sampled(points: &Behaviours, k: usize, seed: u64) -> Clustering {
    let k = k.clamp(1, points.len());
    let interrupt = Interrupt::default();
    super::super::sampled::cluster(points, k, FEW, &mut stream(seed), &interrupt, &|_| {}).unwrap()
}

/// Overlapping clumps of different sizes and widths.
fn overlapping(count: usize, seed: u64) -> Behaviours {
    let mut random = RandomStream::derive(seed, Purpose::Start, 0);
    let points: Vec<Vec<f64>> = (0..count)
        .map(|_| {
            let clump = random.random::<f64>().powi(2) * 9.0;
            let centre = |d: f64| (clump.floor() * d * 0.37).fract() * 2.0;
            (1..=5)
                .map(|d| centre(f64::from(d)) + random.random::<f64>() * (1.0 + clump / 9.0))
                .collect()
        })
        .collect();
    behaviours(&points)
}

/// Checks the properties that every clustering has, a local optimum or not.
#[track_caller]
fn check_shape(points: &Behaviours, k: usize, clustering: &Clustering) {
    let Clustering {
        medoids,
        clusters,
        loss: found,
    } = clustering;
    assert_eq!(
        (medoids.len(), clusters.len()),
        (k.clamp(1, points.len()), points.len())
    );
    for (place, &medoid) in medoids.iter().enumerate() {
        assert_eq!(clusters[medoid] as usize, place, "a medoid is of its own cluster");
    }
    assert!((found - loss(points, medoids)).abs() <= 1e-9 * found);
}

#[test]
fn the_loss_is_that_of_all_candidates_but_for_a_hundredth() {
    let (mut among_samples, mut among_all) = (0.0, 0.0);
    for seed in 0..10 {
        let points = overlapping(1000, seed);
        let of_samples = sampled(&points, 6, seed);
        check_shape(&points, 6, &of_samples);
        among_samples += of_samples.loss;
        among_all += cluster(&points, 6, &mut stream(seed)).loss;
    }
    assert!(
        among_samples <= 1.01 * among_all,
        "{among_samples} is over 1% above {among_all}"
    );
}

#[test]
fn samples_change_nothing_with_the_number_of_threads() {
    let points = overlapping(3000, 1);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| sampled(&points, 5, 3))
    };
    let one = on(1);
    for threads in [2, 4] {
        let other = on(threads);
        assert_eq!(other.loss.to_bits(), one.loss.to_bits());
        assert_eq!(other, one);
    }
}

#[test]
fn up_to_a_size_all_points_are_candidates() {
    assert_eq!(Algorithm::for_size(MOST_EXACT), Algorithm::FasterPam);
    assert_eq!(Algorithm::for_size(MOST_EXACT + 1), Algorithm::Sampled);
    let points = overlapping(400, 2);
    let interrupt = Interrupt::default();
    let full = cluster_by(
        Algorithm::FasterPam,
        &points,
        6,
        &mut stream(1),
        &interrupt,
        &|_| {},
    );
    assert_eq!(full.unwrap(), cluster(&points, 6, &mut stream(1)));
}

/// If these medoids change, the taxonomy of every large campaign changes.
#[test]
fn the_medoids_of_samples_are_the_same_for_ever() {
    let clustering = sampled(&overlapping(1000, 4), 4, 4);
    assert_eq!(
        (clustering.medoids, clustering.loss),
        (vec![185, 133, 305, 245], 1031.2052987516665)
    );
}

#[test]
fn progress_is_told_and_an_interruption_ends_both_ways_at_once() {
    let points = overlapping(2000, 5);
    for algorithm in [Algorithm::FasterPam, Algorithm::Sampled] {
        let interrupt = Interrupt::default();
        let told = Cell::new(0);
        let after_three = |progress: Progress| {
            told.set(told.get() + 1);
            assert_eq!(progress.moves, told.get());
            assert!(progress.mean_distance > 0.0);
            if told.get() == 3 {
                interrupt.raise();
            }
        };
        let ended = cluster_by(algorithm, &points, 40, &mut stream(1), &interrupt, &after_three);
        assert_eq!((ended, told.get()), (Err(Interrupted), 3));
    }
}

proptest! {
    #[test]
    fn every_clustering_by_samples_has_the_shape_of_one(
        lattice in prop::collection::vec(prop::collection::vec(-3..=3i32, 2), 1..400),
        scale in prop::sample::select(vec![1.0, 0.1, 1e-150, 1e90]),
        k in 0..10usize,
        seed in 0..1000u64,
    ) {
        let points: Vec<Vec<f64>> = lattice
            .iter()
            .map(|point| point.iter().map(|&x| f64::from(x) * scale).collect())
            .collect();
        let points = behaviours(&points);
        check_shape(&points, k, &sampled(&points, k, seed));
    }

    #[test]
    fn the_centre_of_a_cluster_is_its_exact_medoid(
        members in (1..=6usize).prop_flat_map(|dims| prop::collection::vec(prop::collection::vec(-1.0..=1.0f64, dims), 1..300)),
        lattice in prop::bool::ANY,
        scale in prop::sample::select(vec![1.0, 1e-150, 1e90]),
    ) {
        let place = |x: f64| scale * if lattice { (x * 3.0).round() } else { x };
        let points: Vec<Vec<f64>> = members.iter().map(|point| point.iter().map(|&x| place(x)).collect()).collect();
        let points = behaviours(&points);
        // Every second point is of another cluster.
        let members: Vec<usize> = (0..points.len()).step_by(2).collect();
        let sum = |of: usize| members.iter().map(|&member| points.squared_distance(of, member).sqrt()).sum::<f64>();
        let centre = centre::medoid(&points, &members, 0, &Interrupt::default()).unwrap();
        prop_assert!(members.contains(&centre));
        let least = members.iter().map(|&member| sum(member)).fold(f64::INFINITY, f64::min);
        prop_assert!(sum(centre) <= least * (1.0 + 1e-9), "{} is above {least}", sum(centre));
    }
}

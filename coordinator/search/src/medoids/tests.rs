//! Compares clusterings with brute force, and checks the properties of every clustering.

mod sampled;

use super::{assignment::Assignment, *};
use murmuration_swarm::Purpose;
use proptest::prelude::*;

fn behaviours(points: &[Vec<f64>]) -> Behaviours {
    let mut behaviours = Behaviours::new(points.first().map_or(2, Vec::len));
    for point in points {
        behaviours.push(point).unwrap();
    }
    behaviours
}

/// Clusters without an interruption.
fn cluster(points: &Behaviours, k: usize, stream: &mut RandomStream) -> Clustering {
    super::cluster(points, k, stream, &Interrupt::default()).unwrap()
}

fn stream(seed: u64) -> RandomStream {
    RandomStream::derive(seed, Purpose::Medoids, 0)
}

/// The loss of a set of medoids, by definition.
fn loss(points: &Behaviours, medoids: &[usize]) -> f64 {
    let distance = |point: usize| {
        let distances = medoids
            .iter()
            .map(|&medoid| points.squared_distance(point, medoid).sqrt());
        distances.fold(f64::INFINITY, f64::min)
    };
    (0..points.len()).map(distance).sum()
}

/// The least loss of any `k` medoids.
fn optimum(points: &Behaviours, k: usize) -> f64 {
    fn search(points: &Behaviours, chosen: &mut Vec<usize>, k: usize) -> f64 {
        if chosen.len() == k {
            return loss(points, chosen);
        }
        let mut best = f64::INFINITY;
        for next in chosen.last().map_or(0, |last| last + 1)..points.len() {
            chosen.push(next);
            best = best.min(search(points, chosen, k));
            chosen.pop();
        }
        best
    }
    search(points, &mut Vec::new(), k)
}

/// Checks every property of a clustering: shape, order, nearest medoids, loss, and that no swap lowers it.
#[track_caller]
fn check(points: &Behaviours, k: usize, clustering: &Clustering) {
    let Clustering {
        medoids, clusters, ..
    } = clustering;
    assert_eq!(medoids.len(), k.clamp(1, points.len()));
    assert_eq!(clusters.len(), points.len());
    let size = |place: usize| {
        clusters
            .iter()
            .filter(|&&cluster| cluster as usize == place)
            .count()
    };
    let order: Vec<_> = (0..medoids.len())
        .map(|place| (Reverse(size(place)), medoids[place]))
        .collect();
    assert!(order.is_sorted_by(|a, b| a < b), "{order:?}");
    for (place, &medoid) in medoids.iter().enumerate() {
        assert_eq!(clusters[medoid] as usize, place);
    }
    for (point, &cluster) in clusters
        .iter()
        .enumerate()
        .filter(|(point, _)| !medoids.contains(point))
    {
        let key = |place: usize| (points.squared_distance(point, medoids[place]), medoids[place]);
        assert!((0..medoids.len()).all(|place| key(cluster as usize) <= key(place)));
    }
    assert!((clustering.loss - loss(points, medoids)).abs() <= 1e-9 * clustering.loss);
    for place in 0..medoids.len() {
        for candidate in (0..points.len()).filter(|candidate| !medoids.contains(candidate)) {
            let mut swapped = medoids.clone();
            swapped[place] = candidate;
            assert!(
                loss(points, &swapped) >= clustering.loss * (1.0 - 1e-9),
                "a swap improves"
            );
        }
    }
}

#[test]
fn clumps_are_found_the_largest_first() {
    let clump = |centre: f64, size: i32| (0..size).map(move |i| vec![centre + 0.01 * f64::from(i), centre]);
    let points: Vec<_> = clump(5.0, 3).chain(clump(-2.0, 9)).chain(clump(0.5, 5)).collect();
    let clustering = cluster(&behaviours(&points), 3, &mut stream(1));
    assert_eq!(clustering.medoids, [7, 14, 1]);
    assert_eq!(
        clustering.clusters,
        [[2; 3].as_slice(), &[0; 9], &[1; 5]].concat()
    );
    assert!((clustering.loss - 0.01 * f64::from(2 + 20 + 6)).abs() < 1e-12);
}

#[test]
fn there_may_be_few_points_or_few_different_ones() {
    let empty = cluster(&Behaviours::new(5), 3, &mut stream(1));
    assert_eq!(
        (empty.medoids.len(), empty.clusters.len(), empty.loss),
        (0, 0, 0.0)
    );

    let line: Vec<Vec<f64>> = (0..4).map(|x| vec![f64::from(x)]).collect();
    for k in [4, 9] {
        let own = cluster(&behaviours(&line), k, &mut stream(1));
        assert_eq!(
            (own.medoids, own.clusters, own.loss),
            (vec![0, 1, 2, 3], vec![0, 1, 2, 3], 0.0)
        );
    }
    assert_eq!(cluster(&behaviours(&line), 0, &mut stream(1)).medoids.len(), 1);

    let two_places: Vec<Vec<f64>> = (0..300).map(|i| vec![f64::from(i % 2); 3]).collect();
    let points = behaviours(&two_places);
    let clustering = cluster(&points, 5, &mut stream(1));
    assert_eq!(clustering.loss, 0.0);
    check(&points, 5, &clustering);
}

#[test]
fn losses_are_close_to_the_least_possible() {
    let (mut found, mut least) = (0.0, 0.0);
    for seed in 0..300 {
        let mut random = RandomStream::derive(seed, Purpose::Start, 0);
        let k = random.random_range(1..=4);
        let points: Vec<Vec<f64>> = (0..13).map(|_| vec![random.random(), random.random()]).collect();
        let points = behaviours(&points);
        let clustering = cluster(&points, k, &mut stream(seed));
        check(&points, k, &clustering);
        let optimum = optimum(&points, k);
        assert!(clustering.loss >= optimum * (1.0 - 1e-9));
        found += clustering.loss;
        least += optimum;
    }
    assert!(found <= 1.01 * least, "{found} is over 1% above {least}");
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let mut random = RandomStream::derive(3, Purpose::Start, 0);
    let points: Vec<Vec<f64>> = (0..1500)
        .map(|_| (0..5).map(|_| random.random()).collect())
        .collect();
    let points = behaviours(&points);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| cluster(&points, 12, &mut stream(3)))
    };
    let one = on(1);
    check(&points, 12, &one);
    for threads in [2, 4] {
        let other = on(threads);
        assert_eq!(other.loss.to_bits(), one.loss.to_bits());
        assert_eq!(other, one);
    }
}

/// If these medoids change, the taxonomy of every campaign changes.
#[test]
fn the_medoids_are_the_same_for_ever() {
    let mut random = RandomStream::derive(4, Purpose::Start, 0);
    let points: Vec<Vec<f64>> = (0..1000)
        .map(|_| (0..5).map(|_| random.random()).collect())
        .collect();
    let clustering = cluster(&behaviours(&points), 5, &mut stream(4));
    assert_eq!(
        (clustering.medoids, clustering.loss),
        (vec![854, 408, 51, 19, 203], 490.53960738401645)
    );
}

proptest! {
    /// A coarse lattice has ties and coinciding points, and thus many swaps that save nothing.
    #[test]
    fn every_clustering_is_a_local_optimum(
        lattice in prop::collection::vec(prop::collection::vec(-3..=3i32, 2), 1..60),
        scale in prop::sample::select(vec![1.0, 0.1, 1e-150, 1e90]),
        k in 1..10usize,
        seed in 0..1000u64,
    ) {
        let points: Vec<Vec<f64>> = lattice
            .iter()
            .map(|point| point.iter().map(|&x| f64::from(x) * scale).collect())
            .collect();
        let points = behaviours(&points);
        check(&points, k, &cluster(&points, k, &mut stream(seed)));
    }
}

/// The best swap of `candidate` with a medoid, computed from FasterPAM's definition, one point after the other.
fn swap_by_definition(points: &Behaviours, medoids: &[usize], candidate: usize) -> Option<(usize, f64)> {
    let mut gain = 0.0;
    let mut changes = vec![0.0; medoids.len()];
    let ranked = |point: usize| {
        let mut ranks: Vec<(f64, usize)> = medoids
            .iter()
            .enumerate()
            .map(|(place, &medoid)| (points.squared_distance(point, medoid).sqrt(), place))
            .collect();
        ranks.sort_by(|a, b| a.0.total_cmp(&b.0));
        (ranks[0], ranks[1].0)
    };
    for point in 0..points.len() {
        let ((to_nearest, nearest), to_second) = ranked(point);
        changes[nearest] += to_second - to_nearest;
    }
    for point in 0..points.len() {
        let ((to_nearest, nearest), to_second) = ranked(point);
        let distance = points.squared_distance(candidate, point).sqrt();
        if distance < to_nearest {
            gain += to_nearest - distance;
            changes[nearest] -= to_second - to_nearest;
        } else if distance < to_second {
            changes[nearest] -= to_second - distance;
        }
    }
    let (place, change) = changes.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1))?;
    Some((place, change - gain))
}

proptest! {
    #[test]
    fn swaps_are_weighed_to_the_bit_as_point_by_point(
        lattice in (1..12usize).prop_flat_map(|dims| prop::collection::vec(prop::collection::vec(-9..=9i32, dims), 4..200)),
        scale in prop::sample::select(vec![1.0, 0.1, 1e-150, 1e-162, 1e90]),
        k in 2..4usize,
    ) {
        let points: Vec<Vec<f64>> = lattice
            .iter()
            .map(|point| point.iter().map(|&x| f64::from(x) * scale).collect())
            .collect();
        let points = behaviours(&points);
        let medoids: Vec<usize> = (0..k).collect();
        let assignment = Assignment::new(&points, medoids.clone(), &Interrupt::default()).unwrap();
        for candidate in k..points.len() {
            let swap = assignment.best_swap(candidate).unwrap();
            let (place, change) = swap_by_definition(&points, &medoids, candidate).unwrap();
            prop_assert_eq!((swap.place, swap.change.to_bits()), (place, change.to_bits()));
        }
    }
}

#[test]
fn an_interrupted_clustering_has_no_result() {
    let points: Vec<Vec<f64>> = (0..3000)
        .map(|i| vec![f64::from(i), f64::from(i * i % 97)])
        .collect();
    let points = behaviours(&points);
    let interrupt = Interrupt::default();
    interrupt.raise();
    assert_eq!(
        super::cluster(&points, 12, &mut stream(1), &interrupt),
        Err(Interrupted)
    );
    // The clustering runs in another thread. Without the interrupt, it would run for far longer than the test takes to raise the
    // interrupt.
    let interrupt = Interrupt::default();
    let clustered = std::thread::scope(|scope| {
        let clustering = scope.spawn(|| super::cluster(&points, 300, &mut stream(1), &interrupt));
        interrupt.raise();
        clustering.join().unwrap()
    });
    assert_eq!(clustered, Err(Interrupted));
}

//! Novelty against the definition, and every way of computing it against the others.

use super::*;
use proptest::prelude::*;

fn behaviours(dims: usize, points: &[Vec<f64>]) -> Behaviours {
    let mut behaviours = Behaviours::new(dims);
    for point in points {
        behaviours.push(point).unwrap();
    }
    behaviours
}

/// Not interrupted.
fn novelty(behaviours: &Behaviours, queries: Range<usize>, k: usize) -> Vec<f64> {
    super::novelty(behaviours, queries, k, &Interrupt::default()).unwrap()
}

/// Not interrupted.
fn novelty_by(lookup: Lookup, behaviours: &Behaviours, queries: Range<usize>, k: usize) -> Vec<f64> {
    super::novelty_by(lookup, behaviours, queries, k, &Interrupt::default()).unwrap()
}

/// The definition, by sorting all distances.
fn defined(points: &[Vec<f64>], query: usize, k: usize) -> f64 {
    let distance = |other: &[f64]| {
        let squares = points[query].iter().zip(other).map(|(a, b)| (a - b) * (a - b));
        squares.fold(0.0, |sum, square| sum + square).sqrt()
    };
    let others = (0..points.len()).filter(|&other| other != query);
    let mut distances: Vec<f64> = others.map(|other| distance(&points[other])).collect();
    distances.sort_by(f64::total_cmp);
    distances.truncate(k);
    match distances.len() {
        0 => 0.0,
        count => distances.iter().fold(0.0, |sum, distance| sum + distance) / count as f64,
    }
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

#[track_caller]
fn check(points: &[f64], k: usize, expected: &[f64]) {
    let points: Vec<Vec<f64>> = points.iter().map(|&x| vec![x]).collect();
    let behaviours = behaviours(1, &points);
    for lookup in [Lookup::BruteForce, Lookup::Tree] {
        assert_eq!(novelty_by(lookup, &behaviours, 0..points.len(), k), expected);
    }
}

#[test]
fn the_mean_is_over_the_nearest_others() {
    check(&[], 3, &[]);
    check(&[7.0], 3, &[0.0]);
    check(&[0.0, 1.0, 3.0, 10.0], 1, &[1.0, 1.0, 2.0, 7.0]);
    check(&[0.0, 1.0, 3.0, 10.0], 2, &[2.0, 1.5, 2.5, 8.0]);
    // Fewer than k others; a point that coincides with others counts them.
    check(&[0.0, 4.0, 8.0], 15, &[6.0, 4.0, 6.0]);
    check(&[5.0, 5.0, 5.0, 8.0], 2, &[0.0, 0.0, 0.0, 3.0]);
    check(&[0.0, 1.0], 0, &[0.0, 0.0]);
}

#[test]
fn only_points_are_queried() {
    let line: Vec<Vec<f64>> = (0..5).map(|x| vec![f64::from(x)]).collect();
    let behaviours = behaviours(1, &line);
    assert_eq!(novelty(&behaviours, 3..5, 2), [1.0, 1.5]);
    assert_eq!(novelty(&behaviours, 4..9, 2), [1.5]);
    assert!(novelty(&behaviours, 7..9, 2).is_empty());
}

#[test]
fn a_vector_that_does_not_fit_is_refused() {
    let mut behaviours = Behaviours::new(2);
    let expected = 2;
    assert_eq!(
        behaviours.push(&[1.0]),
        Err(Misfit::Dimensions { given: 1, expected })
    );
    for value in [f64::INFINITY, f64::NEG_INFINITY, 1.1e100] {
        assert_eq!(
            behaviours.push(&[0.0, value]),
            Err(Misfit::Value { place: 1, value })
        );
    }
    assert!(behaviours.push(&[f64::NAN, 0.0]).is_err());
    assert!(behaviours.is_empty());
    behaviours.push(&[-0.0, MAX_COORDINATE]).unwrap();
    assert_eq!(bits(behaviours.point(0).as_slice()), bits(&[0.0, MAX_COORDINATE]));
    assert_eq!(behaviours.matrix().shape(), (2, 1));
}

/// More coinciding points than a leaf of the tree holds (32), alone and beside others.
#[test]
fn coinciding_points_are_no_trouble_to_the_tree() {
    for (coinciding, apart) in [(33, 0), (1000, 0), (1000, 40), (40, 1000)] {
        let same = std::iter::repeat_n(vec![0.5; 5], coinciding);
        let others = (0..apart).map(|i| (0..5).map(|d| f64::from(i * (d + 3) % 41)).collect());
        let points: Vec<Vec<f64>> = same.chain(others).collect();
        let behaviours = behaviours(5, &points);
        let all = 0..points.len();
        let by_tree = novelty_by(Lookup::Tree, &behaviours, all.clone(), 15);
        assert_eq!(
            bits(&by_tree),
            bits(&novelty_by(Lookup::BruteForce, &behaviours, all, 15))
        );
        assert!(by_tree[..coinciding].iter().all(|&novelty| novelty == 0.0));
    }
}

#[test]
fn one_thread_or_four_give_the_same_bits() {
    let points: Vec<Vec<f64>> = (0..600u32)
        .map(|i| (1..=5).map(|d| f64::from(i * 7919 * d % 1009) / 1009.0).collect())
        .collect();
    let behaviours = behaviours(5, &points);
    for lookup in [Lookup::BruteForce, Lookup::Tree] {
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            bits(&pool.install(|| novelty_by(lookup, &behaviours, 0..600, 15)))
        };
        assert_eq!(on(1), on(4));
    }
}

/// Points on a coarse lattice (ties and coincidences everywhere), or anywhere over many scales.
fn points() -> impl Strategy<Value = (usize, Vec<Vec<f64>>)> {
    let lattice = (-2..=2i32).prop_map(|i| f64::from(i) * 0.1);
    let anywhere =
        (-1.0..=1.0f64, -170..=99i32).prop_map(|(x, e)| x * format!("1e{e}").parse::<f64>().unwrap());
    let near = -1.0..=1.0f64;
    (1..=9usize).prop_flat_map(move |dims| {
        let of = |coordinate: BoxedStrategy<f64>| {
            prop::collection::vec(prop::collection::vec(coordinate, dims), 0..150)
        };
        let sets = prop_oneof![
            of(lattice.clone().boxed()),
            of(anywhere.clone().boxed()),
            of(near.clone().boxed())
        ];
        (Just(dims), sets)
    })
}

proptest! {
    #[test]
    fn every_way_gives_the_bits_of_the_definition((dims, points) in points(), k in 0..40usize) {
        let behaviours = behaviours(dims, &points);
        let defined: Vec<f64> = (0..points.len()).map(|query| defined(&points, query, k)).collect();
        for lookup in [Lookup::BruteForce, Lookup::Tree] {
            let found = novelty_by(lookup, &behaviours, 0..points.len(), k);
            prop_assert_eq!(bits(&found), bits(&defined), "{:?}", lookup);
        }
    }
}

#[test]
fn interrupted_nothing_is_measured() {
    let behaviours = behaviours(1, &[vec![0.0], vec![1.0]]);
    let interrupt = Interrupt::default();
    interrupt.raise();
    for lookup in [Lookup::BruteForce, Lookup::Tree] {
        assert_eq!(
            super::novelty_by(lookup, &behaviours, 0..2, 1, &interrupt),
            Err(Interrupted)
        );
    }
}

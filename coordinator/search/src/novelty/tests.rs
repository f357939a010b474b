//! Compares novelty with its definition, and every way of computing it with the others.

use super::*;
use proptest::prelude::*;
use std::ops::Range;

fn behaviours(dims: usize, points: &[Vec<f64>]) -> Behaviours {
    let mut behaviours = Behaviours::new(dims);
    for point in points {
        behaviours.push(point).unwrap();
    }
    behaviours
}

/// Novelty by an index that is built from all behaviours at once.
fn novelty(behaviours: &Behaviours, queries: Range<usize>, k: usize) -> Vec<f64> {
    Index::new()
        .novelty(behaviours, queries, k, &Interrupt::default())
        .unwrap()
}

/// Novelty by brute force.
fn compared(behaviours: &Behaviours, queries: Range<usize>, k: usize) -> Vec<f64> {
    let queries: Vec<usize> = queries.collect();
    novelty_of(behaviours, &queries, k, &Interrupt::default()).unwrap()
}

/// Novelty by definition, by sorting all distances.
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
    assert_eq!(compared(&behaviours, 0..points.len(), k), expected);
    assert_eq!(novelty(&behaviours, 0..points.len(), k), expected);
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
fn without_dimensions_nothing_is_novel() {
    let behaviours = behaviours(0, &[vec![], vec![], vec![]]);
    assert_eq!(novelty(&behaviours, 0..3, 2), [0.0; 3]);
    assert_eq!(compared(&behaviours, 0..3, 2), [0.0; 3]);
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

/// More coinciding points than a group of the tree holds (64), alone and among others.
#[test]
fn coinciding_points_are_no_trouble_to_the_tree() {
    for (coinciding, apart) in [(65, 0), (1000, 0), (1000, 40), (40, 1000)] {
        let same = std::iter::repeat_n(vec![0.5; 5], coinciding);
        let others = (0..apart).map(|i| (0..5).map(|d| f64::from(i * (d + 3) % 41)).collect());
        let points: Vec<Vec<f64>> = same.chain(others).collect();
        let behaviours = behaviours(5, &points);
        let all = 0..points.len();
        let by_tree = novelty(&behaviours, all.clone(), 15);
        assert_eq!(bits(&by_tree), bits(&compared(&behaviours, all, 15)));
        assert!(by_tree[..coinciding].iter().all(|&novelty| novelty == 0.0));
    }
}

#[test]
fn one_thread_or_four_give_the_same_bits() {
    let points: Vec<Vec<f64>> = (0..600u32)
        .map(|i| (1..=5).map(|d| f64::from(i * 7919 * d % 1009) / 1009.0).collect())
        .collect();
    let behaviours = behaviours(5, &points);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            [
                novelty(&behaviours, 0..600, 15),
                compared(&behaviours, 0..600, 15),
            ]
            .map(|found| bits(&found))
        })
    };
    assert_eq!(on(1), on(4));
}

/// Points on a coarse lattice (with many ties and coincidences), or anywhere over many scales.
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

/// Includes dimensions with and without specialised code.
#[test]
fn larger_archives_have_the_bits_of_brute_force() {
    for dims in [1, 3, 5, 7, 12] {
        let points: Vec<Vec<f64>> = (0..3000_u32)
            .map(|i| {
                (1..=dims)
                    .map(|d| f64::from(i * 7919 % 1201 * d % 1009).powi(2))
                    .collect()
            })
            .collect();
        let behaviours = behaviours(dims as usize, &points);
        let all = 0..points.len();
        assert_eq!(
            bits(&novelty(&behaviours, all.clone(), 15)),
            bits(&compared(&behaviours, all, 15))
        );
    }
}

/// Magnitudes whose single precision is infinite, zero or the same for all, among usual ones, with coincidences.
fn extreme() -> impl Strategy<Value = (usize, Vec<Vec<f64>>)> {
    let scale = prop::sample::select(vec![0.0, 1e-300, 1e-160, 1e-40, 1.0, 1e12, 1e39, 1e99]);
    let coordinate = (scale, -3..=3i32).prop_map(|(scale, i)| scale * f64::from(i));
    let far = (-3..=3i32).prop_map(|i| f64::from(i).mul_add(1e-3, 1e12));
    let any = prop_oneof![coordinate.boxed(), far.boxed()];
    (1..=16usize).prop_flat_map(move |dims| {
        let points = prop::collection::vec(prop::collection::vec(any.clone(), dims), 0..300);
        (Just(dims), points)
    })
}

/// A sorted archive is the worst for a tree that grows: all new points join one group.
#[test]
fn an_archive_that_drifts_has_the_bits_of_brute_force() {
    let (mut grown, mut index) = (Behaviours::new(2), Index::new());
    for first in (0..900).step_by(30) {
        for i in first..first + 30 {
            grown.push(&[f64::from(i), f64::from(i % 7)]).unwrap();
        }
        let queries = first as usize..grown.len();
        let found = index.novelty(&grown, queries.clone(), 15, &Interrupt::default());
        assert_eq!(bits(&found.unwrap()), bits(&compared(&grown, queries, 15)));
    }
}

proptest! {
    #[test]
    fn extreme_magnitudes_have_the_bits_of_the_definition(
        (dims, points) in extreme(),
        before in 0..300usize,
        k in 0..40usize,
    ) {
        let all = behaviours(dims, &points);
        let mut index = Index::new();
        index.extend(&behaviours(dims, &points[..before.min(points.len())]));
        let found = index.novelty(&all, 0..points.len(), k, &Interrupt::default()).unwrap();
        let defined: Vec<f64> = (0..points.len()).map(|query| defined(&points, query, k)).collect();
        prop_assert_eq!(bits(&found), bits(&defined));
    }

    #[test]
    fn every_way_gives_the_bits_of_the_definition((dims, points) in points(), k in 0..40usize) {
        let behaviours = behaviours(dims, &points);
        let defined: Vec<f64> = (0..points.len()).map(|query| defined(&points, query, k)).collect();
        prop_assert_eq!(bits(&novelty(&behaviours, 0..points.len(), k)), bits(&defined));
        prop_assert_eq!(bits(&compared(&behaviours, 0..points.len(), k)), bits(&defined));
    }

    /// However the archive grew, the index has the same answers as one built anew.
    #[test]
    fn an_index_that_grew_is_one_built_anew(
        (dims, points) in points(),
        steps in prop::collection::vec(0..70usize, 0..30),
        k in 0..20usize,
    ) {
        let (mut grown, mut index) = (Behaviours::new(dims), Index::new());
        let mut left = points.iter();
        for step in steps.into_iter().chain([points.len()]) {
            let first = grown.len();
            for point in left.by_ref().take(step) {
                grown.push(point).unwrap();
            }
            let found = index.novelty(&grown, first..grown.len(), k, &Interrupt::default()).unwrap();
            prop_assert_eq!(bits(&found), bits(&novelty(&grown, first..grown.len(), k)));
            prop_assert_eq!(index.len(), grown.len());
        }
    }

    #[test]
    fn the_nearest_are_those_of_all((dims, points) in points(), k in 0..20usize, query in 0..150usize) {
        prop_assume!(query < points.len());
        let behaviours = behaviours(dims, &points);
        let mut index = Index::new();
        index.extend(&behaviours);
        let mut all: Vec<(f64, usize)> = (0..points.len()).map(|other| (behaviours.squared_distance(query, other).sqrt(), other)).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let found: Vec<f64> = index.nearest(&points[query], k).iter().map(|neighbour| neighbour.distance).collect();
        let expected: Vec<f64> = all.iter().take(k).map(|(distance, _)| *distance).collect();
        prop_assert_eq!(bits(&found), bits(&expected));
    }
}

#[test]
fn interrupted_nothing_is_measured() {
    let behaviours = behaviours(1, &[vec![0.0], vec![1.0]]);
    let interrupt = Interrupt::default();
    interrupt.raise();
    assert_eq!(
        Index::new().novelty(&behaviours, 0..2, 1, &interrupt),
        Err(Interrupted)
    );
    assert_eq!(novelty_of(&behaviours, &[0, 1], 1, &interrupt), Err(Interrupted));
}

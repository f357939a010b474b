//! Tests that neighbours stay neighbours in two dimensions.

#![expect(clippy::unwrap_used, reason = "tests fail by panicking")]

use murmuration_search::{
    interrupt::{Interrupt, Interrupted},
    novelty::Behaviours,
    projection,
};
use murmuration_swarm::{Purpose, RandomStream};
use murmuration_tsne::{embed, embed_by};
use rand::RngExt as _;

/// Two clumps of behaviours far from each other, half of `count` in each.
fn clumps(count: usize) -> Behaviours {
    let mut stream = RandomStream::derive(7, Purpose::Propose, 0);
    let mut behaviours = Behaviours::new(5);
    for i in 0..count {
        let centre = if i % 2 == 0 { 0.0 } else { 10.0 };
        let near: Vec<f64> = (0..5).map(|_| centre + stream.random::<f64>()).collect();
        behaviours.push(&near).unwrap();
    }
    behaviours
}

fn distance(one: [f64; 2], other: [f64; 2]) -> f64 {
    (one[0] - other[0]).hypot(one[1] - other[1])
}

#[test]
fn neighbours_stay_neighbours() {
    // 12 and 120 behaviours are placed without a grid, 300 behaviours on a grid.
    for count in [12, 120, 300] {
        let behaviours = clumps(count);
        let axes = projection::principal_axes(&behaviours, &Interrupt::default())
            .unwrap()
            .points;
        let points = embed(&behaviours, &axes, &Interrupt::default()).unwrap();
        assert_ne!(points, axes);
        for (i, &point) in points.iter().enumerate() {
            let others = (0..points.len()).filter(|&other| other != i);
            let nearest =
                others.min_by(|&a, &b| distance(points[a], point).total_cmp(&distance(points[b], point)));
            assert_eq!(nearest.unwrap() % 2, i % 2, "{i} of {count}");
        }
    }
}

#[test]
fn what_is_no_landmark_lies_among_its_like() {
    let behaviours = clumps(700);
    let interrupt = Interrupt::default();
    let axes = projection::principal_axes(&behaviours, &interrupt)
        .unwrap()
        .points;
    let points = embed_by(301, &behaviours, &axes, &interrupt).unwrap();
    let centre = |clump: usize| {
        let members = points.iter().skip(clump).step_by(2);
        members.fold([0.0; 2], |sum, point| {
            [sum[0] + point[0] / 350.0, sum[1] + point[1] / 350.0]
        })
    };
    let centres = [centre(0), centre(1)];
    for (i, &point) in points.iter().enumerate() {
        let [own, other] = [i % 2, (i + 1) % 2].map(|clump| distance(point, centres[clump]));
        assert!(own < other, "{i} lies at {point:?}, the clumps at {centres:?}");
    }
    interrupt.raise();
    assert_eq!(embed_by(301, &behaviours, &axes, &interrupt), Err(Interrupted));
}

#[test]
fn few_behaviours_and_equal_ones_have_a_map_too() {
    for count in [0, 1, 3, 8, 20] {
        let mut equal = Behaviours::new(2);
        (0..count).for_each(|_| equal.push(&[1.0, 2.0]).unwrap());
        let axes = projection::principal_axes(&equal, &Interrupt::default())
            .unwrap()
            .points;
        assert_eq!(embed(&equal, &axes, &Interrupt::default()), Ok(axes));
    }
}

#[test]
fn what_is_interrupted_has_no_map() {
    let behaviours = clumps(120);
    let axes = projection::principal_axes(&behaviours, &Interrupt::default()).unwrap();
    let interrupt = Interrupt::default();
    interrupt.raise();
    assert_eq!(embed(&behaviours, &axes.points, &interrupt), Err(Interrupted));
    assert_eq!(
        projection::principal_axes(&behaviours, &interrupt),
        Err(Interrupted)
    );
}

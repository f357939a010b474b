//! Tests that a search among nearby pieces gives the same results as a search among all pieces.

use super::*;
use murmuration_swarm::{Purpose, RandomStream, World};
use rand::RngExt as _;
use std::f64::consts::TAU;

/// Paths of this number of agents, which start in a square of this `side` and stand or move, at most at `speed`.
fn paths(stream: &mut RandomStream, agents: usize, side: f64, speed: f64) -> Vec<Vec<Point>> {
    let path = |_| {
        let mut at = [0, 1].map(|_| stream.random_range(0.0..=side));
        let (mut heading, turn) = (stream.random_range(0.0..TAU), stream.random_range(-0.5..0.5));
        let speed = if stream.random_bool(0.3) {
            0.0
        } else {
            stream.random_range(0.0..=speed)
        };
        let walk = |_| {
            let (sine, cosine) = libm::sincos(heading);
            heading += turn;
            at = [at[0] + speed * cosine, at[1] + speed * sine];
            at
        };
        (0..41).map(walk).collect()
    };
    (0..agents).map(path).collect()
}

/// Like [`following`], but compares every piece with every other piece.
fn following_of_all(paths: &[Vec<Point>], scale: &Scale) -> (f64, Vec<Vec<bool>>) {
    let mut shared = vec![vec![false; paths.len()]; paths.len()];
    let mut followed = Vec::new();
    for (i, path) in paths.iter().enumerate() {
        for [from, to] in segments(path) {
            let here = mean(&[from, to]);
            let mut nearest = (f64::INFINITY, [0.0; 2]);
            for (j, other) in paths.iter().enumerate().filter(|&(j, _)| j != i) {
                for [a, b] in segments(other) {
                    let distance = distance_to_segment(here, a, b);
                    if distance < nearest.0 {
                        nearest = (distance, minus(b, a));
                    }
                    shared[i][j] |= distance < SHARED * scale.radius;
                }
            }
            let (distance, theirs) = nearest;
            let own = minus(to, from);
            let moves = length(own) > STANDS * scale.radius;
            let along = dot(own, theirs) > SAME_WAY * length(own) * length(theirs);
            followed.push(moves && along && distance < FOLLOWED * scale.radius);
        }
    }
    (share(followed.into_iter()), shared)
}

/// Like [`crossed`], but compares every piece with every other piece.
fn crossed_of_all(paths: &[Vec<Point>], scale: &Scale) -> f64 {
    let moves = |[a, b]: [Point; 2]| length(minus(b, a)) > STANDS * scale.radius;
    let across = |[a, b]: [Point; 2], [c, d]: [Point; 2]| {
        let (own, theirs) = (minus(b, a), minus(d, c));
        moves([a, b])
            && moves([c, d])
            && cross(own, theirs).abs() > ACROSS * length(own) * length(theirs)
            && segments_cross([a, b], [c, d])
    };
    let pair = |i: usize, j: usize| {
        segments(&paths[i]).any(|own| segments(&paths[j]).any(|theirs| across(own, theirs)))
    };
    let pairs = (0..paths.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    2.0 * pairs.filter(|&(i, j)| pair(i, j)).count() as f64 / paths.len() as f64
}

#[test]
fn near_pieces_say_what_all_pieces_do() {
    let scale = Scale::of(&World::default());
    let mut stream = RandomStream::derive(1, Purpose::Start, 0);
    let (mut followed, mut crossings) = (0.0, 0.0);
    for (side, speed) in [
        (500.0, 8.0),
        (120.0, 8.0),
        (40.0, 1.0),
        (500.0, 300.0),
        (0.0, 0.0),
        (0.0, 8.0),
    ] {
        for agents in [1, 2, 5, 24, 40] {
            let paths = paths(&mut stream, agents, side, speed);
            let pieces = Pieces::of(&paths, SHARED * scale.radius);
            let (share, touching) = following(&paths, &pieces, &scale);
            let (expected, shared) = following_of_all(&paths, &scale);
            assert_eq!(share, expected, "{agents} agents, {side}, {speed}");
            for (i, j) in (0..agents).flat_map(|i| (0..agents).map(move |j| (i, j))) {
                assert_eq!(touching.touch(i, j), shared[i][j] || shared[j][i], "{i}, {j}");
            }
            let crossed = crossed(&paths, &pieces, &scale);
            assert_eq!(
                crossed,
                crossed_of_all(&paths, &scale),
                "{agents} agents, {side}, {speed}"
            );
            followed += share;
            crossings += crossed;
        }
    }
    assert!(followed > 0.0 && crossings > 0.0, "nothing was compared");
}

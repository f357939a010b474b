//! Behaviours of five values each, for benchmarks.

use murmuration_search::novelty::Behaviours;
use murmuration_swarm::{Purpose, RandomStream};
use rand::RngExt as _;

/// Behaviours in clumps of different widths, as in an archive.
pub fn archive(points: usize) -> Behaviours {
    behaviours(points, 1, |i, stream| {
        let clump = (i % 12) as f64;
        std::array::from_fn(|d| {
            let centre = (clump * (d + 1) as f64 * 0.37) % 1.0;
            centre + stream.random_range(-0.02..0.02) * (1.0 + clump)
        })
    })
}

/// Behaviours without any clusters.
#[allow(dead_code, reason = "not every benchmark asks for it")]
pub fn uniform(points: usize) -> Behaviours {
    behaviours(points, 2, |_, stream| stream.random())
}

/// Behaviours on a curved sheet with a dense core and a sparse tail.
#[allow(dead_code, reason = "not every benchmark asks for it")]
pub fn skewed(points: usize) -> Behaviours {
    behaviours(points, 3, |_, stream| {
        let (a, b) = (
            stream.random::<f64>().powi(4) * 6.0,
            stream.random::<f64>().powi(2) * 3.0,
        );
        let sheet = [2.0 * a.sin(), (a * b).cos(), b, a * 0.5, a * b * 0.2];
        sheet.map(|value| value + stream.random_range(-0.05..0.05))
    })
}

#[expect(clippy::expect_used, reason = "the vectors are made to fit")]
fn behaviours(
    points: usize,
    seed: u64,
    mut point: impl FnMut(usize, &mut RandomStream) -> [f64; 5],
) -> Behaviours {
    let mut stream = RandomStream::derive(seed, Purpose::Start, points as u64);
    let mut behaviours = Behaviours::new(5);
    for i in 0..points {
        behaviours
            .push(&point(i, &mut stream))
            .expect("five small values");
    }
    behaviours
}

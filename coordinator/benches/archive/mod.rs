//! Behaviours to measure on.

use murmuration_proto::{Purpose, Stream};
use murmuration_search::novelty::Behaviours;

/// `points` behaviours of five values: clumps of differing width, as an archive has them.
#[expect(clippy::expect_used, reason = "the vectors are made to fit")]
pub fn archive(points: usize) -> Behaviours {
    let mut stream = Stream::derive(1, Purpose::Start, points as u64);
    let mut behaviours = Behaviours::new(5);
    for i in 0..points {
        let clump = (i % 12) as f64;
        let vector: [f64; 5] = std::array::from_fn(|d| {
            let centre = (clump * (d + 1) as f64 * 0.37) % 1.0;
            centre + stream.between(-0.02, 0.02) * (1.0 + clump)
        });
        behaviours.push(&vector).expect("five small values");
    }
    behaviours
}

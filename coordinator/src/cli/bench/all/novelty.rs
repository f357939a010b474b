//! The novelty of a generation in a large archive on one thread, beside brute force.

use super::{super::cpu_time::CpuTime, CliError, Floor, Row, in_turns};
use murmuration_proto::{Purpose, RandomStream};
use murmuration_search::{
    interrupt::{Interrupt, Interrupted},
    novelty::{Behaviours, Index, novelty_of},
};
use rayon::ThreadPoolBuilder;
use std::{hint::black_box, time::Duration};

const ARCHIVE: usize = 100_000;
const GENERATION: usize = 100;
/// Neighbours that a campaign asks for unless it is told otherwise.
const NEIGHBOURS: usize = 15;

pub(super) fn row(span: Duration) -> Result<Row, CliError> {
    let pool = ThreadPoolBuilder::new().num_threads(1).build();
    let pool = pool.map_err(|error| CliError::Failed(error.to_string()))?;
    let (ours, brute_force) = pool.install(|| measured(span))?;
    let rate = |seconds: f64| GENERATION as f64 / seconds;
    Ok(Row {
        item: "novelty in an archive of 100,000".to_owned(),
        unit: "individuals/s",
        ours: rate(ours),
        peer: brute_force.map(rate),
        peer_name: Some("brute force"),
        floor: Floor {
            count: NEIGHBOURS as u64 + 1,
            of: "distances",
        },
    })
}

fn measured(span: Duration) -> Result<(f64, Option<f64>), CliError> {
    let behaviours = archive(ARCHIVE)?;
    let newest = ARCHIVE - GENERATION..ARCHIVE;
    let mut before = Index::new();
    before.extend(&behaviours.among(&(0..newest.start).collect::<Vec<_>>()));
    let queries: Vec<usize> = newest.clone().collect();
    let never = Interrupt::default();
    in_turns(span, || {
        let mut index = before.clone();
        let ours = timed(|| index.novelty(&behaviours, newest.clone(), NEIGHBOURS, &never))?;
        let brute_force = timed(|| novelty_of(&behaviours, &queries, NEIGHBOURS, &never))?;
        Ok((ours, Some(brute_force)))
    })
}

/// So many behaviours in clumps of differing width, as an archive has them, of five values each.
pub(super) fn archive(len: usize) -> Result<Behaviours, CliError> {
    let mut stream = RandomStream::derive(1, Purpose::Start, len as u64);
    let mut behaviours = Behaviours::new(5);
    for i in 0..len {
        let clump = (i % 12) as f64;
        let behaviour: [f64; 5] = std::array::from_fn(|value| {
            let centre = (clump * (value + 1) as f64 * 0.37) % 1.0;
            centre + stream.between(-0.02, 0.02) * (1.0 + clump)
        });
        let added = behaviours.push(&behaviour);
        added.map_err(|error| CliError::Failed(error.to_string()))?;
    }
    Ok(behaviours)
}

/// Seconds of this thread's CPU time.
fn timed(work: impl FnOnce() -> Result<Vec<f64>, Interrupted>) -> Result<f64, CliError> {
    let begun = CpuTime::of_thread();
    black_box(work()).map_err(|error| CliError::Failed(error.to_string()))?;
    Ok(CpuTime::of_thread().without(begun).as_secs_f64())
}

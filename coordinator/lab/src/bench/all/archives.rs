//! Measurements of large archives: the novelty of a generation on one thread, compared to brute force, and k-medoids by samples,
//! compared to FasterPAM on the whole archive.

use super::{
    super::{process_cpu, thread_cpu},
    CliError, Floor, Row, in_turns,
};
use murmuration_search::{
    interrupt::{Interrupt, Interrupted},
    medoids::{Algorithm, cluster_by},
    novelty::{Behaviours, Index, novelty_of},
};
use murmuration_swarm::{Purpose, RandomStream, grouped};
use rand::RngExt as _;
use rayon::ThreadPoolBuilder;
use std::{hint::black_box, time::Duration};

const ARCHIVE: usize = 100_000;
const GENERATION: usize = 100;
/// Default number of neighbours in a campaign.
const NEIGHBOURS: usize = 15;

pub(super) fn novelty(span: Duration) -> Result<Row, CliError> {
    let pool = ThreadPoolBuilder::new().num_threads(1).build();
    let pool = pool.map_err(CliError::failed)?;
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

/// `len` behaviours of five values each, in clumps of different widths, as in an archive.
fn archive(len: usize) -> Result<Behaviours, CliError> {
    let mut stream = RandomStream::derive(1, Purpose::Start, len as u64);
    let mut behaviours = Behaviours::new(5);
    for i in 0..len {
        let clump = (i % 12) as f64;
        let behaviour: [f64; 5] = std::array::from_fn(|value| {
            let centre = (clump * (value + 1) as f64 * 0.37) % 1.0;
            centre + stream.random_range(-0.02..0.02) * (1.0 + clump)
        });
        let added = behaviours.push(&behaviour);
        added.map_err(CliError::failed)?;
    }
    Ok(behaviours)
}

/// CPU time of this thread for `work`, seconds.
fn timed(work: impl FnOnce() -> Result<Vec<f64>, Interrupted>) -> Result<f64, CliError> {
    let begun = thread_cpu();
    black_box(work()).map_err(CliError::failed)?;
    Ok(thread_cpu().saturating_sub(begun).as_secs_f64())
}

/// Number of clustered individuals for each second of the measurement, and the largest number. The largest number exceeds the
/// size up to which campaigns use FasterPAM.
const EACH_SECOND: f64 = 4_000.0;
const MOST_CLUSTERED: usize = 20_000;
/// Medoids of the paper's taxonomy.
const MEDOIDS: usize = 12;

pub(super) fn medoids(span: Duration) -> Result<Row, CliError> {
    let len = ((EACH_SECOND * span.as_secs_f64()) as usize).clamp(1_000, MOST_CLUSTERED);
    let behaviours = archive(len)?;
    let (ours, full) = in_turns(span, || {
        let ours = clustered(Algorithm::Sampled, &behaviours)?;
        let full = clustered(Algorithm::FasterPam, &behaviours)?;
        Ok((ours, Some(full)))
    })?;
    let rate = |seconds: f64| len as f64 / seconds;
    Ok(Row {
        item: format!("k-medoids of an archive of {}", grouped(len as u64)),
        unit: "individuals/s",
        ours: rate(ours),
        peer: full.map(rate),
        peer_name: Some("FasterPAM"),
        floor: Floor {
            count: MEDOIDS as u64,
            of: "distances",
        },
    })
}

/// CPU time of this process for one clustering, seconds.
fn clustered(algorithm: Algorithm, behaviours: &Behaviours) -> Result<f64, CliError> {
    let begun = process_cpu();
    let mut stream = RandomStream::derive(1, Purpose::Medoids, 0);
    let clustering = cluster_by(
        algorithm,
        behaviours,
        MEDOIDS,
        &mut stream,
        &Interrupt::default(),
        &|_| {},
    );
    black_box(clustering).map_err(CliError::failed)?;
    Ok(process_cpu().saturating_sub(begun).as_secs_f64())
}

//! k-medoids of an archive by samples, as large archives are clustered, beside FasterPAM on all of it.

use super::{super::cpu_time::CpuTime, CliError, Floor, Row, in_turns, novelty::archive};
use murmuration_proto::{Purpose, RandomStream, grouped};
use murmuration_search::{
    interrupt::Interrupt,
    medoids::{Algorithm, cluster_by},
    novelty::Behaviours,
};
use std::{hint::black_box, time::Duration};

/// Individuals for each second of the measurement, and the most: above the size up to which campaigns use FasterPAM.
const EACH_SECOND: f64 = 4_000.0;
const ARCHIVE: usize = 20_000;
/// Medoids of the paper's taxonomy.
const MEDOIDS: usize = 12;

pub(super) fn row(span: Duration) -> Result<Row, CliError> {
    let len = ((EACH_SECOND * span.as_secs_f64()) as usize).clamp(1_000, ARCHIVE);
    let behaviours = archive(len)?;
    let (ours, full) = in_turns(span, || {
        let ours = seconds(Algorithm::Sampled, &behaviours)?;
        let full = seconds(Algorithm::FasterPam, &behaviours)?;
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

/// Seconds of this process's CPU time.
fn seconds(algorithm: Algorithm, behaviours: &Behaviours) -> Result<f64, CliError> {
    let begun = CpuTime::of_process();
    let mut stream = RandomStream::derive(1, Purpose::Medoids, 0);
    let clustering = cluster_by(
        algorithm,
        behaviours,
        MEDOIDS,
        &mut stream,
        &Interrupt::default(),
        &|_| {},
    );
    black_box(clustering).map_err(|error| CliError::Failed(error.to_string()))?;
    Ok(CpuTime::of_process().without(begun).as_secs_f64())
}

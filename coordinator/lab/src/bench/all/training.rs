//! A training step on one thread, compared to a step in PyTorch.

use super::{
    super::{TRAINED_PICTURE, process_cpu},
    CliError, Floor, Row, in_turns,
    peer::Peer,
};
use murmuration_train::bench::Steps;
use rayon::ThreadPoolBuilder;
use std::time::Duration;

const STEP: &str = include_str!("../../../../../trainer/train/benches/pytorch_step.py");
/// Anchors in a step of the default recipe.
const ANCHORS: usize = 256;

pub(super) fn row(span: Duration, python: &str) -> Result<Row, CliError> {
    let cannot = |error: &dyn std::error::Error| CliError::Failed(error.to_string());
    let pool = ThreadPoolBuilder::new().num_threads(1).build();
    let pool = pool.map_err(|error| cannot(&error))?;
    let mut steps = Steps::new(ANCHORS).map_err(|error| cannot(&error))?;
    let mut pytorch = Peer::start(python, "torch", STEP, "1", "");
    let (ours, peer) = in_turns(span, || {
        let begun = process_cpu();
        pool.install(|| steps.step());
        let took = process_cpu().saturating_sub(begun).as_secs_f64();
        Ok((took, pytorch.as_mut().map(best).transpose()?))
    })?;
    Ok(Row {
        item: "training step".to_owned(),
        unit: "steps/s",
        ours: ours.recip(),
        peer: peer.map(f64::recip),
        peer_name: Some("PyTorch at its best"),
        floor: Floor {
            count: 2 * ANCHORS as u64 * TRAINED_PICTURE,
            of: "multiply-adds",
        },
    })
}

/// The least CPU time of a step among PyTorch's modes. The script prints the wall time and the CPU time of each mode.
fn best(pytorch: &mut Peer) -> Result<f64, CliError> {
    let line = pytorch.round()?;
    let ways: Vec<[f64; 2]> = serde_json::from_str(&line).unwrap_or_default();
    let cpu = ways.into_iter().map(|[_, cpu]| cpu);
    cpu.reduce(f64::min).ok_or_else(|| pytorch.failed(&line))
}

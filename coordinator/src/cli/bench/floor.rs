//! The least that things take, counted by hand: docs/performance.md says how.

/// Pairs of robots that look at each other in a simulation of the paper's world: 24 robots, 1,200 steps.
pub(super) const PAIRS: u64 = 24 * 23 * 1200;
/// Operations of a pair of robots with one sensor in a step.
pub(super) const ONE_SENSOR: u64 = 14;
/// Operations of a pair of robots with two sensors in a step.
pub(super) const TWO_SENSORS: u64 = 21;
/// Operations of a simulation of the paper's world with one sensor.
pub(super) const SIMULATION: u64 = PAIRS * ONE_SENSOR;
/// Multiply-adds of a picture in training with the compact network, forward and back.
pub(super) const TRAINED_PICTURE: u64 = 4_546_112;
/// Bytes of a result that the coordinator receives: a picture of 50 x 50 pixels, and five features in f64.
pub(super) const RESULT: u64 = 50 * 50 + 5 * 8;

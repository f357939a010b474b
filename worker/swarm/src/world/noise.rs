//! Noise of robots: wheels that slip, sensors that misread, readings that are delayed.

use crate::{Invalid, invalid, record::record};
use murmuration_proto::v1;

record! {
    /// The noise of a world, off by default. The seed of the start determines all random numbers.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub struct Noise {
        /// Standard deviation of the factor 1 + N(0, slip^2) on each of the two numbers that drive a robot, 0 to 1: the speed of
        /// each wheel, or the speed and turning rate of a unicycle. The factor is drawn for each robot, number and step.
        slip: f64,
        /// Standard deviation of a factor 1 + N(0, gain^2) on each of the two numbers that drive a robot, 0 to 1. Each robot has
        /// two factors of its own, which never change.
        gain: f64,
        /// Probability, for each sensor and step, that a sensor that is on reads off, 0 to 1.
        missed: f64,
        /// Probability, for each sensor and step, that a sensor that is off reads on, 0 to 1.
        false_detection: f64,
        /// Delay of sensor readings, steps, 0 to 1,000. Before the first reading arrives, a robot moves as if all sensors were
        /// off.
        delay: u32,
    }
}

impl Noise {
    /// Normal numbers are truncated at this many standard deviations, so that the speed of robots has a limit.
    pub const MAX_DEVIATIONS: f64 = 4.0;
    /// Largest delay, in steps.
    pub(crate) const MAX_DELAY: u32 = 1000;

    /// Whether there is no noise.
    #[must_use]
    pub fn is_off(&self) -> bool {
        *self == Self::default()
    }

    /// Whether noise changes how robots move.
    #[must_use]
    pub fn moves(&self) -> bool {
        self.slip > 0.0 || self.gain > 0.0
    }

    /// Whether noise changes what sensors read.
    #[must_use]
    pub fn misreads(&self) -> bool {
        self.missed > 0.0 || self.false_detection > 0.0
    }

    /// The largest factor by which noise multiplies a number that drives a robot.
    #[must_use]
    pub fn largest_factor(&self) -> f64 {
        let largest = |deviation: f64| 1.0 + Self::MAX_DEVIATIONS * deviation;
        largest(self.slip) * largest(self.gain)
    }
}

impl TryFrom<v1::Noise> for Noise {
    type Error = Invalid;

    fn try_from(message: v1::Noise) -> Result<Self, Invalid> {
        // Negative zero becomes zero, so that equal noise has equal bits.
        let part = |field, value: Option<f64>| {
            invalid::real(field, value.unwrap_or_default(), 0.0..=1.0).map(|value| value + 0.0)
        };
        Ok(Self {
            slip: part("slip", message.slip)?,
            gain: part("gain", message.gain)?,
            missed: part("missed", message.missed)?,
            false_detection: part("false_detection", message.false_detection)?,
            delay: invalid::whole("delay", message.delay.unwrap_or_default(), 0..=Self::MAX_DELAY)?,
        })
    }
}

impl From<Noise> for v1::Noise {
    fn from(noise: Noise) -> Self {
        Self {
            slip: Some(noise.slip),
            gain: Some(noise.gain),
            missed: Some(noise.missed),
            false_detection: Some(noise.false_detection),
            delay: Some(noise.delay),
        }
    }
}

//! The number of an individual's trials, and the seeds of their starts.

use crate::{Invalid, Purpose, RandomStream, invalid};
use rand::RngExt as _;

/// Number of trials of an individual: simulations of its controller, each from a start of its own. 1 to [`Starts::MAX`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Starts(u32);

impl Starts {
    /// One start, as in the paper.
    pub const ONE: Self = Self(1);
    /// Maximum number of starts.
    pub const MAX: u32 = 16;

    /// Validates a number of starts, in `field`.
    ///
    /// # Errors
    /// The error names `field` if the number is out of range.
    pub fn new(field: &str, starts: u32) -> Result<Self, Invalid> {
        invalid::whole(field, starts, 1..=Self::MAX).map(Self)
    }

    #[must_use]
    pub const fn get(self) -> usize {
        self.0 as usize
    }

    /// The seeds of the starts of an individual: `seed`, and the seeds derived from `seed`.
    pub fn seeds(self, seed: u64) -> impl Iterator<Item = u64> {
        let further = move |start| RandomStream::derive(seed, Purpose::FurtherTrial, start).random();
        std::iter::once(seed).chain((1..u64::from(self.0)).map(further))
    }
}

impl Default for Starts {
    fn default() -> Self {
        Self::ONE
    }
}

impl From<Starts> for u32 {
    fn from(starts: Starts) -> Self {
        starts.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_starts_leave_the_first_ones_as_they_are() {
        let seeds =
            |starts, seed| -> Vec<u64> { Starts::new("starts", starts).unwrap().seeds(seed).collect() };
        assert_eq!(seeds(1, 7), [7]);
        let mut many = seeds(16, 7);
        assert_eq!(many[..5], seeds(5, 7));
        many.extend(seeds(16, 8));
        many.sort_unstable();
        many.dedup();
        assert_eq!(many.len(), 32);
    }

    #[test]
    fn a_number_out_of_range_is_named() {
        for starts in [0, 17] {
            let refused = Starts::new("evaluation.starts", starts).unwrap_err().to_string();
            assert_eq!(
                refused,
                format!("evaluation.starts = {starts}: must be a whole number from 1 to 16")
            );
        }
    }
}

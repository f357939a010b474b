//! How simultaneous campaigns share the workers.

use murmuration_swarm::Invalid;
use std::{fmt, str::FromStr};

/// The weight of a campaign, from 1 to 10,000. Campaigns that run at once share the workers in proportion to their weights.
/// Weights do not affect the results.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Weight(u32);

impl Weight {
    /// The largest weight.
    pub const MOST: u32 = 10_000;

    pub const fn get(self) -> u32 {
        self.0
    }

    /// The campaign's charge for work of this cost, at least the cost. The coordinator compares charges to choose whose turn is
    /// next.
    pub const fn charge(self, cost: u64) -> u64 {
        cost.saturating_mul(Self::MOST as u64) / self.0 as u64
    }
}

/// The default weight is 100, so that other campaigns can have a smaller or a larger weight.
impl Default for Weight {
    fn default() -> Self {
        Self(100)
    }
}

impl fmt::Display for Weight {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl TryFrom<u32> for Weight {
    type Error = Invalid;

    fn try_from(weight: u32) -> Result<Self, Invalid> {
        match weight {
            1..=Self::MOST => Ok(Self(weight)),
            _ => Err(Invalid::new("weight", weight, "a whole number from 1 to 10,000")),
        }
    }
}

impl FromStr for Weight {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        let number: u32 = text
            .parse()
            .map_err(|_| Invalid::new("weight", text, "a whole number from 1 to 10,000"))?;
        number.try_into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twice_the_weight_pays_half_and_nobody_pays_nothing() {
        let weight = |weight: u32| Weight::try_from(weight).unwrap();
        assert_eq!(weight(100).charge(28_800), 2 * weight(200).charge(28_800));
        assert_eq!(weight(Weight::MOST).charge(1), 1);
    }

    #[test]
    fn a_weight_is_from_1_to_10000() {
        for wrong in ["0", "10001", "-1", "1.5", "", "heavy"] {
            let refused = wrong.parse::<Weight>().unwrap_err().to_string();
            assert!(refused.contains("from 1 to 10,000"), "{refused}");
        }
        assert_eq!("10000".parse::<Weight>().unwrap().get(), 10_000);
    }
}

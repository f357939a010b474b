//! Ids of campaigns.

use murmuration_swarm::{CampaignName, Invalid, text};
use std::{fmt, str::FromStr};

/// A campaign's id, `NAME-N`, unique in its store.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CampaignId(String);

impl CampaignId {
    /// The id of a campaign that the store holds.
    pub const fn from_store(id: String) -> Self {
        Self(id)
    }

    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// The number at the end of the id; `None` if it is larger than 2^64 - 1.
    pub fn number(&self) -> Option<u64> {
        self.0.rsplit_once('-')?.1.parse().ok()
    }
}

impl FromStr for CampaignId {
    type Err = Invalid;

    /// Parses an id that comes from outside the store. No valid id can be a path to another folder.
    fn from_str(text: &str) -> Result<Self, Invalid> {
        let refused = || Invalid::new("campaign", text::quoted(text), "an id, NAME-N");
        let (name, number) = text.rsplit_once('-').ok_or_else(refused)?;
        let is_number = (1..=20).contains(&number.len()) && number.bytes().all(|byte| byte.is_ascii_digit());
        if !is_number || CampaignName::try_from(name.to_owned()).is_err() {
            return Err(refused());
        }
        Ok(Self(text.to_owned()))
    }
}

impl fmt::Display for CampaignId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

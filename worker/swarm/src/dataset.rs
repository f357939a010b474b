//! Datasets that embedders are trained on.

use crate::{Invalid, invalid, record::record};
use murmuration_proto::v1;

record! {
    /// Pictures of controllers sampled uniformly from the controller space (paper, "Data and Network Architecture").
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub struct Dataset {
        /// Number of controllers, 4 to 1,000,000.
        controllers: u32,
        /// Number of simulations of each controller, each from its own random start, 1 to 100.
        starts: u32,
        /// Whether the controllers must pass the heuristic filter.
        filter: bool,
    }
}

impl Dataset {
    /// Maximum number of bytes of a dataset's pictures: a trainer holds all pictures in memory.
    pub const MAX_BYTES: u64 = 8 << 30;

    #[must_use]
    pub const fn pictures(&self) -> u64 {
        self.controllers as u64 * self.starts as u64
    }

    /// Validates a dataset. `default` fills absent fields; `bytes` is the size of a picture.
    ///
    /// # Errors
    /// The error names the field that is out of range.
    pub(crate) fn from_message(message: v1::Dataset, default: Self, bytes: usize) -> Result<Self, Invalid> {
        let controllers = message.controllers.unwrap_or(default.controllers);
        let starts = message.starts.unwrap_or(default.starts);
        let dataset = Self {
            controllers: invalid::whole("controllers", controllers, 4..=1_000_000)?,
            starts: invalid::whole("starts", starts, 1..=100)?,
            filter: message.filter.unwrap_or(default.filter),
        };
        if dataset.pictures() * bytes as u64 > Self::MAX_BYTES {
            let allowed = format!("at most {} bytes of pictures in all", Self::MAX_BYTES);
            return Err(Invalid::new("controllers", controllers, allowed));
        }
        Ok(dataset)
    }

    /// The default dataset of a campaign. An untrained network needs fewer controllers, because they only scale its embeddings.
    pub(crate) const fn default_for(untrained: bool, filter: bool) -> Self {
        let (controllers, starts) = if untrained { (1_000, 1) } else { (10_000, 2) };
        Self {
            controllers,
            starts,
            filter,
        }
    }
}

impl From<Dataset> for v1::Dataset {
    fn from(dataset: Dataset) -> Self {
        Self {
            controllers: Some(dataset.controllers),
            starts: Some(dataset.starts),
            filter: Some(dataset.filter),
        }
    }
}

//! What a robot can sense.

use crate::{Invalid, v1};
use std::fmt;

/// A capability model: which sensors a robot has (paper, "Robot Capability Models").
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum CapabilityModel {
    /// One binary line-of-sight sensor straight ahead.
    SingleSensor,
    /// A second sensor, at an angle that is part of the controller.
    TwoSensor,
}

impl CapabilityModel {
    /// Every model.
    pub const ALL: [Self; 2] = [Self::SingleSensor, Self::TwoSensor];

    /// Its name in files and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::SingleSensor => "single-sensor",
            Self::TwoSensor => "two-sensor",
        }
    }

    /// Number of genes of its controllers: 4 or 9.
    #[must_use]
    pub const fn genes(self) -> usize {
        self.speeds() + self.angles()
    }

    /// How many of the genes are wheel speeds: 4 or 8.
    #[must_use]
    pub const fn speeds(self) -> usize {
        match self {
            Self::SingleSensor => 4,
            Self::TwoSensor => 8,
        }
    }

    /// How many of the genes are sensor angles: 0 or 1.
    #[must_use]
    pub const fn angles(self) -> usize {
        match self {
            Self::SingleSensor => 0,
            Self::TwoSensor => 1,
        }
    }
}

impl fmt::Display for CapabilityModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl TryFrom<v1::CapabilityModel> for CapabilityModel {
    type Error = Invalid;

    fn try_from(model: v1::CapabilityModel) -> Result<Self, Invalid> {
        match model {
            v1::CapabilityModel::SingleSensor => Ok(Self::SingleSensor),
            v1::CapabilityModel::TwoSensor => Ok(Self::TwoSensor),
            v1::CapabilityModel::Unspecified => Err(Invalid::new("model", "nothing", one_of())),
        }
    }
}

impl TryFrom<i32> for CapabilityModel {
    type Error = Invalid;

    /// Converts the value of an enum field of a message.
    fn try_from(number: i32) -> Result<Self, Invalid> {
        v1::CapabilityModel::try_from(number)
            .map_err(|_| Invalid::new("model", number, one_of()))?
            .try_into()
    }
}

impl From<CapabilityModel> for v1::CapabilityModel {
    fn from(model: CapabilityModel) -> Self {
        match model {
            CapabilityModel::SingleSensor => Self::SingleSensor,
            CapabilityModel::TwoSensor => Self::TwoSensor,
        }
    }
}

impl std::str::FromStr for CapabilityModel {
    type Err = Invalid;

    fn from_str(name: &str) -> Result<Self, Invalid> {
        Self::ALL
            .into_iter()
            .find(|model| model.name() == name)
            .ok_or_else(|| Invalid::new("model", format!("\"{name}\""), one_of()))
    }
}

fn one_of() -> String {
    CapabilityModel::ALL
        .map(|model| format!("\"{model}\""))
        .join(" or ")
}

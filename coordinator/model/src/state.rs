//! States of a campaign, and the changes that each state allows.

use super::CampaignId;
use murmuration_proto::v1;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CampaignState {
    /// The campaign is at work, or is interrupted because its coordinator ended.
    Running,
    /// A person stopped the campaign, which can resume where it was.
    Paused,
    /// Every generation is evaluated, and the taxonomy is stored.
    Completed,
    /// An error stopped the campaign, which a person can resume.
    Failed,
    /// A person ended the campaign for good.
    Cancelled,
}

/// A change of a campaign by a person.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// Stop, to continue later.
    Pause,
    Resume,
    /// End for good.
    Cancel,
    /// Move to another checkpoint, and go on.
    Adopt,
    /// Learn from labels, and go on.
    Refine,
    /// Search on after the last generation.
    Extend,
}

/// A change that a campaign's state does not allow.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("cannot {} campaign {id}: it {} {}", .change.name(), .state.verb(), .state.name())]
pub struct NotAllowed {
    pub id: CampaignId,
    pub change: Change,
    pub state: CampaignState,
}

impl Change {
    /// The change's name as a command.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pause => "pause",
            Self::Resume => "resume",
            Self::Cancel => "cancel",
            Self::Adopt => "move",
            Self::Refine => "refine",
            Self::Extend => "extend",
        }
    }
}

impl CampaignState {
    pub const ALL: [Self; 5] = [
        Self::Running,
        Self::Paused,
        Self::Completed,
        Self::Failed,
        Self::Cancelled,
    ];

    /// The state's name in the store and on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Running => "running",
            Self::Paused => "paused",
            Self::Completed => "completed",
            Self::Failed => "failed",
            Self::Cancelled => "cancelled",
        }
    }

    /// The verb before the state's name in a refusal: `was already` if the campaign ended before the request, or else `is`.
    const fn verb(self) -> &'static str {
        match self {
            Self::Completed | Self::Cancelled => "was already",
            Self::Running | Self::Paused | Self::Failed => "is",
        }
    }

    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.name() == name)
    }

    /// The state after `change`; `None` if this state does not allow the change.
    pub const fn after(self, change: Change) -> Option<Self> {
        match (self, change) {
            (Self::Running, Change::Pause) => Some(Self::Paused),
            (Self::Running | Self::Paused | Self::Failed, Change::Resume) => Some(Self::Running),
            (Self::Running | Self::Paused | Self::Failed, Change::Cancel) => Some(Self::Cancelled),
            (
                Self::Running | Self::Paused | Self::Failed | Self::Completed,
                Change::Adopt | Change::Refine,
            )
            | (Self::Completed, Change::Extend) => Some(Self::Running),
            (Self::Paused | Self::Failed | Self::Completed | Self::Cancelled, Change::Pause)
            | (Self::Completed | Self::Cancelled, Change::Resume | Change::Cancel)
            | (Self::Cancelled, Change::Adopt | Change::Refine)
            | (Self::Running | Self::Paused | Self::Failed | Self::Cancelled, Change::Extend) => None,
        }
    }
}

impl From<CampaignState> for v1::CampaignState {
    fn from(state: CampaignState) -> Self {
        match state {
            CampaignState::Running => Self::Running,
            CampaignState::Paused => Self::Paused,
            CampaignState::Completed => Self::Completed,
            CampaignState::Failed => Self::Failed,
            CampaignState::Cancelled => Self::Cancelled,
        }
    }
}

impl TryFrom<v1::CampaignState> for CampaignState {
    type Error = murmuration_swarm::Invalid;

    fn try_from(state: v1::CampaignState) -> Result<Self, Self::Error> {
        match state {
            v1::CampaignState::Running => Ok(Self::Running),
            v1::CampaignState::Paused => Ok(Self::Paused),
            v1::CampaignState::Completed => Ok(Self::Completed),
            v1::CampaignState::Failed => Ok(Self::Failed),
            v1::CampaignState::Cancelled => Ok(Self::Cancelled),
            v1::CampaignState::Unspecified => {
                Err(murmuration_swarm::Invalid::missing("state", "a campaign state"))
            }
        }
    }
}

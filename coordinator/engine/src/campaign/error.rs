//! Errors of campaigns.

use crate::{blocking::Broken, queries::QueryError, space::SpaceError, synthetic::AnnotatorError};
use murmuration_dispatch::JobError;
use murmuration_model::{CampaignId, NotAllowed};
use murmuration_proto::SIMULATOR_VERSION;
use murmuration_search::{breeding::ProposeError, interrupt::Interrupted, novelty::Misfit};
use murmuration_store::{
    DecisionError, DeletionError, LabelError, NotesError, StoreError, checkpoints::CheckpointError,
};
use murmuration_swarm::{BehaviourSpace, CampaignName, CheckpointDigest, Invalid, counted};

/// Why a campaign stopped, or a request about it failed.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    NotAllowed(#[from] NotAllowed),
    #[error(transparent)]
    NotDeleted(DeletionError),
    /// The campaign cannot have these tags.
    #[error(transparent)]
    NotNoted(Invalid),
    #[error("campaign {id} cannot be extended: {reason}")]
    NotExtended { id: CampaignId, reason: Invalid },
    #[error(
        "campaign {0} has learned from feedback, so no campaign that asks for more generations from the start would have its \
         archive: `murmuration refine {0}` searches on, by what it has learned"
    )]
    AfterFeedback(CampaignId),
    #[error(
        "campaign {id} belongs to study {}, whose campaigns are compared after equally many generations: give the study more \
         generations, or submit the campaign by itself",
        .study.as_str()
    )]
    OfStudy { id: CampaignId, study: CampaignName },
    #[error(transparent)]
    Job(#[from] JobError),
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    #[error("campaign {id} has no embedder to replace or to fine-tune: its behaviour space is \"{space}\"")]
    NoEmbedding { id: CampaignId, space: BehaviourSpace },
    #[error("campaign {0} has no embedder to fine-tune yet: wait until its first training is done")]
    NoEmbedder(CampaignId),
    #[error(
        "the labels of campaign {id} name {}, and learning takes at least 2 classes: label more individuals",
        counted(*classes as u64, "class")
    )]
    TooFewClasses {
        id: CampaignId,
        /// Number of classes in the labels.
        classes: usize,
    },
    #[error(
        "checkpoint {checkpoint} cannot be fine-tuned, because its training configuration cannot be read ({reason}): move \
         the campaign to a checkpoint that Murmuration trained (`murmuration adopt`)"
    )]
    Untrainable {
        checkpoint: CheckpointDigest,
        reason: String,
    },
    #[error(transparent)]
    Query(QueryError),
    #[error(transparent)]
    Label(#[from] LabelError),
    #[error(transparent)]
    Propose(#[from] ProposeError),
    #[error("a worker returned an impossible evaluation: {0}")]
    Misfit(#[from] Misfit),
    #[error(
        "{wrong} of campaign {id}, computed by worker {workers}, is wrong and cannot be computed again, because labels or \
         another embedder came after it: save the labels (`murmuration labels {id} --csv FILE`), and submit the campaign \
         again"
    )]
    Tainted {
        id: CampaignId,
        wrong: String,
        workers: String,
    },
    #[error(
        "campaign {id} was started with simulator version {theirs}, but this program has version {}, whose evaluations \
         differ: continue the campaign with a program of version {theirs}, or start a new campaign",
        SIMULATOR_VERSION
    )]
    OtherSimulator {
        id: CampaignId,
        /// Version of the simulator that began the campaign.
        theirs: String,
    },
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
    /// A bug ended the search.
    #[error("the search stopped because of a bug, which the log describes; committed data is safe")]
    Broken,
}

impl From<Broken> for CampaignError {
    fn from(_: Broken) -> Self {
        Self::Broken
    }
}

impl From<QueryError> for CampaignError {
    fn from(error: QueryError) -> Self {
        match error {
            QueryError::Space(error) => error.into(),
            error => Self::Query(error),
        }
    }
}

impl From<SpaceError> for CampaignError {
    fn from(error: SpaceError) -> Self {
        match error {
            SpaceError::Store(error) => Self::Store(error),
            SpaceError::Misfit(error) => Self::Misfit(error),
            SpaceError::Interrupted(error) => Self::Interrupted(error),
        }
    }
}

impl From<AnnotatorError> for CampaignError {
    fn from(error: AnnotatorError) -> Self {
        match error {
            AnnotatorError::Store(error) => error.into(),
            AnnotatorError::Query(error) => error.into(),
            AnnotatorError::Job(error) => error.into(),
            AnnotatorError::Broken(error) => error.into(),
        }
    }
}

impl CampaignError {
    /// Why a decision about campaign `id` was not made.
    pub(super) fn undecided(id: CampaignId, error: DecisionError) -> Self {
        match error {
            DecisionError::Store(error) => Self::Store(error),
            DecisionError::NotAllowed(error) => Self::NotAllowed(error),
            DecisionError::Generations(reason) => Self::NotExtended { id, reason },
        }
    }
}

impl From<NotesError> for CampaignError {
    fn from(error: NotesError) -> Self {
        match error {
            NotesError::Store(error) => Self::Store(error),
            NotesError::Invalid(refused) => Self::NotNoted(refused),
        }
    }
}

impl From<DeletionError> for CampaignError {
    fn from(error: DeletionError) -> Self {
        match error {
            DeletionError::Store(error) => Self::Store(error),
            refused => Self::NotDeleted(refused),
        }
    }
}

impl CampaignError {
    /// Whether a person's decision or the coordinator's end stopped the campaign, and not a fault.
    pub(super) const fn is_stop(&self) -> bool {
        matches!(
            self,
            Self::Job(JobError::ShuttingDown)
                | Self::Interrupted(_)
                | Self::Store(StoreError::Superseded(_))
                | Self::Label(LabelError::Store(StoreError::Superseded(_)))
        )
    }

    /// Whether the disk caused the error, so that a retry can succeed.
    pub const fn may_pass(&self) -> bool {
        match self {
            Self::Store(error)
            | Self::Label(LabelError::Store(error))
            | Self::Checkpoint(CheckpointError::Store(error)) => error.may_pass(),
            _ => false,
        }
    }
}

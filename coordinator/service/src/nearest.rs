//! Individuals of an archive that are near a given behaviour.

use super::CampaignApi;
use crate::status::{IntoStatus, OrStatus as _};
use murmuration_engine::{
    blocking::in_background,
    nearest::{Nearest, NearestError},
};
use murmuration_model::CampaignRecord;
use murmuration_proto::v1;
use murmuration_search::interrupt::Interrupt;
use murmuration_swarm::{CheckpointDigest, Evaluation, FEATURE_NAMES, Features, Invalid, counted};
use tonic::Status;

/// Number of individuals in an answer if the request names no number.
const USUAL_COUNT: u32 = 5;
/// Maximum number of individuals in an answer.
const MAX_COUNT: u32 = 100;

/// A behaviour from an archive or from elsewhere.
#[derive(Debug, Clone, PartialEq)]
pub struct OtherBehaviour {
    /// The behaviour's hand-crafted features.
    pub features: Features,
    /// The embedding of the behaviour's picture, and the checkpoint that made the embedding, if any.
    pub embedding: Option<(CheckpointDigest, Vec<f32>)>,
}

impl OtherBehaviour {
    /// The behaviour of an evaluation, with its embedding if a checkpoint made an embedding.
    #[must_use]
    pub fn of(evaluation: &Evaluation, checkpoint: Option<CheckpointDigest>) -> Self {
        Self {
            features: *evaluation.features(),
            embedding: checkpoint.map(|checkpoint| (checkpoint, evaluation.embedding().to_vec())),
        }
    }
}

impl CampaignApi {
    /// The `count` individuals of a campaign's archive that are nearest to `behaviour` (all if there are fewer).
    ///
    /// # Errors
    /// If the archive is empty or cannot be read, or another checkpoint made its embeddings.
    pub async fn nearest(
        &self,
        record: &CampaignRecord,
        behaviour: OtherBehaviour,
        count: usize,
    ) -> Result<Nearest, Status> {
        let (api, record) = (self.clone(), record.clone());
        let find = move |_: &Interrupt| {
            let clustered = api.queries.clusters(&record).or_status()?;
            let OtherBehaviour { features, embedding } = behaviour;
            let (given, embedding) = embedding.unzip();
            let embedded = clustered.space.archive_version.checkpoint;
            if record.spec.space().embeds() && !clustered.space.behaviours.is_empty() && given != embedded {
                return Err(other_checkpoint(&record, given, embedded));
            }
            let classes = api.store.labels(&record.id).or_status()?.by_individual();
            let scale = &clustered.space.scale;
            let vector = scale.behaviour(&features, &embedding.unwrap_or_default());
            Nearest::find(&clustered, &classes, &vector, count).or_status()
        };
        in_background(find).await.or_status()?
    }

    pub(super) async fn find_nearest_of(
        &self,
        request: v1::FindNearestRequest,
    ) -> Result<v1::FindNearestResponse, Status> {
        let count = request.count.unwrap_or(USUAL_COUNT);
        if !(1..=MAX_COUNT).contains(&count) {
            let allowed = format!("a whole number from 1 to {MAX_COUNT}");
            return Err(Invalid::new("count", count, allowed).into());
        }
        let behaviour = OtherBehaviour {
            features: features(&request.features)?,
            embedding: match request.checkpoint.as_str() {
                "" => None,
                digest => Some((digest.parse()?, request.embedding)),
            },
        };
        let record = self.record(&request.campaign).await?;
        let found = self.nearest(&record, behaviour, count as usize).await?;
        Ok(found.into())
    }
}

fn features(values: &[f64]) -> Result<Features, Invalid> {
    let features = Features::try_from(values).ok();
    let finite = features.filter(|features| features.iter().all(|value| value.is_finite()));
    finite.ok_or_else(|| {
        let value = counted(values.len() as u64, "value");
        Invalid::new(
            "features",
            value,
            format!("{} finite numbers", FEATURE_NAMES.len()),
        )
    })
}

fn other_checkpoint(
    record: &CampaignRecord,
    given: Option<CheckpointDigest>,
    embedded: Option<CheckpointDigest>,
) -> Status {
    let named =
        |digest: Option<CheckpointDigest>| digest.map_or("none".to_owned(), |digest| digest.to_string());
    Status::failed_precondition(format!(
        "the embeddings of campaign {} are by checkpoint {}, and the behaviour's is by {}: embed its picture with that checkpoint",
        record.id,
        named(embedded),
        named(given)
    ))
}

impl IntoStatus for NearestError {
    fn into_status(self) -> Status {
        let message = self.to_string();
        match self {
            Self::Empty => Status::failed_precondition(message),
            Self::Misfit(_) => Status::invalid_argument(message),
            Self::NoMedoid(_) => Status::internal(message),
        }
    }
}

//! Measures a completed campaign of a study.

use super::{
    super::{CliError, accuracy, heard::heard},
    campaign::Clients,
    labelled::Labelled,
};
use murmuration_accuracy::Accuracy;
use murmuration_proto::{CampaignSpec, Method, parts::whole, v1};
use murmuration_report::Entry;
use murmuration_search::interrupt::Interrupt;
use murmuration_service::report_data;
use murmuration_study::{
    AccuracyFigures, Individual, JudgedBehaviours, Measure, Measured, Measures, SearchFigures, cell_digest,
    measure_behaviours,
};
use std::sync::Arc;

/// What is measured, and by what; cheap to clone.
#[derive(Debug, Clone)]
pub(super) struct Measuring {
    pub(super) measures: Arc<Measures>,
    /// Its digest.
    pub(super) digest: String,
    pub(super) labelled: Arc<Labelled>,
    /// Ends what is computed.
    pub(super) interrupt: Interrupt,
}

impl Measuring {
    /// Measures a campaign, which is completed.
    pub(super) async fn measure(
        &self,
        clients: &mut Clients,
        spec: &CampaignSpec,
        campaign: &v1::Campaign,
    ) -> Result<Measured, CliError> {
        let request = v1::GetDigestRequest {
            campaign: campaign.id.clone(),
        };
        let digest = heard(clients.campaigns.get_digest(request).await?)?;
        let has = |measure| self.measures.which.contains(&measure);
        Ok(Measured {
            cell: cell_digest(spec),
            measures: self.digest.clone(),
            campaign: campaign.id.clone(),
            archive_digest: digest.digest,
            checkpoint: campaign.checkpoint.clone(),
            evaluations: digest.evaluations,
            behaviours: match has(Measure::Behaviours) {
                true => Some(self.behaviours(clients, spec, &campaign.id).await?),
                false => None,
            },
            accuracy: match has(Measure::Accuracy) {
                true => self.accuracy(clients, spec, campaign).await?,
                false => None,
            },
            search: match has(Measure::Search) {
                true => search(clients, campaign).await?,
                false => None,
            },
        })
    }

    async fn behaviours(
        &self,
        clients: &mut Clients,
        spec: &CampaignSpec,
        campaign: &str,
    ) -> Result<JudgedBehaviours, CliError> {
        let archive = report_data::archive(&mut clients.campaigns, campaign, spec.model()).await?;
        let method = spec.method();
        let individual = |entry: Entry| Individual {
            generation: entry.generation,
            behaviour: method.behaviour(&entry.features, &entry.embedding),
            controller: entry.controller,
            seed: entry.seed,
        };
        let archive: Vec<Individual> = archive.into_iter().map(individual).collect();
        let (spec, measuring) = (spec.clone(), self.clone());
        computed(move || {
            let Self {
                measures, interrupt, ..
            } = &measuring;
            Ok(measure_behaviours(&spec, &archive, measures, interrupt)?)
        })
        .await
    }

    /// The accuracy of what the cell measures novelty by, where that is features alone or an embedding alone.
    async fn accuracy(
        &self,
        clients: &mut Clients,
        spec: &CampaignSpec,
        campaign: &v1::Campaign,
    ) -> Result<Option<AccuracyFigures>, CliError> {
        let (spec, labelled) = (spec.clone(), Arc::clone(&self.labelled));
        let (embedding, measured) = match spec.method() {
            Method::Random | Method::Concatenate | Method::Exhaustive => return Ok(None),
            Method::HandCrafted => {
                let measured = computed(move || labelled.of_features(&spec)).await?;
                ("features".to_owned(), measured)
            }
            Method::Latent | Method::Untrained => {
                let (file, seen) = accuracy::fetch(&mut clients.checkpoints, &campaign.checkpoint).await?;
                let measured = computed(move || labelled.of_checkpoint(&spec, &file, &seen)).await?;
                (campaign.checkpoint.clone(), measured)
            }
        };
        Ok(measured.and_then(|measured| figures(embedding, &measured)))
    }
}

/// `None` without triplets.
fn figures(embedding: String, measured: &Accuracy) -> Option<AccuracyFigures> {
    Some(AccuracyFigures {
        embedding,
        anchor_not_random: measured.anchor_not_random().percent()?,
        every_anchor: measured.every_anchor().percent()?,
    })
}

async fn search(clients: &mut Clients, campaign: &v1::Campaign) -> Result<Option<SearchFigures>, CliError> {
    let request = v1::GetTaxonomyRequest {
        campaign: campaign.id.clone(),
    };
    let taxonomy = clients.campaigns.get_taxonomy(request).await?;
    let taxonomy = whole(taxonomy.into_inner()).await?;
    Ok(campaign.mean_novelty.map(|novelty| SearchFigures {
        loss: taxonomy.loss,
        novelty,
    }))
}

/// What a computation that takes long comes to.
async fn computed<T: Send + 'static>(
    compute: impl FnOnce() -> Result<T, CliError> + Send + 'static,
) -> Result<T, CliError> {
    match tokio::task::spawn_blocking(compute).await {
        Ok(computed) => computed,
        Err(_) => Err(CliError::Failed(
            "a campaign could not be measured because of a bug".to_owned(),
        )),
    }
}

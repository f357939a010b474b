//! Measures a completed campaign of a study.

use super::labelled::Labelled;
use crate::accuracy;
use murmuration_accuracy::Accuracy;
use murmuration_cli::{
    CliError,
    connection::{CheckpointClient, Client, LabelClient},
    validation::get_digest,
};
use murmuration_model::labels::{self, Annotator, Labels};
use murmuration_proto::{parts::whole, v1};
use murmuration_report::Entry;
use murmuration_search::interrupt::Interrupt;
use murmuration_service::report_data;
use murmuration_study::{
    AccuracyFigures, Individual, Judged, JudgedBehaviours, JudgedTrials, Maps, Measure, Measured, Measures,
    RecallCounts, Reference, SearchFigures, cell_digest, measure_behaviours, measure_maps, measure_recall,
};
use murmuration_swarm::{CampaignSpec, Choice, Controller, Features, Invalid, Method, Scale};
use std::{collections::BTreeMap, sync::Arc};

/// The measures of a study and their inputs; cheap to clone.
#[derive(Debug, Clone)]
pub(super) struct Measuring {
    pub(super) measures: Arc<Measures>,
    pub(super) digest: String,
    pub(super) labelled: Arc<Labelled>,
    /// The content of the atlas. The content is set before the first measurement of a cell if the study measures recall or
    /// richness.
    pub(super) reference: Option<Arc<Reference>>,
    pub(super) interrupt: Interrupt,
}

impl Measuring {
    /// The content of the atlas of a study, from the completed campaign of the atlas.
    pub(super) async fn reference(
        &self,
        clients: &mut Clients,
        spec: &CampaignSpec,
        campaign: &v1::Campaign,
    ) -> Result<Reference, CliError> {
        let digest = get_digest(&mut clients.campaigns, &campaign.id).await?.digest;
        let archive = judged_archive(clients, spec, &campaign.id).await?;
        let plan = self.measures.recall.as_ref();
        let niches = plan.map_or(1, |plan| plan.niches.get() as usize);
        let (spec, interrupt) = (spec.clone(), self.interrupt.clone());
        let made = move || {
            let reference = Reference::of(&spec, &archive, niches, &interrupt);
            reference.map_err(CliError::failed)
        };
        Ok(Reference {
            measures: self.digest.clone(),
            campaign: campaign.id.clone(),
            archive_digest: digest,
            ..computed(made).await?
        })
    }

    pub(super) async fn measure(
        &self,
        clients: &mut Clients,
        spec: &CampaignSpec,
        campaign: &v1::Campaign,
    ) -> Result<Measured, CliError> {
        let digest = get_digest(&mut clients.campaigns, &campaign.id).await?;
        let has = |measure| self.measures.which.contains(&measure);
        // The archive is fetched once for all measures.
        let archive = match self.reference.is_some() || has(Measure::Maps) {
            true => Some(Arc::new(judged_archive(clients, spec, &campaign.id).await?)),
            false => None,
        };
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
            shares: match (has(Measure::Shares), &archive) {
                (true, Some(archive)) => Some(shares_of(archive)),
                (true, None) => Some(shares(clients, spec, &campaign.id).await?),
                (false, _) => None,
            },
            accuracy: match has(Measure::Accuracy) {
                true => self.accuracy(clients, spec, campaign).await?,
                false => None,
            },
            search: match has(Measure::Search) {
                true => search(clients, campaign).await?,
                false => None,
            },
            recall: match (&self.reference, &archive) {
                (Some(reference), Some(archive)) => Some(self.recall(spec, archive, reference).await?),
                _ => None,
            },
            maps: match &archive {
                Some(archive) if has(Measure::Maps) => Some(self.maps(spec, archive).await?),
                _ => None,
            },
        })
    }

    async fn maps(&self, spec: &CampaignSpec, archive: &Arc<Vec<Judged>>) -> Result<Maps, CliError> {
        let archive = Arc::clone(archive);
        let (spec, interrupt) = (spec.clone(), self.interrupt.clone());
        computed(move || measure_maps(&spec, &archive, &interrupt).map_err(CliError::failed)).await
    }

    async fn recall(
        &self,
        spec: &CampaignSpec,
        archive: &Arc<Vec<Judged>>,
        reference: &Arc<Reference>,
    ) -> Result<RecallCounts, CliError> {
        let archive = Arc::clone(archive);
        let plan = self.measures.recall.as_ref();
        let at = plan.map(|plan| plan.at.clone()).unwrap_or_default();
        let (spec, reference) = (spec.clone(), Arc::clone(reference));
        let measured = move || {
            let counts = measure_recall(&spec, &archive, &at, &reference);
            counts.map_err(CliError::failed)
        };
        computed(measured).await
    }

    async fn behaviours(
        &self,
        clients: &mut Clients,
        spec: &CampaignSpec,
        campaign: &str,
    ) -> Result<JudgedBehaviours, CliError> {
        // Taxonomies cover the sample.
        let most = spec.sample().map_or(usize::MAX, |sample| sample as usize);
        let archive = report_data::archive(&mut clients.campaigns, campaign, spec.model(), most).await?;
        let learned = match spec.choice() {
            Choice::Medoids => BTreeMap::new(),
            Choice::Coverage | Choice::ByClass => learned_classes(clients, campaign).await?,
        };
        let scale = spec.scale(archive.iter().map(Entry::measured));
        let individual = |(index, entry): (u64, Entry)| Individual {
            generation: entry.generation,
            behaviour: scale.behaviour(&entry.features, &entry.embedding),
            controller: entry.controller,
            seed: entry.seed,
            class: learned.get(&index).copied(),
        };
        let archive: Vec<Individual> = (0..).zip(archive).map(individual).collect();
        let (spec, measuring) = (spec.clone(), self.clone());
        computed(move || {
            let Self {
                measures, interrupt, ..
            } = &measuring;
            measure_behaviours(&spec, &archive, measures, interrupt).map_err(CliError::failed)
        })
        .await
    }

    /// The accuracy of the embedding in which the cell measures novelty or, without an embedding, of the features.
    async fn accuracy(
        &self,
        clients: &mut Clients,
        spec: &CampaignSpec,
        campaign: &v1::Campaign,
    ) -> Result<Option<AccuracyFigures>, CliError> {
        let (spec, labelled) = (spec.clone(), Arc::clone(&self.labelled));
        let (embedding, measured) = match (spec.method(), spec.space().embeds()) {
            (Method::Random | Method::Exhaustive, _) => return Ok(None),
            (_, false) => {
                let measured = computed(move || labelled.of_features(&spec)).await?;
                ("features".to_owned(), measured)
            }
            (_, true) => {
                let (file, seen) = accuracy::fetch(&mut clients.checkpoints, &campaign.checkpoint).await?;
                let measured = computed(move || labelled.of_checkpoint(&spec, &file, &seen)).await?;
                (campaign.checkpoint.clone(), measured)
            }
        };
        Ok(measured.and_then(|measured| figures(embedding, &measured)))
    }
}

/// The class of each individual that the campaign learned from in rounds without people. A round begins with the last answer of
/// the synthetic annotator: the campaign did not learn from later answers of people.
async fn learned_classes(clients: &mut Clients, campaign: &str) -> Result<BTreeMap<u64, u32>, CliError> {
    let request = v1::ListLabelEntriesRequest {
        campaign: campaign.to_owned(),
    };
    let answered = clients.labels.list_label_entries(request).await?;
    let entries = whole(answered.into_inner()).await?.entries.into_iter();
    let mut log: Vec<labels::Entry> = entries.map(labels::Entry::try_from).collect::<Result<_, _>>()?;
    let synthetic = Annotator::synthetic();
    let is_synthetic = |entry: &labels::Entry| entry.change.annotator == synthetic;
    log.truncate(log.iter().rposition(is_synthetic).map_or(0, |last| last + 1));
    let mut labels = Labels::default();
    let followed = labels.follow(log);
    followed.map_err(CliError::failed)?;
    Ok(labels.numbered_classes().into_iter().collect())
}

/// Fetches the workers' verdicts on the trials of a campaign.
async fn shares(
    clients: &mut Clients,
    spec: &CampaignSpec,
    campaign: &str,
) -> Result<JudgedTrials, CliError> {
    let mut trials = JudgedTrials::default();
    let count = |verdict| trials.add(verdict);
    report_data::verdicts(&mut clients.campaigns, campaign, spec, count).await?;
    Ok(trials)
}

/// The verdicts on the trials of an archive that was fetched before.
fn shares_of(archive: &[Judged]) -> JudgedTrials {
    archive
        .iter()
        .flat_map(|judged| judged.verdicts.iter().copied())
        .collect()
}

/// The figures of a measured accuracy; `None` without triplets.
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

/// Runs a long computation on a thread for blocking work.
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

/// The individuals of a campaign with their verdicts, in order.
async fn judged_archive(
    clients: &mut Clients,
    spec: &CampaignSpec,
    campaign: &str,
) -> Result<Vec<Judged>, CliError> {
    let request = v1::GetArchiveRequest {
        campaign: campaign.to_owned(),
        images: false,
    };
    let mut chunks = clients.campaigns.get_archive(request).await?.into_inner();
    let mut archive = Vec::new();
    while let Some(chunk) = chunks.message().await? {
        for individual in chunk.individuals {
            archive.push((report_data::features(&individual.features)?, individual));
        }
    }
    let parts = archive
        .iter()
        .map(|(features, individual)| (*features, individual.embedding.clone()));
    let scale = spec.scale(parts);
    let judged = |(features, individual)| judged(spec, &scale, features, &individual);
    Ok(archive.into_iter().map(judged).collect::<Result<_, _>>()?)
}

fn judged(
    spec: &CampaignSpec,
    scale: &Scale,
    features: Features,
    individual: &v1::Individual,
) -> Result<Judged, Invalid> {
    Ok(Judged {
        behaviour: scale.behaviour(&features, &individual.embedding),
        controller: Controller::new(spec.model(), &individual.controller)?,
        features,
        verdicts: report_data::verdicts_of(spec, individual)?,
    })
}

/// Clients of a coordinator; cheap to clone.
#[derive(Clone)]
pub(super) struct Clients {
    pub(super) campaigns: Client,
    pub(super) checkpoints: CheckpointClient,
    pub(super) labels: LabelClient,
}

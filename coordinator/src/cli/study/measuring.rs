//! Measures a completed campaign of a study.

use super::{
    super::{CliError, accuracy, heard::heard},
    clients::Clients,
    judged,
    labelled::Labelled,
};
use murmuration_accuracy::Accuracy;
use murmuration_model::labels::{self, Annotator, Labels};
use murmuration_proto::{CampaignSpec, Method, parts::whole, v1};
use murmuration_report::Entry;
use murmuration_search::interrupt::Interrupt;
use murmuration_service::report_data;
use murmuration_study::{
    AccuracyFigures, Individual, Judged, JudgedBehaviours, JudgedTrials, Maps, Measure, Measured, Measures,
    RecallCounts, Reference, SearchFigures, cell_digest, measure_behaviours, measure_maps, measure_recall,
};
use std::{collections::BTreeMap, sync::Arc};

/// What is measured, and by what; cheap to clone.
#[derive(Debug, Clone)]
pub(super) struct Measuring {
    pub(super) measures: Arc<Measures>,
    /// Its digest.
    pub(super) digest: String,
    pub(super) labelled: Arc<Labelled>,
    /// What there is to find; known before the first cell is measured, where recall or richness is.
    pub(super) reference: Option<Arc<Reference>>,
    /// Ends what is computed.
    pub(super) interrupt: Interrupt,
}

impl Measuring {
    /// What the atlas of a study holds, once its campaign is completed.
    pub(super) async fn reference(
        &self,
        clients: &mut Clients,
        spec: &CampaignSpec,
        campaign: &v1::Campaign,
    ) -> Result<Reference, CliError> {
        let request = v1::GetDigestRequest {
            campaign: campaign.id.clone(),
        };
        let digest = heard(clients.campaigns.get_digest(request).await?)?.digest;
        let archive = judged::judged_archive(clients, spec, &campaign.id).await?;
        let plan = self.measures.recall.as_ref();
        let niches = plan.map_or(1, |plan| plan.niches.get() as usize);
        let (spec, interrupt) = (spec.clone(), self.interrupt.clone());
        let made = move || {
            let reference = Reference::of(&spec, &archive, niches, &interrupt);
            reference.map_err(|error| CliError::Failed(error.to_string()))
        };
        Ok(Reference {
            measures: self.digest.clone(),
            campaign: campaign.id.clone(),
            archive_digest: digest,
            ..computed(made).await?
        })
    }

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
        // Fetched once, however many measures take it.
        let archive = match self.reference.is_some() || has(Measure::Maps) {
            true => Some(Arc::new(
                judged::judged_archive(clients, spec, &campaign.id).await?,
            )),
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
        computed(move || Ok(measure_maps(&spec, &archive, &interrupt)?)).await
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
            counts.map_err(|error| CliError::Failed(error.to_string()))
        };
        computed(measured).await
    }

    async fn behaviours(
        &self,
        clients: &mut Clients,
        spec: &CampaignSpec,
        campaign: &str,
    ) -> Result<JudgedBehaviours, CliError> {
        let archive = report_data::archive(&mut clients.campaigns, campaign, spec.model()).await?;
        let learned = match spec.medoids_by_class() {
            true => learned_classes(clients, campaign).await?,
            false => BTreeMap::new(),
        };
        let method = spec.method();
        let individual = |(index, entry): (u64, Entry)| Individual {
            generation: entry.generation,
            behaviour: method.behaviour(&entry.features, &entry.embedding),
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

/// By individual, the class by which a campaign whose rounds nobody attends has learned from it: a round begins with the last
/// answer of the synthetic annotator, so what people said later was not learned from.
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
    followed.map_err(|error| CliError::Failed(error.to_string()))?;
    Ok(labels.numbered_classes().into_iter().collect())
}

/// What the workers' judge said of the trials of a campaign.
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

/// The same of an archive that was fetched.
fn shares_of(archive: &[Judged]) -> JudgedTrials {
    archive
        .iter()
        .flat_map(|judged| judged.verdicts.iter().copied())
        .collect()
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

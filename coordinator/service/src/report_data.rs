//! Gathers what a report shows, through the campaign and label services: of this process or of another.

use bytes::Bytes;
use murmuration_model::{
    Repetition,
    labels::{Annotator, Class, Label, given_classes},
};
use murmuration_proto::{
    CampaignSpec, CapabilityModel, Controller, Features, Frames, Invalid, Method, Replay, SIMULATOR_VERSION,
    counted,
    parts::whole,
    v1::{self, campaign_service_client::CampaignServiceClient, label_service_client::LabelServiceClient},
};
use murmuration_report::{Entry, GenerationSummary, Map, MedoidEntry, Names, Report, TrialEntry};
use murmuration_search::{
    interrupt::{Interrupt, Interrupted},
    novelty::{Behaviours, Misfit},
    projection,
};
use tonic::{
    Status,
    body::Body,
    client::GrpcService,
    codegen::{Body as HttpBody, StdError},
};

/// Why there is nothing to report.
#[derive(Debug, thiserror::Error)]
pub enum ReportDataError {
    /// The service refused, or cannot be reached.
    #[error("{}", .0.message())]
    Service(#[from] Status),
    /// The service says what cannot be.
    #[error("the coordinator's answer is invalid: {0}")]
    Answer(#[from] Invalid),
    /// The archive holds vectors that cannot be compared.
    #[error("the archive holds vectors that cannot be compared: {0}")]
    Misfit(#[from] Misfit),
    /// Whoever wanted the report is gone.
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}

/// What the behaviours of a campaign were called, and by whom.
///
/// # Errors
/// See [`ReportDataError`].
pub async fn names<C>(client: &mut LabelServiceClient<C>, campaign: &str) -> Result<Names, ReportDataError>
where
    C: GrpcService<Body> + Send,
    C::ResponseBody: HttpBody<Data = Bytes> + Send + 'static,
    <C::ResponseBody as HttpBody>::Error: Into<StdError> + Send,
    C::Future: Send,
{
    let request = v1::ListLabelsRequest {
        campaign: campaign.to_owned(),
    };
    let labels = whole(client.list_labels(request).await?.into_inner())
        .await?
        .labels;
    let labels = labels.into_iter().map(label).collect::<Result<Vec<_>, _>>()?;
    let request = v1::ListClassesRequest {
        campaign: campaign.to_owned(),
    };
    let classes = client.list_classes(request).await?.into_inner().classes;
    Ok(Names {
        classes: classes
            .iter()
            .filter(|class| class.labels > 0)
            .map(class)
            .collect::<Result<_, _>>()?,
        by_individual: given_classes(labels.into_iter()),
    })
}

fn label(label: v1::Label) -> Result<Label, Invalid> {
    let answer = label.answer.unwrap_or_default();
    Ok(Label {
        entry: label.entry,
        index: answer.index,
        annotator: Annotator::known(&answer.annotator)?,
        answer: answer.answer.parse()?,
        time_ms: answer.time_ms,
    })
}

fn class(class: &v1::LabelClass) -> Result<Class, Invalid> {
    Ok(Class {
        name: class.name.parse()?,
        colour: class.colour.parse()?,
        labels: class.labels,
        // A report is no place to mend names.
        near: Vec::new(),
    })
}

/// The report of a completed campaign, with what its behaviours were called.
///
/// # Errors
/// See [`ReportDataError`].
pub async fn report<C>(
    client: &mut CampaignServiceClient<C>,
    campaign: &str,
    names: Names,
) -> Result<Report, ReportDataError>
where
    C: GrpcService<Body> + Send,
    C::ResponseBody: HttpBody<Data = Bytes> + Send + 'static,
    <C::ResponseBody as HttpBody>::Error: Into<StdError> + Send,
    C::Future: Send,
{
    let id = || campaign.to_owned();
    let status = client
        .get_campaign(v1::GetCampaignRequest { campaign: id() })
        .await?
        .into_inner();
    let spec = CampaignSpec::try_from(status.spec.unwrap_or_default())?;
    let taxonomy = client
        .get_taxonomy(v1::GetTaxonomyRequest { campaign: id() })
        .await?;
    let taxonomy = whole(taxonomy.into_inner()).await?;
    let digest = client
        .get_digest(v1::GetDigestRequest { campaign: id() })
        .await?
        .into_inner();
    let generations = client
        .list_generations(v1::ListGenerationsRequest { campaign: id() })
        .await?;
    let generations = whole(generations.into_inner()).await?;
    let mut individuals = archive(client, campaign, spec.model()).await?;
    let starts = spec.starts().get() as f64;
    for (entry, &robust) in individuals.iter_mut().zip(&taxonomy.robust_trials) {
        entry.robustness = Some(f64::from(robust) / starts);
    }
    let stride = Frames::to_watch(spec.world()).stride().get();
    let mut medoids = Vec::with_capacity(taxonomy.medoids.len());
    for medoid in taxonomy.medoids {
        let individual = medoid.individual.unwrap_or_default();
        let request = v1::GetReplayRequest {
            campaign: id(),
            index: individual.index,
            stride,
        };
        let replay = whole(client.get_replay(request).await?.into_inner()).await?;
        medoids.push(MedoidEntry {
            index: individual.index,
            image: individual.image.unwrap_or_default(),
            cluster_size: medoid.cluster_size,
            mean_distance: medoid.mean_distance,
            novelty: medoid.novelty,
            replay: Replay::try_from(replay)?,
        });
    }
    Ok(Report {
        campaign: id(),
        repetition: repetition(&digest)?,
        digest: digest.digest,
        checkpoint: status.checkpoint,
        created_ms: status.created_ms,
        simulator_version: SIMULATOR_VERSION.to_owned(),
        generations: generations.generations.into_iter().map(generation).collect(),
        map: map(&individuals, spec.method())?,
        individuals,
        medoids,
        clusters: taxonomy.clusters,
        loss: taxonomy.loss,
        names,
        spec,
    })
}

fn repetition(digest: &v1::GetDigestResponse) -> Result<Repetition, Invalid> {
    let rounds = digest.rounds.iter().cloned().map(TryInto::try_into);
    Ok(Repetition {
        rounds: rounds.collect::<Result<_, _>>()?,
        attended: digest.attended,
        adopted: digest.adopted,
    })
}

/// The archive of a campaign with the features and embeddings of its individuals, by index; their robustness is not known.
///
/// # Errors
/// See [`ReportDataError`].
pub async fn archive<C>(
    client: &mut CampaignServiceClient<C>,
    campaign: &str,
    model: &CapabilityModel,
) -> Result<Vec<Entry>, ReportDataError>
where
    C: GrpcService<Body> + Send,
    C::ResponseBody: HttpBody<Data = Bytes> + Send + 'static,
    <C::ResponseBody as HttpBody>::Error: Into<StdError> + Send,
    C::Future: Send,
{
    let request = v1::GetArchiveRequest {
        campaign: campaign.to_owned(),
        images: false,
    };
    let mut chunks = client.get_archive(request).await?.into_inner();
    let mut entries = Vec::new();
    while let Some(chunk) = chunks.message().await? {
        for individual in chunk.individuals {
            entries.push(entry(&individual, model)?);
        }
    }
    Ok(entries)
}

fn entry(individual: &v1::Individual, model: &CapabilityModel) -> Result<Entry, Invalid> {
    let trial = |trial: &v1::Trial| -> Result<TrialEntry, Invalid> {
        Ok(TrialEntry {
            seed: trial.seed,
            features: features(&trial.features)?,
            embedding: trial.embedding.clone(),
        })
    };
    Ok(Entry {
        generation: individual.generation,
        controller: Controller::new(model, &individual.controller)?,
        seed: individual.seed,
        features: features(&individual.features)?,
        embedding: individual.embedding.clone(),
        trials: individual.trials.iter().map(trial).collect::<Result<_, _>>()?,
        robustness: None,
        novelty_when_evaluated: individual.novelty,
    })
}

fn features(values: &[f64]) -> Result<Features, Invalid> {
    Features::try_from(values)
        .map_err(|_| Invalid::new("features", counted(values.len() as u64, "value"), "5 values"))
}

fn generation(summary: v1::GenerationSummary) -> GenerationSummary {
    GenerationSummary {
        generation: summary.generation,
        best_novelty: summary.best_novelty,
        mean_novelty: summary.mean_novelty,
        filtered: summary.filtered,
    }
}

/// The behaviour space along its two principal axes.
fn map(individuals: &[Entry], method: Method) -> Result<Map, ReportDataError> {
    let behaviour = |entry: &Entry| method.behaviour(&entry.features, &entry.embedding);
    let mut behaviours = Behaviours::new(individuals.first().map_or(0, |first| behaviour(first).len()));
    for entry in individuals {
        behaviours.push(&behaviour(entry))?;
    }
    let projection = projection::principal_axes(&behaviours, &Interrupt::default())?;
    let title = |axis: usize| {
        let share = 100.0 * projection.shares[axis];
        format!("principal axis {} ({share:.0}% of the variance)", axis + 1)
    };
    Ok(Map {
        axis_titles: [title(0), title(1)],
        points: projection.points,
    })
}

//! Gathers the contents of a report through the campaign and label services, of this process or of another process.

use bytes::Bytes;
use murmuration_engine::{
    blocking::{Broken, in_background, parallel},
    queries::beyond_medoids,
    taxonomy::{Place, spreads},
};
use murmuration_model::{
    Repetition,
    labels::{Annotator, Class, Label, given_classes},
};
use murmuration_proto::{
    SIMULATOR_VERSION,
    parts::whole,
    v1::{self, campaign_service_client::CampaignServiceClient, label_service_client::LabelServiceClient},
};
use murmuration_report::{
    CarriedName, Entry, FurtherEntry, GenerationSummary, Judged, Map, MedoidEntry, Member, Names,
    PictureSheets, Report, Spread, TrialEntry, picture::PictureError,
};
use murmuration_search::{
    interrupt::{Interrupt, Interrupted},
    medoids::Clustering,
    novelty::{Behaviours, Misfit},
    projection,
};
use murmuration_swarm::{
    CampaignSpec, CapabilityModel, Controller, Features, Frames, Invalid, Replay, Verdict, counted,
};
use tonic::{
    Status,
    body::Body,
    client::GrpcService,
    codegen::{Body as HttpBody, StdError},
};

/// Number of individuals in a report besides the medoids.
const FURTHER: usize = 12;

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
pub enum ReportDataError {
    /// The service refused the request, or cannot be reached.
    #[error("{}", .0.message())]
    Service(#[from] Status),
    /// The answer of the service contains an invalid value.
    #[error("the coordinator's answer is invalid: {0}")]
    Answer(#[from] Invalid),
    /// The archive holds vectors that cannot be compared.
    #[error("the archive holds vectors that cannot be compared: {0}")]
    Misfit(#[from] Misfit),
    /// A picture of an individual cannot be drawn.
    #[error("cannot draw the individuals: {0}")]
    Picture(#[from] PictureError),
    /// A bug in the drawing of pictures.
    #[error(transparent)]
    Broken(#[from] Broken),
    /// The client that requested the report has disconnected.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

/// The carrier of requests to a service: this process or a connection.
pub trait Transport:
    GrpcService<
        Body,
        ResponseBody: HttpBody<Data = Bytes, Error: Into<StdError> + Send> + Send + 'static,
        Future: Send,
    > + Send
{
}

impl<C> Transport for C where
    C: GrpcService<
            Body,
            ResponseBody: HttpBody<Data = Bytes, Error: Into<StdError> + Send> + Send + 'static,
            Future: Send,
        > + Send
{
}

/// Names of a campaign's behaviours, and who gave them.
///
/// # Errors
/// See [`ReportDataError`].
pub async fn names<C: Transport>(
    client: &mut LabelServiceClient<C>,
    campaign: &str,
) -> Result<Names, ReportDataError> {
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
        // Reports have neither shortcuts nor hints about names.
        shortcut: None,
        near: Vec::new(),
    })
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PicturesOf {
    /// The pictures of the medoids and of evenly chosen individuals.
    Individuals,
    /// The pictures of the medoids and of the members that show the spread of their clusters.
    Medoids,
}

/// The report of a completed campaign, with the names of its behaviours.
///
/// # Errors
/// See [`ReportDataError`].
pub async fn report<C: Transport>(
    client: &mut CampaignServiceClient<C>,
    campaign: &str,
    names: Names,
    pictures: PicturesOf,
) -> Result<Report, ReportDataError> {
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
    let mut sheets = PictureSheets::of(taxonomy.clusters.len(), spec.image().shape());
    let wanted = (pictures == PicturesOf::Individuals).then_some(&mut sheets);
    let most = taxonomy.clusters.len();
    let mut individuals = read_archive(client, campaign, spec.model(), most, wanted).await?;
    let starts = spec.starts().get() as f64;
    for (entry, &robust) in individuals.iter_mut().zip(&taxonomy.robust_trials) {
        entry.robustness = Some(f64::from(robust) / starts);
    }
    let centres = taxonomy.medoids.iter();
    let centres: Vec<_> = centres
        .map(|medoid| {
            medoid
                .individual
                .as_ref()
                .map_or(0, |individual| individual.index) as usize
        })
        .collect();
    let clustering = Clustering {
        medoids: centres.clone(),
        clusters: taxonomy.clusters,
        loss: taxonomy.loss,
    };
    let of = spec.clone();
    let measure = move |interrupt: &Interrupt| -> Result<_, ReportDataError> {
        let behaviours = behaviours(&individuals, &of)?;
        let spreads = spreads(&behaviours, &clustering.medoids, &clustering.clusters);
        let mut further = Vec::new();
        // A figure shows only medoids.
        if pictures == PicturesOf::Individuals {
            further = beyond_medoids(&behaviours, &clustering, &of, interrupt)?;
            further.truncate(FURTHER);
        }
        let map = map(&behaviours, interrupt)?;
        Ok((spreads, further, map, individuals, clustering.clusters))
    };
    let measured = in_background(move |interrupt| parallel(|| measure(interrupt)));
    let (spreads, beyond, map, individuals, clusters) = measured.await??;
    let stride = Frames::to_watch(spec.world()).stride().get();
    let mut medoids = Vec::with_capacity(taxonomy.medoids.len());
    for (place, medoid) in taxonomy.medoids.into_iter().enumerate() {
        let individual = medoid.individual.unwrap_or_default();
        let replay = replay(client, campaign, individual.index, stride).await?;
        let spread = match spreads.get(place).copied().flatten() {
            Some(members) => Some(spread(client, campaign, members).await?),
            None => None,
        };
        medoids.push(MedoidEntry {
            index: individual.index,
            image: individual.image.unwrap_or_default(),
            cluster_size: medoid.cluster_size,
            mean_distance: medoid.mean_distance,
            novelty: medoid.novelty,
            replay,
            spread,
            carried: carried(medoid.name)?,
        });
    }
    let mut further = Vec::with_capacity(beyond.len());
    for index in beyond {
        let index = index as u64;
        further.push(FurtherEntry {
            index,
            replay: replay(client, campaign, index, stride).await?,
        });
    }
    let judged_spec = spec.clone();
    let judge = move || {
        let candidate = |index: u64| {
            let entry = individuals.get(index as usize);
            entry.map(|entry| entry.candidate(index))
        };
        let medoids: Vec<_> = centres
            .iter()
            .filter_map(|&index| candidate(index as u64))
            .collect();
        let sample = Judged::sample(&judged_spec, individuals.len()).into_iter();
        let sample: Vec<_> = sample.filter_map(candidate).collect();
        (Judged::of(&judged_spec, &medoids, &sample), individuals)
    };
    let (judged, individuals) = in_background(move |_| parallel(judge)).await?;
    Ok(Report {
        judged: judged?,
        campaign: id(),
        repetition: repetition(&digest)?,
        digest: digest.digest,
        checkpoint: status.checkpoint,
        created_ms: status.created_ms,
        simulator_version: SIMULATOR_VERSION.to_owned(),
        generations: generations.generations.into_iter().map(generation).collect(),
        map,
        pictured: in_background(move |_| sheets.finish()).await??,
        individuals,
        medoids,
        further,
        clusters,
        loss: taxonomy.loss,
        names,
        spec,
    })
}

/// The name of a cluster, if it comes from an earlier version. The labels contain the medoid's own name.
fn carried(name: Option<v1::ClusterName>) -> Result<Option<CarriedName>, Invalid> {
    let name = name.unwrap_or_default();
    let Some(from) = name.carried else {
        return Ok(None);
    };
    Ok(Some(CarriedName {
        class: name.name.parse()?,
        version: from.version,
        place: from.cluster as usize,
        shared: from.shared,
        of: from.members,
    }))
}

fn repetition(digest: &v1::GetDigestResponse) -> Result<Repetition, Invalid> {
    let rounds = digest.rounds.iter().cloned().map(TryInto::try_into);
    Ok(Repetition {
        rounds: rounds.collect::<Result<_, _>>()?,
        attended: digest.attended,
        adopted: digest.adopted,
    })
}

/// The first `most` individuals of a campaign's archive, by index: their features and embeddings, without their robustness.
///
/// # Errors
/// See [`ReportDataError`].
pub async fn archive<C: Transport>(
    client: &mut CampaignServiceClient<C>,
    campaign: &str,
    model: &CapabilityModel,
    most: usize,
) -> Result<Vec<Entry>, ReportDataError> {
    read_archive(client, campaign, model, most, None).await
}

/// The first `most` individuals of a campaign's archive, or all. `sheets`, if given, get their pictures; the pictures of one part
/// are dropped before the next part is read.
async fn read_archive<C: Transport>(
    client: &mut CampaignServiceClient<C>,
    campaign: &str,
    model: &CapabilityModel,
    most: usize,
    mut sheets: Option<&mut PictureSheets>,
) -> Result<Vec<Entry>, ReportDataError> {
    let request = v1::GetArchiveRequest {
        campaign: campaign.to_owned(),
        images: sheets.is_some(),
    };
    let mut chunks = client.get_archive(request).await?.into_inner();
    let mut entries = Vec::new();
    while let Some(chunk) = chunks.message().await? {
        for individual in chunk.individuals.into_iter().take(most - entries.len()) {
            let index = entries.len() as u64;
            entries.push(entry(&individual, model)?);
            if let Some((sheets, image)) = sheets.as_mut().zip(individual.image.as_ref()) {
                sheets.add(index, image)?;
            }
        }
        if entries.len() == most {
            break;
        }
    }
    Ok(entries)
}

/// Calls `count` with the judge's verdict on each trial of a completed campaign, individual by individual. The judge must judge
/// the campaign's individuals.
///
/// # Errors
/// See [`ReportDataError`]; [`ReportDataError::Answer`] if a trial has no verdict.
pub async fn verdicts<C: Transport>(
    client: &mut CampaignServiceClient<C>,
    campaign: &str,
    spec: &CampaignSpec,
    mut count: impl FnMut(Verdict),
) -> Result<(), ReportDataError> {
    let request = v1::GetArchiveRequest {
        campaign: campaign.to_owned(),
        images: false,
    };
    let mut chunks = client.get_archive(request).await?.into_inner();
    while let Some(chunk) = chunks.message().await? {
        for individual in &chunk.individuals {
            verdicts_of(spec, individual)?.into_iter().for_each(&mut count);
        }
    }
    Ok(())
}

/// The judge's verdicts on the trials of an individual. The judge must judge the individuals of its campaign.
///
/// # Errors
/// If a trial has no verdict or an invalid verdict.
pub fn verdicts_of(spec: &CampaignSpec, individual: &v1::Individual) -> Result<Vec<Verdict>, Invalid> {
    let verdicts = &individual.verdicts;
    if verdicts.len() != spec.starts().get() {
        let value = counted(verdicts.len() as u64, "verdict");
        return Err(Invalid::new("verdicts", value, "one for each trial"));
    }
    verdicts
        .iter()
        .map(|&verdict| Verdict::try_from(verdict))
        .collect()
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

/// The features of an individual or a trial.
///
/// # Errors
/// If the number of values is not the number of features.
pub fn features(values: &[f64]) -> Result<Features, Invalid> {
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

async fn replay<C: Transport>(
    client: &mut CampaignServiceClient<C>,
    campaign: &str,
    index: u64,
    stride: u32,
) -> Result<Replay, ReportDataError> {
    let request = v1::GetReplayRequest {
        campaign: campaign.to_owned(),
        index,
        stride,
    };
    let replay = client.get_replay(request).await?.into_inner();
    Ok(Replay::try_from(whole(replay).await?)?)
}

async fn spread<C: Transport>(
    client: &mut CampaignServiceClient<C>,
    campaign: &str,
    members: [Place; 3],
) -> Result<Spread, ReportDataError> {
    let [nearest, median, farthest] = members;
    Ok(Spread {
        nearest: member(client, campaign, nearest).await?,
        median: member(client, campaign, median).await?,
        farthest: member(client, campaign, farthest).await?,
    })
}

async fn member<C: Transport>(
    client: &mut CampaignServiceClient<C>,
    campaign: &str,
    (index, distance): Place,
) -> Result<Member, ReportDataError> {
    let request = v1::GetIndividualRequest {
        campaign: campaign.to_owned(),
        index: index as u64,
    };
    let individual = client.get_individual(request).await?.into_inner();
    Ok(Member {
        index: index as u64,
        distance,
        image: individual.image.unwrap_or_default(),
    })
}

/// The behaviours of an archive, in the space of its campaign.
fn behaviours(individuals: &[Entry], spec: &CampaignSpec) -> Result<Behaviours, ReportDataError> {
    let scale = spec.scale(individuals.iter().map(Entry::measured));
    let behaviour = |entry: &Entry| scale.behaviour(&entry.features, &entry.embedding);
    let mut behaviours = Behaviours::new(individuals.first().map_or(0, |first| behaviour(first).len()));
    for entry in individuals {
        behaviours.push(&behaviour(entry))?;
    }
    Ok(behaviours)
}

/// The map of behaviours along their two principal axes.
fn map(behaviours: &Behaviours, interrupt: &Interrupt) -> Result<Map, ReportDataError> {
    let projection = projection::principal_axes(behaviours, interrupt)?;
    let title = |axis: usize| {
        let share = 100.0 * projection.shares[axis];
        format!("principal axis {} ({share:.0} % of the variance)", axis + 1)
    };
    Ok(Map {
        axis_titles: [title(0), title(1)],
        points: projection.points,
    })
}

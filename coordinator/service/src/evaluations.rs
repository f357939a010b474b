//! Evaluations for searches that run elsewhere: the work of campaigns, without a campaign.

use super::{Permit, Permits, Streamed};
use crate::status::{IntoStatus as _, OrStatus as _};
use futures_util::{StreamExt as _, stream};
use murmuration_dispatch::{Dispatch, Evaluated, EvaluationJob, JobError};
use murmuration_model::{EmbedderRef, MachineId, Maker, Quarantined, Weight};
use murmuration_proto::{
    CampaignSpec, Controller, EmbedderSource, Invalid, counted,
    parts::parts,
    v1::{self, evaluate_request::Part, evaluation_description::Campaign},
};
use murmuration_store::checkpoints::Checkpoints;
use std::{
    collections::BTreeMap,
    iter,
    sync::{Arc, Mutex, PoisonError},
    time::Duration,
};
use tonic::{Request, Response, Status, Streaming};

/// Most controllers of a request.
const MAX_CONTROLLERS: usize = 1024;
/// Most bytes of pictures that the results of a request have.
const MAX_PICTURE_BYTES: usize = 64 << 20;
/// Requests of a stream that are worked on at once: while the results of one are read, the workers have others.
const AT_ONCE: usize = 4;
/// Time that a new stream has to say how it evaluates.
const DESCRIPTION_LIMIT: Duration = Duration::from_secs(10);

/// Implements `murmuration.v1.EvaluationService`.
#[derive(Debug, Clone)]
pub struct EvaluationApi {
    /// Who leases evaluations to workers.
    pub dispatch: Dispatch,
    /// Where embedders are.
    pub checkpoints: Checkpoints,
    /// How many streams there may be at once.
    pub permits: Permits,
}

/// How the controllers of a stream are evaluated.
struct Described {
    spec: CampaignSpec,
    embedder: Option<EmbedderRef>,
    /// Whether results have pictures.
    pictures: bool,
}

#[tonic::async_trait]
impl v1::evaluation_service_server::EvaluationService for EvaluationApi {
    type EvaluateStream = Streamed<v1::EvaluateResponse>;

    async fn evaluate(
        &self,
        request: Request<Streaming<v1::EvaluateRequest>>,
    ) -> Result<Response<Self::EvaluateStream>, Status> {
        let permit = self.permits.evaluations()?;
        let mut requests = request.into_inner();
        let first = tokio::time::timeout(DESCRIPTION_LIMIT, requests.message())
            .await
            .map_err(|_| Status::deadline_exceeded("no description within 10 seconds"))??;
        let described = Arc::new(self.described(first).await?);
        let dispatch = self.dispatch.clone();
        let side = described.spec.image().resolution();
        let quarantined = dispatch.quarantined();
        let unaudited = Arc::<Unaudited>::default();
        let at_the_end = unaudited.clone();
        let mut next = 0;
        let results = requests
            .map(move |request| {
                let first = next;
                let job = request.and_then(|request| described.job(request, first));
                next += job.as_ref().map_or(0, |job| job.tasks.len());
                evaluated(
                    dispatch.clone(),
                    described.clone(),
                    unaudited.clone(),
                    (first, job),
                )
            })
            .buffered(AT_ONCE)
            .flat_map(move |results| tokio_stream::iter(responses(results, side)))
            .chain(
                stream::iter(iter::once_with(move || {
                    at_the_end.check(&quarantined.borrow()).err().map(Err)
                }))
                .filter_map(std::future::ready),
            );
        Ok(Response::new(Box::pin(while_permitted(permit, results))))
    }
}

impl EvaluationApi {
    async fn described(&self, first: Option<v1::EvaluateRequest>) -> Result<Described, Status> {
        let Some(Part::Description(description)) = first.and_then(|first| first.part) else {
            let allowed = "a description in the first request";
            return Err(Invalid::new("part", "something else", allowed).into());
        };
        let spec = match description.campaign {
            Some(Campaign::Spec(spec)) => CampaignSpec::try_from(spec)?,
            Some(Campaign::Toml(text)) => {
                CampaignSpec::from_toml(&text).map_err(|error| Status::invalid_argument(error.to_string()))?
            }
            None => return Err(Invalid::new("campaign", "nothing", "a campaign").into()),
        };
        let embedder = match spec.embedder() {
            Some(EmbedderSource::Published(checkpoint)) => Some(
                self.checkpoints
                    .embedder(*checkpoint, spec.image())
                    .await
                    .or_status()?,
            ),
            Some(EmbedderSource::Trained { .. }) => {
                let allowed = "the digest of a checkpoint: nothing is trained here";
                return Err(Invalid::new("checkpoint", "nothing", allowed).into());
            }
            None => None,
        };
        Ok(Described {
            spec,
            embedder,
            pictures: description.pictures,
        })
    }
}

/// The results of a job, in the order of its controllers.
async fn evaluated(
    dispatch: Dispatch,
    described: Arc<Described>,
    unaudited: Arc<Unaudited>,
    (first, job): (usize, Result<EvaluationJob, Status>),
) -> Result<Vec<v1::EvaluateResult>, Status> {
    let evaluated = dispatch
        .while_staffed(dispatch.evaluate(job?, Arc::default()))
        .await
        .or_status()?
        .map_err(|error| disagreement(error, first))?;
    for (place, evaluated) in evaluated.iter().enumerate() {
        if let Evaluated::Done { maker, .. } = evaluated {
            unaudited.add(*maker, first + place);
        }
    }
    let result = |evaluated| described.result(evaluated);
    Ok(evaluated.into_iter().map(result).collect())
}

/// An error in the words of a stream, whose controllers are numbered through.
fn disagreement(error: JobError, first: usize) -> Status {
    match error {
        JobError::Disagreement { task, workers } => Status::data_loss(format!(
            "workers disagree about controller {} ({}), and no third machine can decide which of them is right: start a worker \
             on another machine, and evaluate again",
            first + task,
            workers.join(" and ")
        )),
        error => error.into_status(),
    }
}

/// The controllers of a stream whose results one machine alone vouches for.
#[derive(Debug, Default)]
struct Unaudited(Mutex<BTreeMap<MachineId, Vec<usize>>>);

impl Unaudited {
    fn add(&self, maker: Maker, controller: usize) {
        if let Some(machine) = maker.unaudited {
            let mut by_machine = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            by_machine.entry(machine).or_default().push(controller);
        }
    }

    /// Whether all machines are still trusted: results cannot be taken back once they are sent.
    fn check(&self, quarantined: &[Quarantined]) -> Result<(), Status> {
        let by_machine = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        for wrong in quarantined {
            if let Some(controllers) = by_machine.get(&wrong.machine) {
                let first = controllers.iter().min().copied().unwrap_or_default();
                return Err(Status::data_loss(format!(
                    "{} was found wrong after it had evaluated {} of this stream, controller {first} among them: evaluate all \
                     controllers again",
                    wrong.name,
                    counted(controllers.len() as u64, "controller"),
                )));
            }
        }
        Ok(())
    }
}

impl Described {
    /// The job that a request is, whose controllers are numbered from `first` in their stream.
    fn job(&self, request: v1::EvaluateRequest, first: usize) -> Result<EvaluationJob, Status> {
        let Some(Part::Controllers(v1::ControllersToEvaluate { tasks })) = request.part else {
            let allowed = "controllers in every request but the first";
            return Err(Invalid::new("part", "something else", allowed).into());
        };
        let most = (MAX_PICTURE_BYTES / self.spec.individual_bytes()).clamp(1, MAX_CONTROLLERS);
        if !(1..=most).contains(&tasks.len()) {
            let allowed = format!("1 to {most} in a request, with pictures of this size");
            return Err(Invalid::new("controllers.tasks", tasks.len(), allowed).into());
        }
        let model = self.spec.model();
        let tasks = tasks.into_iter().enumerate().map(|(place, task)| {
            let controller = Controller::new(model.clone(), &task.controller);
            let controller =
                controller.map_err(|error| error.within(&format!("controllers[{}]", first + place)))?;
            Ok((controller, task.seed))
        });
        Ok(EvaluationJob {
            campaign: None,
            weight: Weight::default(),
            model: model.clone(),
            world: self.spec.world().clone(),
            image: *self.spec.image(),
            embedder: self.embedder,
            starts: self.spec.starts(),
            judges: self.spec.judges(),
            tasks: tasks.collect::<Result<_, Invalid>>()?,
        })
    }

    fn result(&self, evaluated: Evaluated) -> v1::EvaluateResult {
        match evaluated {
            Evaluated::Done { trials, .. } => v1::EvaluateResult {
                trials: trials
                    .into_iter()
                    .map(|trial| {
                        let trial = v1::Evaluation::from(trial);
                        let image = if self.pictures { trial.image } else { Vec::new() };
                        v1::Evaluation { image, ..trial }
                    })
                    .collect(),
                failure: String::new(),
            },
            Evaluated::Poisoned(task) => v1::EvaluateResult {
                trials: Vec::new(),
                failure: task.to_string(),
            },
        }
    }
}

/// Results as messages of a bounded size; after an error nothing more.
fn responses(
    results: Result<Vec<v1::EvaluateResult>, Status>,
    side: u32,
) -> Vec<Result<v1::EvaluateResponse, Status>> {
    match results {
        Ok(results) => parts(results, |results| Ok(v1::EvaluateResponse { results, side })).collect(),
        Err(status) => vec![Err(status)],
    }
}

/// A stream that holds a permit for as long as it lasts.
fn while_permitted<T>(
    permit: Permit,
    stream: impl futures_util::Stream<Item = T>,
) -> impl futures_util::Stream<Item = T> {
    stream.map(move |item| {
        let _held = &permit;
        item
    })
}

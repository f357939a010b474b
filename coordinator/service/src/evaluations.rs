//! Evaluations without a campaign, for searches that run elsewhere.

use super::Streamed;
use crate::{
    simulations::{Simulation, send_motion, spec_of},
    status::{IntoStatus as _, OrStatus as _},
};
use futures_util::{Stream, StreamExt as _, stream};
use murmuration_dispatch::{Dispatch, Evaluated, EvaluationJob, JobError, JobProgress, Submitter};
use murmuration_engine::blocking::spawn;
use murmuration_model::{EmbedderRef, MachineId, Maker, Quarantined, Weight};
use murmuration_proto::{
    parts::parts,
    v1::{self, evaluate_request::Part},
};
use murmuration_store::{StoreError, checkpoints::Checkpoints};
use murmuration_swarm::{
    CampaignSpec, CompressedImage, Controller, EmbedderSource, Evaluation, Invalid, counted, start_seed,
};
use std::{
    collections::BTreeMap,
    pin::pin,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};
use tokio::{
    sync::{mpsc, oneshot},
    time::Instant,
};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status, Streaming};

/// Maximum number of controllers in a request.
const MAX_CONTROLLERS: usize = 1024;
/// Maximum size in bytes of the pictures in the results of a request.
const MAX_PICTURE_BYTES: usize = 64 << 20;
/// Number of requests of a stream that are evaluated at once, so that workers are busy while a client reads results.
const AT_ONCE: usize = 4;
/// Time limit for the description on a new stream.
const DESCRIPTION_LIMIT: Duration = Duration::from_secs(10);
/// Time limit for a stream without a request from the client, or without room for a result. A search that needs longer opens
/// another stream.
const IDLE_LIMIT: Duration = Duration::from_secs(60 * 60);

/// Implements `murmuration.v1.EvaluationService`.
#[derive(Debug, Clone)]
pub struct EvaluationApi {
    /// The dispatcher that leases evaluations to workers.
    pub dispatch: Dispatch,
    /// The store of checkpoints.
    pub checkpoints: Checkpoints,
}

/// The description of a stream: how its controllers are evaluated.
struct Described {
    spec: CampaignSpec,
    embedder: Option<EmbedderRef>,
    /// Whether results contain pictures.
    pictures: bool,
    /// The seed from which the seeds of controllers derive; `None` if the requests contain them.
    seed: Option<u64>,
    submitter: Submitter,
}

#[tonic::async_trait]
impl v1::evaluation_service_server::EvaluationService for EvaluationApi {
    type EvaluateStream = Streamed<v1::EvaluateResponse>;

    async fn evaluate(
        &self,
        request: Request<Streaming<v1::EvaluateRequest>>,
    ) -> Result<Response<Self::EvaluateStream>, Status> {
        let mut requests = request.into_inner();
        let first = tokio::time::timeout(DESCRIPTION_LIMIT, requests.message())
            .await
            .map_err(|_| Status::deadline_exceeded("no description within 10 seconds"))??;
        let described = Arc::new(self.described(first).await?);
        let dispatch = self.dispatch.clone();
        let side = described.spec.image().resolution();
        let unaudited = Arc::<Unaudited>::default();
        let audits = StreamAudits {
            dispatch: dispatch.clone(),
            submitter: described.submitter.clone(),
            unaudited: unaudited.clone(),
        };
        let mut next = 0;
        let at_work = Arc::<AtWork>::default();
        let taken = at_work.clone();
        let results = within_limit(requests, at_work.clone())
            .map(move |request| {
                let first = next;
                let job = request.and_then(|request| described.job(request, first));
                next += job.as_ref().map_or(0, |job| job.tasks.len());
                let evaluated = evaluated(dispatch.clone(), described.clone(), unaudited.clone(), first, job);
                at_work.begin();
                let at_work = at_work.clone();
                async move {
                    let results = evaluated.await;
                    at_work.end();
                    results
                }
            })
            .buffered(AT_ONCE)
            .flat_map(move |results| tokio_stream::iter(responses(results, side)))
            .chain(stream::once(audits.end()).filter_map(|end| std::future::ready(end.err().map(Err))));
        let (sender, receiver) = mpsc::channel(2);
        let (late, text) = oneshot::channel();
        tokio::spawn(async move {
            if let Err(status) = forward(results, &sender, || taken.touch()).await {
                // The client may have disconnected.
                let _ = late.send(status);
            }
        });
        let end = stream::once(text).filter_map(|text| std::future::ready(text.ok().map(Err)));
        Ok(Response::new(Box::pin(ReceiverStream::new(receiver).chain(end))))
    }

    type SimulateStream = Streamed<v1::Motion>;

    async fn simulate(
        &self,
        request: Request<v1::SimulateRequest>,
    ) -> Result<Response<Self::SimulateStream>, Status> {
        let simulation = Simulation::try_from(request.into_inner())?;
        let (parts, stream) = mpsc::channel(1);
        spawn(async move { send_motion(simulation, &parts).await });
        Ok(Response::new(Box::pin(ReceiverStream::new(stream))))
    }
}

impl EvaluationApi {
    async fn described(&self, first: Option<v1::EvaluateRequest>) -> Result<Described, Status> {
        let Some(Part::Description(description)) = first.and_then(|first| first.part) else {
            let allowed = "a description in the first request";
            return Err(Invalid::new("part", "something else", allowed).into());
        };
        let spec = spec_of(description.campaign)?;
        let embedder = match spec.embedder() {
            Some(EmbedderSource::Published(checkpoint)) => Some(
                self.checkpoints
                    .embedder(*checkpoint, spec.image())
                    .await
                    .or_status()?,
            ),
            Some(EmbedderSource::Trained { .. }) => {
                let allowed = "the digest of a checkpoint: an evaluation trains no embedder";
                return Err(Invalid::missing("checkpoint", allowed).into());
            }
            None => None,
        };
        Ok(Described {
            spec,
            embedder,
            pictures: description.pictures,
            seed: description.seed,
            submitter: self.dispatch.new_stream(),
        })
    }
}

/// The results of a job, in the order of its controllers; `first` is the place of its first controller in the stream.
async fn evaluated(
    dispatch: Dispatch,
    described: Arc<Described>,
    unaudited: Arc<Unaudited>,
    first: usize,
    job: Result<EvaluationJob, Status>,
) -> Result<Vec<v1::EvaluateResult>, Status> {
    let job = job?;
    let seeds: Vec<u64> = job.tasks.iter().map(|(_, seed)| *seed).collect();
    let evaluated = dispatch
        .while_staffed(dispatch.evaluate(job, Arc::default()))
        .await
        .or_status()?
        .map_err(|error| disagreement(error, first))?;
    for (place, evaluated) in evaluated.iter().enumerate() {
        if let Evaluated::Done { maker, .. } = evaluated {
            unaudited.add(*maker, first + place);
        }
    }
    let results = evaluated.into_iter().zip(seeds);
    results
        .map(|(evaluated, seed)| described.result(evaluated, seed))
        .collect()
}

/// The audits that go on after the jobs of a stream. They end with the stream.
struct StreamAudits {
    dispatch: Dispatch,
    submitter: Submitter,
    unaudited: Arc<Unaudited>,
}

impl StreamAudits {
    /// Waits until all results of the stream are as certain as they can become.
    async fn end(self) -> Result<(), Status> {
        let quarantined = self.dispatch.quarantined();
        loop {
            let seen = quarantined.borrow().len();
            self.unaudited.check(&quarantined.borrow())?;
            let are_over = self
                .dispatch
                .audited(&self.submitter, seen, &JobProgress::default())
                .await;
            if let Some(JobError::Disagreement { workers, .. }) =
                self.dispatch.take_disagreement(&self.submitter)
            {
                return Err(disagree("a controller of this stream", &workers));
            }
            if are_over {
                return Ok(());
            }
        }
    }
}

impl Drop for StreamAudits {
    fn drop(&mut self) {
        let (dispatch, submitter) = (self.dispatch.clone(), self.submitter.clone());
        // Outside of a runtime, the dispatcher has ended.
        if let Ok(runtime) = tokio::runtime::Handle::try_current() {
            runtime.spawn(async move { dispatch.withdraw_audits(submitter).await });
        }
    }
}

fn disagree(about: &str, workers: &[String]) -> Status {
    Status::data_loss(format!(
        "workers disagree about {about} ({}), and no third machine can decide which of them is right: start a worker on another \
         machine, and evaluate again",
        workers.join(" and ")
    ))
}

/// Converts an error to a status that numbers the controllers as in the stream.
fn disagreement(error: JobError, first: usize) -> Status {
    match error {
        JobError::Disagreement { task, workers } => {
            disagree(&format!("controller {}", first + task), &workers)
        }
        error => error.into_status(),
    }
}

/// For each machine, the controllers of a stream whose results only this machine has computed: the first one, and their number.
#[derive(Debug, Default)]
struct Unaudited(Mutex<BTreeMap<MachineId, (usize, u64)>>);

impl Unaudited {
    fn add(&self, maker: Maker, controller: usize) {
        if let Some(machine) = maker.unaudited {
            let mut by_machine = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            let (first, count) = by_machine.entry(machine).or_insert((controller, 0));
            (*first, *count) = ((*first).min(controller), *count + 1);
        }
    }

    /// Checks that no machine with unaudited results is quarantined. Results cannot be taken back once they are sent.
    fn check(&self, quarantined: &[Quarantined]) -> Result<(), Status> {
        let by_machine = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        for wrong in quarantined {
            if let Some(&(first, count)) = by_machine.get(&wrong.machine) {
                return Err(Status::data_loss(format!(
                    "{} returned wrong results, and had evaluated {} of this stream, controller {first} among them: evaluate \
                     all controllers again",
                    wrong.name,
                    counted(count, "controller"),
                )));
            }
        }
        Ok(())
    }
}

impl Described {
    /// The job for a request, whose first controller has the number `first` in its stream.
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
            let derived = self.seed.map(|seed| start_seed(seed, (first + place) as u64));
            Ok((controller, derived.unwrap_or(task.seed)))
        });
        Ok(EvaluationJob {
            submitter: Some(self.submitter.clone()),
            weight: Weight::default(),
            model: model.clone(),
            world: self.spec.world().clone(),
            image: *self.spec.image(),
            embedder: self.embedder,
            starts: self.spec.starts(),
            judges: self.spec.judges(),
            tasks: tasks.collect::<Result<_, Invalid>>()?,
            next: false,
        })
    }

    fn result(&self, evaluated: Evaluated, seed: u64) -> Result<v1::EvaluateResult, Status> {
        Ok(match evaluated {
            Evaluated::Done { trials, .. } => v1::EvaluateResult {
                trials: trials
                    .into_iter()
                    .map(|trial| self.trial(&trial))
                    .collect::<Result<_, _>>()?,
                failure: String::new(),
                seed,
            },
            Evaluated::Poisoned(task) => v1::EvaluateResult {
                trials: Vec::new(),
                failure: task.to_string(),
                seed,
            },
        })
    }

    fn trial(&self, trial: &Evaluation<CompressedImage>) -> Result<v1::Evaluation, Status> {
        let pixels = || {
            trial
                .image()
                .pixels()
                .map_err(StoreError::Compression)
                .or_status()
        };
        Ok(v1::Evaluation {
            features: trial.features().to_vec(),
            image: if self.pictures { pixels()? } else { Vec::new() },
            embedding: trial.embedding().to_vec(),
            verdict: trial.verdict().map_or(0, |verdict| verdict.number().into()),
        })
    }
}

/// Results as messages of a bounded size, or the error.
fn responses(
    results: Result<Vec<v1::EvaluateResult>, Status>,
    side: u32,
) -> Vec<Result<v1::EvaluateResponse, Status>> {
    match results {
        Ok(results) => parts(results, |results| Ok(v1::EvaluateResponse { results, side })).collect(),
        Err(status) => vec![Err(status)],
    }
}

/// The number of requests that are being evaluated, and the time since which the stream waits for its client.
#[derive(Debug)]
struct AtWork(Mutex<(usize, Instant)>);

impl Default for AtWork {
    fn default() -> Self {
        Self(Mutex::new((0, Instant::now())))
    }
}

impl AtWork {
    fn begin(&self) {
        self.lock().0 += 1;
    }

    fn end(&self) {
        let mut at_work = self.lock();
        *at_work = (at_work.0.saturating_sub(1), Instant::now());
    }

    /// Records that the client has taken a result.
    fn touch(&self) {
        self.lock().1 = Instant::now();
    }

    /// The end of the time limit for an idle client; `None` while it waits for results.
    fn deadline(&self) -> Option<Instant> {
        let (requests, last) = *self.lock();
        (requests == 0).then_some(last + IDLE_LIMIT)
    }

    fn lock(&self) -> MutexGuard<'_, (usize, Instant)> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The requests of a stream. The stream fails if no request arrives within the time limit while nothing is evaluated: an idle
/// stream must not hold its permit for ever.
fn within_limit<T>(
    requests: impl Stream<Item = Result<T, Status>> + Unpin,
    at_work: Arc<AtWork>,
) -> impl Stream<Item = Result<T, Status>> {
    stream::unfold(Some((requests, at_work)), |state| async {
        let (mut requests, at_work) = state?;
        let mut deadline = Instant::now() + IDLE_LIMIT;
        loop {
            match tokio::time::timeout_at(deadline, requests.next()).await {
                Ok(next) => return next.map(|next| (next, Some((requests, at_work)))),
                Err(_) => match at_work.deadline() {
                    None => deadline = Instant::now() + IDLE_LIMIT,
                    Some(later) if later > Instant::now() => deadline = later,
                    Some(_) => {
                        let message = format!(
                            "no request within {} minutes: open another stream for the next request",
                            IDLE_LIMIT.as_secs() / 60
                        );
                        return Some((Err(Status::deadline_exceeded(message)), None));
                    }
                },
            }
        }
    })
}

/// Sends the items of a stream while the client is connected, and calls `sent` after each item. Fails if the client takes no item
/// in time.
async fn forward<T>(
    items: impl Stream<Item = T>,
    sender: &mpsc::Sender<T>,
    sent: impl Fn(),
) -> Result<(), Status> {
    let mut items = pin!(items);
    loop {
        let next = tokio::select! {
            () = sender.closed() => return Ok(()),
            next = items.next() => next,
        };
        let Some(item) = next else {
            return Ok(());
        };
        match tokio::time::timeout(IDLE_LIMIT, sender.send(item)).await {
            Ok(Ok(())) => sent(),
            Ok(Err(_)) => return Ok(()),
            Err(_) => {
                let minutes = IDLE_LIMIT.as_secs() / 60;
                let message = format!("the client took no result within {minutes} minutes: evaluate again");
                return Err(Status::deadline_exceeded(message));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tonic::Code;

    #[tokio::test(start_paused = true)]
    async fn a_stream_without_requests_ends_with_a_word() {
        let (sender, receiver) = tokio::sync::mpsc::channel(1);
        let at_work = Arc::<AtWork>::default();
        let requests = ReceiverStream::new(receiver);
        let mut requests = Box::pin(within_limit(requests, at_work.clone()));
        sender.send(Ok(1)).await.unwrap();
        assert_eq!(requests.next().await.unwrap().unwrap(), 1);
        // The limit does not apply during an evaluation.
        at_work.begin();
        let waited = tokio::time::timeout(5 * IDLE_LIMIT / 2, requests.next()).await;
        assert!(waited.is_err());
        // The end of an evaluation restarts the limit.
        at_work.end();
        let ended = Instant::now();
        let refused = requests.next().await.unwrap().unwrap_err();
        assert!(ended.elapsed() >= IDLE_LIMIT);
        assert_eq!(refused.code(), Code::DeadlineExceeded, "{refused}");
        assert!(requests.next().await.is_none());
        drop(sender);
    }

    #[tokio::test(start_paused = true)]
    async fn a_client_that_takes_no_result_is_not_waited_for_ever() {
        let (sender, mut receiver) = mpsc::channel(1);
        let sent = Mutex::new(0);
        let count = || *sent.lock().unwrap() += 1;
        let refused = forward(stream::iter([1, 2, 3]), &sender, count)
            .await
            .unwrap_err();
        assert_eq!(refused.code(), Code::DeadlineExceeded, "{refused}");
        assert_eq!(*sent.lock().unwrap(), 1);
        assert_eq!(receiver.recv().await, Some(1));
        // A client that disconnects ends the stream at once, even during an evaluation.
        drop(receiver);
        forward(stream::pending::<i32>(), &sender, || {}).await.unwrap();
    }
}

//! The peer of a campaign: the same evaluations on the same number of threads, with nothing else.

use super::{CliError, Took, process_cpu};
use murmuration_embed::{EmbedError, Embedder, Runtime};
use murmuration_onnx::EmbedderModel;
use murmuration_sim::{evaluate::Evaluator, simulate::Start};
use murmuration_swarm::{CampaignSpec, Controller, Evaluation};
use std::{
    hint::black_box,
    sync::atomic::{AtomicUsize, Ordering},
    thread,
    time::Instant,
};

/// Evaluations that a thread takes at a time.
const AT_ONCE: usize = 64;

/// One evaluator per thread, and one embedder per thread if pictures are embedded.
pub(in crate::bench) struct PlainLoop {
    threads: Vec<(Evaluator, Option<Embedder>)>,
}

impl PlainLoop {
    pub(in crate::bench) fn new(
        spec: &CampaignSpec,
        model: Option<&[u8]>,
        threads: usize,
    ) -> Result<Self, CliError> {
        let thread = |_| {
            let evaluator = Evaluator::new(spec.world(), spec.image())?;
            Ok((evaluator, model.map(embedder).transpose()?))
        };
        let threads = (0..threads).map(thread).collect::<Result<_, CliError>>()?;
        Ok(Self { threads })
    }

    pub(in crate::bench) fn run(self, tasks: &[(Controller, Start)]) -> Result<Took, CliError> {
        let next = AtomicUsize::new(0);
        let (begun, cpu) = (Instant::now(), process_cpu());
        thread::scope(|scope| {
            let work = |(evaluator, embedder)| scope.spawn(|| work(evaluator, embedder, tasks, &next));
            let threads: Vec<_> = self.threads.into_iter().map(work).collect();
            let ended = threads.into_iter().map(|thread| match thread.join() {
                Ok(ended) => ended,
                Err(_) => Err(CliError::Failed(
                    "a thread of the plain loop ended early".to_owned(),
                )),
            });
            ended.collect::<Result<Vec<()>, _>>()
        })?;
        Ok(Took {
            wall: begun.elapsed(),
            cpu: process_cpu().saturating_sub(cpu),
        })
    }
}

fn work(
    mut evaluator: Evaluator,
    mut embedder: Option<Embedder>,
    tasks: &[(Controller, Start)],
    next: &AtomicUsize,
) -> Result<(), CliError> {
    loop {
        let first = next.fetch_add(AT_ONCE, Ordering::Relaxed).min(tasks.len());
        let part = &tasks[first..tasks.len().min(first + AT_ONCE)];
        if part.is_empty() {
            return Ok(());
        }
        let evaluations = evaluator.evaluate_all(part)?;
        if let Some(embedder) = &mut embedder {
            let images: Vec<&[u8]> = evaluations.iter().map(Evaluation::<Vec<u8>>::image).collect();
            black_box(embedder.embed(&images).map_err(failed)?);
        }
        black_box(evaluations);
    }
}

fn embedder(model: &[u8]) -> Result<Embedder, CliError> {
    let model = EmbedderModel::read(model).map_err(|error| CliError::Input(error.to_string()))?;
    Embedder::open(&Runtime::load()?, model).map_err(failed)
}

fn failed(error: EmbedError) -> CliError {
    CliError::Failed(error.to_string())
}

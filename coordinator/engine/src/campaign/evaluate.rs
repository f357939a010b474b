//! Evaluations by the workers, with substitutes for poisoned tasks.

use super::CampaignError;
use murmuration_dispatch::{Dispatch, Evaluated, EvaluationJob, JobError, JobProgress, PoisonedTask};
use murmuration_model::Maker;
use murmuration_search::breeding::{EVALUATION_ATTEMPTS, ProposeError};
use murmuration_store::{Picture, Provenance};
use murmuration_swarm::{CompressedImage, Controller, Evaluation};
use std::{collections::BTreeMap, sync::Arc};

/// The results of a job.
#[derive(Debug)]
pub(super) struct Done {
    /// The completed tasks: the job's tasks, with substitutes for poisoned tasks.
    pub(super) tasks: Vec<(Controller, u64)>,
    /// The trials of each task.
    pub(super) evaluations: Vec<Vec<Evaluation<CompressedImage>>>,
    /// The maker of each task's result.
    pub(super) makers: Vec<Maker>,
    /// The place of each poisoned task in the job, with the reason.
    pub(super) poisoned: Vec<(usize, PoisonedTask)>,
}

impl Done {
    /// The pictures of all tasks (one trial each), and their provenance. `notice` makes the message about a poisoned task.
    pub(super) fn into_pictures(
        self,
        notice: impl Fn(usize, &PoisonedTask) -> String,
    ) -> (Vec<Picture<CompressedImage>>, Provenance) {
        let picture = |((controller, seed), evaluation): ((Controller, u64), Evaluation<_>)| Picture {
            controller,
            seed,
            features: Some(*evaluation.features()),
            image: evaluation.into_image(),
        };
        let notices = self.poisoned.iter().map(|(place, reason)| notice(*place, reason));
        let provenance = Provenance {
            notices: notices.collect(),
            makers: self.makers,
        };
        let trials = self.evaluations.into_iter().flatten();
        let pictures = self.tasks.into_iter().zip(trials).map(picture);
        (pictures.collect(), provenance)
    }
}

/// A task and its place in a job.
pub(super) type Placed = (usize, (Controller, u64));

/// Runs `job` on the workers. `substitute` gets the place of a poisoned task and the number of the attempt, from 1. It returns
/// the tasks to run instead, including new tasks for neighbours that belong with the poisoned task.
pub(super) async fn evaluate(
    dispatch: &Dispatch,
    job_progress: Arc<JobProgress>,
    job: EvaluationJob,
    substitute: impl Fn(usize, u64) -> Result<Vec<Placed>, ProposeError>,
) -> Result<Done, CampaignError> {
    let mut tasks = job.tasks.clone();
    let mut results: Vec<Option<(Vec<Evaluation<_>>, Maker)>> = vec![None; tasks.len()];
    let mut poisoned = Vec::new();
    let mut wanted: Vec<Placed> = tasks.iter().cloned().enumerate().collect();
    for attempt in 1.. {
        let job = EvaluationJob {
            submitter: job.submitter.clone(),
            model: job.model.clone(),
            world: job.world.clone(),
            tasks: wanted.iter().map(|(_, task)| task.clone()).collect(),
            ..job
        };
        let evaluated = dispatch.evaluate(job, job_progress.clone()).await?;
        let mut substitutes = BTreeMap::new();
        for ((place, _), evaluated) in wanted.into_iter().zip(evaluated) {
            match evaluated {
                Evaluated::Done { trials, maker } => results[place] = Some((trials, maker)),
                Evaluated::Poisoned(reason) if attempt == EVALUATION_ATTEMPTS => {
                    return Err(JobError::Poisoned(reason).into());
                }
                Evaluated::Poisoned(reason) => {
                    poisoned.push((place, reason));
                    substitutes.extend(substitute(place, attempt)?);
                }
            }
        }
        for (&place, task) in &substitutes {
            tasks[place] = task.clone();
            results[place] = None;
        }
        wanted = substitutes.into_iter().collect();
        if wanted.is_empty() {
            break;
        }
    }
    let (evaluations, makers) = results.into_iter().flatten().unzip();
    Ok(Done {
        tasks,
        evaluations,
        makers,
        poisoned,
    })
}

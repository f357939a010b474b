//! Audits that go on after their jobs, and the disagreements that they found.

use crate::{JobError, Submitter, leases::JobId};
use std::collections::BTreeMap;

/// Audits that go on after their jobs.
#[derive(Debug, Default)]
pub(crate) struct OpenAudits {
    /// The jobs of audits that are not over.
    jobs: BTreeMap<JobId, Submitter>,
    /// Disagreements that no third machine could decide, by job and task.
    disagreements: BTreeMap<(JobId, usize), Disagreement>,
}

#[derive(Debug)]
struct Disagreement {
    submitter: Submitter,
    error: JobError,
    /// Whether the submitter knows of it.
    is_told: bool,
}

impl OpenAudits {
    pub(crate) fn begin(&mut self, job: JobId, submitter: Submitter) {
        self.jobs.insert(job, submitter);
    }

    pub(crate) fn end(&mut self, job: JobId) {
        self.jobs.remove(&job);
        self.disagreements.retain(|&(of, _), _| of != job);
    }

    /// Notes a disagreement about a task of a job, which the submitter is told again; returns whether it is new.
    pub(crate) fn disagree(&mut self, job: JobId, task: usize, error: JobError) -> bool {
        let Some(submitter) = self.jobs.get(&job).cloned() else {
            return false;
        };
        let disagreement = Disagreement {
            submitter,
            error,
            is_told: false,
        };
        self.disagreements.insert((job, task), disagreement).is_none()
    }

    /// Removes the disagreements of a job that were decided; returns whether there were any.
    pub(crate) fn settle(&mut self, job: JobId, is_disputed: impl Fn(usize) -> bool) -> bool {
        let before = self.disagreements.len();
        self.disagreements
            .retain(|&(of, task), _| of != job || is_disputed(task));
        self.disagreements.len() < before
    }

    /// Whether nothing goes on for a submitter, or there is a disagreement of which the submitter does not know.
    pub(crate) fn is_over(&self, submitter: &Submitter) -> bool {
        let mut disagreements = self.disagreements.values();
        !self.jobs.values().any(|of| of == submitter)
            || disagreements.any(|found| found.submitter == *submitter && !found.is_told)
    }

    /// A disagreement of which the submitter does not know. From now on, the submitter knows of all its disagreements.
    pub(crate) fn take_disagreement(&mut self, submitter: &Submitter) -> Option<JobError> {
        let news = self
            .disagreements
            .values_mut()
            .filter(|found| found.submitter == *submitter && !found.is_told);
        let told = news.map(|found| {
            found.is_told = true;
            found.error.clone()
        });
        told.reduce(|first, _| first)
    }
}

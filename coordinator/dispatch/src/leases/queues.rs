//! Queues of a job's waiting tasks.

use std::collections::BTreeSet;

/// The waiting tasks of a job, by the worker that they need. A task is in at most one queue.
#[derive(Debug)]
pub(super) struct Queues {
    /// Tasks for any worker that were leased before, leased before the tasks in `next`.
    first: BTreeSet<usize>,
    /// Tasks for any worker.
    next: BTreeSet<usize>,
    /// Tasks for a worker on a machine that has not answered them yet.
    pub(super) second: BTreeSet<usize>,
    /// Tasks for a worker that holds no other task: other tasks would be lost with the worker.
    pub(super) alone: BTreeSet<usize>,
}

impl Queues {
    pub(super) fn new(next: impl Iterator<Item = usize>) -> Self {
        Self {
            first: BTreeSet::new(),
            next: next.collect(),
            second: BTreeSet::new(),
            alone: BTreeSet::new(),
        }
    }

    pub(super) fn want_next(&mut self, place: usize) {
        self.first.insert(place);
    }

    pub(super) fn want_second(&mut self, place: usize) {
        self.second.insert(place);
    }

    pub(super) fn want_alone(&mut self, place: usize) {
        self.alone.insert(place);
    }

    pub(super) fn remove(&mut self, place: usize) {
        for queue in [&mut self.first, &mut self.next, &mut self.second, &mut self.alone] {
            queue.remove(&place);
        }
    }

    pub(super) fn len(&self) -> usize {
        self.ready_len() + self.second.len() + self.alone.len()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.len() == 0
    }

    pub(super) fn ready_len(&self) -> usize {
        self.first.len() + self.next.len()
    }

    /// Tasks for any worker, in the order in which they are leased.
    pub(super) fn ready(&self) -> impl Iterator<Item = usize> {
        self.first.iter().chain(&self.next).copied()
    }
}

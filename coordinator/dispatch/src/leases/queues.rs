//! Queues of a job's waiting tasks.

use std::collections::BTreeSet;

/// The tasks of a job that wait for a worker, by the worker that they need; each is in at most one queue.
#[derive(Debug)]
pub(super) struct Queues {
    /// For any worker, before `next`.
    first: BTreeSet<usize>,
    /// For any worker.
    next: BTreeSet<usize>,
    /// For a worker on a machine that has not answered them yet.
    pub(super) second: BTreeSet<usize>,
    /// For a worker that holds nothing else, which would be lost with it.
    pub(super) alone: BTreeSet<usize>,
}

impl Queues {
    pub(super) fn new(first: impl Iterator<Item = usize>, next: impl Iterator<Item = usize>) -> Self {
        Self {
            first: first.collect(),
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

    /// Tasks for any worker, in the order in which they go out.
    pub(super) fn ready(&self) -> impl Iterator<Item = usize> {
        self.first.iter().chain(&self.next).copied()
    }
}

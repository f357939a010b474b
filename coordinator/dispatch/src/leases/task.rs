//! One task of a job: the workers' votes on its result, and whether these votes settle the task.

use super::{Agree, MOST_LOST, Settled, WorkerProcessId};
use murmuration_model::MachineId;
use std::{collections::BTreeSet, time::Instant};

#[derive(Debug)]
pub(super) struct Task<R> {
    /// The result of each machine that answered the task.
    pub(super) votes: Vec<(WorkerProcessId, R)>,
    /// Workers that reported the task as impossible, one for each machine.
    pub(super) refused: Vec<WorkerProcessId>,
    /// Workers that were lost while they held the task, and have not reconnected.
    pub(super) lost: BTreeSet<WorkerProcessId>,
    /// Number of workers that hold the task.
    pub(super) out: usize,
    /// How often the task was taken back from a worker that made no progress.
    pub(super) taken_back: u32,
    /// Time since which no other machine could decide about the task.
    pub(super) alone_since: Option<Instant>,
    /// Whether one vote does not settle the task.
    audited: bool,
    /// Whether a second vote is still wanted once the task's job is over.
    is_postponed: bool,
    /// Whether workers lost on one machine are enough to poison the task.
    one_machine_is_enough: bool,
}

/// State of a task.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TaskState {
    /// The task needs a further result.
    Open,
    /// The vote at this place is the result of the task.
    Settled(usize),
    /// Too many workers were lost with the task.
    Poisoned,
}

impl TaskState {
    pub(super) const fn is_settled(self) -> bool {
        matches!(self, Self::Settled(_) | Self::Poisoned)
    }
}

impl<R: Agree> Task<R> {
    pub(super) const fn new(audited: bool) -> Self {
        Self {
            votes: Vec::new(),
            refused: Vec::new(),
            lost: BTreeSet::new(),
            out: 0,
            taken_back: 0,
            alone_since: None,
            audited,
            is_postponed: false,
            one_machine_is_enough: false,
        }
    }

    /// One vote settles a task. An audited or disputed task needs two votes that agree; two such votes outvote any other vote.
    pub(super) fn state(&self) -> TaskState {
        let count = |place: usize| self.agreeing(place).count();
        let Some(best) = (0..self.votes.len()).rev().max_by_key(|&place| count(place)) else {
            return if self.has_lost_enough() && (self.one_machine_is_enough || self.lost_on_several()) {
                TaskState::Poisoned
            } else {
                TaskState::Open
            };
        };
        let unanimous = count(best) == self.votes.len();
        let wanted = if self.audited || !unanimous { 2 } else { 1 };
        if count(best) >= wanted {
            TaskState::Settled(best)
        } else {
            TaskState::Open
        }
    }

    /// Whether a worker on `machine` could help to settle the task. The machine must not have answered the task yet. Once three
    /// workers were lost with the task, the machine must not have lost any of them.
    pub(super) fn wants(&self, machine: MachineId) -> bool {
        let lost_there = || self.lost.iter().any(|process| process.machine == machine);
        let may_die_of_it = self.has_lost_enough() && lost_there();
        !self.has_answered(machine) && !may_die_of_it
    }

    /// Whether only a machine that has not tried the task can settle it.
    pub(super) fn wants_another_machine(&self) -> bool {
        let met = !self.votes.is_empty() || !self.refused.is_empty() || self.has_lost_enough();
        met && !self.state().is_settled()
    }

    /// Whether enough workers were lost with the task to blame the task.
    pub(super) fn has_lost_enough(&self) -> bool {
        self.lost.len() >= MOST_LOST
    }

    fn lost_on_several(&self) -> bool {
        let machine = |process: Option<&WorkerProcessId>| process.map(|process| process.machine);
        // `lost` is sorted by machine.
        machine(self.lost.first()) != machine(self.lost.last())
    }

    fn has_answered(&self, machine: MachineId) -> bool {
        let refused = self.refused.iter().any(|by| by.machine == machine);
        refused || self.votes.iter().any(|(by, _)| by.machine == machine)
    }

    pub(super) fn voters(&self) -> impl Iterator<Item = WorkerProcessId> {
        self.votes.iter().map(|(by, _)| *by)
    }

    /// Whether machines disagree about the task.
    pub(super) fn is_disputed(&self) -> bool {
        !self.votes.is_empty() && self.agreeing(0).count() < self.votes.len()
    }

    /// Records a vote; false if it contradicts the machine's own earlier vote.
    pub(super) fn record_vote(&mut self, by: WorkerProcessId, result: R) -> bool {
        self.refused.retain(|refused| refused.machine != by.machine);
        let mut votes = self.votes.iter();
        if let Some((_, before)) = votes.find(|(voter, _)| voter.machine == by.machine) {
            return before.agrees_with(&result);
        }
        self.votes.push((by, result));
        true
    }

    /// Records a worker's report that the task is impossible; returns whether the task [is impossible](Self::is_impossible) now.
    pub(super) fn refuse(&mut self, by: WorkerProcessId) -> bool {
        if !self.has_answered(by.machine) {
            self.refused.push(by);
        }
        self.is_impossible()
    }

    /// Whether two machines report the task as impossible, and no machine has done the task.
    pub(super) fn is_impossible(&self) -> bool {
        self.votes.is_empty() && self.refused.len() > 1
    }

    /// A worker was lost while it held the task.
    pub(super) fn lose(&mut self, process: WorkerProcessId) {
        self.one_machine_is_enough = false;
        self.lost.insert(process);
    }

    /// A process has reconnected; returns whether it had been lost with this task.
    pub(super) fn acquit(&mut self, process: WorkerProcessId) -> bool {
        let was_lost = self.lost.remove(&process);
        // With `&= !was_lost` instead, the random schedules fail in builds that rustc 1.95 optimises, and in no other builds.
        if was_lost {
            self.one_machine_is_enough = false;
        }
        was_lost
    }

    /// Discards a machine's vote, refusal and lost workers; returns whether anything was discarded.
    pub(super) fn discard_votes(&mut self, machine: MachineId) -> bool {
        let known = |task: &Self| (task.votes.len(), task.refused.len(), task.lost.len());
        let before = known(self);
        self.votes.retain(|(by, _)| by.machine != machine);
        self.refused.retain(|by| by.machine != machine);
        self.lost.retain(|process| process.machine != machine);
        let changed = known(self) != before;
        // This is not `&= !changed`, for the reason that `acquit` gives.
        if changed {
            self.one_machine_is_enough = false;
        }
        changed
    }

    /// From now on, workers lost on one machine are enough to poison the task, until another machine is involved.
    pub(super) const fn blame(&mut self) {
        self.one_machine_is_enough = true;
    }

    /// From now on, one vote settles the task, for good.
    pub(super) const fn waive_audit(&mut self) {
        self.audited = false;
    }

    /// From now on, one vote settles the task for its job. The audit goes on after the job.
    pub(super) const fn postpone_audit(&mut self) {
        self.audited = false;
        self.is_postponed = true;
    }

    /// Whether the audit of the task goes on after the job.
    pub(super) fn is_postponed(&self) -> bool {
        self.is_postponed && self.votes.len() == 1
    }

    /// This task with its votes, as a task of the job in which its audit goes on. A task without such an audit is settled there
    /// too.
    pub(super) fn for_audits(&self) -> Self
    where
        R: Clone,
    {
        Self {
            votes: self.votes.clone(),
            lost: if self.votes.is_empty() {
                self.lost.clone()
            } else {
                BTreeSet::new()
            },
            one_machine_is_enough: self.one_machine_is_enough,
            ..Self::new(self.is_postponed())
        }
    }

    /// Processes whose votes differ from the settled result.
    pub(super) fn wrong(&self) -> Vec<WorkerProcessId> {
        let TaskState::Settled(place) = self.state() else {
            return Vec::new();
        };
        let result = &self.votes[place].1;
        let differs = |(_, other): &&(WorkerProcessId, R)| !result.agrees_with(other);
        self.votes.iter().filter(differs).map(|(by, _)| *by).collect()
    }

    pub(super) fn into_settled(mut self) -> Option<Settled<R>> {
        match self.state() {
            TaskState::Open => None,
            TaskState::Poisoned => Some(Settled::Poisoned {
                lost: self.lost.into_iter().collect(),
            }),
            TaskState::Settled(place) => {
                let audited = self.agreeing(place).count() > 1;
                let (by, value) = self.votes.swap_remove(place);
                Some(Settled::Result { value, by, audited })
            }
        }
    }

    fn agreeing(&self, place: usize) -> impl Iterator<Item = &(WorkerProcessId, R)> {
        let result = &self.votes[place].1;
        self.votes
            .iter()
            .filter(move |(_, other)| result.agrees_with(other))
    }
}

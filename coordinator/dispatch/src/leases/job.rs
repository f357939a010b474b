//! The tasks of one job. Results and failures move tasks between queues, and change the number of settled tasks.

use super::{
    Agree, JobId, LeaseNumber, WorkerId, WorkerProcessId,
    queues::Queues,
    task::{Task, TaskState},
};
use murmuration_model::MachineId;
use std::{
    collections::{BTreeMap, BTreeSet},
    time::Instant,
};

#[derive(Debug)]
pub(super) struct Job<R> {
    pub(super) tasks: Vec<Task<R>>,
    pub(super) queues: Queues,
    pub(super) settled: usize,
    /// Cost of all tasks of the job that were leased so far; the job with the lowest cost is served next.
    pub(super) served: u64,
    pub(super) cost: u64,
    pub(super) speculative: bool,
    /// Whether only workers that embed can do the job.
    pub(super) embeds: bool,
    /// An earlier job with which the job shares its turns.
    pub(super) after: Option<JobId>,
    /// Whether the results are only shown, so that the job shares the turn of all such jobs.
    pub(super) is_shown: bool,
    /// Whether the job is the rest of another job: audits that the other job did not wait for.
    pub(super) is_audits: bool,
    /// Time since which some audit of the job waits for machines that are late or away.
    pub(super) late_since: Option<Instant>,
    /// When each machine was first asked to answer a task that another machine had answered. A machine that reconnects gets no
    /// further time.
    pub(super) asked: BTreeMap<(usize, MachineId), Instant>,
    /// The job's leases, including leases that no worker holds any more.
    pub(super) leases: BTreeSet<LeaseNumber>,
    /// Workers that gave back leases of the job.
    pub(super) rested: BTreeSet<WorkerId>,
    /// Machines that returned or lost a lease of the job, on whatever connection, and have completed none since.
    pub(super) unreliable: BTreeSet<MachineId>,
    /// The tasks that each lost process held.
    pub(super) lost_with: BTreeMap<WorkerProcessId, BTreeSet<usize>>,
}

impl<R: Agree> Job<R> {
    /// Whether the machine has returned and lost no lease of the job since it last completed one.
    pub(super) fn is_reliable(&self, machine: MachineId) -> bool {
        !self.unreliable.contains(&machine)
    }

    /// Records a worker's result of a task; `held` is whether the worker still held the task. Returns the processes that this
    /// result proves wrong.
    pub(super) fn record_vote(
        &mut self,
        place: usize,
        by: WorkerProcessId,
        result: R,
        held: bool,
    ) -> Vec<WorkerProcessId> {
        let task = &mut self.tasks[place];
        let before = task.state();
        task.out -= usize::from(held);
        let consistent = task.record_vote(by, result);
        let mut wrong = self.file(place, before);
        if !consistent {
            wrong.push(by);
        }
        wrong
    }

    /// A lease on a task is returned undone; `broke` is the worker's process if the worker was lost.
    pub(super) fn come_back(&mut self, place: usize, broke: Option<WorkerProcessId>) {
        let task = &mut self.tasks[place];
        let before = task.state();
        task.out -= 1;
        if let Some(process) = broke {
            task.lose(process);
            self.lost_with.entry(process).or_default().insert(place);
        }
        self.file(place, before);
    }

    /// A worker that counted as lost has reconnected, so its tasks are not to blame.
    pub(super) fn acquit(&mut self, process: WorkerProcessId) {
        for place in self.lost_with.remove(&process).unwrap_or_default() {
            let before = self.tasks[place].state();
            if self.tasks[place].acquit(process) {
                self.file(place, before);
            }
        }
    }

    /// Discards a machine's results, and returns the number of tasks that are no longer settled. Results that another machine
    /// confirms stay settled.
    pub(super) fn discard_votes(&mut self, machine: MachineId) -> usize {
        let before = self.settled;
        for place in 0..self.tasks.len() {
            let state = self.tasks[place].state();
            if self.tasks[place].discard_votes(machine) {
                self.file(place, state);
            }
        }
        before.saturating_sub(self.settled)
    }

    /// Moves a changed task to its queue; `before` is its former state. Returns the processes that the task's result proves
    /// wrong.
    pub(super) fn file(&mut self, place: usize, before: TaskState) -> Vec<WorkerProcessId> {
        let task = &self.tasks[place];
        let state = task.state();
        self.settled = self.settled - usize::from(before.is_settled()) + usize::from(state.is_settled());
        self.queues.remove(place);
        match state {
            TaskState::Settled(_) => return task.wrong(),
            TaskState::Poisoned => {}
            TaskState::Open if task.out > 0 => {}
            TaskState::Open if !task.votes.is_empty() => self.queues.want_second(place),
            TaskState::Open if !task.lost.is_empty() => self.queues.want_alone(place),
            TaskState::Open if !task.refused.is_empty() => self.queues.want_second(place),
            TaskState::Open => self.queues.want_next(place),
        }
        Vec::new()
    }
}

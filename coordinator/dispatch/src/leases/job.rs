//! The tasks of one job: what is heard of them changes where they wait, and how many are settled.

use super::{
    Agree, WorkerProcessId,
    queues::Queues,
    task::{Task, Verdict},
};
use murmuration_model::MachineId;

#[derive(Debug)]
pub(super) struct Job<R> {
    pub(super) tasks: Vec<Task<R>>,
    pub(super) queues: Queues,
    pub(super) settled: usize,
    /// Effort that it has had, of all its workers; whoever has had least is next.
    pub(super) served: u64,
    pub(super) effort: u64,
    pub(super) speculative: bool,
    /// Whether only workers that embed can do it.
    pub(super) embeds: bool,
}

impl<R: Agree> Job<R> {
    /// Takes in what a worker says about a task, who had it in hand if `held`; who that shows to be wrong.
    pub(super) fn hear(
        &mut self,
        place: usize,
        by: WorkerProcessId,
        result: R,
        held: bool,
    ) -> Vec<WorkerProcessId> {
        let task = &mut self.tasks[place];
        let before = task.verdict();
        task.out -= usize::from(held);
        let consistent = task.hear(by, result);
        let mut wrong = self.file(place, before);
        if !consistent {
            wrong.push(by);
        }
        wrong
    }

    /// A lease on a task came back undone, from a worker that the task may have taken with it.
    pub(super) fn come_back(&mut self, place: usize, broke: Option<WorkerProcessId>) {
        let task = &mut self.tasks[place];
        let before = task.verdict();
        task.out -= 1;
        if let Some(process) = broke {
            task.lose(process);
        }
        self.file(place, before);
    }

    /// A worker that was given up for lost is back: no task took it.
    pub(super) fn acquit(&mut self, process: WorkerProcessId) {
        for place in 0..self.tasks.len() {
            let before = self.tasks[place].verdict();
            if self.tasks[place].acquit(process) {
                self.file(place, before);
            }
        }
    }

    /// Forgets what a machine said, but for what another found too; how many tasks that opens again.
    pub(super) fn unhear(&mut self, machine: MachineId) -> usize {
        let before = self.settled;
        for place in 0..self.tasks.len() {
            let verdict = self.tasks[place].verdict();
            if self.tasks[place].unhear(machine) {
                self.file(place, verdict);
            }
        }
        before.saturating_sub(self.settled)
    }

    /// Puts a task that has changed where it belongs; `before` is what it was. Who is shown to be wrong.
    pub(super) fn file(&mut self, place: usize, before: Verdict) -> Vec<WorkerProcessId> {
        let task = &self.tasks[place];
        let verdict = task.verdict();
        self.settled = self.settled - usize::from(before.is_settled()) + usize::from(verdict.is_settled());
        self.queues.remove(place);
        match verdict {
            Verdict::Settled(_) => return task.wrong(),
            Verdict::SetAside => {}
            Verdict::Open if task.out > 0 => {}
            Verdict::Open if !task.votes.is_empty() => self.queues.want_second(place),
            Verdict::Open if !task.lost.is_empty() => self.queues.want_alone(place),
            Verdict::Open if !task.refused.is_empty() => self.queues.want_second(place),
            Verdict::Open => self.queues.want_next(place),
        }
        Vec::new()
    }
}

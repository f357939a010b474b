//! Events of a schedule's cluster, checked against the truth of the schedule.

use super::*;

impl SimulatedCluster {
    pub(super) fn hear_events(&mut self) {
        for events in self.table.take_events() {
            match events {
                Event::Progress { job, settled } => assert!(settled < self.jobs[&job].tasks),
                Event::Waived { tasks, .. } => self.seen.waived += tasks as u64,
                Event::Done { job, results, audits } => {
                    let submitted = self.jobs.remove(&job).expect("a job ended twice");
                    assert_eq!(results.len(), submitted.tasks);
                    if let Some(audits) = audits {
                        self.go_on(job, &submitted, audits);
                    }
                    for (place, settled) in results.into_iter().enumerate() {
                        self.check(job, &submitted, place, settled);
                    }
                }
                Event::Disagreement { job, between, .. } => {
                    // Audits that go on after their job stay until a third machine decides.
                    if self.origins.contains_key(&job) {
                        self.undecided.insert(job);
                    } else {
                        self.jobs.remove(&job).expect("a job ended twice");
                    }
                    assert!(self.are_several(&between), "a machine differs from itself");
                    let lies = |by: &WorkerProcessId| self.machines[&by.machine] == Character::Liar;
                    assert!(between.iter().any(lies), "honest machines differ");
                    self.seen.disagreements += 1;
                }
                Event::Impossible { job, by } => {
                    let submitted = self.jobs.remove(&job).expect("a job ended twice");
                    assert!(by.len() == 1 || self.are_several(&by));
                    let honest = |by: &WorkerProcessId| self.machines[&by.machine] == Character::Honest;
                    assert!(
                        !submitted.impossible.is_empty() || !by.iter().any(honest),
                        "an honest machine refuses"
                    );
                    self.seen.impossible += 1;
                }
                Event::TakenBack { job, .. } => {
                    let job = self.table.jobs.get(&job);
                    assert!(job.is_none_or(|job| !job.speculative));
                }
                Event::Quarantined { process, workers, .. } => {
                    self.seen.quarantines += 1;
                    let machine = process.machine;
                    assert_eq!(
                        self.machines[&machine],
                        Character::Liar,
                        "an honest machine was found wrong"
                    );
                    let of_machine = self.processes.iter_mut().filter(|(id, _)| id.machine == machine);
                    let mut connected: Vec<_> = of_machine
                        .filter_map(|(_, process)| process.worker.take())
                        .collect();
                    connected.sort_unstable();
                    assert_eq!(connected, workers);
                }
            }
        }
    }

    /// Remembers the tasks of audits that go on after their job.
    fn go_on(&mut self, old: JobId, submitted: &Submitted, Audits { job, places }: Audits) {
        self.seen.postponed += places.len() as u64;
        let only = |tasks: &BTreeSet<usize>| -> BTreeSet<usize> {
            let of = places
                .iter()
                .enumerate()
                .filter(|(_, place)| tasks.contains(place));
            of.map(|(next, _)| next).collect()
        };
        let audits = Submitted {
            tasks: places.len(),
            deadly: only(&submitted.deadly),
            impossible: only(&submitted.impossible),
            embeds: submitted.embeds,
            lost: places
                .iter()
                .enumerate()
                .filter_map(|(next, place)| Some((next, *submitted.lost.get(place)?)))
                .collect(),
        };
        self.jobs.insert(job, audits);
        self.origins.insert(job, (old, places));
    }

    /// The right answer to a task; the answer to an audit is that of the task in the old job.
    pub(super) fn truth(&self, job: JobId, place: usize) -> u64 {
        match self.origins.get(&job) {
            Some((old, places)) => truth(*old, places[place]),
            None => truth(job, place),
        }
    }

    pub(super) fn are_several(&self, processes: &[WorkerProcessId]) -> bool {
        let machines: BTreeSet<_> = processes.iter().map(|process| process.machine).collect();
        machines.len() == processes.len() && machines.len() > 1
    }

    pub(super) fn check(&mut self, job: JobId, submitted: &Submitted, place: usize, settled: Settled<u64>) {
        match settled {
            Settled::Result { value, by, audited } => {
                self.seen.settled += 1;
                let is_liar = self.machines[&by.machine] == Character::Liar;
                assert!(!submitted.deadly.contains(&place), "a deadly task was done");
                assert!(
                    is_liar || !submitted.impossible.contains(&place),
                    "an impossible task was done"
                );
                if value != self.truth(job, place) {
                    assert!(
                        !audited && is_liar && !self.table.quarantined.contains(&by.machine),
                        "a lie was kept"
                    );
                }
            }
            Settled::Poisoned { lost } => {
                self.seen.poisoned += 1;
                assert!(lost.len() >= MOST_LOST);
                assert!(submitted.lost[&place] >= MOST_LOST, "poisoned without a reason");
            }
        }
    }
}

//! Tests the lease table with random schedules of all events in a cluster. Machines run several workers, send wrong results from
//! all of them, or report tasks as impossible. Workers hang, and tasks can be deadly or impossible.
//!
//! `MURMURATION_SCHEDULES` is the number of schedules, and `MURMURATION_SEED` is the seed of the first schedule. A failure names
//! its seed.

mod observed;

use super::*;
use rand::{RngExt as _, SeedableRng as _, seq::IteratorRandom as _};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

impl Agree for u64 {
    fn agrees_with(&self, other: &Self) -> bool {
        self == other
    }
}

const DISPUTE_TIMEOUT: Duration = Duration::from_millis(200);

/// The right answer to a task.
fn truth(job: JobId, place: usize) -> u64 {
    job.0 << 20 | place as u64
}

/// Behaviour of all workers of a machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Character {
    Honest,
    /// The machine's workers sometimes send a wrong result, mostly the same wrong result, which no other machine sends.
    Liar,
    /// The machine's workers sometimes report a possible task as impossible.
    Unfit,
}

struct Process {
    character: Character,
    /// Whether the process sends heartbeats but never answers.
    hangs: bool,
    embeds: bool,
    /// The process's connection, if it has a connection.
    worker: Option<WorkerId>,
    /// Leases that the process has not answered, on any connection.
    has: Vec<Grant>,
}

struct Submitted {
    tasks: usize,
    /// Tasks that kill their worker.
    deadly: BTreeSet<usize>,
    /// Tasks that no worker can do.
    impossible: BTreeSet<usize>,
    embeds: bool,
    /// For each task, how many workers were lost while they held it.
    lost: BTreeMap<usize, usize>,
}

/// A cluster whose events are drawn at random.
struct SimulatedCluster {
    die: ChaCha8Rng,
    now: Instant,
    table: LeaseTable<u64>,
    processes: BTreeMap<WorkerProcessId, Process>,
    machines: BTreeMap<MachineId, Character>,
    jobs: BTreeMap<JobId, Submitted>,
    /// For each job of audits: the old job, and the places of the tasks there.
    origins: BTreeMap<JobId, (JobId, Vec<usize>)>,
    /// Jobs of audits that a disagreement keeps open.
    undecided: BTreeSet<JobId>,
    next_instance: u64,
    /// How often each kind of event occurred, to check that the schedules reach all kinds.
    seen: Seen,
}

#[derive(Debug, Default, Clone, Copy)]
struct Seen {
    settled: u64,
    poisoned: u64,
    disagreements: u64,
    quarantines: u64,
    impossible: u64,
    late: u64,
    postponed: u64,
    waived: u64,
}

impl SimulatedCluster {
    fn new(seed: u64) -> Self {
        Self {
            die: ChaCha8Rng::seed_from_u64(seed),
            now: Instant::now(),
            table: LeaseTable::new(DISPUTE_TIMEOUT),
            processes: BTreeMap::new(),
            machines: BTreeMap::new(),
            jobs: BTreeMap::new(),
            origins: BTreeMap::new(),
            undecided: BTreeSet::new(),
            next_instance: 0,
            seen: Seen::default(),
        }
    }

    fn chance(&mut self, one_in: u32) -> bool {
        self.die.random_ratio(1, one_in)
    }

    fn pick(&mut self) -> Option<WorkerProcessId> {
        self.processes.keys().choose(&mut self.die).copied()
    }

    fn submit(&mut self) {
        let tasks = self.die.random_range(1..=30);
        let audited = (0..tasks).filter(|_| self.chance(5)).collect();
        let deadly = (0..tasks).filter(|_| self.chance(40)).collect();
        let impossible = (0..tasks).filter(|_| self.chance(150)).collect();
        let embeds = self.chance(3);
        let params = JobParams {
            tasks,
            cost: self.die.random_range(1..=5),
            audited,
            embeds,
            speculative: !self.chance(4),
            after: None,
            is_shown: false,
        };
        let job = self.table.submit(params);
        let submitted = Submitted {
            tasks,
            deadly,
            impossible,
            embeds,
            lost: BTreeMap::new(),
        };
        self.jobs.insert(job, submitted);
    }

    /// Adds a new machine.
    fn new_machine(&mut self, character: Character) -> MachineId {
        let machine = MachineId(1 + self.machines.len() as u64);
        self.machines.insert(machine, character);
        machine
    }

    /// A random machine; half of the time, a new machine.
    fn some_machine(&mut self) -> MachineId {
        if !self.machines.is_empty() && self.chance(2) {
            return *self.machines.keys().choose(&mut self.die).unwrap();
        }
        let character = match self.die.random_range(0..6) {
            0 | 1 => Character::Liar,
            2 => Character::Unfit,
            _ => Character::Honest,
        };
        self.new_machine(character)
    }

    fn start(&mut self, machine: MachineId, hangs: bool, embeds: bool) {
        self.next_instance += 1;
        let id = WorkerProcessId {
            machine,
            instance: self.next_instance,
        };
        let process = Process {
            character: self.machines[&machine],
            hangs,
            embeds,
            worker: None,
            has: Vec::new(),
        };
        self.processes.insert(id, process);
        self.connect(id);
    }

    fn connect(&mut self, id: WorkerProcessId) {
        let capacity = self.die.random_range(1..=4);
        let credits = self.die.random_range(1..=12);
        let process = self.processes.get_mut(&id).unwrap();
        if process.worker.is_some() {
            return;
        }
        let abilities = Abilities {
            capacity,
            embeds: process.embeds,
        };
        process.worker = self.table.join(id, abilities, self.now);
        match process.worker {
            Some(worker) => self.table.add_credits(worker, credits),
            None => assert_eq!(
                process.character,
                Character::Liar,
                "an honest machine was refused"
            ),
        }
    }

    /// Breaks a process's connection; the process keeps its leases.
    fn cut(&mut self, id: WorkerProcessId) {
        let Some(worker) = self.processes.get_mut(&id).unwrap().worker.take() else {
            return;
        };
        for lease in &self.table.workers.get(worker).unwrap().holds {
            let Lease { job, tasks, .. } = &self.table.leases[lease];
            let lost = &mut self.jobs.get_mut(job).unwrap().lost;
            for &place in tasks {
                *lost.entry(place).or_default() += 1;
            }
        }
        self.table.lose(worker);
    }

    fn die(&mut self, id: WorkerProcessId) {
        self.cut(id);
        self.processes.remove(&id);
    }

    fn grant(&mut self) {
        while let Some(grant) = self.table.grant(self.now) {
            assert!(grant.tasks.len() <= MAX_BATCH && !grant.tasks.is_empty());
            // The job may be of audits that have only just begun.
            self.hear_events();
            let id = self.table.process(grant.worker).unwrap();
            let process = self.processes.get_mut(&id).unwrap();
            assert_eq!(process.worker, Some(grant.worker));
            assert!(process.embeds || !self.jobs[&grant.job].embeds);
            self.seen.late += u64::from(
                grant
                    .tasks
                    .iter()
                    .any(|&place| self.table.jobs[&grant.job].tasks[place].out > 1),
            );
            process.has.push(grant);
        }
        self.hear_events();
    }

    /// A process answers its next lease; false if the process has no lease or never answers.
    fn work(&mut self, id: WorkerProcessId) -> bool {
        let process = &self.processes[&id];
        let (Some(worker), false) = (process.worker, process.has.is_empty()) else {
            return false;
        };
        if process.hangs {
            return false;
        }
        let (character, count) = (process.character, process.has.len());
        let place = self.die.random_range(0..count);
        let mut grant = self.processes.get_mut(&id).unwrap().has.swap_remove(place);
        // The lease may have gone over to a job of audits.
        if let Some(job) = self.table.job(grant.lease) {
            (grant.job, grant.tasks) = (job, self.table.tasks(grant.lease).to_vec());
        }
        let meets = |tasks: fn(&Submitted) -> &BTreeSet<usize>| {
            let job = self.jobs.get(&grant.job);
            job.is_some_and(|job| grant.tasks.iter().any(|place| tasks(job).contains(place)))
        };
        let (is_deadly, is_impossible) = (meets(|job| &job.deadly), meets(|job| &job.impossible));
        if is_deadly {
            self.die(id);
            self.hear_events();
            return true;
        }
        let refuses = match character {
            Character::Honest => is_impossible,
            Character::Unfit => is_impossible || self.chance(3),
            Character::Liar => self.chance(8),
        };
        if refuses {
            self.table.refuse(worker, grant.lease, self.now);
            self.table.add_credits(worker, grant.tasks.len());
            self.hear_events();
            return true;
        }
        let lies = character == Character::Liar && self.chance(3);
        let contradicts = u64::from(self.chance(6));
        let say = |&place: &usize| match lies {
            true => u64::MAX - id.machine.0 - 1000 * contradicts,
            false => self.truth(grant.job, place),
        };
        let results = grant.tasks.iter().map(say).collect();
        let taken = self.table.complete(worker, grant.lease, results, self.now);
        assert!(matches!(taken, Ok(()) | Err(Refused::UnknownLease)), "{taken:?}");
        self.table.add_credits(worker, grant.tasks.len());
        self.hear_events();
        true
    }

    fn step(&mut self) {
        let passed = self.die.random_range(0..200);
        self.now += Duration::from_millis(passed);
        let picked = self.pick();
        match (self.die.random_range(0..16), picked) {
            (0, _) => self.submit(),
            (1, _) if self.processes.len() < 8 => {
                let machine = self.some_machine();
                let (hangs, embeds) = (self.chance(8), !self.chance(4));
                self.start(machine, hangs, embeds);
            }
            (2, Some(instance)) => self.connect(instance),
            (3, Some(instance)) => self.cut(instance),
            (4, Some(instance)) if self.chance(4) => self.die(instance),
            (5, Some(instance)) => self.give_back(instance),
            (6, Some(instance)) => {
                if let Some(worker) = self.processes[&instance].worker.filter(|_| self.chance(8)) {
                    self.table.drain(worker);
                }
            }
            (7, Some(instance)) => self.meddle(instance),
            (8, _) if self.chance(30) => {
                if let Some(&job) = self.jobs.keys().next() {
                    self.table.forget(job);
                    self.jobs.remove(&job);
                }
            }
            (_, Some(instance)) => {
                self.work(instance);
            }
            _ => {}
        }
        self.grant();
    }

    fn give_back(&mut self, id: WorkerProcessId) {
        let process = self.processes.get_mut(&id).unwrap();
        if let Some(worker) = process.worker
            && let Some(grant) = process.has.pop()
        {
            self.table.give_back(worker, grant.lease, self.now);
        }
    }

    /// Answers another worker's lease, and a lease that was never granted; both answers must fail.
    fn meddle(&mut self, id: WorkerProcessId) {
        let Some(worker) = self.processes[&id].worker else {
            return;
        };
        let foreign = self.table.leases.iter().find(|(_, lease)| lease.process != id);
        if let Some((&lease, Lease { tasks, .. })) = foreign {
            let lies = vec![0; tasks.len()];
            assert_eq!(
                self.table.complete(worker, lease, lies, self.now),
                Err(Refused::NotYours)
            );
        }
        let never = LeaseNumber(u64::MAX);
        assert_eq!(
            self.table.complete(worker, never, vec![], self.now),
            Err(Refused::UnknownLease)
        );
    }

    /// Adds honest machines as long as there is work; all jobs must end.
    fn finish(&mut self) {
        let leaves = |worker: WorkerId| self.table.workers.get(worker).unwrap().capacity == 0;
        let leaving = self
            .processes
            .iter()
            .filter(|(_, process)| process.worker.is_some_and(leaves));
        for instance in leaving.map(|(&instance, _)| instance).collect::<Vec<_>>() {
            self.die(instance);
        }
        if self.table.jobs.values().any(|job| !job.speculative) {
            // A task that is not speculative waits for its hung worker until the worker is killed.
            let hung = self.processes.iter().filter(|(_, process)| process.hangs);
            for instance in hung.map(|(&instance, _)| instance).collect::<Vec<_>>() {
                self.die(instance);
            }
        }
        for round in 0.. {
            assert!(round < 10_000, "no progress: {:?}", self.table);
            self.now += Duration::from_secs(10);
            while self.honest_machines() < 3 {
                let machine = self.new_machine(Character::Honest);
                self.start(machine, false, true);
            }
            self.grant();
            // All machines may have answered or refused: then only the end of the campaign ends the audit.
            for job in std::mem::take(&mut self.undecided) {
                self.table.forget(job);
                self.jobs.remove(&job);
            }
            if self.jobs.is_empty() {
                break;
            }
            let everybody: Vec<_> = self.processes.keys().copied().collect();
            for instance in everybody {
                while self.processes.contains_key(&instance) && self.work(instance) {}
                self.grant();
            }
            for worker in self.processes.values().filter_map(|process| process.worker) {
                self.table.add_credits(worker, 1);
            }
        }
        assert!(self.table.leases.is_empty(), "leases leak");
        assert!(self.table.jobs.is_empty(), "jobs leak");
        assert_eq!((self.table.waiting(), self.table.out()), (0, 0));
    }
}

impl SimulatedCluster {
    /// Number of machines with a worker that can do any task.
    fn honest_machines(&self) -> usize {
        let works = |process: &Process| {
            let is_sound = process.character == Character::Honest && !process.hangs;
            is_sound && process.embeds && process.worker.is_some()
        };
        let working = self.processes.iter().filter(|(_, process)| works(process));
        working.map(|(id, _)| id.machine).collect::<BTreeSet<_>>().len()
    }
}

fn number(variable: &str, otherwise: u64) -> u64 {
    std::env::var(variable).map_or(otherwise, |text| text.parse().unwrap())
}

#[test]
fn no_task_is_lost_or_done_twice_and_there_is_always_progress() {
    let first = number("MURMURATION_SEED", 1);
    let count = number("MURMURATION_SCHEDULES", 20_000);
    let mut seen = Seen::default();
    for seed in first..first + count {
        let run = std::panic::catch_unwind(|| {
            let mut cluster = SimulatedCluster::new(seed);
            for _ in 0..cluster.die.random_range(20..170) {
                cluster.step();
            }
            cluster.finish();
            cluster.seen
        });
        let Ok(one) = run else { panic!("schedule {seed}") };
        seen.settled += one.settled;
        seen.poisoned += one.poisoned;
        seen.disagreements += one.disagreements;
        seen.quarantines += one.quarantines;
        seen.impossible += one.impossible;
        seen.late += one.late;
        seen.postponed += one.postponed;
        seen.waived += one.waived;
    }
    eprintln!("{count} schedules from seed {first}: {seen:?}");
    let all = [
        seen.settled,
        seen.poisoned,
        seen.disagreements,
        seen.quarantines,
        seen.impossible,
        seen.late,
        seen.postponed,
        seen.waived,
    ];
    assert!(
        all.iter().all(|&count| count > 0),
        "the schedules do not reach everything: {seen:?}"
    );
}

//! The lease table under random schedules of everything that a cluster does, wrong workers and deadly tasks included.
//!
//! `MURMURATION_SCHEDULES` says how many, `MURMURATION_SEED` where they begin: a failure names the seed of its own.

use super::*;
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng as _, SeedableRng as _};
use std::collections::BTreeMap;

impl Agree for u64 {
    fn agrees_with(&self, other: &Self) -> bool {
        self == other
    }
}

const DISPUTE_PATIENCE: Duration = Duration::from_millis(200);

/// What the one right answer to a task is.
fn truth(job: JobId, place: usize) -> u64 {
    job.0 << 20 | place as u64
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Character {
    Honest,
    /// Says what no other worker says, every now and then.
    Liar,
    /// Is heard, and never answers.
    Hung,
}

struct Process {
    character: Character,
    /// Its connection, if it has one.
    worker: Option<WorkerId>,
    /// What it was given and has not answered, on whichever connection.
    has: Vec<Grant>,
}

struct Submitted {
    tasks: usize,
    /// Tasks that take their worker with them.
    deadly: BTreeSet<usize>,
    /// How often somebody was lost while they held a task.
    lost: BTreeMap<usize, usize>,
}

/// A cluster that lives by the throw of a die.
struct Cluster {
    die: ChaCha8Rng,
    now: Instant,
    table: LeaseTable<u64>,
    processes: BTreeMap<Instance, Process>,
    jobs: BTreeMap<JobId, Submitted>,
    next_instance: u64,
    /// How many tasks were settled, set aside, disputed: that the schedules reach all of it.
    seen: Seen,
}

#[derive(Debug, Default, Clone, Copy)]
struct Seen {
    settled: u64,
    set_aside: u64,
    disagreements: u64,
    quarantines: u64,
    late: u64,
}

impl Cluster {
    fn new(seed: u64) -> Self {
        Self {
            die: ChaCha8Rng::seed_from_u64(seed),
            now: Instant::now(),
            table: LeaseTable::new(DISPUTE_PATIENCE),
            processes: BTreeMap::new(),
            jobs: BTreeMap::new(),
            next_instance: 0,
            seen: Seen::default(),
        }
    }

    fn below(&mut self, count: usize) -> usize {
        (self.die.next_u64() % count.max(1) as u64) as usize
    }

    fn chance(&mut self, one_in: usize) -> bool {
        self.below(one_in) == 0
    }

    fn pick(&mut self) -> Option<Instance> {
        let place = self.below(self.processes.len());
        self.processes.keys().nth(place).copied()
    }

    fn submit(&mut self) {
        let tasks = 1 + self.below(30);
        let audited = (0..tasks).filter(|_| self.chance(5)).collect();
        let deadly = (0..tasks).filter(|_| self.chance(40)).collect();
        let terms = Terms {
            tasks,
            effort: 1 + self.below(5) as u64,
            audited,
            hurried: !self.chance(4),
        };
        let job = self.table.submit(terms);
        let lost = BTreeMap::new();
        self.jobs.insert(job, Submitted { tasks, deadly, lost });
    }

    fn start(&mut self, character: Character) -> Instance {
        self.next_instance += 1;
        let instance = Instance(self.next_instance);
        let process = Process {
            character,
            worker: None,
            has: Vec::new(),
        };
        self.processes.insert(instance, process);
        self.connect(instance);
        instance
    }

    fn connect(&mut self, instance: Instance) {
        let capacity = 1 + self.below(4);
        let credits = 1 + self.below(12);
        let process = self.processes.get_mut(&instance).unwrap();
        if process.worker.is_some() {
            return;
        }
        process.worker = self.table.join(instance, capacity, self.now);
        match process.worker {
            Some(worker) => self.table.add_credits(worker, credits),
            None => assert_eq!(process.character, Character::Liar, "an honest worker was refused"),
        }
    }

    /// Its connection breaks; the process goes on with what it has.
    fn cut(&mut self, instance: Instance) {
        let Some(worker) = self.processes.get_mut(&instance).unwrap().worker.take() else {
            return;
        };
        for lease in &self.table.workers[&worker].holds {
            let Lease { job, tasks, .. } = &self.table.leases[lease];
            let lost = &mut self.jobs.get_mut(job).unwrap().lost;
            for &place in tasks {
                *lost.entry(place).or_default() += 1;
            }
        }
        self.table.lose(worker);
    }

    fn die(&mut self, instance: Instance) {
        self.cut(instance);
        self.processes.remove(&instance);
    }

    fn grant(&mut self) {
        while let Some(grant) = self.table.grant(self.now) {
            assert!(grant.tasks.len() <= MAX_BATCH && !grant.tasks.is_empty());
            let instance = self.table.instance(grant.worker).unwrap();
            let process = self.processes.get_mut(&instance).unwrap();
            assert_eq!(process.worker, Some(grant.worker));
            self.seen.late += u64::from(
                grant
                    .tasks
                    .iter()
                    .any(|&place| self.table.jobs[&grant.job].tasks[place].out > 1),
            );
            process.has.push(grant);
        }
        self.hear_news();
    }

    /// A process does the next thing that it has; false if it has nothing, or never will.
    fn work(&mut self, instance: Instance) -> bool {
        let process = &self.processes[&instance];
        let (Some(worker), false) = (process.worker, process.has.is_empty()) else {
            return false;
        };
        if process.character == Character::Hung {
            return false;
        }
        let (character, count) = (process.character, process.has.len());
        let place = self.below(count);
        let grant = self.processes.get_mut(&instance).unwrap().has.swap_remove(place);
        let job = self.jobs.get(&grant.job);
        if job.is_some_and(|job| grant.tasks.iter().any(|place| job.deadly.contains(place))) {
            self.die(instance);
            self.hear_news();
            return true;
        }
        let lies = character == Character::Liar && self.chance(3);
        let say = |&place: &usize| match lies {
            true => u64::MAX - instance.0,
            false => truth(grant.job, place),
        };
        let results = grant.tasks.iter().map(say).collect();
        let taken = self.table.complete(worker, grant.lease, results, self.now);
        assert!(matches!(taken, Ok(()) | Err(Refused::UnknownLease)), "{taken:?}");
        self.table.add_credits(worker, grant.tasks.len());
        self.hear_news();
        true
    }

    fn hear_news(&mut self) {
        for news in self.table.take_news() {
            match news {
                News::Progress { job, settled } => assert!(settled < self.jobs[&job].tasks),
                News::Done { job, results } => {
                    let submitted = self.jobs.remove(&job).expect("a job ended twice");
                    assert_eq!(results.len(), submitted.tasks);
                    for (place, settled) in results.into_iter().enumerate() {
                        self.check(job, &submitted, place, settled);
                    }
                }
                News::Disagreement { job, between, .. } => {
                    self.jobs.remove(&job).expect("a job ended twice");
                    let honest = |by: &Instance| {
                        self.processes
                            .get(by)
                            .is_some_and(|p| p.character == Character::Liar)
                    };
                    let gone = |by: &Instance| !self.processes.contains_key(by);
                    assert!(
                        between.iter().any(|by| honest(by) || gone(by)),
                        "honest workers differ"
                    );
                    self.seen.disagreements += 1;
                }
                News::Quarantined {
                    instance, workers, ..
                } => {
                    self.seen.quarantines += 1;
                    if let Some(process) = self.processes.get_mut(&instance) {
                        assert_eq!(
                            process.character,
                            Character::Liar,
                            "an honest worker was found wrong"
                        );
                        assert_eq!(process.worker.take().as_slice(), workers);
                    }
                }
            }
        }
    }

    fn check(&mut self, job: JobId, submitted: &Submitted, place: usize, settled: Settled<u64>) {
        match settled {
            Settled::Result { value, by, audited } => {
                self.seen.settled += 1;
                assert!(!submitted.deadly.contains(&place), "a deadly task was done");
                if value != truth(job, place) {
                    assert!(
                        !audited && !self.table.quarantined.contains(&by),
                        "a lie was kept"
                    );
                }
            }
            Settled::SetAside { lost } => {
                self.seen.set_aside += 1;
                assert!(lost.len() >= MOST_LOST);
                assert!(submitted.lost[&place] >= MOST_LOST, "set aside without a reason");
            }
        }
    }

    fn step(&mut self) {
        let passed = self.below(200) as u64;
        self.now += Duration::from_millis(passed);
        let picked = self.pick();
        match (self.below(16), picked) {
            (0, _) => self.submit(),
            (1, _) if self.processes.len() < 6 => {
                let character = match self.below(6) {
                    0 => Character::Liar,
                    1 => Character::Hung,
                    _ => Character::Honest,
                };
                self.start(character);
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

    fn give_back(&mut self, instance: Instance) {
        let process = self.processes.get_mut(&instance).unwrap();
        if let Some(worker) = process.worker
            && let Some(grant) = process.has.pop()
        {
            self.table.give_back(worker, grant.lease, self.now);
        }
    }

    /// Answers a lease of another, and one that was never given.
    fn meddle(&mut self, instance: Instance) {
        let Some(worker) = self.processes[&instance].worker else {
            return;
        };
        let foreign = self
            .table
            .leases
            .iter()
            .find(|(_, lease)| lease.instance != instance);
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

    /// Honest workers come for as long as there is work: all of it ends.
    fn finish(&mut self) {
        let leaves = |worker: WorkerId| self.table.workers[&worker].capacity == 0;
        let leaving = self
            .processes
            .iter()
            .filter(|(_, process)| process.worker.is_some_and(leaves));
        for instance in leaving.map(|(&instance, _)| instance).collect::<Vec<_>>() {
            self.die(instance);
        }
        if self.table.jobs.values().any(|job| !job.hurried) {
            // What is not given twice waits for its worker until somebody ends it.
            let hung = self
                .processes
                .iter()
                .filter(|(_, process)| process.character == Character::Hung);
            for instance in hung.map(|(&instance, _)| instance).collect::<Vec<_>>() {
                self.die(instance);
            }
        }
        for round in 0.. {
            assert!(round < 10_000, "no progress: {:?}", self.table);
            self.now += Duration::from_secs(10);
            while self
                .processes
                .values()
                .filter(|p| p.worker.is_some() && p.character == Character::Honest)
                .count()
                < 3
            {
                self.start(Character::Honest);
            }
            self.grant();
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
            let mut cluster = Cluster::new(seed);
            for _ in 0..20 + cluster.below(150) {
                cluster.step();
            }
            cluster.finish();
            cluster.seen
        });
        let Ok(one) = run else { panic!("schedule {seed}") };
        seen.settled += one.settled;
        seen.set_aside += one.set_aside;
        seen.disagreements += one.disagreements;
        seen.quarantines += one.quarantines;
        seen.late += one.late;
    }
    eprintln!("{count} schedules from seed {first}: {seen:?}");
    let all = [
        seen.settled,
        seen.set_aside,
        seen.disagreements,
        seen.quarantines,
        seen.late,
    ];
    assert!(
        all.iter().all(|&count| count > 0),
        "the schedules do not reach everything: {seen:?}"
    );
}

//! Cost of the coordinator's lease table with up to 10,000 simulated workers, on a simulated clock.
//!
//! `cargo bench --workspace --bench queue`
//!
//! The events are the events of a real coordinator: a worker joins, asks for work, sends a heartbeat each second, and answers a
//! lease after an evaluation time that varies by a factor of five. Some workers are lost and reconnect later. After each event,
//! the table grants all leases that it can. `WORKERS` is the number of workers, each on its own machine. There are twenty tasks
//! for each worker, and one task in a hundred is audited. Time is CPU time of the table alone, without the queue of simulated
//! events and without reading the clock. One asynchronous task owns the table, so a message waits while the table handles earlier
//! messages. Therefore, the time that the table really takes is added to the simulated clock. Memory is the growth of the
//! process, including the simulation.

#![expect(clippy::print_stdout, reason = "a table is printed")]

use murmuration_dispatch::leases::{
    Abilities, Agree, Event, JobParams, LeaseNumber, LeaseTable, WorkerId, WorkerProcessId,
};
use murmuration_model::MachineId;
use murmuration_swarm::{Purpose, RandomStream};
use rand::RngExt as _;
use rustix::time::{ClockId, clock_gettime};
use std::{
    cmp::Reverse,
    collections::{BTreeMap, BinaryHeap},
    time::{Duration, Instant},
};

/// Number of tasks for each worker.
const TASKS_EACH: usize = 20;
/// Number of evaluations that a worker accepts at once.
const CREDITS: usize = 4;
/// Shortest and longest evaluation, milliseconds.
const EVALUATION_MS: (u64, u64) = (200, 1_000);
/// Time that a message takes on the network, one way.
const LATENCY: Duration = Duration::from_millis(5);
const HEARTBEAT: Duration = Duration::from_secs(1);
const SILENCE_LIMIT: Duration = Duration::from_secs(4);
const TICK: Duration = Duration::from_millis(100);
/// Probability that a worker is lost during a lease.
const LOST: f64 = 0.001;

/// Results of honest workers are all the same.
#[derive(Debug, Clone, Copy)]
struct Answer;

impl Agree for Answer {
    fn agrees_with(&self, _: &Self) -> bool {
        true
    }
}

/// Event on the simulated clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Happens {
    Join(u64),
    Heartbeat(WorkerId),
    /// The worker was lost: no more messages come from it.
    Silence(WorkerId),
    Result(WorkerId, LeaseNumber, usize),
    Credits(WorkerId, usize),
    Tick,
}

/// A cluster, and the table that serves it.
struct Cluster {
    table: LeaseTable<Answer>,
    clock: Instant,
    agenda: BinaryHeap<Reverse<(Instant, u64, Happens)>>,
    number: u64,
    stream: RandomStream,
    /// For each worker, its process, and the time when it finishes all its leases.
    alive: BTreeMap<WorkerId, (Instant, u64)>,
    /// Time that reading the clock takes.
    clock_takes: Duration,
    /// Time that the table has taken.
    spent: Duration,
    messages: u64,
    leases: u64,
    /// End of the table's current work, on the simulated clock.
    busy: Instant,
    /// How long each message waited for the table.
    waits: Vec<Duration>,
    /// Peak of resident memory, bytes.
    memory: u64,
    is_over: bool,
    results: usize,
    /// Total time that workers were idle while they waited for a lease.
    idle: Duration,
}

impl Cluster {
    fn new(workers: usize) -> Self {
        let begun = Instant::now();
        let mut cluster = Self {
            table: LeaseTable::new(SILENCE_LIMIT),
            clock: begun,
            agenda: BinaryHeap::new(),
            number: 0,
            stream: RandomStream::derive(1, Purpose::Audit, 0),
            alive: BTreeMap::new(),
            clock_takes: clock_takes(),
            spent: Duration::ZERO,
            messages: 0,
            leases: 0,
            busy: begun,
            waits: Vec::new(),
            memory: 0,
            is_over: false,
            results: 0,
            idle: Duration::ZERO,
        };
        for process in 0..workers as u64 {
            // The joins are spread over a second, so that the heartbeats are too.
            let at = HEARTBEAT.mul_f64(process as f64 / workers as f64);
            cluster.plan(begun + at, Happens::Join(process));
        }
        cluster.plan(begun + TICK, Happens::Tick);
        let tasks = workers * TASKS_EACH;
        let stream = &mut cluster.stream;
        let audited = (0..tasks).filter(|_| stream.random_bool(0.01)).collect();
        let params = JobParams {
            tasks,
            cost: 1,
            audited,
            embeds: false,
            speculative: true,
            after: None,
            is_shown: false,
        };
        cluster.timed(|table, _| table.submit(params));
        cluster
    }

    fn plan(&mut self, at: Instant, happens: Happens) {
        self.number += 1;
        self.agenda.push(Reverse((at, self.number, happens)));
    }

    /// Runs an operation of the table and adds its time to `spent`.
    fn timed<T>(&mut self, act: impl FnOnce(&mut LeaseTable<Answer>, Instant) -> T) -> T {
        let begun = cpu_time();
        let done = act(&mut self.table, self.clock);
        self.spent += (cpu_time() - begun).saturating_sub(self.clock_takes);
        done
    }

    fn run(mut self) -> Self {
        while !self.is_over
            && let Some(Reverse((at, _, happens))) = self.agenda.pop()
        {
            self.clock = at;
            let begins = self.busy.max(at);
            let before = self.spent;
            self.happen(happens);
            self.busy = begins + (self.spent - before);
            self.messages += 1;
            self.waits.push(begins - at);
        }
        self
    }

    fn happen(&mut self, happens: Happens) {
        match happens {
            Happens::Join(process) => {
                let id = WorkerProcessId {
                    machine: MachineId(process),
                    instance: process,
                };
                let abilities = Abilities {
                    capacity: 1,
                    embeds: false,
                };
                let joined = self.timed(|table, now| table.join(id, abilities, now));
                let Some(worker) = joined else { return };
                self.alive.insert(worker, (self.clock, process));
                self.plan(self.clock + HEARTBEAT, Happens::Heartbeat(worker));
                self.plan(self.clock, Happens::Credits(worker, CREDITS));
            }
            Happens::Heartbeat(worker) => {
                if self.alive.contains_key(&worker) {
                    self.timed(|table, now| table.keep_alive(worker, now));
                    self.plan(self.clock + HEARTBEAT, Happens::Heartbeat(worker));
                }
            }
            Happens::Credits(worker, count) => {
                if self.alive.contains_key(&worker) {
                    self.timed(|table, now| {
                        table.keep_alive(worker, now);
                        table.add_credits(worker, count);
                    });
                    self.grant();
                }
            }
            Happens::Result(worker, lease, tasks) => {
                if self.alive.contains_key(&worker) {
                    self.timed(|table, now| {
                        table.keep_alive(worker, now);
                        // `complete` fails if the job is over: another worker has then answered the task.
                        let _ = table.complete(worker, lease, vec![Answer; tasks], now);
                    });
                    self.plan(self.clock, Happens::Credits(worker, tasks));
                    self.grant();
                }
            }
            Happens::Silence(worker) => {
                if let Some((_, process)) = self.alive.remove(&worker) {
                    self.plan(self.clock + 2 * SILENCE_LIMIT, Happens::Join(process));
                }
            }
            Happens::Tick => {
                let silent = self.timed(|table, now| table.silent(now, SILENCE_LIMIT));
                for worker in silent {
                    self.timed(|table, _| table.lose(worker));
                }
                self.grant();
                self.memory = self.memory.max(resident());
                self.plan(self.clock + TICK, Happens::Tick);
            }
        }
    }

    /// Grants all leases that the table can grant, and plans their results.
    fn grant(&mut self) {
        while let Some(grant) = self.timed(|table, now| table.grant(now)) {
            self.leases += 1;
            let Some(&(busy_until, process)) = self.alive.get(&grant.worker) else {
                continue;
            };
            let arrives = self.clock + LATENCY;
            let begins = busy_until.max(arrives);
            self.idle += begins.saturating_duration_since(busy_until);
            let mut ends = begins;
            for _ in &grant.tasks {
                let (least, most) = EVALUATION_MS;
                ends += Duration::from_millis(self.stream.random_range(least..most));
            }
            self.alive.insert(grant.worker, (ends, process));
            if self.stream.random_bool(LOST) {
                self.plan(ends, Happens::Silence(grant.worker));
            } else {
                let result = Happens::Result(grant.worker, grant.lease, grant.tasks.len());
                self.plan(ends + LATENCY, result);
            }
        }
        let events = self.timed(|table, _| table.take_events());
        for event in events {
            if let Event::Done { results, .. } = event {
                self.results = results.len();
                self.is_over = true;
            }
        }
    }
}

/// CPU time of this thread so far.
fn cpu_time() -> Duration {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    Duration::new(time.tv_sec.unsigned_abs(), time.tv_nsec.unsigned_abs() as u32)
}

fn clock_takes() -> Duration {
    let reads = 10_000;
    let begun = cpu_time();
    for _ in 0..reads {
        std::hint::black_box(cpu_time());
    }
    (cpu_time() - begun) / reads
}

/// Resident memory of this process, bytes; 0 if the system does not report it.
fn resident() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    let kib = line.and_then(|line| line.split_whitespace().next()?.parse::<u64>().ok());
    kib.map_or(0, |kib| kib << 10)
}

fn main() {
    let sizes = std::env::var("WORKERS").unwrap_or_else(|_| "10,100,1000,10000".to_owned());
    println!(
        "workers  results  messages  µs/message  results/s of CPU  busy  mean wait  99 % wait  idle  MiB"
    );
    for workers in sizes
        .split(',')
        .filter_map(|size| size.trim().parse::<usize>().ok())
    {
        let before = resident();
        let begun = Cluster::new(workers);
        let start = begun.clock;
        let mut cluster = begun.run();
        let lasted = cluster.clock - start;
        cluster.waits.sort_unstable();
        let waits = &cluster.waits;
        let mean = waits.iter().sum::<Duration>() / waits.len().max(1) as u32;
        println!(
            "{workers:7}  {:7}  {:8}  {:10.2}  {:16.0}  {:3.1} %  {:6.1} µs  {:6.1} µs  {:3.1} %  {:3}",
            cluster.results,
            cluster.messages,
            1e6 * cluster.spent.as_secs_f64() / cluster.messages as f64,
            cluster.results as f64 / cluster.spent.as_secs_f64(),
            100.0 * cluster.spent.as_secs_f64() / lasted.as_secs_f64(),
            1e6 * mean.as_secs_f64(),
            1e6 * waits[waits.len() * 99 / 100].as_secs_f64(),
            100.0 * cluster.idle.as_secs_f64() / (lasted.as_secs_f64() * workers as f64),
            cluster.memory.saturating_sub(before) >> 20,
        );
    }
}

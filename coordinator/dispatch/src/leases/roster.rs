//! The connected workers, in the order of their turns. Look-ups take logarithmic time in the number of workers; only look-ups
//! that iterate over all workers take longer.

use super::{AWAY, LeaseNumber, WorkerId, machine::Machine, workers::Worker};
use murmuration_model::MachineId;
use std::{
    cmp::Reverse,
    collections::{BTreeMap, BTreeSet},
    time::{Duration, Instant},
};

/// Order of turns: workers with a lower load first, then workers with more credits, then workers that joined earlier.
type Turn = (usize, Reverse<usize>, WorkerId);

/// The connected workers.
#[derive(Debug)]
pub(super) struct Roster {
    workers: BTreeMap<WorkerId, Worker>,
    machines: BTreeMap<MachineId, Machine>,
    /// Machines whose last worker has left a moment ago, with the time of its last message.
    away: BTreeMap<MachineId, (Instant, Machine)>,
    /// Workers that can get more tasks.
    free: BTreeSet<Turn>,
    /// Workers that embed and can get more tasks.
    free_embedders: BTreeSet<Turn>,
    /// All workers, those with the fewest leases first.
    by_leases: BTreeSet<(usize, WorkerId)>,
    all: Staff,
    embedders: Staff,
    /// Number of leases that workers hold.
    out: usize,
}

/// Number of workers that take work, and number of tasks that they have proven to run at once.
#[derive(Debug, Clone, Copy, Default)]
struct Staff {
    workers: usize,
    capacity: usize,
}

impl Staff {
    const fn add(&mut self, worker: &Worker) {
        self.workers += (worker.capacity > 0) as usize;
    }

    const fn take_away(&mut self, worker: &Worker) {
        self.workers -= (worker.capacity > 0) as usize;
    }
}

fn is_recent(left: Instant, now: Instant) -> bool {
    now.saturating_duration_since(left) <= AWAY
}

impl Worker {
    /// The worker's turn, if the worker can get more tasks.
    fn turn(&self, id: WorkerId) -> Option<Turn> {
        let may = self.credits > 0 && !self.alone && self.capacity > 0;
        may.then(|| (self.load(), Reverse(self.credits), id))
    }
}

impl Roster {
    pub(super) const fn new() -> Self {
        let nobody = Staff {
            workers: 0,
            capacity: 0,
        };
        Self {
            workers: BTreeMap::new(),
            machines: BTreeMap::new(),
            away: BTreeMap::new(),
            free: BTreeSet::new(),
            free_embedders: BTreeSet::new(),
            by_leases: BTreeSet::new(),
            all: nobody,
            embedders: nobody,
            out: 0,
        }
    }

    pub(super) fn get(&self, id: WorkerId) -> Option<&Worker> {
        self.workers.get(&id)
    }

    /// All workers, in the order in which they joined.
    pub(super) fn iter(&self) -> impl Iterator<Item = (WorkerId, &Worker)> {
        self.workers.iter().map(|(&id, worker)| (id, worker))
    }

    /// Workers that can get more tasks, in the order of their turns; only workers that embed if `embeds`.
    pub(super) fn free(&self, embeds: bool) -> impl Iterator<Item = (WorkerId, &Worker)> {
        let free = if embeds { &self.free_embedders } else { &self.free };
        free.iter()
            .filter_map(|&(_, _, id)| Some((id, self.workers.get(&id)?)))
    }

    /// Free workers that hold no lease.
    pub(super) fn idle(&self, embeds: bool) -> impl Iterator<Item = (WorkerId, &Worker)> {
        // A load of 0 is not enough: loads are rounded down, so a worker with many threads and one task also has a load of 0.
        self.free(embeds)
            .take_while(|(_, worker)| worker.load() == 0)
            .filter(|(_, worker)| worker.holds.is_empty())
    }

    /// All workers, those with the fewest leases first.
    pub(super) fn by_leases(&self) -> impl Iterator<Item = (WorkerId, &Worker)> {
        self.by_leases
            .iter()
            .filter_map(|&(_, id)| Some((id, self.workers.get(&id)?)))
    }

    /// Number of workers that take work.
    pub(super) const fn working(&self) -> usize {
        self.all.workers
    }

    /// Number of workers that take work and embed.
    pub(super) const fn embedders(&self) -> usize {
        self.embedders.workers
    }

    /// Number of tasks that all workers run at once; only workers that embed count if `embeds`.
    pub(super) const fn capacity(&self, embeds: bool) -> usize {
        if embeds {
            self.embedders.capacity
        } else {
            self.all.capacity
        }
    }

    /// Number of leases that workers hold.
    pub(super) const fn out(&self) -> usize {
        self.out
    }

    pub(super) fn insert(&mut self, id: WorkerId, worker: Worker) {
        let away = self.away.remove(&worker.machine());
        let returned = || away.map(|(_, machine)| machine).unwrap_or_default();
        let machine = self.machines.entry(worker.machine()).or_insert_with(returned);
        machine.workers += 1;
        machine.embeds |= worker.embeds;
        machine.joined.get_or_insert(worker.heard);
        self.enter(id, &worker);
        self.workers.insert(id, worker);
    }

    pub(super) fn remove(&mut self, id: WorkerId) {
        let Some(worker) = self.workers.remove(&id) else {
            return;
        };
        self.strike(id, &worker);
        let Some(mut machine) = self.machines.remove(&worker.machine()) else {
            return;
        };
        for &lease in &worker.owes {
            machine.excuse(lease);
        }
        machine.workers -= 1;
        if machine.workers > 0 {
            self.machines.insert(worker.machine(), machine);
            return;
        }
        self.away.retain(|_, (left, _)| is_recent(*left, worker.heard));
        self.away.insert(worker.machine(), (worker.heard, machine));
    }

    /// Machines without workers whose last worker may be restarting.
    pub(super) fn away(&self, now: Instant) -> impl Iterator<Item = (MachineId, &Machine)> {
        let recent = self
            .away
            .iter()
            .filter(move |(_, (left, _))| is_recent(*left, now));
        recent.map(|(&id, (_, machine))| (id, machine))
    }

    /// A machine with workers.
    pub(super) fn machine(&self, id: MachineId) -> Option<&Machine> {
        self.machines.get(&id)
    }

    /// Records that a worker owes the answer to a lease.
    pub(super) fn owe(&mut self, id: WorkerId, lease: LeaseNumber, now: Instant) {
        if let Some(worker) = self.workers.get_mut(&id) {
            worker.owes.insert(lease);
            let machine = worker.machine();
            self.change_machine(machine, |machine| machine.owe(lease, now));
        }
    }

    /// Since when a worker owes its oldest answer.
    pub(super) fn owes_since(&self, worker: &Worker) -> Option<Instant> {
        let oldest = worker.owes.first()?;
        self.machines.get(&worker.machine())?.granted(*oldest)
    }

    /// Records that a worker need not answer a lease any more; returns whether the worker owed the answer.
    pub(super) fn excuse(&mut self, id: WorkerId, lease: LeaseNumber) -> bool {
        let Some(worker) = self.workers.get_mut(&id) else {
            return false;
        };
        let owed = worker.owes.remove(&lease);
        let machine = worker.machine();
        if owed {
            self.change_machine(machine, |machine| machine.excuse(lease));
        }
        owed
    }

    /// Records that a worker has answered a lease at time `now`.
    pub(super) fn be_active(&mut self, id: WorkerId, now: Instant) {
        if let Some(worker) = self.workers.get_mut(&id) {
            worker.active = now;
            let machine = worker.machine();
            self.change_machine(machine, |machine| machine.active = Some(now));
        }
    }

    /// Records that a worker makes progress with a lease that takes long.
    pub(super) fn renew(&mut self, id: WorkerId, lease: LeaseNumber, now: Instant) {
        if self.excuse(id, lease) {
            self.owe(id, lease, now);
        }
    }

    /// Records an answer of a machine at time `now` to a lease of this many tasks, which took this long.
    pub(super) fn learn(&mut self, machine: MachineId, tasks: usize, took: Duration, now: Instant) {
        self.change_machine(machine, |machine| machine.learn(tasks, took, now));
    }

    /// Whether a machine owes an answer for so long that it gets no more work.
    pub(super) fn hangs(&self, machine: MachineId, now: Instant) -> bool {
        self.machines
            .get(&machine)
            .is_some_and(|machine| machine.hangs(now))
    }

    /// Changes a machine, whose proven capacity may change too.
    fn change_machine(&mut self, id: MachineId, change: impl FnOnce(&mut Machine)) {
        let Some(machine) = self.machines.get_mut(&id) else {
            return;
        };
        let before = machine.proven();
        change(machine);
        let after = machine.proven();
        self.all.capacity = self.all.capacity - before.all + after.all;
        self.embedders.capacity = self.embedders.capacity - before.embedders + after.embedders;
    }

    /// Changes a worker and its turn; `None` if the worker is unknown. Every change of a worker must use this function.
    pub(super) fn change<T>(&mut self, id: WorkerId, change: impl FnOnce(&mut Worker) -> T) -> Option<T> {
        let mut worker = self.workers.remove(&id)?;
        self.strike(id, &worker);
        let changed = change(&mut worker);
        self.enter(id, &worker);
        self.workers.insert(id, worker);
        Some(changed)
    }

    /// Records the time of a worker's message, which changes no turn.
    pub(super) fn hear(&mut self, id: WorkerId, now: Instant) {
        if let Some(worker) = self.workers.get_mut(&id) {
            worker.heard = now;
        }
    }

    fn enter(&mut self, id: WorkerId, worker: &Worker) {
        self.all.add(worker);
        self.change_machine(worker.machine(), |machine| machine.add(worker));
        self.out += worker.holds.len();
        self.by_leases.insert((worker.holds.len(), id));
        let turn = worker.turn(id);
        self.free.extend(turn);
        if worker.embeds {
            self.embedders.add(worker);
            self.free_embedders.extend(turn);
        }
    }

    fn strike(&mut self, id: WorkerId, worker: &Worker) {
        self.all.take_away(worker);
        self.change_machine(worker.machine(), |machine| machine.take_away(worker));
        self.out -= worker.holds.len();
        self.by_leases.remove(&(worker.holds.len(), id));
        if worker.embeds {
            self.embedders.take_away(worker);
        }
        if let Some(turn) = worker.turn(id) {
            self.free.remove(&turn);
            self.free_embedders.remove(&turn);
        }
    }
}

//! Who and what a lease is about.

use murmuration_model::MachineId;

/// A worker's connection; a worker that connects anew has another one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct WorkerId(pub(super) u64);

/// A worker's process, the same over all its connections from one machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct WorkerProcessId {
    /// Where it runs.
    pub machine: MachineId,
    /// What tells it from other processes of that machine: a number of its own choosing, which gives it no vote.
    pub instance: u64,
}

/// What a worker can do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Abilities {
    /// Tasks that it runs at once, 1 or more.
    pub capacity: usize,
    /// Whether it embeds pictures.
    pub embeds: bool,
}

/// A job that was submitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct JobId(pub(super) u64);

/// A lease; numbers are never used twice in one run of the coordinator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct LeaseNumber(pub u64);

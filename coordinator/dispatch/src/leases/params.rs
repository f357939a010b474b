//! What a job asks of the lease table.

use std::collections::BTreeSet;

/// How a job is to be done.
#[derive(Debug, Clone)]
pub struct JobParams {
    /// Number of tasks, at least one.
    pub tasks: usize,
    /// What a task costs its job when turns are compared, in a unit that all jobs share (agents times steps over a weight,
    /// say); at least 1.
    pub cost: u64,
    /// Places of the tasks that a worker on a second machine repeats, where there is one.
    pub audited: BTreeSet<usize>,
    /// Whether only workers that embed can do them.
    pub embeds: bool,
    /// Whether a late lease is also given to a worker that would be idle.
    pub speculative: bool,
}

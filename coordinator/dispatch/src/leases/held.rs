//! Look-ups of leases, their holders and their tasks.

use super::{Agree, JobId, LeaseNumber, LeaseTable, WorkerId};
use murmuration_model::MachineId;

impl<R: Agree + Clone> LeaseTable<R> {
    pub fn held(&self, job: JobId) -> impl Iterator<Item = (WorkerId, LeaseNumber)> {
        let leases = self.jobs.get(&job).into_iter().flat_map(|job| &job.leases);
        leases.filter_map(|number| Some((self.leases.get(number)?.holder?, *number)))
    }

    /// The job of a lease that was granted to this worker, if the job is not over.
    #[must_use]
    pub fn leased(&self, worker: WorkerId, lease: LeaseNumber) -> Option<JobId> {
        let lease = self.leases.get(&lease)?;
        (lease.process == self.process(worker)?).then_some(lease.job)
    }

    /// The job of a lease, if the job is not over.
    pub(crate) fn job(&self, lease: LeaseNumber) -> Option<JobId> {
        Some(self.leases.get(&lease)?.job)
    }

    /// The job of a lease that a worker on this machine holds.
    #[must_use]
    pub(crate) fn held_by(&self, machine: MachineId, lease: LeaseNumber) -> Option<JobId> {
        let lease = self.leases.get(&lease)?;
        (lease.holder.is_some() && lease.process.machine == machine).then_some(lease.job)
    }

    /// The jobs of the leases that a worker holds, each with the number of tasks.
    pub fn in_hand(&self, worker: WorkerId) -> impl Iterator<Item = (JobId, usize)> {
        let holds = self
            .workers
            .get(worker)
            .into_iter()
            .flat_map(|worker| &worker.holds);
        let leases = holds.filter_map(|number| self.leases.get(number));
        leases.map(|lease| (lease.job, lease.tasks.len()))
    }

    /// Number of tasks that a worker runs at once; 0 if the worker takes no more work or is gone.
    #[must_use]
    pub fn capacity(&self, worker: WorkerId) -> usize {
        self.workers.get(worker).map_or(0, |worker| worker.capacity)
    }

    /// Places of the tasks of a lease; empty if its job is over.
    #[must_use]
    pub fn tasks(&self, lease: LeaseNumber) -> &[usize] {
        let lease = self.leases.get(&lease);
        lease.map_or(&[], |lease| &lease.tasks)
    }
}

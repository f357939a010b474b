//! What the lease table and the names of workers come to, for people.

use super::Service;
use crate::{
    ConnectedMachine, WorkInHand,
    leases::{JobId, WorkerId},
};

impl Service {
    /// Everybody who is connected, by name.
    pub(super) fn connected(&self) -> Vec<ConnectedMachine> {
        let mut machines: Vec<_> = self.workers.keys().map(|&id| self.machine(id)).collect();
        machines.sort_by(|one, other| one.name.cmp(&other.name));
        machines
    }

    fn machine(&self, id: WorkerId) -> ConnectedMachine {
        let process = self.table.process(id);
        let name = process.and_then(|process| self.names.get(&process));
        let mut work: Vec<WorkInHand> = Vec::new();
        for (job, tasks) in self.table.in_hand(id) {
            self.add(&mut work, job, tasks);
        }
        ConnectedMachine {
            name: name.cloned().unwrap_or_default(),
            capacity: self.table.capacity(id),
            work,
        }
    }

    fn add(&self, work: &mut Vec<WorkInHand>, job: JobId, tasks: usize) {
        let Some(job) = self.jobs.get(&job) else { return };
        let (kind, campaign) = (job.submitted.kind(), job.submitted.campaign());
        let known = work
            .iter_mut()
            .find(|known| known.kind == kind && known.campaign.as_ref() == campaign);
        match known {
            Some(known) => known.tasks += tasks,
            None => work.push(WorkInHand {
                kind,
                campaign: campaign.cloned(),
                tasks,
            }),
        }
    }
}

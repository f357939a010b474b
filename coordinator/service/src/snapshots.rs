//! Snapshots of trainings, which arrive from trainers part by part. Parts are only kept for a training that is leased to the
//! stream's trainer.

use super::lease_id;
use murmuration_dispatch::{Dispatch, LeaseNumber, TrainingLease, WorkerId, WorkerReport};
use murmuration_model::SavedTraining;
use murmuration_proto::{PART_BYTES, v1};
use murmuration_swarm::Invalid;

/// Unfinished snapshots of one stream.
pub(super) struct Snapshots {
    dispatch: Dispatch,
    worker: WorkerId,
    arriving: Option<Arriving>,
}

/// The training and the epoch that a snapshot belongs to.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Moment {
    /// The coordinator's epoch in which the lease was granted.
    epoch: u64,
    lease: LeaseNumber,
    /// Number of epochs trained.
    epochs_done: u64,
}

/// A snapshot whose last part has not arrived yet.
struct Arriving {
    of: Moment,
    /// Maximum size in bytes of such a snapshot; `None` if the lease is over, so that the snapshot is not kept.
    room: Option<usize>,
    bytes: Vec<u8>,
}

impl Snapshots {
    pub(super) const fn of(dispatch: Dispatch, worker: WorkerId) -> Self {
        Self {
            dispatch,
            worker,
            arriving: None,
        }
    }

    /// Adds a part of a snapshot. Returns the complete snapshot after its last part, and a heartbeat after each earlier part.
    ///
    /// # Errors
    /// The first part fails if this stream never had the lease, or the training has no such epoch. Any part fails if the snapshot
    /// exceeds its maximum size.
    pub(super) async fn add(&mut self, part: v1::TrainingSnapshot) -> Result<WorkerReport, Invalid> {
        let (epoch, lease) = lease_id(part.lease, "snapshot.lease")?;
        if part.data.len() > PART_BYTES {
            let value = format!("{} bytes", part.data.len());
            return Err(Invalid::new(
                "snapshot.data",
                value,
                format!("at most {PART_BYTES} bytes a part"),
            ));
        }
        let of = Moment {
            epoch,
            lease,
            epochs_done: part.epoch,
        };
        let begun = self.arriving.take().filter(|arriving| arriving.of == of);
        let mut arriving = match begun {
            Some(arriving) => arriving,
            None => self.begin(of).await?,
        };
        if let Some(room) = arriving.room {
            if arriving.bytes.len() + part.data.len() > room {
                let allowed = format!("at most {room} bytes for this training");
                return Err(Invalid::new("snapshot.data", "more", allowed));
            }
            arriving.bytes.extend_from_slice(&part.data);
        }
        if !part.last {
            self.arriving = Some(arriving);
            return Ok(WorkerReport::Heartbeat);
        }
        if arriving.room.is_none() {
            return Ok(WorkerReport::Heartbeat);
        }
        let training = SavedTraining {
            epoch: part.epoch,
            bytes: arriving.bytes,
        };
        Ok(WorkerReport::Saved {
            epoch,
            lease,
            training,
        })
    }

    async fn begin(&self, of: Moment) -> Result<Arriving, Invalid> {
        let Moment {
            epoch,
            lease,
            epochs_done,
        } = of;
        let room = match self.dispatch.training_lease(self.worker, epoch, lease).await {
            TrainingLease::Held(training) => {
                let most = training.configuration.recipe().epochs();
                if !(1..=most).contains(&epochs_done) {
                    let allowed = format!("from 1 to {most}, the epochs of this training");
                    return Err(Invalid::new("snapshot.epoch", epochs_done, allowed));
                }
                Some(training.snapshot_bytes)
            }
            TrainingLease::Over => None,
            TrainingLease::Never => {
                let value = format!("{epoch}-{}", lease.0);
                let allowed = "the lease of a training that this trainer was given";
                return Err(Invalid::new("snapshot.lease", value, allowed));
            }
        };
        Ok(Arriving {
            of,
            room,
            bytes: Vec::new(),
        })
    }
}

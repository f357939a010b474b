//! A validated training task.

use super::event::Undone;
use murmuration_proto::v1;
use murmuration_swarm::{
    CheckpointDigest, Dataset, FEATURE_NAMES, Invalid, PictureShape, training::Configuration,
};

#[derive(Debug)]
pub(super) struct Task {
    pub(super) lease: v1::LeaseId,
    pub(super) campaign: String,
    pub(super) trace_parent: String,
    pub(super) configuration: Configuration,
    /// The shape of each picture.
    pub(super) pictures: PictureShape,
    pub(super) views: usize,
    /// Bytes of all pictures.
    pub(super) bytes: usize,
    /// The checkpoint and labelled pictures, if the training learns from labels.
    pub(super) fine_tuning: Option<FineTuningTask>,
}

impl Task {
    /// Number of features that come with the pictures: five for each behaviour if the recipe uses flattening, otherwise none.
    pub(super) fn features(&self) -> usize {
        match self.configuration.recipe().flattening() {
            0 => 0,
            _ => self.bytes / (self.pictures.bytes() * self.views.max(1)) * FEATURE_NAMES.len(),
        }
    }
}

/// The part of a task that only trainings on labels have.
#[derive(Debug)]
pub(super) struct FineTuningTask {
    /// The checkpoint to train further.
    pub(super) parent: CheckpointDigest,
    /// Bytes of all labelled pictures.
    pub(super) bytes: usize,
    pub(super) labels: usize,
}

/// Number of bytes of the pictures of all behaviours, if the pictures fit into a trainer's memory.
fn bytes(field: &str, shape: PictureShape, views: u32, behaviours: u32) -> Result<usize, Undone> {
    let bytes = [views, behaviours]
        .iter()
        .try_fold(shape.bytes() as u64, |product, &size| {
            product.checked_mul(size.into())
        })
        .filter(|&bytes| bytes <= Dataset::MAX_BYTES)
        .and_then(|bytes| usize::try_from(bytes).ok());
    bytes.ok_or_else(|| {
        let value = format!("{behaviours} of {views} pictures of {shape}");
        let allowed = format!("at most {} bytes of pictures in all", Dataset::MAX_BYTES);
        Undone::fatal(Invalid::new(field, value, allowed))
    })
}

impl TryFrom<v1::Lease> for Task {
    type Error = Undone;

    fn try_from(lease: v1::Lease) -> Result<Self, Undone> {
        let Some(v1::lease::Work::Training(task)) = lease.work else {
            return Err(Undone::fatal(
                "work: must be a kind of work that this trainer knows",
            ));
        };
        let configuration = Configuration::from_toml(&task.configuration)
            .map_err(|error| Undone::fatal(format!("the training's configuration: {error}")))?;
        let pictures =
            PictureShape::new(task.channels as usize, task.side as usize).map_err(Undone::fatal)?;
        let fine_tuning = match task.parent.as_str() {
            "" => None,
            parent => Some(FineTuningTask {
                parent: parent
                    .parse()
                    .map_err(|error: Invalid| Undone::fatal(error.within("parent")))?,
                bytes: bytes("labelled", pictures, 1, task.labelled)?,
                labels: task.labels as usize,
            }),
        };
        Ok(Self {
            bytes: bytes("behaviours", pictures, task.views, task.behaviours)?,
            fine_tuning,
            lease: lease.id.unwrap_or_default(),
            campaign: lease.campaign,
            trace_parent: lease.trace_parent,
            configuration,
            pictures,
            views: task.views as usize,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lease(configuration: &str, behaviours: u32) -> v1::Lease {
        v1::Lease {
            id: None,
            campaign: "small-1".to_owned(),
            trace_parent: String::new(),
            work: Some(v1::lease::Work::Training(v1::TrainingTask {
                configuration: configuration.to_owned(),
                channels: 1,
                side: 50,
                views: 2,
                behaviours,
                parent: String::new(),
                labelled: 0,
                labels: 0,
            })),
        }
    }

    #[test]
    fn a_task_knows_how_many_bytes_to_expect() {
        let task = Task::try_from(lease("seed = 3", 10_000)).unwrap();
        assert_eq!((task.bytes, task.configuration.seed()), (50_000_000, 3));
    }

    #[track_caller]
    fn check_refused(lease: v1::Lease, expected: &str) {
        let error = Task::try_from(lease).unwrap_err().to_string();
        assert!(error.contains(expected), "{error:?} does not say {expected:?}");
    }

    #[test]
    fn what_is_wrong_is_named() {
        check_refused(lease("sed = 3", 100), "configuration: ");
        check_refused(lease("", u32::MAX), "at most 8589934592 bytes of pictures");
        let replay = v1::lease::Work::Replay(v1::ReplayTask::default());
        let work = v1::Lease {
            id: None,
            campaign: "small-1".to_owned(),
            trace_parent: String::new(),
            work: Some(replay),
        };
        check_refused(work, "a kind of work that this trainer knows");
    }
}

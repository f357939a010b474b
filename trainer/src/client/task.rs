//! A validated training task.

use super::event::Undone;
use crate::compared_pictures::ComparedPictures;
use murmuration_proto::{CheckpointDigest, Dataset, Invalid, PictureShape, training::Configuration, v1};

/// A training task.
#[derive(Debug)]
pub(super) struct Task {
    pub(super) lease: v1::LeaseId,
    pub(super) campaign: String,
    /// Its trace.
    pub(super) trace_parent: String,
    pub(super) configuration: Configuration,
    /// The shape of each picture.
    pub(super) pictures: PictureShape,
    pub(super) views: usize,
    /// Bytes of all pictures.
    pub(super) bytes: usize,
    /// The checkpoint and labelled pictures, if it learns from labels.
    pub(super) fine_tuning: Option<FineTuningTask>,
}

/// The labelled pictures to learn from.
#[derive(Debug)]
pub(super) struct FineTuningTask {
    /// The checkpoint to train further.
    pub(super) parent: CheckpointDigest,
    /// Bytes of all labelled pictures.
    pub(super) bytes: usize,
    /// Number of their labels.
    pub(super) labels: usize,
    /// What people compared, if they have.
    pub(super) compared: Option<ComparedTask>,
}

/// The comparisons to learn from.
#[derive(Debug)]
pub(super) struct ComparedTask {
    /// Pictures of each behaviour.
    pub(super) views: usize,
    /// Bytes of all compared pictures.
    pub(super) bytes: usize,
    /// Number of comparisons.
    pub(super) comparisons: usize,
}

/// The comparisons of a task, if it has some.
fn compared(task: &v1::TrainingTask, shape: PictureShape) -> Result<Option<ComparedTask>, Undone> {
    let comparisons = task.comparisons as usize;
    if comparisons == 0 {
        return Ok(None);
    }
    if comparisons > ComparedPictures::MAX_TRIPLETS {
        let allowed = format!("at most {}", ComparedPictures::MAX_TRIPLETS);
        return Err(Undone::fatal(Invalid::new("comparisons", comparisons, allowed)));
    }
    let views = task.compared_views as usize;
    if !(1..=ComparedPictures::MAX_VIEWS).contains(&views) {
        let allowed = format!("1 to {}", ComparedPictures::MAX_VIEWS);
        return Err(Undone::fatal(Invalid::new("compared_views", views, allowed)));
    }
    Ok(Some(ComparedTask {
        views,
        bytes: bytes("compared", shape, (task.compared_views, task.compared))?,
        comparisons,
    }))
}

/// Bytes of this number of pictures, if they fit into a trainer's memory.
fn bytes(field: &str, shape: PictureShape, (views, behaviours): (u32, u32)) -> Result<usize, Undone> {
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
                bytes: bytes("labelled", pictures, (1, task.labelled))?,
                labels: task.labels as usize,
                compared: compared(&task, pictures)?,
            }),
        };
        Ok(Self {
            bytes: bytes("behaviours", pictures, (task.views, task.behaviours))?,
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
                compared: 0,
                compared_views: 0,
                comparisons: 0,
            })),
        }
    }

    #[test]
    fn a_task_knows_how_many_bytes_to_expect() {
        let task = Task::try_from(lease("seed = 3", 10_000)).unwrap();
        assert_eq!((task.bytes, task.configuration.seed()), (50_000_000, 3));
    }

    #[track_caller]
    fn check_refused(lease: v1::Lease, said: &str) {
        let error = Task::try_from(lease).unwrap_err().to_string();
        assert!(error.contains(said), "{error:?} does not say {said:?}");
    }

    #[test]
    fn what_is_wrong_is_named() {
        check_refused(lease("sed = 3", 100), "configuration: ");
        check_refused(lease("", u32::MAX), "at most 8589934592 bytes of pictures");
        let compared = |compared_views, comparisons| {
            let mut lease = lease("", 100);
            if let Some(v1::lease::Work::Training(task)) = &mut lease.work {
                task.parent = CheckpointDigest::of(b"parent").to_string();
                (task.compared, task.compared_views, task.comparisons) = (9, compared_views, comparisons);
            }
            lease
        };
        assert!(Task::try_from(compared(2, 5)).is_ok());
        check_refused(compared(17, 5), "compared_views = 17: must be 1 to 16");
        check_refused(
            compared(2, 1_000_001),
            "comparisons = 1000001: must be at most 1000000",
        );
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

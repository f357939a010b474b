//! Metrics of a dispatcher: work, leases, workers.

use prometheus_client::{
    metrics::{
        counter::Counter,
        family::Family,
        gauge::Gauge,
        histogram::{Histogram, exponential_buckets},
    },
    registry::{Registry, Unit},
};
use std::time::Duration;

/// The kind of client that a dispatcher serves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PeerKind {
    Worker,
    Trainer,
}

impl PeerKind {
    const fn name(self) -> &'static str {
        match self {
            Self::Worker => "worker",
            Self::Trainer => "trainer",
        }
    }
}

/// Kinds of work.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WorkKind {
    Evaluation,
    /// Pictures to embed.
    Embedding,
    /// Simulations to watch.
    Replay,
    Training,
}

impl WorkKind {
    const ALL: [Self; 4] = [Self::Evaluation, Self::Embedding, Self::Replay, Self::Training];

    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Evaluation => "evaluation",
            Self::Embedding => "embedding",
            Self::Replay => "replay",
            Self::Training => "training",
        }
    }

    const fn labels(self) -> MetricLabels {
        [("work", self.name())]
    }

    const fn peer(self) -> PeerKind {
        match self {
            Self::Evaluation | Self::Embedding | Self::Replay => PeerKind::Worker,
            Self::Training => PeerKind::Trainer,
        }
    }
}

type MetricLabels = [(&'static str, &'static str); 1];

/// Metric families of all dispatchers of a coordinator, distinguished by labels; cheap to clone.
#[derive(Debug, Clone)]
pub struct Families {
    connected: Family<MetricLabels, Gauge>,
    pending: Family<MetricLabels, Gauge>,
    leased: Family<MetricLabels, Gauge>,
    returned: Family<MetricLabels, Counter>,
    dropped: Family<MetricLabels, Counter>,
    quarantined: Counter,
    audited: Counter,
    waived: Counter,
    disagreements: Counter,
    poisoned: Counter,
    done: Family<MetricLabels, Counter>,
    turnaround: Family<MetricLabels, Histogram>,
}

/// Metrics of one dispatcher; cheap to clone.
#[derive(Debug, Clone)]
pub struct DispatchMetrics {
    connected: Gauge,
    pending: Gauge,
    leased: Gauge,
    returned: Counter,
    dropped: Counter,
    families: Families,
}

impl Families {
    /// Registers all families in `registry`, at zero.
    #[must_use]
    pub fn register(registry: &mut Registry) -> Self {
        let families = Self {
            connected: Family::default(),
            pending: Family::default(),
            leased: Family::default(),
            returned: Family::default(),
            dropped: Family::default(),
            quarantined: Counter::default(),
            audited: Counter::default(),
            waived: Counter::default(),
            disagreements: Counter::default(),
            poisoned: Counter::default(),
            done: Family::default(),
            // The buckets range from a millisecond to almost five hours, because a training is one lease.
            turnaround: Family::new_with_constructor(|| Histogram::new(exponential_buckets(0.001, 4.0, 13))),
        };
        let Self {
            connected,
            pending,
            leased,
            returned,
            dropped,
            quarantined,
            audited,
            waived,
            disagreements,
            poisoned,
            done,
            turnaround,
        } = families.clone();
        registry.register("connected", "Workers and trainers that take work", connected);
        registry.register(
            "tasks_pending",
            "Tasks that no worker or trainer has yet",
            pending,
        );
        registry.register("leases", "Leases that workers and trainers hold", leased);
        registry.register(
            "leases_returned",
            "Leases that were returned without a result, and are leased again",
            returned,
        );
        registry.register(
            "dropped",
            "Workers and trainers that fell silent or misbehaved",
            dropped,
        );
        registry.register(
            "quarantines",
            "Workers that are not trusted any more",
            quarantined,
        );
        registry.register(
            "audits",
            "Evaluations repeated on another worker, to compare",
            audited,
        );
        registry.register(
            "audits_waived",
            "Audits that ended without a result of another worker",
            waived,
        );
        registry.register(
            "disagreements",
            "Evaluations on which two workers differed",
            disagreements,
        );
        registry.register(
            "tasks_poisoned",
            "Tasks that were given up because they end their workers",
            poisoned,
        );
        registry.register("tasks_done", "Results that came, repetitions included", done);
        registry.register_with_unit(
            "lease_turnaround",
            "Time from giving a lease to its answer",
            Unit::Seconds,
            turnaround,
        );
        families
    }

    /// Metrics of the dispatcher of workers or of trainers.
    #[must_use]
    pub fn of(&self, peer: PeerKind) -> DispatchMetrics {
        let labels = [("peer", peer.name())];
        // Counters start at zero instead of being absent, so that rates are right from the first scrape on.
        for kind in WorkKind::ALL.into_iter().filter(|kind| kind.peer() == peer) {
            drop(self.done.get_or_create(&kind.labels()));
            drop(self.turnaround.get_or_create(&kind.labels()));
        }
        DispatchMetrics {
            connected: self.connected.get_or_create_owned(&labels),
            pending: self.pending.get_or_create_owned(&labels),
            leased: self.leased.get_or_create_owned(&labels),
            returned: self.returned.get_or_create_owned(&labels),
            dropped: self.dropped.get_or_create_owned(&labels),
            families: self.clone(),
        }
    }
}

impl DispatchMetrics {
    /// Sets the gauges of connected peers, waiting tasks and held leases.
    pub(crate) fn stand(&self, connected: usize, pending: usize, leased: usize) {
        self.connected.set(connected as i64);
        self.pending.set(pending as i64);
        self.leased.set(leased as i64);
    }

    /// A lease was answered with `results` results; `after` is the time since the lease was granted.
    pub(crate) fn answered(&self, kind: WorkKind, results: usize, after: Duration) {
        let labels = kind.labels();
        self.families.done.get_or_create(&labels).inc_by(results as u64);
        let turnaround = self.families.turnaround.get_or_create(&labels);
        turnaround.observe(after.as_secs_f64());
    }

    /// A number of leases were returned undone.
    pub(crate) fn returned(&self, leases: usize) {
        self.returned.inc_by(leases as u64);
    }

    /// A worker or trainer was dropped, because it fell silent or sent an invalid message.
    pub(crate) fn dropped(&self) {
        self.dropped.inc();
    }

    /// An evaluation was repeated on another worker.
    pub(crate) fn audited(&self) {
        self.families.audited.inc();
    }

    /// Audits ended without a result of another worker.
    pub(crate) fn waived(&self, tasks: usize) {
        self.families.waived.inc_by(tasks as u64);
    }

    /// A job ended because machines disagree about a task.
    pub(crate) fn disagreed(&self) {
        self.families.disagreements.inc();
    }

    /// A machine was quarantined.
    pub(crate) fn quarantined(&self) {
        self.families.quarantined.inc();
    }

    /// Tasks were given up because their workers were lost.
    pub(crate) fn poisoned(&self, tasks: usize) {
        self.families.poisoned.inc_by(tasks as u64);
    }
}

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

/// With whom a dispatcher deals.
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

/// Metric families of all dispatchers of a coordinator, told apart by labels; cheap to clone.
#[derive(Debug, Clone)]
pub struct Families {
    connected: Family<MetricLabels, Gauge>,
    pending: Family<MetricLabels, Gauge>,
    leased: Family<MetricLabels, Gauge>,
    returned: Family<MetricLabels, Counter>,
    dropped: Family<MetricLabels, Counter>,
    quarantined: Counter,
    audited: Counter,
    disagreements: Counter,
    poisoned: Counter,
    done: Family<MetricLabels, Counter>,
    turnaround: Family<MetricLabels, Histogram>,
}

/// Where one dispatcher counts; cheap to clone.
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
    /// All at nought, and told to `registry`.
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
            disagreements: Counter::default(),
            poisoned: Counter::default(),
            done: Family::default(),
            // From a millisecond to nine hours: a training is one lease.
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
            disagreements,
            poisoned,
            done,
            turnaround,
        } = families.clone();
        registry.register("connected", "Workers and trainers that take work", connected);
        registry.register("tasks_pending", "Tasks that nobody has yet", pending);
        registry.register("leases", "Leases that are with somebody", leased);
        registry.register(
            "leases_returned",
            "Leases that came back undone, to be given again",
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

    /// Where the dispatcher of workers or trainers counts.
    #[must_use]
    pub fn of(&self, peer: PeerKind) -> DispatchMetrics {
        let labels = [("peer", peer.name())];
        // Events that have not happened yet count zero instead of being absent, so that rates are right from the first scrape on.
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
    /// How things stand: who is there, how many tasks nobody has, how many leases somebody has.
    pub(crate) fn stand(&self, connected: usize, pending: usize, leased: usize) {
        self.connected.set(connected as i64);
        self.pending.set(pending as i64);
        self.leased.set(leased as i64);
    }

    /// A lease was answered with so many results, as long after it was given as that.
    pub(crate) fn answered(&self, kind: WorkKind, results: usize, after: Duration) {
        let labels = kind.labels();
        self.families.done.get_or_create(&labels).inc_by(results as u64);
        let turnaround = self.families.turnaround.get_or_create(&labels);
        turnaround.observe(after.as_secs_f64());
    }

    /// So many leases came back undone.
    pub(crate) fn returned(&self, leases: usize) {
        self.returned.inc_by(leases as u64);
    }

    /// A worker or trainer was sent away: it fell silent, or said what cannot be.
    pub(crate) fn dropped(&self) {
        self.dropped.inc();
    }

    /// An evaluation is repeated on another worker.
    pub(crate) fn audited(&self) {
        self.families.audited.inc();
    }

    /// Two workers differ about one evaluation.
    pub(crate) fn disagreed(&self) {
        self.families.disagreements.inc();
    }

    /// A worker is not trusted any more.
    pub(crate) fn quarantined(&self) {
        self.families.quarantined.inc();
    }

    /// So many tasks were given up, because whoever has them dies of them.
    pub(crate) fn poisoned(&self, tasks: usize) {
        self.families.poisoned.inc_by(tasks as u64);
    }
}

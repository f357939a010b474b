//! The queries of a coordinator: rankings made once, and who holds what.

use super::{
    AnnotatorSession, Query, Reason,
    clusters::{self, Clustered, Clusters},
    leases::QueryLeases,
    ranking,
};
use crate::{
    blocking,
    space::{SpaceError, Spaces},
};
use murmuration_model::{
    ArchiveVersion, CampaignId, CampaignRecord,
    labels::{Annotator, Labels},
};
use murmuration_proto::{Purpose, RandomStream, Strategy};
use murmuration_search::interrupt::Interrupt;
use murmuration_store::{Store, StoreError, kept::Kept};
use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Instant,
};

/// Most bytes of orders that are kept.
const MOST_BYTES: usize = 64 << 20;

/// A request for questions.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct QueryRequest {
    pub holder: AnnotatorSession,
    pub strategy: Strategy,
    /// Whether it is about behaviours to which others gave a class, to see whether annotators agree. Otherwise about
    /// those that nobody was asked about.
    pub agreement: bool,
    /// Queries that they want to hold at once.
    pub count: usize,
    /// Individuals that they would be asked about before all else, the first of them first.
    pub again: Vec<usize>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Asked {
    /// The queries that they hold now, oldest first.
    pub queries: Vec<Query>,
    /// Individuals about which somebody has answered.
    pub answered: u64,
    /// Individuals about which this annotator has answered.
    pub own: u64,
    /// Individuals about which the synthetic annotator alone has answered.
    pub synthetic: u64,
    pub individuals: u64,
}

/// Why nobody can be asked.
#[derive(Debug, thiserror::Error)]
pub enum QueryError {
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    Space(#[from] SpaceError),
    /// A bug: an order of questions could not be made.
    #[error("no questions could be chosen because of a bug, which the log describes; no label is lost")]
    Broken,
}

/// Which queries are with whom, campaign by campaign; cheap to clone.
#[derive(Debug, Clone)]
pub struct Queries {
    store: Store,
    rankings: Arc<Kept<Rankings>>,
    leases: Arc<Mutex<LeasesById>>,
    clusters: Clusters,
    interrupt: Interrupt,
}

/// Queries that are with somebody. They cannot be made again: those of a campaign go when all of them are over.
type LeasesById = BTreeMap<CampaignId, Arc<Mutex<QueryLeases<Kind>>>>;

/// The strategy of questions, and whether they measure agreement.
type Kind = (Strategy, bool);

/// The orders of one campaign.
#[derive(Debug, Default)]
struct Rankings(Mutex<BTreeMap<Strategy, Arc<Ranking>>>);

/// The order of a strategy.
#[derive(Debug, Default)]
struct Ranking {
    newest: Mutex<Option<Arc<Ranked>>>,
    /// Held by who makes a newer one.
    making: Arc<tokio::sync::Mutex<()>>,
}

/// An order, and what it was made of.
#[derive(Debug)]
struct Ranked {
    order: Vec<Query>,
    archive_version: ArchiveVersion,
}

impl Queries {
    /// Nobody has been asked anything yet. Archives are clustered until `interrupt` is raised.
    pub fn new(store: Store, spaces: Spaces, interrupt: Interrupt) -> Self {
        Self {
            store,
            rankings: Arc::new(Kept::within(MOST_BYTES)),
            leases: Arc::default(),
            clusters: Clusters::new(spaces),
            interrupt,
        }
    }

    /// The next questions; `campaign` may be `latest`. The first caller by a strategy waits until its ranking is made. When the
    /// archive has grown, or lies in another space, it is made anew meanwhile, and the former serves until then.
    pub async fn next(
        &self,
        campaign: &str,
        request: QueryRequest,
        now: Instant,
    ) -> Result<Asked, QueryError> {
        let (store, campaign) = (self.store.clone(), campaign.to_owned());
        let record = blocking(move || store.campaign(&campaign)).await??;
        let ranked = self.ranked(&record, request.strategy).await?;
        let (store, leases) = (self.store.clone(), self.leases_of(&record.id, now));
        blocking(move || Ok(lease(&leases, &store, &record, &ranked, &request, now)?)).await?
    }

    /// The leases of a campaign; those of others that are over are forgotten.
    fn leases_of(&self, campaign: &CampaignId, now: Instant) -> Arc<Mutex<QueryLeases<Kind>>> {
        let mut by_campaign = lock(&self.leases);
        // Leases that are being given just now are held elsewhere too.
        by_campaign.retain(|_, leases| Arc::strong_count(leases) > 1 || !lock(leases).are_over(now));
        Arc::clone(by_campaign.entry(campaign.clone()).or_default())
    }

    /// The first `count` individuals in the order of a strategy that nobody has answered about, fewer where there are not
    /// so many: a function of archive and log alone, whoever is being asked meanwhile. Clustering ends early once
    /// `interrupt` is raised.
    pub(crate) async fn unanswered(
        &self,
        record: &CampaignRecord,
        strategy: Strategy,
        count: usize,
        interrupt: &Interrupt,
    ) -> Result<Vec<usize>, QueryError> {
        let (store, id) = (self.store.clone(), record.id.clone());
        let labels = blocking(move || store.labels(&id)).await??;
        let (clusters, interrupt) = (self.clusters.clone(), interrupt.clone());
        let now = move |record: &CampaignRecord| clusters.now(record, &interrupt);
        let order = self.rank(record.clone(), strategy, now).await?.order;
        let indices = order.into_iter().map(|query| query.index);
        let open = indices.filter(|&index| labels.answered(index as u64).next().is_none());
        Ok(open.take(count).collect())
    }

    /// The first `count` individuals that are farthest from the medoids and from each other, in the order in which the strategy
    /// [`Strategy::Coverage`] asks about them.
    pub async fn beyond_medoids(
        &self,
        record: &CampaignRecord,
        count: usize,
    ) -> Result<Vec<usize>, QueryError> {
        let ranked = self.ranked(record, Strategy::Coverage).await?;
        Ok(ranking::uncovered(&ranked.order).take(count).collect())
    }

    /// The clusters of an archive: those of its taxonomy, or what they would be if the search ended now. While it runs they
    /// may be of the archive as it was when it was a fifth smaller. Blocks while the archive is clustered.
    pub fn clusters(&self, record: &CampaignRecord) -> Result<Arc<Clustered>, SpaceError> {
        self.clusters.lately(record, &self.interrupt)
    }

    /// The flag that ends every clustering of this coordinator.
    pub const fn interrupt(&self) -> &Interrupt {
        &self.interrupt
    }

    /// The order of a strategy, perhaps that of a while ago.
    async fn ranked(&self, record: &CampaignRecord, strategy: Strategy) -> Result<Arc<Ranked>, QueryError> {
        // Not forgotten while it is in use here.
        let rankings = self.rankings.of(&record.id);
        let ranking = Arc::clone(lock(&rankings.0).entry(strategy).or_default());
        let newest = ranking.newest();
        if let Some(ranked) = newest.as_ref().filter(|ranked| ranked.still_fits(record)) {
            return Ok(Arc::clone(ranked));
        }
        // A random order takes no time, and an empty archive has no questions.
        let serves = |former: &Arc<Ranked>| strategy != Strategy::Random && !former.order.is_empty();
        let Some(former) = newest.filter(serves) else {
            let _making = ranking.making.lock().await;
            if let Some(ranked) = ranking.newest().filter(|ranked| ranked.still_fits(record)) {
                return Ok(ranked);
            }
            return self.renew(&rankings, record.clone(), strategy).await;
        };
        if let Ok(making) = Arc::clone(&ranking.making).try_lock_owned() {
            let (queries, record) = (self.clone(), record.clone());
            tokio::spawn(async move {
                if let Err(error) = queries.renew(&rankings, record, strategy).await {
                    tracing::warn!(%error, %strategy, "questions go on in the former order");
                }
                drop(making);
            });
        }
        Ok(former)
    }

    async fn renew(
        &self,
        rankings: &Rankings,
        record: CampaignRecord,
        strategy: Strategy,
    ) -> Result<Arc<Ranked>, QueryError> {
        let (clusters, interrupt) = (self.clusters.clone(), self.interrupt.clone());
        let id = record.id.clone();
        let lately = move |record: &CampaignRecord| clusters.lately(record, &interrupt);
        let ranked = Arc::new(self.rank(record, strategy, lately).await?);
        let mut by_strategy = lock(&rankings.0);
        *lock(&by_strategy.entry(strategy).or_default().newest) = Some(Arc::clone(&ranked));
        let orders = by_strategy.values().filter_map(|ranking| ranking.newest());
        let bytes = orders.map(|ranked| size_of_val(ranked.order.as_slice())).sum();
        self.rankings.weigh(&id, bytes);
        Ok(ranked)
    }

    /// `clustered` gives the clusters that all but the random strategy begin with.
    async fn rank(
        &self,
        record: CampaignRecord,
        strategy: Strategy,
        clustered: impl FnOnce(&CampaignRecord) -> Result<Arc<Clustered>, SpaceError> + Send + 'static,
    ) -> Result<Ranked, QueryError> {
        let interrupt = self.interrupt.clone();
        blocking(move || {
            let (order, archive_version) = match strategy {
                Strategy::Medoids => {
                    let clustered = clustered(&record)?;
                    let order = ranking::by_uncertainty(&clustered.space.behaviours, &clustered.clustering);
                    (order, clustered.space.archive_version)
                }
                Strategy::Coverage => {
                    let clustered = clustered(&record)?;
                    let order = ranking::by_coverage(
                        &clustered.space.behaviours,
                        &clustered.clustering,
                        &record.spec,
                        &interrupt,
                    );
                    (order.map_err(SpaceError::from)?, clustered.space.archive_version)
                }
                Strategy::Random => {
                    let count = record.individuals() as usize;
                    let mut stream = RandomStream::derive(record.spec.seed(), Purpose::Query, 0);
                    (
                        ranking::in_random_order(count, &mut stream),
                        record.archive_version(),
                    )
                }
            };
            Ok(Ranked {
                order,
                archive_version,
            })
        })
        .await?
    }
}

/// Gives the holder the questions that are theirs, and then the next of the order.
fn lease(
    leases: &Mutex<QueryLeases<Kind>>,
    store: &Store,
    record: &CampaignRecord,
    ranked: &Ranked,
    request: &QueryRequest,
    now: Instant,
) -> Result<Asked, StoreError> {
    // Labels are read and queries leased under this lock, so that no two are given the same.
    let mut leases = lock(leases);
    let labels = store.labels(&record.id)?;
    let kind = (request.strategy, request.agreement);
    let individuals = record.individuals();
    // An order of a while ago may be of more than there is now.
    let is_open = |index: usize| (index as u64) < individuals && is_open(&labels, index as u64, request);
    for &index in request.again.iter().rev().filter(|&&index| is_open(index)) {
        let query = Query {
            index,
            reason: Reason::Again,
        };
        leases.give_first(&request.holder, kind, query, now);
    }
    let queries = leases.top_up(&request.holder, kind, request.count, &ranked.order, is_open, now);
    Ok(Asked {
        queries,
        answered: labels.individuals() as u64,
        own: labels.answered_by(&request.holder.annotator) as u64,
        synthetic: labels.answered_by_machine() as u64,
        individuals,
    })
}

impl Ranking {
    fn newest(&self) -> Option<Arc<Ranked>> {
        lock(&self.newest).clone()
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs `work`, which computes or waits for the disk, where it does not hold up the network.
async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, QueryError> {
    blocking::blocking(work).await.map_err(|_| QueryError::Broken)
}

impl Ranked {
    /// Whether it can still be asked from.
    fn still_fits(&self, record: &CampaignRecord) -> bool {
        clusters::serves(self.order.len() as u64, self.archive_version, record)
    }
}

/// Whether `request` may be about an individual: nobody is asked what was asked before, but for agreement, and then not what
/// they answered themselves.
fn is_open(labels: &Labels, index: u64, request: &QueryRequest) -> bool {
    let mut answered = labels.answered(index);
    if !request.agreement {
        return answered.next().is_none();
    }
    let own = |who: &Annotator| *who == request.holder.annotator;
    let answered: Vec<_> = answered.collect();
    answered.iter().any(|(_, names_class)| *names_class) && !answered.iter().any(|(who, _)| own(who))
}

#[cfg(test)]
mod tests;

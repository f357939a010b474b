//! The queries of a coordinator: cached rankings, and the holders of queries.

use super::{
    AnnotatorSession, Query, Reason,
    clusters::{self, Clustered, Clusters},
    leases::QueryLeases,
    ranking, unlike,
};
use crate::{
    blocking::{blocking, parallel, shared},
    space::{SpaceError, Spaces},
};
use murmuration_model::{
    ArchiveVersion, CampaignId, CampaignRecord,
    labels::{Annotator, Labels},
};
use murmuration_search::interrupt::Interrupt;
use murmuration_store::{Store, StoreError, kept::Kept};
use murmuration_swarm::{Purpose, RandomStream, Strategy};
use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Instant,
};

/// Maximum size in bytes of the rankings that are kept.
const MOST_BYTES: usize = 64 << 20;

/// A request for questions.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct QueryRequest {
    pub holder: AnnotatorSession,
    pub strategy: Strategy,
    /// Whether to ask about behaviours to which other annotators gave a class, to measure agreement. If false, the questions are
    /// about behaviours without any answer.
    pub agreement: bool,
    /// Number of queries to hold at once.
    pub count: usize,
    /// Individuals to ask about before all others, in this order.
    pub again: Vec<usize>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Asked {
    /// The queries that the holder has now, oldest first.
    pub queries: Vec<Query>,
    /// Number of individuals with an answer.
    pub answered: u64,
    /// Number of individuals with an answer by this annotator.
    pub own: u64,
    /// Number of individuals with an answer by the synthetic annotator alone.
    pub synthetic: u64,
    /// Number of individuals that questions can be about.
    pub individuals: u64,
}

/// Why there are no questions.
#[derive(Debug, thiserror::Error)]
pub enum QueryError {
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    Space(#[from] SpaceError),
    /// A bug prevented a ranking.
    #[error("no questions could be chosen because of a bug, which the log describes; no label is lost")]
    Broken,
}

/// For each campaign, its ranked queries and the annotators that hold them; cheap to clone.
#[derive(Debug, Clone)]
pub struct Queries {
    store: Store,
    rankings: Arc<Kept<Rankings>>,
    leases: Arc<Mutex<LeasesById>>,
    clusters: Clusters,
    interrupt: Interrupt,
}

/// Leased queries by campaign. They cannot be recomputed, so a campaign's leases are only forgotten when all leases are over.
type LeasesById = BTreeMap<CampaignId, Arc<Mutex<QueryLeases<Kind>>>>;

/// The strategy of questions, and whether they measure agreement.
type Kind = (Strategy, bool);

/// The rankings of one campaign.
#[derive(Debug, Default)]
struct Rankings(Mutex<BTreeMap<Strategy, Arc<Ranking>>>);

/// The ranking of a strategy.
#[derive(Debug, Default)]
struct Ranking {
    newest: Mutex<Option<Arc<Ranked>>>,
    /// Held while a newer ranking is made.
    making: Arc<tokio::sync::Mutex<()>>,
}

/// A ranking, and the version of its archive.
#[derive(Debug)]
struct Ranked {
    order: Vec<Query>,
    archive_version: ArchiveVersion,
}

impl Queries {
    /// Starts without questions. Raising `interrupt` ends the clustering of archives.
    pub fn new(store: Store, spaces: Spaces, interrupt: Interrupt) -> Self {
        Self {
            store,
            rankings: Arc::new(Kept::within(MOST_BYTES)),
            leases: Arc::default(),
            clusters: Clusters::new(spaces),
            interrupt,
        }
    }

    /// The next questions; `campaign` may be `latest`. The first request for a strategy waits until its ranking is made. If the
    /// archive has since grown or moved to another space, a new ranking is made in the background. The former ranking is used
    /// meanwhile.
    pub async fn next(
        &self,
        campaign: &str,
        request: QueryRequest,
        now: Instant,
    ) -> Result<Asked, QueryError> {
        let campaign = campaign.to_owned();
        let record = self.store.run(move |store| store.campaign(&campaign)).await?;
        let ranked = self.ranked(&record, request.strategy).await?;
        let leases = self.leases_of(&record.id, now);
        let lease = move |store: &Store| lease(&leases, store, &record, &ranked, &request, now);
        Ok(self.store.run(lease).await?)
    }

    /// The leases of a campaign. Expired leases of other campaigns are forgotten.
    fn leases_of(&self, campaign: &CampaignId, now: Instant) -> Arc<Mutex<QueryLeases<Kind>>> {
        let mut by_campaign = lock(&self.leases);
        // Leases in use elsewhere have another reference.
        by_campaign.retain(|_, leases| Arc::strong_count(leases) > 1 || !lock(leases).are_over(now));
        Arc::clone(by_campaign.entry(campaign.clone()).or_default())
    }

    /// The first `count` individuals in the order of a strategy that have no answer, or as many as there are. The result depends
    /// only on the archive and the log, not on current leases. Raising `interrupt` ends clustering early.
    pub(crate) async fn unanswered(
        &self,
        record: &CampaignRecord,
        strategy: Strategy,
        count: usize,
        interrupt: &Interrupt,
    ) -> Result<Vec<usize>, QueryError> {
        let id = record.id.clone();
        let labels = self.store.run(move |store| store.labels(&id)).await?;
        let (clusters, interrupt) = (self.clusters.clone(), interrupt.clone());
        let now = move |record: &CampaignRecord| clusters.now(record, &interrupt);
        let order = self.rank(record.clone(), strategy, now).await?.order;
        let indices = order.into_iter().map(|query| query.index);
        let open = indices.filter(|&index| labels.answered(index as u64).next().is_none());
        Ok(open.take(count).collect())
    }

    /// The first `count` individuals that are farthest from the medoids and from each other, in the order of the strategy
    /// [`Strategy::Coverage`].
    pub async fn beyond_medoids(
        &self,
        record: &CampaignRecord,
        count: usize,
    ) -> Result<Vec<usize>, QueryError> {
        let ranked = self.ranked(record, Strategy::Coverage).await?;
        Ok(ranking::uncovered(&ranked.order).take(count).collect())
    }

    /// The clusters of an archive: the clusters of its taxonomy, or of the taxonomy that it would have if the search ended now.
    /// During a search, the clusters may belong to an archive up to a fifth smaller. Blocks while the archive is clustered.
    pub fn clusters(&self, record: &CampaignRecord) -> Result<Arc<Clustered>, SpaceError> {
        self.clusters.lately(record, &self.interrupt)
    }

    /// At most `count` individuals that are least like individual `index` and unlike each other: from the quarter of the archive
    /// that is farthest from it, those farthest from each other. Empty if the archive's sample does not have the individual, or has
    /// no other. Blocks while the archive is read.
    pub fn unlike(
        &self,
        record: &CampaignRecord,
        index: usize,
        count: usize,
        interrupt: &Interrupt,
    ) -> Result<Vec<usize>, SpaceError> {
        let space = self.clusters.spaces.of(record)?;
        if index >= space.behaviours.len() {
            return Ok(Vec::new());
        }
        let chosen = unlike::unlike(&space.behaviours, index, count, &record.spec, interrupt)?;
        Ok(chosen)
    }

    /// The flag that ends all clustering of this coordinator.
    pub const fn interrupt(&self) -> &Interrupt {
        &self.interrupt
    }

    /// The ranking of a strategy, possibly an older one.
    async fn ranked(&self, record: &CampaignRecord, strategy: Strategy) -> Result<Arc<Ranked>, QueryError> {
        // Rankings in use are not forgotten.
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
            return shared(self.renew(&rankings, record.clone(), strategy)).await;
        };
        if let Ok(making) = Arc::clone(&ranking.making).try_lock_owned() {
            let (queries, record) = (self.clone(), record.clone());
            tokio::spawn(async move {
                if let Err(error) = queries.renew(&rankings, record, strategy).await {
                    tracing::warn!(%error, %strategy, "the order of the questions could not be updated");
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

    /// Ranks the behaviours of an archive. Every strategy except the random strategy calls `clustered` for the archive's
    /// clusters.
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
                    let (behaviours, clustering) = (&clustered.space.behaviours, &clustered.clustering);
                    let order = parallel(|| ranking::by_uncertainty(behaviours, clustering));
                    (order, clustered.space.archive_version)
                }
                Strategy::Coverage => {
                    let clustered = clustered(&record)?;
                    let (behaviours, clustering) = (&clustered.space.behaviours, &clustered.clustering);
                    let order =
                        parallel(|| ranking::by_coverage(behaviours, clustering, &record.spec, &interrupt));
                    (order.map_err(SpaceError::from)?, clustered.space.archive_version)
                }
                Strategy::Random => {
                    let count = record.sampled() as usize;
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
        .await
        .map_err(|_| QueryError::Broken)?
    }
}

/// Leases to the holder the questions that they already have, and then the next questions of the ranking.
fn lease(
    leases: &Mutex<QueryLeases<Kind>>,
    store: &Store,
    record: &CampaignRecord,
    ranked: &Ranked,
    request: &QueryRequest,
    now: Instant,
) -> Result<Asked, StoreError> {
    // Labels are read and queries leased under this lock, so that no query is leased twice.
    let mut leases = lock(leases);
    let labels = store.labels(&record.id)?;
    let kind = (request.strategy, request.agreement);
    let individuals = record.sampled();
    // An older ranking may contain individuals that no longer exist.
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

impl Ranked {
    /// Whether the ranking is still good enough.
    fn still_fits(&self, record: &CampaignRecord) -> bool {
        clusters::serves(self.order.len() as u64, self.archive_version, record)
    }
}

/// Whether `request` can ask about an individual. For agreement, other annotators must have given the individual a class, and the
/// annotator no answer. If not for agreement, the individual must have no answer.
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

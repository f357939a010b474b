//! The queries of a coordinator: rankings made once, and who holds what.

use super::{
    Holder, Query, QueryLeases, Reason,
    clusters::{self, Clustered, Clusters},
    committee::{Committee, NoCommittee},
    ranking,
};
use crate::{
    campaign::CampaignId,
    labels::{Annotator, Labels},
    space::{Space, SpaceError},
    store::{CampaignRecord, Edition, Store, StoreError},
};
use murmuration_proto::{Purpose, Strategy, Stream};
use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, PoisonError},
    time::Instant,
};

/// What somebody would like to be asked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Wish {
    /// Who.
    pub holder: Holder,
    /// How it is chosen.
    pub strategy: Strategy,
    /// Whether it is about behaviours to which others gave a class, to see whether annotators agree. Otherwise about
    /// those that nobody was asked about.
    pub agreement: bool,
    /// Queries that they want to hold at once.
    pub count: usize,
    /// Individuals that they would be asked about before all else, the first of them first.
    pub again: Vec<usize>,
}

/// What somebody is asked.
#[derive(Debug, Clone, PartialEq)]
pub struct Asked {
    /// The queries that they hold now, oldest first.
    pub queries: Vec<Query>,
    /// Individuals about which somebody has answered.
    pub answered: u64,
    /// Individuals in the archive.
    pub individuals: u64,
}

/// Why nobody can be asked.
#[derive(Debug, thiserror::Error)]
pub enum QueryError {
    /// The store could not be read, or has no such campaign.
    #[error("{0}")]
    Store(#[from] StoreError),
    /// The archive cannot be read as behaviours.
    #[error("{0}")]
    Space(#[from] SpaceError),
    /// The campaign has no embeddings that could differ.
    #[error("strategy \"committee\": {0}")]
    Committee(#[from] NoCommittee),
}

/// Which queries are with whom, campaign by campaign; cheap to clone.
#[derive(Debug, Clone)]
pub struct Queries {
    store: Store,
    /// One lock a campaign: its labels are read and its queries leased under it, so that no two are given the same.
    campaigns: Arc<Mutex<BTreeMap<CampaignId, Arc<Mutex<Open>>>>>,
    clusters: Clusters,
}

/// Of a strategy, whether for agreement.
type Kind = (Strategy, bool);

#[derive(Debug, Default)]
struct Open {
    rankings: BTreeMap<Strategy, Ranked>,
    leases: QueryLeases<Kind>,
}

/// A ranking, and what it was made of.
#[derive(Debug)]
struct Ranked {
    order: Vec<Query>,
    edition: Edition,
}

impl Queries {
    /// Nobody has been asked anything yet.
    #[must_use]
    pub fn new(store: Store) -> Self {
        Self {
            store,
            campaigns: Arc::default(),
            clusters: Clusters::default(),
        }
    }

    /// What to ask now; `campaign` may be `latest`. Blocks while the archive is clustered, once for a strategy and
    /// checkpoint, and again when the archive has grown.
    ///
    /// # Errors
    /// See [`QueryError`].
    pub fn next(&self, campaign: &str, wish: &Wish, now: Instant) -> Result<Asked, QueryError> {
        let record = self.store.campaign(campaign)?;
        let open = {
            let mut campaigns = self.campaigns.lock().unwrap_or_else(PoisonError::into_inner);
            Arc::clone(campaigns.entry(record.id.clone()).or_default())
        };
        let mut open = open.lock().unwrap_or_else(PoisonError::into_inner);
        let Open { rankings, leases } = &mut *open;
        let individuals = record.individuals();
        if !rankings
            .get(&wish.strategy)
            .is_some_and(|ranked| ranked.still_fits(&record))
        {
            let ranked = self.rank(&record, wish.strategy, || self.clusters(&record))?;
            rankings.insert(wish.strategy, ranked);
        }
        let ranking = rankings.get(&wish.strategy).map(|ranked| ranked.order.as_slice());
        let labels = self.store.labels(&record.id)?;
        let kind = (wish.strategy, wish.agreement);
        for &index in wish.again.iter().rev() {
            if (index as u64) < individuals && is_open(&labels, index as u64, wish) {
                let query = Query {
                    index,
                    reason: Reason::Again,
                };
                leases.give_first(&wish.holder, kind, query, now);
            }
        }
        let queries = leases.top_up(
            &wish.holder,
            kind,
            wish.count,
            ranking.unwrap_or_default(),
            |index| is_open(&labels, index as u64, wish),
            now,
        );
        Ok(Asked {
            queries,
            answered: labels.individuals() as u64,
            individuals,
        })
    }

    /// The first `count` individuals in the order of a strategy that nobody has answered about, fewer where there are not
    /// so many: a function of archive and log alone, whoever is being asked meanwhile.
    ///
    /// # Errors
    /// See [`QueryError`].
    pub fn unanswered(
        &self,
        record: &CampaignRecord,
        strategy: Strategy,
        count: usize,
    ) -> Result<Vec<usize>, QueryError> {
        let labels = self.store.labels(&record.id)?;
        let now = || Ok(Arc::new(Clustered::read(&self.store, record)?));
        let order = self.rank(record, strategy, now)?.order;
        let indices = order.into_iter().map(|query| query.index);
        let open = indices.filter(|&index| labels.answered(index as u64).next().is_none());
        Ok(open.take(count).collect())
    }

    /// The clusters of an archive: those of its taxonomy, or what they would be if the search ended now. While it runs they
    /// may be of the archive as it was when it was a fifth smaller. Blocks while the archive is clustered.
    ///
    /// # Errors
    /// See [`SpaceError`].
    pub fn clusters(&self, record: &CampaignRecord) -> Result<Arc<Clustered>, SpaceError> {
        self.clusters.lately(&self.store, record)
    }

    /// `clustered` is told what by medoids is ranked by.
    fn rank(
        &self,
        record: &CampaignRecord,
        strategy: Strategy,
        clustered: impl FnOnce() -> Result<Arc<Clustered>, SpaceError>,
    ) -> Result<Ranked, QueryError> {
        let mut stream = Stream::derive(record.spec.seed(), Purpose::Query, 0);
        let (order, edition) = match strategy {
            Strategy::Random => {
                let count = record.individuals() as usize;
                (ranking::by_lot(count, &mut stream), record.edition())
            }
            Strategy::Medoids => {
                let clustered = clustered()?;
                let Space { behaviours, edition } = &clustered.space;
                (ranking::by_doubt(behaviours, &clustered.clustering), *edition)
            }
            Strategy::Committee => {
                let Space { behaviours, edition } = Space::read(&self.store, record)?;
                let members = [behaviours];
                let committee = Committee::new(&members)?;
                (ranking::by_committee(&committee, &mut stream), edition)
            }
        };
        Ok(Ranked { order, edition })
    }
}

impl Ranked {
    /// Whether it can still be asked from.
    fn still_fits(&self, record: &CampaignRecord) -> bool {
        clusters::serves(self.order.len() as u64, self.edition, record)
    }
}

/// Whether `wish` may be about an individual: nobody is asked what was asked before, but for agreement, and then not what
/// they answered themselves.
fn is_open(labels: &Labels, index: u64, wish: &Wish) -> bool {
    let mut answered = labels.answered(index);
    if !wish.agreement {
        return answered.next().is_none();
    }
    let own = |who: &Annotator| *who == wish.holder.annotator;
    let answered: Vec<_> = answered.collect();
    answered.iter().any(|(_, names_class)| *names_class) && !answered.iter().any(|(who, _)| own(who))
}

#[cfg(test)]
mod tests;

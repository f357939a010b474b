//! The holders of queries: leases of queries as a pure state machine, which does not read the clock or the archive.
//!
//! Invariants, each tested below: a behaviour has at most one holder; a holder who asks again first gets the queries that they
//! have; queries that are not answered in time go to other holders; no token holds all queries.

use super::Query;
use murmuration_model::labels::Annotator;
use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

/// How long a query stays with a holder who makes no further request.
pub(super) const QUERY_LEASE_TIME: Duration = Duration::from_secs(5 * 60);

/// Maximum number of queries that an annotator's token holds at once, in all its windows. Beyond this maximum, queries are taken
/// from the windows whose last request is oldest.
const MAX_HELD: usize = 1000;

/// The holder of a query: an annotator and one of their windows.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct AnnotatorSession {
    /// The number of the annotator's token; `None` for operators, who have no maximum.
    pub token: Option<u64>,
    pub annotator: Annotator,
    /// The name of the window, chosen by its page; may be empty.
    pub session: String,
}

/// The leased queries of one campaign. `K` is the kind of question: a holder who asks for another kind returns their queries of
/// the former kind.
#[derive(Debug)]
pub(super) struct QueryLeases<K> {
    by_index: BTreeMap<usize, QueryLease<K>>,
}

#[derive(Debug)]
struct QueryLease<K> {
    holder: AnnotatorSession,
    kind: K,
    query: Query,
    /// Position in the order of leasing: a holder sees the oldest query first.
    turn: i64,
    until: Instant,
}

impl<K: PartialEq + Copy> QueryLeases<K> {
    /// Puts `query` before all other queries of `holder`, unless another holder has `query`.
    pub(crate) fn give_first(&mut self, holder: &AnnotatorSession, kind: K, query: Query, now: Instant) {
        let other = self.by_index.get(&query.index);
        if other.is_some_and(|lease| lease.holder != *holder && lease.until > now) {
            return;
        }
        let own = self.by_index.values().filter(|lease| lease.holder == *holder);
        let turn = own.map(|lease| lease.turn).min().unwrap_or(0) - 1;
        self.by_index.insert(
            query.index,
            QueryLease {
                holder: holder.clone(),
                kind,
                query,
                turn,
                until: now + QUERY_LEASE_TIME,
            },
        );
    }

    /// Leases up to `count` queries of `kind` to `holder` at time `now`: first the open queries that the holder has, oldest
    /// first, then the first open and free queries of `ranking`. Each lease lasts another `QUERY_LEASE_TIME`. The holder's other
    /// queries are returned.
    pub(crate) fn top_up(
        &mut self,
        holder: &AnnotatorSession,
        kind: K,
        count: usize,
        ranking: &[Query],
        open: impl Fn(usize) -> bool,
        now: Instant,
    ) -> Vec<Query> {
        let mut own = self.keep(holder, kind, &open, now);
        self.make_room_for(holder, count);
        own.truncate(count);
        let kept = own.iter().map(|(_, query)| query.index).collect::<Vec<_>>();
        self.by_index
            .retain(|index, lease| lease.holder != *holder || kept.contains(index));

        let mut turn = own.last().map_or(0, |(turn, _)| turn + 1);
        for query in ranking {
            if own.len() == count {
                break;
            }
            if !self.by_index.contains_key(&query.index) && open(query.index) {
                self.by_index.insert(
                    query.index,
                    QueryLease {
                        holder: holder.clone(),
                        kind,
                        query: *query,
                        turn,
                        until: now + QUERY_LEASE_TIME,
                    },
                );
                own.push((turn, *query));
                turn += 1;
            }
        }
        own.into_iter().map(|(_, query)| query).collect()
    }

    /// Takes queries back from other windows of the holder's token, those with the oldest last request first, until the token has
    /// room for `count` more.
    fn make_room_for(&mut self, holder: &AnnotatorSession, count: usize) {
        let Some(token) = holder.token else {
            return;
        };
        // All leases of a window end at the same time.
        let mut others: BTreeMap<(Instant, &AnnotatorSession), usize> = BTreeMap::new();
        for lease in self.by_index.values() {
            if lease.holder.token == Some(token) && lease.holder != *holder {
                *others.entry((lease.until, &lease.holder)).or_default() += 1;
            }
        }
        let mut held: usize = others.values().sum();
        let mut taken = Vec::new();
        for ((_, other), queries) in others {
            if held + count <= MAX_HELD {
                break;
            }
            held -= queries;
            taken.push(other.clone());
        }
        self.by_index.retain(|_, lease| !taken.contains(&lease.holder));
    }

    /// Whether all leases are over at time `now`.
    pub(crate) fn are_over(&self, now: Instant) -> bool {
        self.by_index.values().all(|lease| lease.until <= now)
    }

    /// Forgets expired leases, and renews the leases that stay with `holder`. Returns the renewed leases, oldest first.
    fn keep(
        &mut self,
        holder: &AnnotatorSession,
        kind: K,
        open: impl Fn(usize) -> bool,
        now: Instant,
    ) -> Vec<(i64, Query)> {
        let mut own = Vec::new();
        self.by_index.retain(|index, lease| {
            if lease.holder != *holder {
                return lease.until > now;
            }
            let stays = lease.until > now && lease.kind == kind && open(*index);
            if stays {
                lease.until = now + QUERY_LEASE_TIME;
                own.push((lease.turn, lease.query));
            }
            stays
        });
        own.sort_by_key(|(turn, _)| *turn);
        own
    }
}

impl<K> Default for QueryLeases<K> {
    fn default() -> Self {
        Self {
            by_index: BTreeMap::new(),
        }
    }
}

#[cfg(test)]
mod tests;

//! With whom a query is: leases as a pure state machine, without clock or content.
//!
//! Invariants, each tested below: a behaviour is with one holder at most; whoever asks again is given what they have
//! first; what is not answered in time is given to others; no token holds all queries.

use super::Query;
use murmuration_model::labels::Annotator;
use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

/// How long a query stays with a holder who does not ask for more.
pub(super) const QUERY_LEASE_TIME: Duration = Duration::from_secs(5 * 60);

/// Most queries that an annotator's token holds at once, in all its windows. More are taken from the windows that asked longest ago.
const MAX_HELD: usize = 1000;

/// The holder of a query: an annotator, and which of their windows, should they have several.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct AnnotatorSession {
    /// The number of the annotator's token; `None` for operators, who may hold all queries.
    pub token: Option<u64>,
    pub annotator: Annotator,
    /// The window, as its page calls it; may be empty.
    pub session: String,
}

/// The queries of one campaign that are with somebody. `K` is the kind of question: whoever asks for another kind gives
/// back what they have of the former.
#[derive(Debug)]
pub(super) struct QueryLeases<K> {
    by_index: BTreeMap<usize, QueryLease<K>>,
}

#[derive(Debug)]
struct QueryLease<K> {
    holder: AnnotatorSession,
    kind: K,
    query: Query,
    /// Order of giving, so that a holder sees the oldest first.
    turn: i64,
    until: Instant,
}

impl<K: PartialEq + Copy> QueryLeases<K> {
    /// Puts `query` before all others of `holder`, unless somebody else holds it.
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

    /// Gives `holder` up to `count` queries of `kind` at time `now`: those that they have and that
    /// are still open, oldest first, then the first of `ranking` that are open and with nobody. All are theirs for
    /// another `QUERY_LEASE_TIME`; whatever else they had is given back.
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

    /// Takes queries back from the other windows of the holder's token that asked longest ago, until it holds few enough for
    /// `count` more.
    fn make_room_for(&mut self, holder: &AnnotatorSession, count: usize) {
        let Some(token) = holder.token else {
            return;
        };
        // The leases of a window end together.
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

    /// Whether nothing is with anybody any more at time `now`.
    pub(crate) fn are_over(&self, now: Instant) -> bool {
        self.by_index.values().all(|lease| lease.until <= now)
    }

    /// Forgets leases that are over, and renews those that stay with `holder`: these, oldest first.
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

//! The k nearest of many points.

use super::walk::Collect;
use std::{cmp::Ordering, collections::BinaryHeap};

/// A point at a squared distance.
#[derive(Debug, Clone, Copy)]
pub(super) struct Offer {
    pub(super) squared: f64,
    pub(super) index: u32,
}

/// Keeps the `k` smallest of the squared distances that it is offered, and their points.
pub(super) struct Nearest {
    k: usize,
    /// The farthest first.
    kept: BinaryHeap<Offer>,
    limit: f64,
}

impl Nearest {
    pub(super) const fn new(k: usize) -> Self {
        Self {
            k,
            kept: BinaryHeap::new(),
            limit: if k == 0 { 0.0 } else { f64::INFINITY },
        }
    }

    fn keep(&mut self, offer: Offer) {
        if self.kept.len() < self.k {
            self.kept.push(offer);
        } else if let Some(mut farthest) = self.kept.peek_mut() {
            *farthest = offer;
        }
        if self.kept.len() == self.k {
            self.limit = self
                .kept
                .peek()
                .map_or(f64::INFINITY, |farthest| farthest.squared);
        }
    }

    /// The kept offers, the nearest first.
    pub(super) fn into_sorted(self) -> Vec<Offer> {
        self.kept.into_sorted_vec()
    }
}

impl Collect for Nearest {
    #[inline(always)]
    fn limit(&self) -> f64 {
        self.limit
    }

    #[inline(always)]
    fn offer(&mut self, squared: f64, index: u32) {
        if squared < self.limit {
            self.keep(Offer { squared, index });
        }
    }
}

impl Ord for Offer {
    fn cmp(&self, other: &Self) -> Ordering {
        let by_distance = self.squared.total_cmp(&other.squared);
        by_distance.then(self.index.cmp(&other.index))
    }
}

impl PartialOrd for Offer {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Offer {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Offer {}

//! The k smallest of many distances.

use std::{cmp::Ordering, collections::BinaryHeap};

/// A point at a squared distance.
#[derive(Debug, Clone, Copy)]
pub(super) struct Offer {
    pub(super) squared: f64,
    pub(super) index: u32,
}

/// Keeps the `k` smallest of the offered squared distances, and their points.
pub(super) struct Nearest {
    k: usize,
    /// The kept offers, the farthest first.
    kept: BinaryHeap<Offer>,
    limit: f64,
}

impl Nearest {
    pub(super) const fn new(k: usize) -> Self {
        Self {
            k,
            kept: BinaryHeap::new(),
            limit: Self::limit_of_none(k),
        }
    }

    const fn limit_of_none(k: usize) -> f64 {
        if k == 0 { 0.0 } else { f64::INFINITY }
    }

    /// Squared distances at or above this limit are no longer among the `k` smallest.
    #[inline(always)]
    pub(super) const fn limit(&self) -> f64 {
        self.limit
    }

    /// Takes a finite squared distance into account.
    #[inline(always)]
    pub(super) fn offer(&mut self, squared: f64, index: u32) {
        if squared < self.limit {
            self.keep(Offer { squared, index });
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

    /// Removes and returns the kept offers, the nearest first.
    pub(super) fn take(&mut self) -> Vec<Offer> {
        self.limit = Self::limit_of_none(self.k);
        std::mem::take(&mut self.kept).into_sorted_vec()
    }

    /// Returns the mean of the kept distances except the `passed` smallest, summed in ascending order; 0 without further
    /// distances. Removes all offers, but keeps the allocation.
    pub(super) fn take_mean(&mut self, passed: usize) -> f64 {
        let mut kept = self.take();
        let counted = kept.get(passed..).unwrap_or_default();
        let sum = counted.iter().fold(0.0, |sum, offer| sum + offer.squared.sqrt());
        let mean = sum / counted.len().max(1) as f64;
        kept.clear();
        self.kept = kept.into();
        mean
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

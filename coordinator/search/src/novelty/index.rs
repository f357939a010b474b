//! The archive in a few trees, which grow with it.
//!
//! The logarithmic method of Bentley and Saxe: what is new becomes a tree of its own, together with the trees before it
//! that are not much larger. Each tree is thus over twice as large as the next, a query asks a logarithmic number of them,
//! and a point is put in order a logarithmic number of times over the life of the archive.

use super::{
    Behaviours,
    nearest::Nearest,
    tree::{Path, Tree},
};
use crate::interrupt::{Interrupt, Interrupted};
use rayon::prelude::*;
use std::ops::Range;

/// How many times larger than what is new a tree must be to be left alone.
const LARGER: usize = 2;

/// Where the behaviours of one archive are near each other. It is told of them whenever it is asked, and adds those that
/// it does not know yet.
#[derive(Debug, Clone, Default)]
pub struct Index {
    /// Of the archive from its begin on, the largest first.
    trees: Vec<Tree>,
}

/// A behaviour near a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Neighbour {
    pub index: usize,
    pub distance: f64,
}

impl Index {
    /// Knows nothing yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { trees: Vec::new() }
    }

    /// How many behaviours it knows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.trees.last().map_or(0, |last| last.range().end)
    }

    /// Whether it knows none.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.trees.is_empty()
    }

    /// Takes in what of `behaviours` is new; the others are those that it knows.
    pub fn extend(&mut self, behaviours: &Behaviours) {
        let end = behaviours.len();
        let mut begin = self.len();
        if begin >= end {
            return;
        }
        while let Some(last) = self
            .trees
            .pop_if(|last| last.range().len() < LARGER * (end - begin))
        {
            begin = last.range().start;
        }
        self.trees.push(Tree::build(behaviours, begin..end));
    }

    /// Novelty of the points `queries`: for each, its mean Euclidean distance to the `k` nearest other points of
    /// `behaviours` (paper, Eq. 1), in the order of the range. `behaviours` are those of before, and perhaps more behind
    /// them.
    ///
    /// A point does not count itself, but counts others that coincide with it. Where there are fewer than `k`
    /// others the mean is over those there are; it is 0 if there is none, or if `k` is 0. The part of `queries`
    /// beyond the last point is passed over.
    ///
    /// # Errors
    /// [`Interrupted`] once `interrupt` is raised.
    pub fn novelty(
        &mut self,
        behaviours: &Behaviours,
        queries: Range<usize>,
        k: usize,
        interrupt: &Interrupt,
    ) -> Result<Vec<f64>, Interrupted> {
        interrupt.check()?;
        self.extend(behaviours);
        let queries = queries.start.min(behaviours.len())..queries.end.min(behaviours.len());
        // One more than k: a query finds itself, or another in its place.
        let asked = k.saturating_add(1).min(behaviours.len());
        let novelty = |(nearest, path): &mut (Nearest, Path), query: usize| {
            interrupt.check()?;
            self.look(behaviours.values_of(query), nearest, path);
            Ok(nearest.take_mean(1))
        };
        queries
            .into_par_iter()
            .map_init(|| (Nearest::new(asked), Path::new()), novelty)
            .collect()
    }

    /// The `k` nearest to `place`, which is of as many values as they, the nearest first; which of equally near ones is
    /// the k-th is not promised.
    #[must_use]
    pub fn nearest(&self, place: &[f64], k: usize) -> Vec<Neighbour> {
        let mut nearest = Nearest::new(k);
        self.look(place, &mut nearest, &mut Path::new());
        let neighbours = nearest.take().into_iter();
        neighbours
            .map(|offer| Neighbour {
                index: offer.index as usize,
                distance: offer.squared.sqrt(),
            })
            .collect()
    }

    #[cfg(test)]
    pub(super) fn trees(&self) -> usize {
        self.trees.len()
    }

    fn look(&self, place: &[f64], nearest: &mut Nearest, path: &mut Path) {
        for tree in &self.trees {
            tree.look(place, nearest, path);
        }
    }
}

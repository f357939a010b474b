//! An index of the archive: a few trees that grow with it.
//!
//! This is the logarithmic method of Bentley and Saxe: new behaviours, together with the last trees that are not much larger,
//! become a new tree. Each tree is thus at least twice as large as the next tree. A query therefore searches a logarithmic number
//! of trees, and a point is sorted a logarithmic number of times while the archive grows.

use super::{
    Behaviours,
    nearest::Nearest,
    tree::{Path, Tree},
};
use crate::interrupt::{Interrupt, Interrupted};
use rayon::prelude::*;
use std::ops::Range;

/// A tree that is at least this many times as large as the new tree is not merged into it.
const LARGER: usize = 2;

/// Finds the nearest behaviours of one archive. Every call passes the whole archive, and the index adds the new behaviours.
#[derive(Debug, Clone, Default)]
pub struct Index {
    /// Trees over successive ranges of the archive, the largest first.
    trees: Vec<Tree>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Neighbour {
    pub index: usize,
    pub distance: f64,
}

impl Index {
    /// An empty index.
    #[must_use]
    pub const fn new() -> Self {
        Self { trees: Vec::new() }
    }

    /// Number of behaviours in the index.
    #[must_use]
    pub fn len(&self) -> usize {
        self.trees.last().map_or(0, |last| last.range().end)
    }

    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.trees.is_empty()
    }

    /// Adds the new behaviours in `behaviours`, which must begin with the behaviours that are already in the index.
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

    /// Novelty of the points `queries`, in their order: the mean Euclidean distance of each query to the `k` nearest other points
    /// of `behaviours` (paper, Eq. 1). `behaviours` must begin with the behaviours of earlier calls; new behaviours are added to
    /// the index.
    ///
    /// A point does not count itself, but counts other points that coincide with it. With fewer than `k` other points, the mean
    /// is over all other points. Without other points, or if `k` is 0, the novelty is 0. Indices beyond the last point are
    /// ignored.
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
        // The search asks for one point more than `k`, because a query finds itself, or a point that coincides with it.
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

    /// The `k` behaviours nearest to `place`, the nearest first; `place` has as many values as a behaviour. The order of equally
    /// near behaviours is unspecified, also for the last place.
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

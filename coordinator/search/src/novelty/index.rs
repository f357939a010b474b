//! An index of the archive, which grows with it.

use super::{
    Behaviours,
    nearest::Nearest,
    smallest::Smallest,
    tree::Tree,
    walk::{Path, look},
};
use crate::interrupt::{Interrupt, Interrupted};
use rayon::prelude::*;
use std::ops::Range;

/// Finds the nearest behaviours of one archive. Every call passes the whole archive, and the index adds the new behaviours.
#[derive(Debug, Clone)]
pub struct Index {
    tree: Tree,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Neighbour {
    pub index: usize,
    pub distance: f64,
}

impl Default for Index {
    fn default() -> Self {
        Self::new()
    }
}

impl Index {
    /// An empty index.
    #[must_use]
    pub const fn new() -> Self {
        Self { tree: Tree::new() }
    }

    /// Number of behaviours in the index.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.tree.len()
    }

    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.tree.len() == 0
    }

    /// Adds the new ones of `behaviours`, which must begin with the behaviours that are in the index.
    pub fn extend(&mut self, behaviours: &Behaviours) {
        self.tree.extend(behaviours);
    }

    /// Novelty of the points `queries`, in their order: the mean Euclidean distance of each to the `k` nearest other points of
    /// `behaviours` (paper, Eq. 1). `behaviours` must begin with those of earlier calls; new ones are added to the index.
    ///
    /// A point does not count itself, but counts others that coincide with it. With fewer than `k` others, the mean is over all
    /// of them; it is 0 if there are none, or if `k` is 0. Indices beyond the last point are ignored.
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
        // One more than k, because a query finds itself, or a point that coincides with it.
        let asked = k.saturating_add(1).min(behaviours.len());
        let novelty = |(nearest, path): &mut (Smallest, Path), query: usize| {
            interrupt.check()?;
            look(&self.tree, behaviours.values_of(query), nearest, path);
            Ok(nearest.take_mean(1))
        };
        queries
            .into_par_iter()
            .map_init(|| (Smallest::new(asked), Path::new()), novelty)
            .collect()
    }

    /// The `k` behaviours nearest to `place`, the nearest first. `place` has a value for each dimension of the behaviour space.
    /// Which of several equally near behaviours is the k-th is unspecified.
    #[must_use]
    pub fn nearest(&self, place: &[f64], k: usize) -> Vec<Neighbour> {
        let mut nearest = Nearest::new(k);
        look(&self.tree, place, &mut nearest, &mut Path::new());
        nearest
            .into_sorted()
            .into_iter()
            .map(|offer| Neighbour {
                index: offer.index as usize,
                distance: offer.squared.sqrt(),
            })
            .collect()
    }
}

//! The search of the tree for the points nearest to a place.
//!
//! The distance to a box uses the same operations, in the same order, as a distance between points
//! ([`super::Behaviours::squared_distance`]). Each operation is monotone, even with rounding, so no point is nearer than its box.
//! Hence the search skips no point that brute force would count, without any tolerance.

use super::{blocks::Points, tree::Tree};
use crate::lanes::{LANES, with_dimensions};
use pulp::{Arch, Simd, WithSimd};

/// A collector of the points that may be among the nearest.
pub(super) trait Collect {
    /// Squared distances at or above this limit do not count.
    fn limit(&self) -> f64;

    /// Takes a finite squared distance, of the point `index`, into account.
    fn offer(&mut self, squared: f64, index: u32);
}

/// Stack of the blocks still to visit; reused from query to query.
pub(super) type Path = Vec<Stop>;

/// A block of boxes, and the squared distance to the box around it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stop {
    squared: f64,
    level: u32,
    block: u32,
}

/// Offers all points that may be among the nearest to `origin`.
pub(super) fn look(tree: &Tree, origin: &[f64], nearest: &mut impl Collect, path: &mut Path) {
    with_dimensions!(tree.dims, walk, (tree, origin, nearest, path));
}

type Task<'a, C> = (&'a Tree, &'a [f64], &'a mut C, &'a mut Path);

fn walk<const D: usize>((tree, origin, nearest, path): Task<'_, impl Collect>) {
    Arch::new().dispatch(Walk::<_, D> {
        tree,
        origin,
        nearest,
        path,
    });
}

/// A walk through the tree, in `D` dimensions, or in any number if `D` is 0.
struct Walk<'a, C, const D: usize> {
    tree: &'a Tree,
    origin: &'a [f64],
    nearest: &'a mut C,
    path: &'a mut Path,
}

impl<C: Collect, const D: usize> WithSimd for Walk<'_, C, D> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        let Some(top) = self.tree.levels.len().checked_sub(1) else {
            return;
        };
        self.path.clear();
        self.path.push(Stop {
            squared: 0.0,
            level: top as u32,
            block: 0,
        });
        while let Some(stop) = self.path.pop() {
            if stop.squared >= self.nearest.limit() {
                continue;
            }
            let block = stop.block as usize;
            let squared = self.tree.levels[stop.level as usize].squared_distances::<D>(block, self.origin);
            if stop.level == 0 {
                self.visit_group(block, &squared);
            } else {
                self.descend(stop, &squared);
            }
        }
    }
}

impl<C: Collect, const D: usize> Walk<'_, C, D> {
    /// Puts the blocks below a block on the stack, the nearest last.
    #[inline(always)]
    fn descend(&mut self, from: Stop, squared: &[f64; LANES]) {
        let bottom = self.path.len();
        for lane in below(squared, self.nearest.limit()) {
            let stop = Stop {
                squared: squared[lane],
                level: from.level - 1,
                block: from.block * LANES as u32 + lane as u32,
            };
            self.path.push(stop);
            let mut place = self.path.len() - 1;
            while place > bottom && self.path[place - 1].squared < stop.squared {
                self.path[place] = self.path[place - 1];
                place -= 1;
            }
            self.path[place] = stop;
        }
    }

    /// Visits the new points of a group, then those of its leaves that are near enough.
    #[inline(always)]
    fn visit_group(&mut self, group: usize, squared: &[f64; LANES]) {
        let tree = self.tree;
        for block in tree.new_points(group) {
            self.offer(block);
        }
        for lane in below(squared, self.nearest.limit()) {
            if squared[lane] < self.nearest.limit() {
                self.offer(group * LANES + lane);
            }
        }
    }

    /// Offers the points of a block.
    #[inline(always)]
    fn offer(&mut self, block: usize) {
        let points: &Points = &self.tree.points;
        let squared = points.squared_distances::<D>(block, self.origin);
        for lane in below(&squared, self.nearest.limit()) {
            self.nearest.offer(squared[lane], points.indices(block)[lane]);
        }
    }
}

/// The lanes of the values below `limit`.
#[inline(always)]
fn below(values: &[f64; LANES], limit: f64) -> Set {
    // Two halves, because compilers compare four values at once.
    let (halves, _) = values.as_chunks();
    Set(half_below(&halves[0], limit) | half_below(&halves[1], limit) << (LANES / 2))
}

#[inline(always)]
fn half_below(values: &[f64; LANES / 2], limit: f64) -> u32 {
    let mut mask = 0;
    for (lane, &value) in values.iter().enumerate() {
        mask |= u32::from(value < limit) << lane;
    }
    mask
}

/// The lanes of a mask, from the first to the last.
struct Set(u32);

impl Iterator for Set {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        let lane = self.0.trailing_zeros() as usize;
        self.0 &= self.0.wrapping_sub(1);
        (lane < LANES).then_some(lane)
    }
}

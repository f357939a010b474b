//! A k-d tree over a range of an archive. Its results have the bits of brute force.
//!
//! Every node has the bounding box of its points. The distance to a box uses the same operations, in the same order, as a
//! distance between points ([`Behaviours::squared_distance`]). Each operation is monotone, even with rounding, so no point is
//! nearer than its box. The search therefore skips no point that brute force would count, and needs no tolerance. Each range is
//! halved by the number of its points, so coinciding points are no special case.
//!
//! The tree's shape follows from the number of points, so it has no pointers.

use super::{Behaviours, nearest::Nearest};
use crate::lanes::{LANES, Lanes, with_dimensions};
use pulp::{Arch, Simd, WithSimd};
use std::ops::Range;

/// Points of a leaf; the last leaf can have fewer points.
const LEAF: usize = 4 * LANES;

/// Minimum number of points in the left half for building both halves in parallel.
const PARALLEL: usize = 8192;

/// A k-d tree.
#[derive(Debug, Clone)]
pub(super) struct Tree {
    dims: usize,
    range: Range<usize>,
    /// The points of one leaf after another.
    lanes: Lanes,
    /// The index of each point.
    indices: Vec<u32>,
    /// For each node, in preorder: the least value in each dimension, then the largest.
    boxes: Vec<f64>,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Node {
    place: usize,
    first_leaf: usize,
    leaves: usize,
}

/// Stack of the nodes still to visit, with their squared distances; reused from query to query.
pub(super) type Path = Vec<(f64, Node)>;

impl Tree {
    /// The tree over the behaviours `range`, which must not be empty.
    pub(super) fn build(behaviours: &Behaviours, range: Range<usize>) -> Self {
        let dims = behaviours.dims();
        let mut indices: Vec<u32> = range.clone().map(|index| index as u32).collect();
        let leaves = indices.len().div_ceil(LEAF);
        let mut boxes = vec![0.0; (2 * leaves - 1) * 2 * dims];
        halve(behaviours, &mut indices, &mut boxes);
        let points = indices.iter().map(|&index| behaviours.values_of(index as usize));
        Self {
            dims,
            range,
            lanes: Lanes::new(dims, points),
            indices,
            boxes,
        }
    }

    pub(super) fn range(&self) -> Range<usize> {
        self.range.clone()
    }

    /// Offers all points that may be among the nearest to `origin`.
    pub(super) fn look(&self, origin: &[f64], nearest: &mut Nearest, path: &mut Path) {
        with_dimensions!(self.dims, look, (self, origin, nearest, path));
    }

    /// Squared distance from `origin` to a node's box, at most the squared distance to any point of the node.
    #[inline(always)]
    fn distance_to_box<const D: usize>(&self, place: usize, origin: &[f64]) -> f64 {
        let dims = if D == 0 { self.dims } else { D };
        let (low, high) = self.boxes[place * 2 * dims..][..2 * dims].split_at(dims);
        let origin = &origin[..dims];
        let mut sum = 0.0;
        for d in 0..dims {
            // One of the two differences is positive if `origin` lies outside the box.
            let gap = (low[d] - origin[d]).max(origin[d] - high[d]).max(0.0);
            sum += gap * gap;
        }
        sum
    }
}

/// Sorts points into leaves, and writes the boxes.
fn halve(behaviours: &Behaviours, indices: &mut [u32], boxes: &mut [f64]) {
    let dims = behaviours.dims();
    let (own, others) = boxes.split_at_mut(2 * dims);
    let (low, high) = own.split_at_mut(dims);
    low.fill(f64::INFINITY);
    high.fill(f64::NEG_INFINITY);
    for &index in &*indices {
        for (d, &value) in behaviours.values_of(index as usize).iter().enumerate() {
            low[d] = low[d].min(value);
            high[d] = high[d].max(value);
        }
    }
    let leaves = indices.len().div_ceil(LEAF);
    if leaves == 1 {
        return;
    }
    let width = |d: &usize| high[*d] - low[*d];
    if let Some(widest) = (0..dims).max_by(|a, b| width(a).total_cmp(&width(b))) {
        let value = |index: u32| behaviours.values_of(index as usize)[widest];
        indices.select_nth_unstable_by(leaves / 2 * LEAF, |&a, &b| value(a).total_cmp(&value(b)));
    }
    let (left, right) = indices.split_at_mut(leaves / 2 * LEAF);
    let (left_boxes, right_boxes) = others.split_at_mut((2 * (leaves / 2) - 1) * 2 * dims);
    if left.len() < PARALLEL {
        halve(behaviours, left, left_boxes);
        halve(behaviours, right, right_boxes);
    } else {
        rayon::join(
            || halve(behaviours, left, left_boxes),
            || halve(behaviours, right, right_boxes),
        );
    }
}

impl Node {
    /// The two halves of a node that is not a leaf.
    #[inline(always)]
    const fn halves(self) -> [Self; 2] {
        let left = Self {
            place: self.place + 1,
            first_leaf: self.first_leaf,
            leaves: self.leaves / 2,
        };
        let right = Self {
            place: self.place + 2 * left.leaves,
            first_leaf: self.first_leaf + left.leaves,
            leaves: self.leaves - left.leaves,
        };
        [left, right]
    }
}

type Task<'a> = (&'a Tree, &'a [f64], &'a mut Nearest, &'a mut Path);

fn look<const D: usize>((tree, origin, nearest, path): Task<'_>) {
    Arch::new().dispatch(Look::<D> {
        tree,
        origin,
        nearest,
        path,
    });
}

/// A walk through the tree, in `D` dimensions, or in any number if `D` is 0.
struct Look<'a, const D: usize> {
    tree: &'a Tree,
    origin: &'a [f64],
    nearest: &'a mut Nearest,
    path: &'a mut Path,
}

impl<const D: usize> WithSimd for Look<'_, D> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self {
            tree,
            origin,
            nearest,
            path,
        } = self;
        path.clear();
        path.push((
            tree.distance_to_box::<D>(0, origin),
            Node {
                place: 0,
                first_leaf: 0,
                leaves: tree.indices.len().div_ceil(LEAF),
            },
        ));
        while let Some((distance, node)) = path.pop() {
            if distance >= nearest.limit() {
                continue;
            }
            if node.leaves > 1 {
                let [left, right] = node
                    .halves()
                    .map(|half| (tree.distance_to_box::<D>(half.place, origin), half));
                // The nearer half is visited first.
                if left.0 <= right.0 {
                    path.extend([right, left]);
                } else {
                    path.extend([left, right]);
                }
                continue;
            }
            let first = node.first_leaf * (LEAF / LANES);
            for block in first..tree.lanes.blocks().min(first + LEAF / LANES) {
                let squared = tree.lanes.squared_distances::<D>(block, origin);
                let indices = &tree.indices[block * LANES..];
                for (&squared, &index) in squared.iter().zip(indices) {
                    nearest.offer(squared, index);
                }
            }
        }
    }
}

//! A tree of boxes over an archive, which grows with it. Its results have the bits of brute force.
//!
//! Eight points are a leaf, eight leaves a group, and so on up to the root: each level has one box for each block of the level
//! below. The shape of the tree follows from the number of points, so it has no pointers.
//!
//! A new point joins the group whose box it lies in or near, and widens the box. The new points of a group are a chain of blocks.
//! When the points are half as many again, the tree is built anew. Thus a point is sorted a few times over the life of the
//! archive.

use super::{
    Behaviours,
    blocks::{Boxes, Points},
    choice::choose,
    order::order,
};
use crate::lanes::LANES;

/// The tree is built anew once it would have this many times the points that it was built from: numerator and denominator.
const GROWTH: (usize, usize) = (3, 2);

/// No block.
const NONE: u32 = u32::MAX;

#[derive(Debug, Clone)]
pub(super) struct Tree {
    pub(super) dims: usize,
    len: usize,
    /// Number of points when the tree was built.
    built: usize,
    /// The leaves, then blocks of new points.
    pub(super) points: Points,
    /// The boxes of the leaves, those of the groups, and so on. The last has a single block.
    pub(super) levels: Vec<Boxes>,
    /// Number of new points of each group.
    added: Vec<u32>,
    /// The latest block of new points of each group, or [`NONE`].
    latest: Vec<u32>,
    /// For each block of new points, the group's block before, or [`NONE`].
    before: Vec<u32>,
}

impl Tree {
    /// A tree without points.
    pub(super) const fn new() -> Self {
        Self {
            dims: 0,
            len: 0,
            built: 0,
            points: Points::new(0),
            levels: Vec::new(),
            added: Vec::new(),
            latest: Vec::new(),
            before: Vec::new(),
        }
    }

    pub(super) const fn len(&self) -> usize {
        self.len
    }

    /// The blocks of new points of a group.
    #[inline(always)]
    pub(super) fn new_points(&self, group: usize) -> impl Iterator<Item = usize> {
        let leaves = self.built.div_ceil(LANES);
        let mut block = self.latest[group];
        std::iter::from_fn(move || {
            let found = (block != NONE).then_some(block as usize)?;
            block = self.before[found - leaves];
            Some(found)
        })
    }

    /// Adds the new ones of `behaviours`, which must begin with the behaviours that are in the tree.
    pub(super) fn extend(&mut self, behaviours: &Behaviours) {
        if behaviours.len() <= self.len {
            return;
        }
        if behaviours.dims() == 0 {
            // Without dimensions nothing is apart, and no block tells a missing point.
            self.len = behaviours.len();
        } else if behaviours.len() * GROWTH.1 >= self.built * GROWTH.0 {
            *self = Self::build(behaviours);
        } else {
            for index in self.len..behaviours.len() {
                self.insert(behaviours.values_of(index), index as u32);
            }
            self.len = behaviours.len();
        }
    }

    fn build(behaviours: &Behaviours) -> Self {
        let (dims, len) = (behaviours.dims(), behaviours.len());
        let leaves = len.div_ceil(LANES);
        let groups = leaves.div_ceil(LANES);
        let mut points = Points::new(dims);
        points.add_blocks(leaves);
        let mut boxes = Boxes::new(dims, leaves);
        for (place, index) in order(behaviours).into_iter().enumerate() {
            let point = behaviours.values_of(index as usize);
            let leaf = place / LANES;
            points.write(leaf, place % LANES, point, index);
            boxes.widen(leaf, point, point);
        }
        Self {
            dims,
            len,
            built: len,
            points,
            levels: levels(dims, boxes, groups),
            added: vec![0; groups],
            latest: vec![NONE; groups],
            before: Vec::new(),
        }
    }

    fn insert(&mut self, point: &[f64], index: u32) {
        let mut group = 0;
        for boxes in self.levels[1..].iter_mut().rev() {
            group = group * LANES + choose(boxes, group, point);
            boxes.widen(group, point, point);
        }
        let lane = self.added[group] as usize % LANES;
        self.added[group] += 1;
        if lane == 0 {
            self.before.push(self.latest[group]);
            self.latest[group] = self.points.add_blocks(1) as u32;
        }
        self.points.write(self.latest[group] as usize, lane, point, index);
    }
}

/// All levels of boxes above those of the leaves.
fn levels(dims: usize, leaves: Boxes, groups: usize) -> Vec<Boxes> {
    let (mut levels, mut below, mut blocks) = (Vec::new(), leaves, groups);
    while blocks > 1 {
        let mut above = Boxes::new(dims, blocks);
        for block in 0..blocks {
            let (low, high) = below.around(block);
            above.widen(block, &low, &high);
        }
        levels.push(below);
        (below, blocks) = (above, blocks.div_ceil(LANES));
    }
    levels.push(below);
    levels
}

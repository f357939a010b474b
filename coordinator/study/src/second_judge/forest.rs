//! Classifies by measures: a forest of decision trees with one vote each.
//!
//! Trees only compare a measure with a threshold. For a swarm unlike all training examples, only the side of each threshold
//! counts, however far the measure is from the threshold.

use murmuration_swarm::{Class, World};

/// A node of a tree, as written by `scripts/second-judge`. The children of a node follow the node.
#[derive(Debug, Clone, Copy)]
enum Node {
    /// A split: the number of a measure, a threshold, and the place of the child for values above the threshold. The other child
    /// is the next node.
    S(u8, f64, u16),
    /// A leaf: the number of the class in [`Class::ALL`].
    L(u8),
}

use Node::{L, S};

/// Each tree begins with its root.
static FOREST: &[&[Node]] = &include!("forest.txt");

/// The class with the most votes among those that have a meaning in `world`; of classes with equally many votes, the last in
/// [`Class::ALL`], which ends with `random`.
pub(super) fn class(measures: &[f64], world: &World) -> Class {
    let mut votes = [0_u32; Class::ALL.len()];
    for tree in FOREST {
        if let Some(vote) = vote(tree, measures).and_then(|class| votes.get_mut(class)) {
            *vote += 1;
        }
    }
    let classes = Class::ALL.into_iter().zip(votes);
    let possible = classes.filter(|(class, _)| class.without_meaning(world).is_none());
    let best = possible.max_by_key(|&(_, votes)| votes);
    best.map_or(Class::Random, |(class, _)| class)
}

/// The class that a tree votes for, by its place in [`Class::ALL`].
fn vote(tree: &[Node], measures: &[f64]) -> Option<usize> {
    let mut at = 0;
    loop {
        match *tree.get(at)? {
            L(class) => return Some(class.into()),
            S(measure, threshold, above) => {
                let is_above = *measures.get(usize::from(measure))? > threshold;
                at = if is_above { above.into() } else { at + 1 };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{super::measures::MEASURES, *};

    /// Every walk through a tree ends at a class, because children come after their node.
    #[test]
    fn every_tree_leads_on_to_leaves() {
        assert_eq!(FOREST.len(), 50);
        for tree in FOREST {
            for (place, node) in tree.iter().enumerate() {
                match *node {
                    L(class) => assert!(usize::from(class) < Class::ALL.len()),
                    S(measure, threshold, above) => {
                        assert!(usize::from(measure) < MEASURES && threshold.is_finite());
                        assert!((place + 2..tree.len()).contains(&above.into()));
                    }
                }
            }
            assert!(matches!(tree.last(), Some(L(_))));
        }
    }
}

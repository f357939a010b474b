//! What became of the clusters of a taxonomy in a later version.

use murmuration_store::StoredTaxonomy;

/// How the clusters of a taxonomy became the clusters of a later version. The archive may have grown between the two versions.
/// Clusters are identified by their places.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Change {
    /// For each earlier cluster, the number of its members in each later cluster.
    shared: Vec<Vec<u64>>,
    /// For each later cluster, the number of members that are new in the archive.
    new: Vec<u64>,
}

impl Change {
    /// The change from one version to another. Individuals that only one version has count as members of no cluster in the other
    /// version.
    pub fn between(before: &StoredTaxonomy, after: &StoredTaxonomy) -> Self {
        let mut shared = vec![vec![0; after.medoids.len()]; before.medoids.len()];
        for (&from, &to) in before.clusters.iter().zip(&after.clusters) {
            if let Some(count) = shared
                .get_mut(from as usize)
                .and_then(|row| row.get_mut(to as usize))
            {
                *count += 1;
            }
        }
        let mut new = vec![0; after.medoids.len()];
        for &to in after.clusters.iter().skip(before.clusters.len()) {
            if let Some(count) = new.get_mut(to as usize) {
                *count += 1;
            }
        }
        Self { shared, new }
    }

    /// Number of members of the earlier cluster `before` in the later cluster `after`; 0 if either cluster does not exist.
    pub fn shared(&self, before: usize, after: usize) -> u64 {
        let row = self.shared.get(before);
        row.and_then(|row| row.get(after)).copied().unwrap_or(0)
    }

    /// Number of members of an earlier cluster, without individuals that the later version lacks.
    pub fn size_before(&self, before: usize) -> u64 {
        self.shared.get(before).map_or(0, |row| row.iter().sum())
    }

    /// Number of members of a later cluster.
    pub fn size_after(&self, after: usize) -> u64 {
        self.shared.iter().filter_map(|row| row.get(after)).sum::<u64>() + self.new_in(after)
    }

    /// Number of members of a later cluster that are new in the archive.
    pub fn new_in(&self, after: usize) -> u64 {
        self.new.get(after).copied().unwrap_or(0)
    }

    /// The later cluster that holds most members of the earlier cluster `before`, the first such cluster if tied; `None` if
    /// `before` has no members.
    pub fn largest_part(&self, before: usize) -> Option<usize> {
        let row = self.shared.get(before)?.iter().enumerate();
        let largest = row.min_by_key(|(_, count)| std::cmp::Reverse(**count))?;
        (*largest.1 > 0).then_some(largest.0)
    }

    /// The later cluster that the earlier cluster `before` became: the later cluster that holds more than half of its members, if
    /// any.
    pub fn successor(&self, before: usize) -> Option<usize> {
        let part = self.largest_part(before)?;
        (2 * self.shared(before, part) > self.size_before(before)).then_some(part)
    }

    /// The earlier clusters that became the later cluster `after`, first the cluster with most members in `after`. Empty if
    /// `after` is new.
    pub fn predecessors(&self, after: usize) -> Vec<usize> {
        let all = 0..self.shared.len();
        let mut found: Vec<usize> = all
            .filter(|&before| self.successor(before) == Some(after))
            .collect();
        found.sort_by_key(|&before| std::cmp::Reverse(self.shared(before, after)));
        found
    }

    /// The earlier clusters that share members with the later cluster `after`, first the cluster that shares most members.
    pub fn sources(&self, after: usize) -> Vec<usize> {
        let all = 0..self.shared.len();
        let mut found: Vec<usize> = all.filter(|&before| self.shared(before, after) > 0).collect();
        found.sort_by_key(|&before| std::cmp::Reverse(self.shared(before, after)));
        found
    }

    /// The earlier clusters without a successor: their members are spread over several later clusters.
    pub fn gone(&self) -> impl Iterator<Item = usize> {
        (0..self.shared.len()).filter(|&before| self.successor(before).is_none())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A taxonomy with `clusters` clusters; `members` has the cluster of each individual.
    pub(crate) fn stored(clusters: usize, members: &[u32]) -> StoredTaxonomy {
        StoredTaxonomy {
            medoids: vec![0; clusters],
            clusters: members.to_vec(),
            loss: 0.0,
            measures: Vec::new(),
            robust_trials: Vec::new(),
        }
    }

    #[test]
    fn clusters_are_followed_by_the_majority_of_their_members() {
        let before = stored(3, &[0, 0, 0, 1, 1, 2, 2, 2]);
        let after = stored(3, &[1, 1, 0, 1, 1, 0, 2, 1, 2, 2]);
        let change = Change::between(&before, &after);
        let successors: Vec<_> = (0..3).map(|place| change.successor(place)).collect();
        // The last cluster has one member in each later cluster: no majority.
        assert_eq!(successors, [Some(1), Some(1), None]);
        assert_eq!(change.gone().collect::<Vec<_>>(), [2]);
        assert_eq!((change.shared(0, 1), change.size_before(0)), (2, 3));
        assert_eq!(change.predecessors(1), [0, 1]);
        assert!(change.predecessors(0).is_empty());
        assert_eq!(change.sources(0), [0, 2]);
        assert_eq!((change.size_after(2), change.new_in(2)), (3, 2));
        assert_eq!(change.largest_part(2), Some(0));
        // Half is no majority.
        let halves = Change::between(&stored(1, &[0, 0]), &stored(2, &[0, 1]));
        assert_eq!(halves.successor(0), None);
    }

    #[test]
    fn a_cluster_without_members_became_nothing() {
        let change = Change::between(&stored(1, &[]), &stored(1, &[0]));
        assert_eq!((change.successor(0), change.largest_part(0)), (None, None));
        assert_eq!((change.new_in(0), change.shared(7, 7)), (1, 0));
    }
}

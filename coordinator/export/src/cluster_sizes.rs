//! How many individuals are in each cluster of a taxonomy.

/// The sizes of the clusters, by their places.
#[derive(Debug, Default)]
pub(crate) struct ClusterSizes(Vec<u64>);

impl ClusterSizes {
    /// Counts an individual that is in a cluster. The place is one that the specification allows, as the sequence of parts has
    /// made sure.
    pub(crate) fn add(&mut self, cluster: Option<u32>) {
        let Some(place) = cluster.map(|cluster| cluster as usize) else {
            return;
        };
        if self.0.len() <= place {
            self.0.resize(place + 1, 0);
        }
        self.0[place] += 1;
    }

    pub(crate) fn as_slice(&self) -> &[u64] {
        &self.0
    }
}

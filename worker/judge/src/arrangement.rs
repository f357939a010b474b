//! The arrangement of a swarm: neighbours and clusters.

use super::{
    Scale,
    geometry::{dot, length, minus},
    window::{Point, Window, quantile, share},
};

/// An agent is crowded if its nearest neighbour is nearer than this distance, in spacings. Nearly half of randomly placed agents
/// are crowded.
const CROWDED: f64 = 0.43;
/// Two bodies are in contact if their centres are nearer than this distance, in radii. (Bodies touch at 2.)
const CONTACT: f64 = 3.0;
/// An agent belongs to a cluster if it is within this distance, in radii, of an agent of the cluster. Two bodies fit between two
/// agents at this distance.
const CLUSTER_LINK: f64 = 6.0;

/// Measures of the agents' positions.
#[derive(Debug, Clone, PartialEq)]
pub struct Arrangement {
    /// Median distance of the agents from their median position at the end, in packed radii: about 0.7 for a tight disc.
    pub spread: f64,
    /// Median distance of an agent to its third nearest neighbour at the end, in body radii: 2 in a tight disc.
    pub packing: f64,
    /// Share of agents whose nearest neighbour is closer than 0.43 spacings at the end.
    pub crowded: f64,
    /// Mean distance from the centre of an agent's path to the nearest centre of another path, in spacings: about 0.5 for random
    /// centres, 1 on a square grid.
    pub homes: f64,
    /// Share of time that agents spend with another agent's centre within three radii.
    pub contact: f64,
    /// Sizes of the clusters at the end, largest first. Two agents at most six radii apart are in the same cluster.
    pub clusters: Vec<usize>,
}

impl Arrangement {
    pub(super) fn of(window: &Window, scale: &Scale) -> Self {
        let end = window.end();
        let homes = window.homes();
        let nearest = neighbours::<1>;
        let crowded = nearest(&end)
            .into_iter()
            .map(|distance| distance < CROWDED * scale.spacing);
        let homes = nearest(&homes);
        let middle = [0, 1].map(|axis| quantile(end.iter().map(|point| point[axis]), 0.5));
        let contact = (0..window.times()).flat_map(|time| nearest(&window.at(time).collect::<Vec<_>>()));
        Self {
            spread: quantile(end.iter().map(|&point| length(minus(point, middle))), 0.5) / scale.packed,
            packing: quantile(neighbours::<3>(&end).into_iter(), 0.5) / scale.radius,
            crowded: share(crowded),
            homes: homes.iter().sum::<f64>() / homes.len() as f64 / scale.spacing,
            contact: share(contact.map(|distance| distance < CONTACT * scale.radius)),
            clusters: clusters(&end, CLUSTER_LINK * scale.radius)
                .iter()
                .map(Vec::len)
                .collect(),
        }
    }

    /// Share of agents in the two largest clusters.
    #[must_use]
    pub(crate) fn in_two_clusters(&self) -> f64 {
        let agents: usize = self.clusters.iter().sum();
        self.clusters.iter().take(2).sum::<usize>() as f64 / agents.max(1) as f64
    }
}

/// Distance from each point to its `RANK`-th nearest other point; infinite if there are fewer points.
fn neighbours<const RANK: usize>(points: &[Point]) -> Vec<f64> {
    let nearest = |(i, &point): (usize, &Point)| {
        // Squares of the smallest distances, ascending; the distances have the same order.
        let mut least = [f64::INFINITY; RANK];
        for (_, &other) in points.iter().enumerate().filter(|&(j, _)| j != i) {
            let way = minus(other, point);
            let mut square = dot(way, way);
            for place in &mut least {
                (*place, square) = (square.min(*place), square.max(*place));
            }
        }
        least[RANK - 1].sqrt()
    };
    points.iter().enumerate().map(nearest).collect()
}

/// Members of the clusters of `points`, largest cluster first. Single linkage joins points that are at most `link` apart.
pub(super) fn clusters(points: &[Point], link: f64) -> Vec<Vec<usize>> {
    linked(points.len(), |i, j| length(minus(points[i], points[j])) <= link)
}

/// The numbers under `count`, in groups that the symmetric relation `link` connects: largest group first, then by smallest
/// member.
pub(super) fn linked(count: usize, link: impl Fn(usize, usize) -> bool) -> Vec<Vec<usize>> {
    let mut free: Vec<usize> = (0..count).collect();
    let mut groups = Vec::new();
    while !free.is_empty() {
        let mut group = vec![free.remove(0)];
        let mut reached = 0;
        while let Some(&member) = group.get(reached) {
            let (near, far) = free.iter().partition(|&&other| link(member, other));
            group.extend::<Vec<usize>>(near);
            free = far;
            reached += 1;
        }
        group.sort_unstable();
        groups.push(group);
    }
    groups.sort_by_key(|group| std::cmp::Reverse(group.len()));
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clusters_are_what_short_steps_connect() {
        let points = [0.0, 9.0, 1.0, 20.0, 2.0, 10.0].map(|x| [x, 0.0]);
        assert_eq!(clusters(&points, 1.5), [vec![0, 2, 4], vec![1, 5], vec![3]]);
        assert_eq!(clusters(&[], 1.0), Vec::<Vec<usize>>::new());
    }

    #[test]
    fn a_lone_point_has_no_neighbour() {
        assert_eq!(neighbours::<1>(&[[0.0, 0.0], [3.0, 4.0]]), [5.0, 5.0]);
        assert_eq!(neighbours::<1>(&[[0.0, 0.0]]), [f64::INFINITY]);
    }
}

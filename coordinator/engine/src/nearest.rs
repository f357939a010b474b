//! Individuals of an archive that are near a given behaviour.

use crate::queries::Clustered;
use murmuration_model::labels::ClassName;
use murmuration_search::novelty::{Behaviours, Misfit};
use murmuration_swarm::counted;
use std::collections::BTreeMap;

/// A behaviour is far from a cluster if its distance from the medoid is more than `UNLIKE` times the cluster's mean distance.
pub const UNLIKE: f64 = 3.0;

#[derive(Debug, Clone, PartialEq)]
pub struct Neighbour {
    /// Place in the archive, from 0.
    pub index: u64,
    /// Distance of the individual from the behaviour, in units of the behaviour space.
    pub distance: f64,
    /// Place of the individual's cluster, from 0.
    pub cluster: u32,
    pub class: Option<ClassName>,
}

/// The individuals of an archive that are nearest to a behaviour.
#[derive(Debug, Clone, PartialEq)]
pub struct Nearest {
    /// The nearest individuals, nearest first; ties by index.
    pub neighbours: Vec<Neighbour>,
    /// The nearest individual that has a class.
    pub labelled: Option<Neighbour>,
    /// The nearest medoid; the behaviour belongs to its cluster.
    pub medoid: Neighbour,
    /// Mean distance of the nearest medoid's cluster, in units of the behaviour space.
    pub mean_distance: f64,
    /// Mean distance of all individuals from the medoids of their clusters, in units of the behaviour space.
    pub spread: f64,
    /// Whether the clusters come from the taxonomy.
    pub is_taxonomy: bool,
}

/// Why no individuals can be compared with a behaviour.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NearestError {
    #[error("the archive is empty: wait until the first generation is complete")]
    Empty,
    #[error(transparent)]
    Misfit(#[from] Misfit),
    #[error("the archive of {} has no medoids", counted(*.0 as u64, "individual"))]
    NoMedoid(usize),
}

impl Nearest {
    /// Finds the `count` individuals of an archive that are nearest to `behaviour` (all if there are fewer), with their
    /// `classes`.
    pub fn find(
        clustered: &Clustered,
        classes: &BTreeMap<u64, ClassName>,
        behaviour: &[f64],
        count: usize,
    ) -> Result<Self, NearestError> {
        let (behaviours, clustering) = (&clustered.space.behaviours, &clustered.clustering);
        if behaviours.is_empty() {
            return Err(NearestError::Empty);
        }
        let distances = distances(behaviours, behaviour)?;
        let neighbour = |place: usize| Neighbour {
            index: place as u64,
            distance: distances[place],
            cluster: clustering.clusters.get(place).copied().unwrap_or_default(),
            class: classes.get(&(place as u64)).cloned(),
        };
        let nearer = |one: &usize, other: &usize| {
            let distances = distances[*one].total_cmp(&distances[*other]);
            distances.then(one.cmp(other))
        };
        let mut places: Vec<usize> = (0..distances.len()).collect();
        let count = count.min(places.len());
        if count < places.len() {
            places.select_nth_unstable_by(count, nearer);
            places.truncate(count);
        }
        places.sort_unstable_by(nearer);
        let labelled = classes.keys().map(|&index| index as usize);
        let labelled = labelled.filter(|&place| place < distances.len()).min_by(nearer);
        let medoid = clustering.medoids.iter().copied().min_by(nearer);
        let medoid = medoid.ok_or(NearestError::NoMedoid(distances.len()))?;
        let (mut of_cluster, mut of_all) = (Mean::default(), Mean::default());
        for (&cluster, member) in clustering.clusters.iter().zip(0..) {
            let Some(&own) = clustering.medoids.get(cluster as usize) else {
                continue;
            };
            let distance = behaviours.squared_distance(member, own).sqrt();
            of_all.add(distance);
            if own == medoid {
                of_cluster.add(distance);
            }
        }
        Ok(Self {
            neighbours: places.into_iter().map(neighbour).collect(),
            labelled: labelled.map(neighbour),
            medoid: neighbour(medoid),
            mean_distance: of_cluster.value(),
            spread: of_all.value(),
            is_taxonomy: clustered.is_taxonomy,
        })
    }
}

/// A mean of the numbers added so far; 0 without numbers.
#[derive(Default)]
struct Mean {
    sum: f64,
    count: u32,
}

impl Mean {
    fn add(&mut self, number: f64) {
        self.sum += number;
        self.count += 1;
    }

    fn value(&self) -> f64 {
        self.sum / f64::from(self.count.max(1))
    }
}

impl Nearest {
    /// The distance from the nearest medoid, divided by the mean distance of its cluster; `None` if all members are at one place.
    pub fn relative_distance(&self) -> Option<f64> {
        relative_distance(self.medoid.distance, self.mean_distance)
    }

    /// Whether the behaviour is unlike everything in the archive: it is far from its nearest cluster, and farther from the nearest
    /// individual than individuals are from their medoids on average. A behaviour between clusters, beside an individual that
    /// belongs to none of them either, is like this individual.
    pub fn is_unlike(&self) -> bool {
        let nearest = self
            .neighbours
            .first()
            .map_or(f64::INFINITY, |near| near.distance);
        self.medoid.distance > UNLIKE * self.mean_distance && nearest > self.spread
    }
}

/// A distance from a medoid, divided by the mean distance of its cluster; `None` if all members are at one place.
pub fn relative_distance(distance: f64, mean_distance: f64) -> Option<f64> {
    (mean_distance > 0.0).then(|| distance / mean_distance)
}

/// The distance of every individual from a behaviour of the same space.
fn distances(behaviours: &Behaviours, behaviour: &[f64]) -> Result<Vec<f64>, Misfit> {
    let mut own = Behaviours::new(behaviours.dims());
    own.push(behaviour)?;
    Ok((0..behaviours.len())
        .map(|place| behaviours.squared_distance_to(place, behaviour).sqrt())
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::Space;
    use murmuration_model::ArchiveVersion;
    use murmuration_search::medoids::Clustering;
    use murmuration_swarm::{BehaviourSpace, Scale};
    use std::sync::Arc;

    /// An archive on a line, with clusters around 1 and 10.
    fn archive(places: &[f64]) -> Clustered {
        let mut behaviours = Behaviours::new(1);
        for place in places {
            behaviours.push(&[*place]).unwrap();
        }
        Clustered {
            space: Arc::new(Space {
                behaviours,
                scale: Scale::unscaled(BehaviourSpace::Features),
                archive_version: ArchiveVersion {
                    created_ms: 0,
                    rollbacks: 0,
                    checkpoint: None,
                },
            }),
            clustering: Clustering {
                medoids: vec![1, 3],
                clusters: vec![0, 0, 0, 1],
                loss: 3.0,
            },
            is_taxonomy: true,
            robust_trials: Vec::new(),
        }
    }

    fn class(name: &str) -> ClassName {
        name.parse().unwrap()
    }

    #[test]
    fn the_nearest_come_first_with_their_clusters_and_classes() {
        let archive = archive(&[0.0, 1.0, 3.0, 10.0]);
        let classes = BTreeMap::from([(0, class("ring")), (3, class("wall"))]);
        let found = Nearest::find(&archive, &classes, &[2.0], 3).unwrap();
        let near: Vec<_> = found
            .neighbours
            .iter()
            .map(|near| (near.index, near.distance, near.cluster))
            .collect();
        assert_eq!(near, [(1, 1.0, 0), (2, 1.0, 0), (0, 2.0, 0)]);
        assert_eq!(found.neighbours[2].class, Some(class("ring")));
        assert_eq!(found.labelled.as_ref().map(|near| near.index), Some(0));
        assert_eq!((found.medoid.index, found.medoid.distance), (1, 1.0));
        // The members of the first cluster are at distances 1, 0 and 2 from its medoid, that of the second at 0.
        assert_eq!((found.mean_distance, found.spread), (1.0, 0.75));
        assert!(!found.is_unlike());
        let far = Nearest::find(&archive, &BTreeMap::new(), &[12.0], 9).unwrap();
        // All members of a cluster with one member are at one place.
        assert!(far.is_unlike() && far.relative_distance().is_none());
        assert_eq!(
            (far.neighbours.len(), far.medoid.cluster, far.labelled),
            (4, 1, None)
        );
    }

    #[test]
    fn what_is_beside_an_individual_is_like_it_even_far_from_every_medoid() {
        // The member at 6 is far from its medoid at 1.
        let archive = archive(&[0.9, 1.0, 6.0, 10.0]);
        let found = |place: f64| Nearest::find(&archive, &BTreeMap::new(), &[place], 1).unwrap();
        let twin = found(6.1);
        assert!((twin.medoid.index, twin.mean_distance) == (3, 0.0) && twin.medoid.distance > 3.0);
        assert!(!twin.is_unlike());
        assert!(found(8.0).is_unlike());
    }

    #[test]
    fn what_cannot_be_compared_is_refused() {
        let found = |places: &[f64], behaviour: &[f64]| {
            Nearest::find(&archive(places), &BTreeMap::new(), behaviour, 1).unwrap_err()
        };
        assert_eq!(found(&[], &[1.0]), NearestError::Empty);
        let places = [0.0, 1.0, 3.0, 10.0];
        assert!(matches!(found(&places, &[1.0, 2.0]), NearestError::Misfit(_)));
        assert!(matches!(found(&places, &[f64::NAN]), NearestError::Misfit(_)));
    }
}

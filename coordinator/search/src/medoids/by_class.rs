//! Medoids by class, so that the medoids represent every labelled class.
//!
//! k-medoids places medoids where points are many and far apart, so a class that fills little of the behaviour space shares a
//! medoid with another class. This module gives each unlabelled point the majority class of the labelled points nearest to it. At
//! least one medoid of a class is a labelled point, because a point in the middle of an assumed class need not belong to that
//! class. The other medoids go to classes one at a time, each to the class whose loss the medoid lowers most. A sample of a class
//! determines the number of its medoids, and all points of the class determine the medoids themselves.

use super::{Algorithm, Clustering, Progress, arrange, cluster_by, sampled::Sample, swaps};
use crate::{
    interrupt::{Interrupt, Interrupted},
    novelty::{Behaviours, Index},
};
use murmuration_swarm::RandomStream;
use rayon::prelude::*;
use std::{cmp::Reverse, collections::BTreeMap};

/// Number of nearest labelled points that vote on the class of a point. Another number changes the outcome.
const VOTERS: usize = 5;

/// Size of the sample that determines the number of medoids of a class. Another size changes the outcome.
const SAMPLE: usize = 1024;

/// Clusters `points` like [`cluster`](super::cluster), but with medoids chosen class by class; `labelled` maps indices of points
/// to classes.
///
/// If there are more classes than medoids, the smallest classes have no medoid. With fewer than two classes, the outcome is that
/// of [`cluster`](super::cluster). Labels of indices beyond the last point are ignored. A cluster always has the points that are
/// nearest to its medoid, whatever the class of these points.
///
/// # Errors
/// Fails as [`cluster`](super::cluster) does.
pub(super) fn cluster_by_class(
    points: &Behaviours,
    labelled: &BTreeMap<usize, u32>,
    k: usize,
    stream: &mut RandomStream,
    interrupt: &Interrupt,
    told: &dyn Fn(Progress),
) -> Result<Clustering, Interrupted> {
    let k = k.max(1).min(points.len());
    let mut classes = members_by_class(points, labelled, interrupt)?;
    classes.truncate(k);
    if classes.len() < 2 {
        return cluster_by(
            Algorithm::for_size(points.len()),
            points,
            k,
            stream,
            interrupt,
            told,
        );
    }
    let counts = medoids_of_each(points, &classes, k, stream, interrupt)?;
    let mut medoids = Vec::with_capacity(k);
    for (members, count) in classes.iter().zip(counts) {
        let own = points.among(members);
        let algorithm = Algorithm::for_size(own.len());
        let mut found = cluster_by(algorithm, &own, count, stream, interrupt, told)?.medoids;
        vouch(&own, &mut found, |place| labelled.contains_key(&members[place]));
        medoids.extend(found.into_iter().map(|place| members[place]));
    }
    arrange(points, medoids, interrupt)
}

/// Ensures that a medoid of a class is labelled: if no medoid is labelled, the labelled point nearest to a medoid replaces that
/// medoid.
fn vouch(points: &Behaviours, medoids: &mut [usize], is_labelled: impl Fn(usize) -> bool) {
    if medoids.iter().any(|&medoid| is_labelled(medoid)) {
        return;
    }
    let labelled = (0..points.len()).filter(|&point| is_labelled(point));
    let of = |point: usize| {
        let distances = medoids.iter().enumerate();
        distances.map(move |(place, &medoid)| (points.squared_distance(point, medoid), place, point))
    };
    let nearest = labelled.flat_map(of).min_by(|a, b| a.0.total_cmp(&b.0));
    if let Some((_, place, point)) = nearest {
        medoids[place] = point;
    }
}

/// The points of each class, the largest class first.
fn members_by_class(
    points: &Behaviours,
    labelled: &BTreeMap<usize, u32>,
    interrupt: &Interrupt,
) -> Result<Vec<Vec<usize>>, Interrupted> {
    let known = labelled.range(..points.len());
    let (indices, classes): (Vec<usize>, Vec<u32>) = known.map(|(&index, &class)| (index, class)).unzip();
    if indices.is_empty() {
        return Ok(Vec::new());
    }
    let mut voters = Index::new();
    voters.extend(&points.among(&indices));
    let class_of = |point: usize| {
        interrupt.check()?;
        Ok(match labelled.get(&point) {
            Some(&class) => class,
            None => elected(&voters, &classes, points.values_of(point)),
        })
    };
    let elected: Vec<u32> = (0..points.len())
        .into_par_iter()
        .map(class_of)
        .collect::<Result<_, Interrupted>>()?;
    let mut members: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (point, class) in elected.into_iter().enumerate() {
        members.entry(class).or_default().push(point);
    }
    let mut members: Vec<Vec<usize>> = members.into_values().collect();
    members.sort_by_key(|members| Reverse(members.len()));
    Ok(members)
}

/// Majority class of the nearest voters; in a tie, the tied class with the nearest voter.
fn elected(voters: &Index, classes: &[u32], place: &[f64]) -> u32 {
    let nearest = voters.nearest(place, VOTERS);
    let votes: Vec<u32> = nearest.iter().map(|voter| classes[voter.index]).collect();
    let count = |class: u32| votes.iter().filter(|&&vote| vote == class).count();
    // `max_by_key` returns the last of several equal maxima, so `rev` puts the nearest voter last.
    let most = votes.iter().rev().max_by_key(|&&class| count(class));
    most.copied().unwrap_or_default()
}

/// Number of the `k` medoids that each class gets: at least one, and at most the number of points in the class.
fn medoids_of_each(
    points: &Behaviours,
    classes: &[Vec<usize>],
    k: usize,
    stream: &mut RandomStream,
    interrupt: &Interrupt,
) -> Result<Vec<usize>, Interrupted> {
    let mut shares = Vec::with_capacity(classes.len());
    for members in classes {
        shares.push(Share::new(points, members, stream, interrupt)?);
    }
    for _ in classes.len()..k {
        // `max_by` returns the last of several equal maxima, so `rev` puts the first class last.
        let open = shares.iter_mut().rev().filter(|share| share.next.is_some());
        let Some(most) = open.max_by(|a, b| a.gain().total_cmp(&b.gain())) else {
            break;
        };
        most.take_one(stream, interrupt)?;
    }
    Ok(shares.into_iter().map(|share| share.count).collect())
}

/// Loss of a class with its current medoids.
struct Share {
    sample: Behaviours,
    /// Points of the class per point of the sample.
    weight: f64,
    members: usize,
    count: usize,
    /// Loss of the sample with `count` medoids.
    loss: f64,
    /// Loss of the sample with one more medoid; `None` if every point is a medoid already.
    next: Option<f64>,
}

impl Share {
    /// A class with one medoid.
    fn new(
        points: &Behaviours,
        members: &[usize],
        stream: &mut RandomStream,
        interrupt: &Interrupt,
    ) -> Result<Self, Interrupted> {
        let sample = Sample::draw(&points.among(members), SAMPLE, stream).behaviours;
        let mut share = Self {
            weight: members.len() as f64 / sample.len() as f64,
            members: members.len(),
            count: 0,
            loss: 0.0,
            next: None,
            sample,
        };
        share.next = share.loss_of(1, stream, interrupt)?;
        share.take_one(stream, interrupt)?;
        Ok(share)
    }

    /// Amount by which one more medoid lowers the loss of the class.
    fn gain(&self) -> f64 {
        self.next.map_or(0.0, |next| (self.loss - next) * self.weight)
    }

    fn take_one(&mut self, stream: &mut RandomStream, interrupt: &Interrupt) -> Result<(), Interrupted> {
        let Some(next) = self.next else {
            return Ok(());
        };
        (self.count, self.loss) = (self.count + 1, next);
        self.next = self.loss_of(self.count + 1, stream, interrupt)?;
        Ok(())
    }

    /// The loss of the sample with `count` medoids; `None` if the class has fewer than `count` points.
    fn loss_of(
        &self,
        count: usize,
        stream: &mut RandomStream,
        interrupt: &Interrupt,
    ) -> Result<Option<f64>, Interrupted> {
        if count > self.members {
            return Ok(None);
        }
        if count >= self.sample.len() {
            return Ok(Some(0.0));
        }
        let medoids = swaps::fasterpam(&self.sample, count, stream, interrupt, &|_| {})?;
        Ok(Some(arrange(&self.sample, medoids, interrupt)?.loss))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_swarm::Purpose;
    use proptest::prelude::*;

    fn stream() -> RandomStream {
        RandomStream::derive(1, Purpose::Medoids, 0)
    }

    fn line(places: impl IntoIterator<Item = f64>) -> Behaviours {
        let mut behaviours = Behaviours::new(1);
        for place in places {
            behaviours.push(&[place]).unwrap();
        }
        behaviours
    }

    /// A hundred points over a long range, and behind this range four points near each other.
    fn wide_and_narrow() -> Behaviours {
        line(
            (0..100)
                .map(|i| f64::from(i) * 10.0)
                .chain([1001.0, 1002.0, 1003.0, 1004.0]),
        )
    }

    fn clustered(points: &Behaviours, labelled: &BTreeMap<usize, u32>, k: usize) -> Clustering {
        cluster_by_class(points, labelled, k, &mut stream(), &Interrupt::default(), &|_| {}).unwrap()
    }

    fn plain(points: &Behaviours, k: usize) -> Clustering {
        super::super::cluster(points, k, &mut stream(), &Interrupt::default()).unwrap()
    }

    #[test]
    fn a_class_that_is_small_has_a_medoid_of_its_own() {
        let points = wide_and_narrow();
        let small = |clustering: &Clustering| clustering.medoids.iter().any(|&medoid| medoid >= 100);
        assert!(!small(&plain(&points, 3)));
        let labelled = BTreeMap::from([(10, 0), (40, 0), (50, 0), (99, 0), (101, 7), (102, 7)]);
        let by_class = clustered(&points, &labelled, 3);
        assert!(small(&by_class));
        assert_eq!(by_class.medoids.len(), 3);
        // The third medoid goes to the class whose loss it lowers most.
        assert_eq!(by_class.medoids.iter().filter(|&&medoid| medoid < 100).count(), 2);
    }

    #[test]
    fn most_of_the_nearest_decide_and_the_nearest_of_all_where_they_are_even() {
        let mut voters = Index::new();
        voters.extend(&line([0.0, 1.0, 2.0, 3.0, 4.0, 100.0]));
        assert_eq!(elected(&voters, &[1, 2, 2, 1, 2, 3], &[0.0]), 2);
        assert_eq!(elected(&voters, &[1, 2, 2, 1, 3, 3], &[0.4]), 1);
        assert_eq!(elected(&voters, &[1, 2, 2, 1, 3, 3], &[0.6]), 2);
    }

    #[test]
    fn without_two_classes_it_is_as_without_labels() {
        let points = wide_and_narrow();
        for labelled in [
            BTreeMap::new(),
            BTreeMap::from([(3, 1), (4, 1)]),
            BTreeMap::from([(104, 1)]),
        ] {
            assert_eq!(
                clustered(&points, &labelled, 5),
                plain(&points, 5),
                "{labelled:?}"
            );
        }
    }

    #[test]
    fn where_there_are_more_classes_than_medoids_the_largest_have_them() {
        let points = wide_and_narrow();
        let labelled = BTreeMap::from([(5, 0), (50, 1), (95, 2), (102, 3)]);
        let clustering = clustered(&points, &labelled, 2);
        assert_eq!(clustering.medoids.len(), 2);
        assert!(clustering.medoids.iter().all(|&medoid| medoid < 100));
    }

    #[test]
    fn an_interrupt_ends_it() {
        let interrupt = Interrupt::default();
        interrupt.raise();
        let labelled = BTreeMap::from([(5, 0), (102, 3)]);
        let ended = cluster_by_class(
            &wide_and_narrow(),
            &labelled,
            4,
            &mut stream(),
            &interrupt,
            &|_| {},
        );
        assert_eq!(ended, Err(Interrupted));
    }

    proptest! {
        #[test]
        fn each_labelled_class_has_a_medoid_and_each_medoid_is_another(
            places in prop::collection::vec(0_u8..40, 1..60),
            labels in prop::collection::btree_map(0_usize..70, 0_u32..6, 0..12),
            k in 1_usize..20,
        ) {
            let points = line(places.iter().map(|&place| f64::from(place)));
            let clustering = clustered(&points, &labels, k);
            let mut medoids = clustering.medoids.clone();
            medoids.sort_unstable();
            medoids.dedup();
            prop_assert_eq!(medoids.len(), k.min(points.len()));
            let classes = members_by_class(&points, &labels, &Interrupt::default()).unwrap();
            if (2..=k).contains(&classes.len()) {
                for members in classes {
                    let own = members.iter().filter(|member| medoids.binary_search(member).is_ok());
                    prop_assert!(own.into_iter().any(|medoid| labels.contains_key(medoid)));
                }
            }
        }
    }
}

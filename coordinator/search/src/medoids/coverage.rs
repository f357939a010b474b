//! Behaviours that cover a behaviour space.
//!
//! k-medoids places medoids where points are dense. Most behaviours of random controllers look alike, so most of these medoids
//! look alike. This module chooses each new point as the point farthest from all points chosen before (Gonzalez, "Clustering to
//! minimize the maximum intercluster distance", 1985). The module first leaves out the points farthest from their neighbours:
//! farthest-first would choose all of these isolated outliers.

use super::{Clustering, arrange};
use crate::{
    interrupt::{Interrupt, Interrupted},
    novelty::{Behaviours, Index},
};
use murmuration_swarm::RandomStream;
use std::{cmp::Reverse, collections::BTreeMap};

/// One in this many points is left out. Another number changes the outcome.
const LEFT_OUT: usize = 10;

/// Number of nearest points of its class by which a labelled point is judged. Another number changes the outcome.
const OF_ITS_CLASS: usize = 5;

/// Clusters `points` about `k` of these points, which cover the space. A point's distance from its neighbours is its mean
/// distance to the nearest `neighbours` points.
///
/// `labelled` maps indices of points to classes. One point of each class is chosen before all other points, in descending order
/// of labels per class. Indices beyond the last point are ignored.
///
/// # Errors
/// [`Interrupted`] once `interrupt` is raised.
pub(super) fn cover(
    points: &Behaviours,
    labelled: &BTreeMap<usize, u32>,
    k: usize,
    neighbours: usize,
    stream: &mut RandomStream,
    interrupt: &Interrupt,
) -> Result<Clustering, Interrupted> {
    let k = k.max(1).min(points.len());
    let mut chosen = of_each_class(points, labelled, interrupt)?;
    chosen.truncate(k);
    let (chosen, _) = farthest_first(points, chosen, k, neighbours, stream, interrupt)?;
    arrange(points, chosen, interrupt)
}

/// All points except `shown`, in an order of coverage: first `count` points, chosen after `shown` as [`choose`](super::choose)
/// chooses for coverage. The other points follow by descending distance from `shown` and the chosen points.
///
/// # Errors
/// [`Interrupted`] once `interrupt` is raised.
pub fn order(
    points: &Behaviours,
    shown: Vec<usize>,
    count: usize,
    neighbours: usize,
    stream: &mut RandomStream,
    interrupt: &Interrupt,
) -> Result<Vec<usize>, Interrupted> {
    let before = shown.len();
    let k = (before + count).min(points.len());
    let (mut chosen, Distances(distances)) = farthest_first(points, shown, k, neighbours, stream, interrupt)?;
    let mut others: Vec<usize> = (0..points.len())
        .filter(|&point| distances[point] >= 0.0)
        .collect();
    others.sort_by(|&a, &b| distances[b].total_cmp(&distances[a]));
    chosen.extend(others);
    Ok(chosen.split_off(before))
}

/// Extends `chosen` to `k` points. Each new point is the point farthest from all chosen before; of equally far points, the point
/// with the lowest index. Returns the chosen points, and the distances of all points to the chosen points. If `chosen` is empty,
/// the first point is drawn. Points far from their neighbours are chosen only after all other points.
fn farthest_first(
    points: &Behaviours,
    mut chosen: Vec<usize>,
    k: usize,
    neighbours: usize,
    stream: &mut RandomStream,
    interrupt: &Interrupt,
) -> Result<(Vec<usize>, Distances), Interrupted> {
    let mut open = in_company(points, k, neighbours, interrupt)?;
    if chosen.is_empty() && !open.is_empty() {
        chosen.push(open[stream.below(open.len() as u64) as usize]);
    }
    let mut distances = Distances::to(points, &chosen);
    while chosen.len() < k {
        interrupt.check()?;
        let of = |point: &usize| distances.0[*point];
        // `max_by` returns the last of several equal maxima, so `rev` puts the first point last.
        let farthest = open.iter().rev().filter(|point| of(point) >= 0.0);
        match farthest.max_by(|a, b| of(a).total_cmp(&of(b))) {
            Some(&farthest) => {
                chosen.push(farthest);
                distances.lower(points, farthest);
            }
            None => open = (0..points.len()).collect(),
        }
    }
    Ok((chosen, distances))
}

/// For each point, its squared distance to the nearest chosen point; -1 for a chosen point.
struct Distances(Vec<f64>);

impl Distances {
    fn to(points: &Behaviours, chosen: &[usize]) -> Self {
        let mut distances = Self(vec![f64::INFINITY; points.len()]);
        for &one in chosen {
            distances.lower(points, one);
        }
        distances
    }

    fn lower(&mut self, points: &Behaviours, chosen: usize) {
        points.each_squared_distance(chosen, |point, squared| {
            self.0[point] = self.0[point].min(squared);
        });
        self.0[chosen] = -1.0;
    }
}

/// Ascending indices of all points except the points farthest from their neighbours; at least `k` indices.
fn in_company(
    points: &Behaviours,
    k: usize,
    neighbours: usize,
    interrupt: &Interrupt,
) -> Result<Vec<usize>, Interrupted> {
    let distances = Index::new().novelty(points, 0..points.len(), neighbours, interrupt)?;
    let mut kept: Vec<usize> = (0..points.len()).collect();
    kept.sort_by(|&a, &b| distances[a].total_cmp(&distances[b]));
    kept.truncate((points.len() - points.len() / LEFT_OUT).max(k));
    kept.sort_unstable();
    Ok(kept)
}

/// For each class, the labelled point nearest to the other labelled points of the class. The classes are in descending order of
/// labels per class.
fn of_each_class(
    points: &Behaviours,
    labelled: &BTreeMap<usize, u32>,
    interrupt: &Interrupt,
) -> Result<Vec<usize>, Interrupted> {
    let mut classes: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (&point, &class) in labelled.range(..points.len()) {
        classes.entry(class).or_default().push(point);
    }
    let mut classes: Vec<Vec<usize>> = classes.into_values().collect();
    classes.sort_by_key(|members| Reverse(members.len()));
    let mut chosen = Vec::with_capacity(classes.len());
    for members in classes {
        let own = points.among(&members);
        let distances = Index::new().novelty(&own, 0..own.len(), OF_ITS_CLASS, interrupt)?;
        let nearest = members.iter().zip(distances).min_by(|a, b| a.1.total_cmp(&b.1));
        chosen.extend(nearest.map(|(&member, _)| member));
    }
    Ok(chosen)
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_swarm::Purpose;
    use proptest::prelude::*;

    fn line(places: impl IntoIterator<Item = f64>) -> Behaviours {
        let mut behaviours = Behaviours::new(1);
        for place in places {
            behaviours.push(&[place]).unwrap();
        }
        behaviours
    }

    fn covered(points: &Behaviours, labelled: &[(usize, u32)], k: usize) -> Clustering {
        let mut stream = RandomStream::derive(1, Purpose::Medoids, 0);
        let labelled = labelled.iter().copied().collect();
        cover(points, &labelled, k, 3, &mut stream, &Interrupt::default()).unwrap()
    }

    /// A thousand points near 0, two tighter groups of four near 50 and near 100, and one point very far away.
    fn crowd() -> Behaviours {
        let many = (0..1000).map(|i| f64::from(i) * 1e-3);
        let few = [50.0, 100.0]
            .into_iter()
            .flat_map(|at| (0..4).map(move |i| at + f64::from(i) * 1e-4));
        line(many.chain(few).chain([1e6]))
    }

    #[test]
    fn what_is_rare_is_shown_beside_what_is_frequent_but_no_freak() {
        let mut medoids = covered(&crowd(), &[], 3).medoids;
        medoids.sort_unstable();
        assert!(medoids[0] < 1000);
        assert!((1000..1004).contains(&medoids[1]), "{medoids:?}");
        assert!((1004..1008).contains(&medoids[2]), "{medoids:?}");
    }

    #[test]
    fn each_class_is_shown_by_one_that_is_in_its_midst() {
        let labelled = [(10, 4), (400, 4), (401, 4), (402, 4), (500, 9), (2000, 9)];
        let medoids = covered(&crowd(), &labelled, 4).medoids;
        assert!(medoids.contains(&500), "{medoids:?}");
        assert!(medoids.iter().any(|medoid| (400..403).contains(medoid)));
        let fewer = covered(&crowd(), &labelled, 1).medoids;
        assert!((400..403).contains(&fewer[0]), "{fewer:?}");
    }

    #[test]
    fn an_order_begins_where_what_is_shown_ends_and_has_every_other_point_once() {
        let points = crowd();
        let shown = covered(&points, &[], 2).medoids;
        let mut stream = RandomStream::derive(1, Purpose::Query, 0);
        let found = order(&points, shown.clone(), 20, 3, &mut stream, &Interrupt::default()).unwrap();
        let next = covered(&points, &[], 3).medoids;
        assert!(next.contains(&found[0]));
        let mut all = [found, shown].concat();
        all.sort_unstable();
        assert_eq!(all, (0..points.len()).collect::<Vec<_>>());
    }

    #[test]
    fn an_interrupt_ends_it() {
        let interrupt = Interrupt::default();
        interrupt.raise();
        let mut stream = RandomStream::derive(1, Purpose::Medoids, 0);
        let ended = cover(&crowd(), &BTreeMap::new(), 3, 3, &mut stream, &interrupt);
        assert_eq!(ended, Err(Interrupted));
    }

    proptest! {
        #[test]
        fn as_many_different_points_are_shown_as_are_asked_for(
            places in prop::collection::vec(0_u8..40, 1..60),
            labels in prop::collection::btree_map(0_usize..70, 0_u32..6, 0..12),
            k in 1_usize..80,
        ) {
            let points = line(places.iter().map(|&place| f64::from(place)));
            let labels: Vec<_> = labels.into_iter().collect();
            let mut medoids = covered(&points, &labels, k).medoids;
            medoids.sort_unstable();
            medoids.dedup();
            prop_assert_eq!(medoids.len(), k.min(points.len()));
        }
    }
}

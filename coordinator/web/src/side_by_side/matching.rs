//! Matches behaviours of several campaigns: by distance if all campaigns share one behaviour space, or else by class.

use murmuration_engine::taxonomy::{distance, touch};
use murmuration_model::labels::{ClassKey, ClassName};
use std::collections::BTreeMap;

/// A medoid of one of the compared campaigns.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Behaviour {
    /// Index of the behaviour's campaign among the compared campaigns.
    pub(super) campaign: usize,
    /// Index of the behaviour in the taxonomy of its campaign.
    pub(super) place: usize,
    /// Coordinates of the medoid in the behaviour space of its campaign.
    pub(super) at: Vec<f64>,
    /// Mean distance of the cluster's members to the medoid, in units of the behaviour space.
    pub(super) mean_distance: f64,
    /// The class that annotators gave, or else the class that the judge gave.
    pub(super) class: Option<ClassName>,
}

/// Behaviours that are taken for the same behaviour.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Group {
    /// For each campaign, the indices of its behaviours in the list of all behaviours, largest cluster first.
    pub(super) members: Vec<Vec<usize>>,
    /// Set only if the group has a single behaviour: the nearest behaviour of another campaign that it touches, as an index in
    /// the list of all behaviours.
    pub(super) touches: Option<usize>,
}

impl Group {
    /// Number of campaigns that have this behaviour.
    pub(super) fn campaigns(&self) -> usize {
        self.members.iter().filter(|own| !own.is_empty()).count()
    }

    fn of(campaigns: usize, all: &[Behaviour], members: impl IntoIterator<Item = usize>) -> Self {
        let mut group = Self {
            members: vec![Vec::new(); campaigns],
            touches: None,
        };
        for member in members {
            group.members[all[member].campaign].push(member);
        }
        group
    }
}

/// Groups of behaviours whose clusters touch. As on the page Taxonomy, two clusters touch if the distance between their medoids
/// is less than the sum of both mean distances. The nearest pair is joined first, and a group has at most one behaviour of each
/// campaign. All behaviours must be in one space.
pub(super) fn by_distance(campaigns: usize, all: &[Behaviour]) -> Vec<Group> {
    let touching = touching(all);
    // `group_of` has the group of each behaviour; `members` has the behaviours of each group, at most one of each campaign.
    let mut group_of: Vec<usize> = (0..all.len()).collect();
    let mut members: Vec<Vec<usize>> = (0..all.len()).map(|member| vec![member]).collect();
    for &(one, other, _) in &touching {
        let (one, other) = (group_of[one], group_of[other]);
        let (into, from) = (one.min(other), one.max(other));
        let campaigns = |group: usize| members[group].iter().map(|&member| all[member].campaign);
        if into != from && campaigns(into).all(|one| campaigns(from).all(|other| one != other)) {
            let moving = std::mem::take(&mut members[from]);
            moving.iter().for_each(|&member| group_of[member] = into);
            members[into].extend(moving);
        }
    }
    let nearest = |member: usize| {
        let mut pairs = touching.iter();
        let (one, other, _) = pairs.find(|(one, other, _)| *one == member || *other == member)?;
        Some(if *one == member { *other } else { *one })
    };
    let groups = members.into_iter().filter(|members| !members.is_empty());
    let groups = groups.map(|members| Group {
        touches: match members.as_slice() {
            [alone] => nearest(*alone),
            _ => None,
        },
        ..Group::of(campaigns, all, members)
    });
    ordered(groups.collect())
}

/// Pairs of behaviours of two campaigns whose clusters touch, with their distances, nearest first.
fn touching(all: &[Behaviour]) -> Vec<(usize, usize, f64)> {
    let mut found = Vec::new();
    for (other, theirs) in all.iter().enumerate() {
        for (one, ours) in all[..other].iter().enumerate() {
            if ours.campaign == theirs.campaign {
                continue;
            }
            let distance = distance(&ours.at, &theirs.at);
            // Clusters of one individual have a mean distance of 0, but two such clusters can be at the same place.
            if distance == 0.0 || touch(distance, [ours.mean_distance, theirs.mean_distance]) {
                found.push((one, other, distance));
            }
        }
    }
    found.sort_by(|(.., a), (.., b)| a.total_cmp(b));
    found
}

/// One group of behaviours for each class; behaviours without a class come last.
pub(super) fn by_class(campaigns: usize, all: &[Behaviour]) -> Vec<Group> {
    let mut classes: BTreeMap<ClassKey, Vec<usize>> = BTreeMap::new();
    let mut without = Vec::new();
    for (member, behaviour) in all.iter().enumerate() {
        match &behaviour.class {
            Some(class) => classes.entry(class.key()).or_default().push(member),
            None => without.push(member),
        }
    }
    let named = classes
        .into_values()
        .map(|members| Group::of(campaigns, all, members));
    let mut groups = ordered(named.collect());
    if !without.is_empty() {
        groups.push(Group::of(campaigns, all, without));
    }
    groups
}

/// Sorts groups by the number of campaigns, the largest first, then by the first campaign, then by the size of the cluster.
fn ordered(mut groups: Vec<Group>) -> Vec<Group> {
    let first = |group: &Group| group.members.iter().flatten().min().copied();
    groups.sort_by_key(|group| (std::cmp::Reverse(group.campaigns()), first(group)));
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    fn behaviour(campaign: usize, place: usize, at: f64) -> Behaviour {
        Behaviour {
            campaign,
            place,
            at: vec![at],
            mean_distance: 1.0,
            class: None,
        }
    }

    fn members(groups: &[Group]) -> Vec<Vec<Vec<usize>>> {
        groups.iter().map(|group| group.members.clone()).collect()
    }

    #[test]
    fn the_nearest_that_touch_are_the_same_and_what_touches_nothing_is_only_here() {
        let all = [
            behaviour(0, 0, 0.0),
            behaviour(0, 1, 1.5),
            behaviour(0, 2, 50.0),
            behaviour(1, 0, 0.5),
            behaviour(1, 1, 9.0),
        ];
        let groups = by_distance(2, &all);
        assert_eq!(
            members(&groups),
            [
                vec![vec![0], vec![3]],
                vec![vec![1], vec![]],
                vec![vec![2], vec![]],
                vec![vec![], vec![4]],
            ]
        );
        // The second behaviour of the first campaign touches a behaviour of the other campaign that is nearer to the first
        // behaviour.
        let touches: Vec<_> = groups.iter().map(|group| group.touches).collect();
        assert_eq!(touches, [None, Some(3), None, None]);
        assert_eq!(groups[0].campaigns(), 2);
    }

    #[test]
    fn a_group_has_one_of_each_campaign_however_many_there_are() {
        let all = [
            behaviour(0, 0, 0.0),
            behaviour(1, 0, 1.0),
            behaviour(2, 0, 2.5),
            behaviour(0, 1, 3.0),
        ];
        // 2.5 and 3.0 are joined first, and then 0.0 and 1.0. The two groups stay apart, because both have a behaviour of the
        // first campaign.
        let groups = by_distance(3, &all);
        assert_eq!(
            members(&groups),
            [vec![vec![0], vec![1], vec![]], vec![vec![3], vec![], vec![2]]]
        );
    }

    #[test]
    fn clusters_of_one_individual_are_the_same_at_one_place_alone() {
        let alone = |campaign, at| Behaviour {
            mean_distance: 0.0,
            ..behaviour(campaign, 0, at)
        };
        assert_eq!(by_distance(2, &[alone(0, 3.0), alone(1, 3.0)]).len(), 1);
        assert_eq!(by_distance(2, &[alone(0, 3.0), alone(1, 3.1)]).len(), 2);
        // As on the page Taxonomy, two clusters do not touch if the distance equals the sum of the mean distances.
        assert_eq!(
            by_distance(2, &[behaviour(0, 0, 3.0), behaviour(1, 0, 5.0)]).len(),
            2
        );
    }

    #[test]
    fn behaviours_of_one_class_are_in_one_row_and_those_without_in_the_last() {
        let named = |campaign, place, class: &str| Behaviour {
            class: Some(class.parse().unwrap()),
            ..behaviour(campaign, place, 0.0)
        };
        let all = [
            behaviour(0, 0, 0.0),
            named(0, 1, "ring"),
            named(0, 2, "ring"),
            named(1, 0, "wall"),
            named(1, 1, "ring"),
        ];
        assert_eq!(
            members(&by_class(2, &all)),
            [
                vec![vec![1, 2], vec![4]],
                vec![vec![], vec![3]],
                vec![vec![0], vec![]],
            ]
        );
    }
}

//! Names of clusters. A person names a medoid, which is a label. When the campaign has learned from labels, the name moves to the
//! cluster that holds the majority of the named cluster's members. Names are not stored: they follow from labels and versions.

use super::Change;
use murmuration_model::{
    CampaignId,
    labels::{ClassName, GivenClass, Labels},
};
use murmuration_store::{Store, StoreError, StoredTaxonomy, TaxonomyVersion};
use std::collections::BTreeMap;

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ClusterName {
    pub class: ClassName,
    pub origin: Origin,
}

/// Where the name of a cluster comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// A person gave the name to the medoid.
    Person,
    /// Only the rule-based judge gave the name to the medoid.
    Judge,
    /// The name was carried over from a cluster of an earlier version.
    Carried {
        version: u32,
        /// The place of the earlier cluster in that version.
        place: usize,
        /// Number of members that the earlier cluster and this cluster share.
        shared: u64,
        /// Number of the earlier cluster's members that this version still has.
        of: u64,
    },
}

/// The names of a version's clusters.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Names {
    /// The name of each cluster, by place; `None` if the cluster has no name.
    pub names: Vec<Option<ClusterName>>,
    /// Names of the previous version that were not carried over to this version, in the order of their places.
    pub uncarried: Vec<Uncarried>,
}

/// A name that was not carried over.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Uncarried {
    pub class: ClassName,
    /// The place of the named cluster in the previous version.
    pub place: usize,
    pub why: NotCarried,
}

/// Why a name was not carried over.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum NotCarried {
    /// No cluster holds more than half of the named cluster's members.
    Spread {
        /// The cluster with most of the named cluster's members.
        most_in: Option<usize>,
        /// Number of the named cluster's members in `most_in`.
        shared: u64,
        /// Number of the named cluster's members that this version still has.
        of: u64,
    },
    /// The cluster that holds the majority has another name: a person's name, or a name that comes with more members.
    Outdone {
        /// The cluster that holds the majority.
        place: usize,
        by: ClassName,
    },
}

impl Names {
    /// The names of the first version of a taxonomy: the `given` classes of its medoids.
    pub fn first(medoids: &[u64], given: &BTreeMap<u64, GivenClass>) -> Self {
        let own = medoids.iter().map(|medoid| {
            given.get(medoid).map(|given| ClusterName {
                class: given.class.clone(),
                origin: if given.by_machine {
                    Origin::Judge
                } else {
                    Origin::Person
                },
            })
        });
        Self {
            names: own.collect(),
            uncarried: Vec::new(),
        }
    }

    /// The names of a later version with the medoids `medoids`; `self` has the names of `version`, the previous version. A name
    /// moves to the cluster that holds the majority of the named cluster's members, unless a person gave that cluster another
    /// name. If two names move to one cluster, the name with more members stays. The judge's names are not carried over, because
    /// the judge names each version anew.
    pub fn carried(
        &self,
        version: u32,
        change: &Change,
        medoids: &[u64],
        given: &BTreeMap<u64, GivenClass>,
    ) -> Self {
        let mut after = Self::first(medoids, given).names;
        let known = self.names.iter().enumerate();
        let mut known: Vec<(usize, &ClassName, Option<usize>)> = known
            .filter_map(|(place, name)| Some((place, name.as_ref()?)))
            .filter(|(_, name)| name.origin != Origin::Judge)
            .map(|(place, name)| (place, &name.class, change.successor(place)))
            .collect();
        known.sort_by_key(|&(place, _, to)| {
            let shared = to.map_or(0, |to| change.shared(place, to));
            (std::cmp::Reverse(shared), place)
        });
        let mut uncarried = Vec::new();
        // A name that a medoid of this version has by itself is not lost.
        let own: Vec<ClassName> = after.iter().flatten().map(|name| name.class.clone()).collect();
        let is_lost = |class: &ClassName| !own.contains(class);
        for (place, class, to) in known {
            let of = change.size_before(place);
            let Some((to, name)) = to.and_then(|to| Some((to, after.get_mut(to)?))) else {
                let most_in = change.largest_part(place);
                let shared = most_in.map_or(0, |most_in| change.shared(place, most_in));
                let why = NotCarried::Spread { most_in, shared, of };
                if is_lost(class) {
                    uncarried.push((place, class, why));
                }
                continue;
            };
            match name {
                Some(name) if name.origin != Origin::Judge => {
                    if name.class != *class && is_lost(class) {
                        let by = name.class.clone();
                        uncarried.push((place, class, NotCarried::Outdone { place: to, by }));
                    }
                }
                _ => {
                    let shared = change.shared(place, to);
                    let origin = Origin::Carried {
                        version,
                        place,
                        shared,
                        of,
                    };
                    *name = Some(ClusterName {
                        class: class.clone(),
                        origin,
                    });
                }
            }
        }
        uncarried.sort_by_key(|(place, ..)| *place);
        let uncarried = uncarried.into_iter().map(|(place, class, why)| Uncarried {
            class: class.clone(),
            place,
            why,
        });
        Self {
            names: after,
            uncarried: uncarried.collect(),
        }
    }

    /// The cluster names of the last of `versions` of a campaign's taxonomy, oldest version first. A medoid's label is the name
    /// of its cluster, and names are carried over from each version to the next.
    pub fn read(
        store: &Store,
        campaign: &CampaignId,
        versions: &[TaxonomyVersion],
        labels: &Labels,
    ) -> Result<Self, StoreError> {
        let given = labels.given_classes();
        let mut names = Self::default();
        let mut before: Option<(u32, StoredTaxonomy)> = None;
        for version in versions {
            let Some(stored) = store.taxonomy_of_version(campaign, version.version)? else {
                continue;
            };
            names = match &before {
                None => Self::first(&stored.medoids, &given),
                Some((number, before)) => {
                    let change = Change::between(before, &stored);
                    names.carried(*number, &change, &stored.medoids, &given)
                }
            };
            before = Some((version.version, stored));
        }
        Ok(names)
    }

    /// The names of the current taxonomy; empty if there is no taxonomy.
    pub fn standing(store: &Store, campaign: &CampaignId) -> Result<Self, StoreError> {
        let versions = store.taxonomy_versions(campaign)?;
        match versions.last() {
            Some(last) if last.stands => {
                let labels = store.labels(campaign)?;
                Self::read(store, campaign, &versions, &labels)
            }
            _ => Ok(Self::default()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{super::change::tests::stored, *};

    fn name(text: &str) -> ClassName {
        text.parse().unwrap()
    }

    fn given(message: &[(u64, &str, bool)]) -> BTreeMap<u64, GivenClass> {
        let given = message.iter().map(|&(medoid, class, by_machine)| {
            let class = name(class);
            (medoid, GivenClass { class, by_machine })
        });
        given.collect()
    }

    /// The names of later clusters with these members. The earlier clusters were `ring` with three members and `pair` with two.
    fn after(members: &[u32], medoids: &[u64], message: &[(u64, &str, bool)]) -> Names {
        let before = Names::first(&[0, 3], &given(&[(0, "ring", false), (3, "pair", false)]));
        let change = Change::between(&stored(2, &[0, 0, 0, 1, 1]), &stored(medoids.len(), members));
        before.carried(4, &change, medoids, &given(message))
    }

    fn carried(class: &str, (place, shared, of): (usize, u64, u64)) -> Option<ClusterName> {
        let origin = Origin::Carried {
            version: 4,
            place,
            shared,
            of,
        };
        Some(ClusterName {
            class: name(class),
            origin,
        })
    }

    #[test]
    fn names_follow_the_majority_of_members() {
        let names = after(&[1, 1, 0, 0, 0], &[10, 11], &[]);
        assert_eq!(
            names.names,
            [carried("pair", (1, 2, 2)), carried("ring", (0, 2, 3))]
        );
        assert_eq!(names.uncarried, []);
    }

    #[test]
    fn of_two_names_that_meet_the_one_with_more_members_stays() {
        let names = after(&[0, 0, 0, 0, 0], &[10, 11], &[]);
        assert_eq!(names.names, [carried("ring", (0, 3, 3)), None]);
        let why = NotCarried::Outdone {
            place: 0,
            by: name("ring"),
        };
        assert_eq!(
            names.uncarried,
            [Uncarried {
                class: name("pair"),
                place: 1,
                why
            }]
        );
    }

    #[test]
    fn a_spread_cluster_keeps_no_name_and_what_a_person_says_goes_first() {
        let names = after(
            &[0, 0, 0, 0, 1],
            &[10, 11],
            &[(10, "swarm", false), (11, "wall", true)],
        );
        let own = |class, origin| {
            Some(ClusterName {
                class: name(class),
                origin,
            })
        };
        assert_eq!(
            names.names,
            [own("swarm", Origin::Person), own("wall", Origin::Judge)]
        );
        let spread = NotCarried::Spread {
            most_in: Some(0),
            shared: 1,
            of: 2,
        };
        let outdone = NotCarried::Outdone {
            place: 0,
            by: name("swarm"),
        };
        let lost = [("ring", 0, outdone), ("pair", 1, spread)];
        assert_eq!(
            names.uncarried,
            lost.map(|(class, place, why)| Uncarried {
                class: name(class),
                place,
                why
            })
        );
    }

    #[test]
    fn a_carried_name_goes_before_the_judges_and_the_judges_is_not_carried() {
        let names = after(&[0, 0, 0, 1, 1], &[10, 11], &[(10, "wall", true)]);
        assert_eq!(
            names.names,
            [carried("ring", (0, 3, 3)), carried("pair", (1, 2, 2))]
        );
        let judged = Names::first(&[0], &given(&[(0, "ring", true)]));
        let change = Change::between(&stored(1, &[0, 0]), &stored(1, &[0, 0]));
        assert_eq!(judged.carried(1, &change, &[1], &given(&[])).names, [None]);
    }
}

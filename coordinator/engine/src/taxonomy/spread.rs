//! The members of a cluster that show its spread.

use murmuration_search::novelty::Behaviours;

/// A member of a cluster: its index, and its distance to the medoid in units of the behaviour space.
pub type Place = (usize, f64);

/// The nearest, the median and the farthest member of each cluster, without its medoid; `None` if the medoid is the only member.
/// If the number of members is even, the median is the farther of the two members in the middle. `medoids` are indices of
/// individuals; `clusters` has for each individual the place of its medoid.
pub fn spreads(behaviours: &Behaviours, medoids: &[usize], clusters: &[u32]) -> Vec<Option<[Place; 3]>> {
    let mut members: Vec<Vec<Place>> = vec![Vec::new(); medoids.len()];
    for (member, &cluster) in clusters.iter().enumerate().take(behaviours.len()) {
        let place = cluster as usize;
        let medoid = medoids.get(place).filter(|&&medoid| medoid < behaviours.len());
        if let Some(&medoid) = medoid.filter(|&&medoid| medoid != member) {
            members[place].push((member, behaviours.squared_distance(member, medoid).sqrt()));
        }
    }
    members.into_iter().map(spread).collect()
}

fn spread(mut members: Vec<Place>) -> Option<[Place; 3]> {
    members.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    let median = members.get(members.len() / 2)?;
    Some([*members.first()?, *median, *members.last()?])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(places: &[f64]) -> Behaviours {
        let mut behaviours = Behaviours::new(1);
        for &place in places {
            behaviours.push(&[place]).unwrap();
        }
        behaviours
    }

    #[test]
    fn nearest_median_and_farthest_are_told_without_the_medoid() {
        let behaviours = line(&[0.0, 5.0, -1.0, 3.0, 100.0, 2.0]);
        let told = spreads(&behaviours, &[0, 4], &[0, 0, 0, 0, 1, 0]);
        assert_eq!(told, [Some([(2, 1.0), (3, 3.0), (1, 5.0)]), None]);
    }

    #[test]
    fn two_in_one_place_are_told_by_index() {
        let told = spreads(&line(&[1.0, 1.0, 1.0]), &[1], &[0, 0, 0]);
        assert_eq!(told, [Some([(0, 0.0), (2, 0.0), (2, 0.0)])]);
    }

    #[test]
    fn answers_that_do_not_fit_together_are_no_spread() {
        assert_eq!(spreads(&line(&[0.0]), &[7], &[0, 0, 3]), [None]);
    }
}

//! Individuals of an archive that are least like one of them.

use murmuration_search::{
    interrupt::{Interrupt, Interrupted},
    medoids,
    novelty::Behaviours,
};
use murmuration_swarm::{CampaignSpec, Purpose, RandomStream};

/// The individuals are chosen from one in this many behaviours, those farthest from the given one.
const FARTHEST: usize = 4;

/// At most `count` behaviours from the quarter that is farthest from behaviour `index`: the farthest of all, then each the farthest
/// from all chosen before. Behaviours far from their neighbours come last, as in
/// [`Strategy::Coverage`](super::Strategy::Coverage). If the quarter has fewer than `count` behaviours, the farthest `count` are
/// returned.
///
/// # Errors
/// [`Interrupted`] once `interrupt` is raised.
pub(super) fn unlike(
    behaviours: &Behaviours,
    index: usize,
    count: usize,
    spec: &CampaignSpec,
    interrupt: &Interrupt,
) -> Result<Vec<usize>, Interrupted> {
    let distance = |&other: &usize| behaviours.squared_distance(index, other);
    let mut far: Vec<usize> = (0..behaviours.len()).filter(|&other| other != index).collect();
    far.sort_by(|one, other| distance(other).total_cmp(&distance(one)));
    far.truncate((behaviours.len() / FARTHEST).max(count));
    if far.is_empty() {
        return Ok(far);
    }
    let mut stream = RandomStream::derive(spec.seed(), Purpose::Query, 0);
    let neighbours = spec.search().neighbours() as usize;
    let further = count.saturating_sub(1);
    let among = behaviours.among(&far);
    let order = medoids::order(&among, vec![0], further, neighbours, &mut stream, interrupt)?;
    let chosen = [0].into_iter().chain(order).take(count);
    Ok(chosen.map(|place| far[place]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(points: &[f64], index: usize, count: usize) -> Vec<usize> {
        let spec = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"random\"").unwrap();
        let mut behaviours = Behaviours::new(1);
        for &point in points {
            behaviours.push(&[point]).unwrap();
        }
        unlike(&behaviours, index, count, &spec, &Interrupt::default()).unwrap()
    }

    #[test]
    fn the_individuals_are_far_from_the_given_one_and_from_each_other() {
        // Sixteen behaviours from 0 to 15; the farthest quarter from 3 is 12 to 15.
        let line: Vec<f64> = (0..16).map(f64::from).collect();
        assert_eq!(chosen(&line, 3, 2), [15, 12]);
        // A quarter is too few: of the farthest six, 10 to 15, these are far from each other.
        let mut six = chosen(&line, 3, 6);
        assert_eq!(six[..2], [15, 10]);
        six.sort_unstable();
        assert_eq!(six, [10, 11, 12, 13, 14, 15]);
    }

    #[test]
    fn an_archive_may_have_fewer_individuals() {
        assert_eq!(chosen(&[1.0, 5.0, 2.0], 0, 50), [1, 2]);
        assert!(chosen(&[1.0], 0, 50).is_empty());
    }
}

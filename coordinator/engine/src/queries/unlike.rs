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
    let far = farthest(
        behaviours,
        index,
        (behaviours.len() / FARTHEST).max(count),
        interrupt,
    )?;
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

/// The `count` behaviours that are farthest from behaviour `index`, the farthest first; of equally far ones, the first of the archive.
fn farthest(
    behaviours: &Behaviours,
    index: usize,
    count: usize,
    interrupt: &Interrupt,
) -> Result<Vec<usize>, Interrupted> {
    let others = (0..behaviours.len()).filter(|&other| other != index);
    let mut distances: Vec<(f64, usize)> = others
        .map(|other| (behaviours.squared_distance(index, other), other))
        .collect();
    interrupt.check()?;
    let farther =
        |one: &(f64, usize), other: &(f64, usize)| other.0.total_cmp(&one.0).then(one.1.cmp(&other.1));
    if count < distances.len() {
        distances.select_nth_unstable_by(count, farther);
        distances.truncate(count);
    }
    distances.sort_unstable_by(farther);
    interrupt.check()?;
    Ok(distances.into_iter().map(|(_, other)| other).collect())
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
    fn the_farthest_of_equally_far_behaviours_are_the_first_ones() {
        let mut behaviours = Behaviours::new(1);
        for point in [0.0, 2.0, -2.0, 1.0, -1.0, 2.0] {
            behaviours.push(&[point]).unwrap();
        }
        let interrupt = Interrupt::default();
        let farthest = |count| farthest(&behaviours, 0, count, &interrupt);
        assert_eq!(farthest(0), Ok(vec![]));
        assert_eq!(farthest(2), Ok(vec![1, 2]));
        assert_eq!(farthest(9), Ok(vec![1, 2, 5, 3, 4]));
        interrupt.raise();
        assert_eq!(farthest(2), Err(Interrupted));
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

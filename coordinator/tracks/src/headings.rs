//! Headings that no camera measured.

use crate::{Sighting, filmed::Filmed};

/// Most steps before and after a step whose motion says where a robot looks.
const MOST_STEPS: usize = 5;

/// The heading of a robot at each step of its path, radians: where none is known, the direction of the motion about the step; where
/// there is hardly one, the heading before, or else the first that there is; 0 if there is none.
pub(crate) fn complete(path: &[Sighting], filmed: &Filmed<'_>) -> Vec<f64> {
    let known: Vec<Option<f64>> = (0..path.len())
        .map(|step| path[step].heading.or_else(|| direction(path, step, filmed)))
        .collect();
    let mut last = known.iter().flatten().next().copied().unwrap_or(0.0);
    let kept = known.into_iter().map(|heading| {
        last = heading.unwrap_or(last);
        last
    });
    kept.collect()
}

/// The direction of the motion from some steps before to as many after, the fewest in which it is no jitter; `None` if there are
/// none.
fn direction(path: &[Sighting], step: usize, filmed: &Filmed<'_>) -> Option<f64> {
    (1..=MOST_STEPS).find_map(|steps| {
        let before = path[step.saturating_sub(steps)];
        let after = path[(step + steps).min(path.len() - 1)];
        let [x, y] = filmed.world().way(before.at, after.at);
        (x.hypot(y) > filmed.still()).then(|| y.atan2(x))
    })
}

//! From the frames of a film to the steps of a world.

use crate::{Filmed, MAX_GAP_FRAMES, Sighting, Tracks, TracksError, file::Robot};
use murmuration_swarm::Invalid;
use std::{collections::BTreeMap, f64::consts::TAU};

/// Maximum number of poses of a motion (480 MB).
pub const MAX_POSES: u64 = 20_000_000;

/// Maximum number of steps before and after a step over which the direction of motion at this step is measured.
const MOST_STEPS: usize = 5;

impl Tracks {
    /// The pose (x, y, heading; world units and radians) of each robot, in the order of their numbers, at the end of the film and
    /// before each of the last `steps` steps. If the film is shorter than that, there are fewer steps.
    ///
    /// Between two frames, and over gaps of up to [`MAX_GAP_FRAMES`], a robot moves straight ahead at one speed and turns the
    /// shorter way. Before its first frame and after its last, a robot stands still, for at most [`MAX_GAP_FRAMES`]. An unknown
    /// heading is the direction of motion over the fewest steps, up to five before and five after, in which the robot moves by
    /// more than a fifth of the largest radius. A robot that moves by less keeps its last heading.
    ///
    /// # Errors
    /// If the film is shorter than a step, a robot is missing for more than [`MAX_GAP_FRAMES`], or the motion would have more
    /// than [`MAX_POSES`].
    pub fn ending(&self, steps: u32, filmed: &Filmed<'_>) -> Result<Vec<Vec<[f64; 3]>>, TracksError> {
        let [first, last] = self.frames().map(f64::from);
        let whole = ((last - first) / filmed.frames_a_step).floor();
        // If `whole` is too large for `u32`, the cast saturates.
        let steps = steps.min(whole as u32);
        if steps == 0 {
            return Err(TracksError::Short(self.path.clone()));
        }
        let poses = (u64::from(steps) + 1) * u64::from(self.robots());
        if poses > MAX_POSES {
            let allowed = format!("small enough to keep {poses} poses under {MAX_POSES}");
            return Err(Invalid::new("image.window", steps, allowed).into());
        }
        // Moments are counted from the end of the film, so that they coincide with frames if there is one frame per step.
        let moments = (0..=steps).map(|step| last - f64::from(steps - step) * filmed.frames_a_step);
        let moments: Vec<f64> = moments.collect();
        let mut frames = vec![Vec::with_capacity(self.robots.len()); moments.len()];
        for robot in &self.robots {
            let at = |&moment: &f64| {
                self.check_gap(robot, moment)
                    .map(|()| seen(&robot.sightings, moment, filmed))
            };
            let path = moments.iter().map(at).collect::<Result<Vec<_>, _>>()?;
            let headings = headings(&path, filmed);
            for ((frame, sighting), heading) in frames.iter_mut().zip(&path).zip(headings) {
                frame.push([sighting.at[0], sighting.at[1], heading]);
            }
        }
        Ok(frames)
    }

    /// Checks that the gap around a moment is not too long.
    fn check_gap(&self, robot: &Robot, moment: f64) -> Result<(), TracksError> {
        let [before, after] = around(&robot.sightings, moment);
        let [first, last] = self.frames();
        let missing = match (before, after) {
            (Some((before, _)), Some((after, _))) if before == after => return Ok(()),
            (Some((before, _)), Some((after, _))) => [before + 1, after - 1],
            (None, Some((after, _))) => [first, after - 1],
            (Some((before, _)), None) => [before + 1, last],
            // Every robot has a sighting.
            (None, None) => [first, last],
        };
        // Adjacent frames have no gap.
        let count = (u64::from(missing[1]) + 1).saturating_sub(missing[0].into());
        if count <= u64::from(MAX_GAP_FRAMES) {
            return Ok(());
        }
        Err(TracksError::Gap {
            path: self.path.clone(),
            robot: robot.name.clone(),
            frames: missing,
        })
    }
}

/// The last sighting at or before a moment, and the first one at or after it.
fn around(sightings: &BTreeMap<u32, Sighting>, moment: f64) -> [Option<(u32, Sighting)>; 2] {
    // Moments lie between the first frame and the last.
    let before = sightings.range(..=moment.floor() as u32).next_back();
    let after = sightings.range(moment.ceil() as u32..).next();
    let own = |found: Option<(&u32, &Sighting)>| found.map(|(frame, sighting)| (*frame, *sighting));
    [own(before), own(after)]
}

/// A robot at a moment, in world coordinates.
fn seen(sightings: &BTreeMap<u32, Sighting>, moment: f64, filmed: &Filmed<'_>) -> Sighting {
    let placed = |sighting: Sighting| Sighting {
        at: filmed.place(sighting.at),
        heading: sighting.heading.map(|heading| filmed.turn(heading)),
    };
    let (before, after) = match around(sightings, moment) {
        [Some(before), Some(after)] if before.0 < after.0 => (before, after),
        [Some((_, only)), _] | [None, Some((_, only))] => return placed(only),
        // Every robot has a sighting.
        [None, None] => {
            return Sighting {
                at: filmed.place([0.0; 2]),
                heading: None,
            };
        }
    };
    let share = (moment - f64::from(before.0)) / (f64::from(after.0) - f64::from(before.0));
    let (before, after) = (placed(before.1), placed(after.1));
    let way = filmed.world.way(before.at, after.at);
    let turned = |from: f64, to: f64| {
        let turn = to - from;
        from + share * (turn - TAU * (turn / TAU).round())
    };
    Sighting {
        at: [0, 1].map(|axis| before.at[axis] + share * way[axis]),
        heading: before
            .heading
            .zip(after.heading)
            .map(|(from, to)| turned(from, to)),
    }
}

/// The heading of a robot at each step of its path, in radians. An unknown heading is the direction of motion around the step. A
/// robot that hardly moves keeps its previous heading; at the beginning it has the first known heading, or 0 if no heading is
/// known.
fn headings(path: &[Sighting], filmed: &Filmed<'_>) -> Vec<f64> {
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

/// The direction of motion from some steps before a step to as many steps after: the fewest steps in which the motion exceeds the
/// camera's jitter. `None` if the motion exceeds jitter in no number of steps up to [`MOST_STEPS`].
fn direction(path: &[Sighting], step: usize, filmed: &Filmed<'_>) -> Option<f64> {
    (1..=MOST_STEPS).find_map(|steps| {
        let before = path[step.saturating_sub(steps)];
        let after = path[(step + steps).min(path.len() - 1)];
        let [x, y] = filmed.world.way(before.at, after.at);
        (x.hypot(y) > filmed.still()).then(|| y.atan2(x))
    })
}

#[cfg(test)]
mod tests;

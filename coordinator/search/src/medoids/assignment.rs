//! Which medoid every point belongs to, and what a swap would change.

use crate::{
    interrupt::{Interrupt, Interrupted},
    novelty::Behaviours,
};
use rayon::prelude::*;

/// A point's nearest medoid and the next.
#[derive(Debug, Clone, Copy)]
struct Ranked {
    /// Places of the two among the medoids.
    nearest: u32,
    second: u32,
    /// Their distances; the second is infinite where there is only one medoid.
    to_nearest: f64,
    to_second: f64,
}

/// The exchange of one medoid for a candidate.
#[derive(Debug, Clone, Copy)]
pub(super) struct Swap {
    /// The point that becomes a medoid.
    pub(super) candidate: usize,
    /// Place of the medoid that it takes.
    pub(super) place: usize,
    /// What is added to the loss.
    pub(super) change: f64,
}

/// Medoids, and every point's two nearest among them.
#[derive(Debug, Clone)]
pub(super) struct Assignment<'p> {
    points: &'p Behaviours,
    medoids: Vec<usize>,
    ranked: Vec<Ranked>,
    /// For each medoid, by how much the loss grows if it is dropped (not meaningful where it is the only one).
    removal: Vec<f64>,
    loss: f64,
}

impl<'p> Assignment<'p> {
    pub(super) fn new(
        points: &'p Behaviours,
        medoids: Vec<usize>,
        interrupt: &Interrupt,
    ) -> Result<Self, Interrupted> {
        let ranked = (0..points.len())
            .into_par_iter()
            .map(|point| {
                interrupt.check()?;
                Ok(rank(points, &medoids, point))
            })
            .collect::<Result<_, Interrupted>>()?;
        Ok(Self::with_ranks(points, medoids, ranked))
    }

    fn with_ranks(points: &'p Behaviours, medoids: Vec<usize>, ranked: Vec<Ranked>) -> Self {
        // In the order of the points, so that a set of medoids has one loss, however it was come by.
        let loss = ranked.iter().fold(0.0, |sum, point| sum + point.to_nearest);
        let mut removal = vec![0.0; medoids.len()];
        for point in &ranked {
            removal[point.nearest as usize] += point.to_second - point.to_nearest;
        }
        Self {
            points,
            medoids,
            ranked,
            removal,
            loss,
        }
    }

    pub(super) const fn points(&self) -> &'p Behaviours {
        self.points
    }

    pub(super) const fn loss(&self) -> f64 {
        self.loss
    }

    pub(super) fn into_medoids(self) -> Vec<usize> {
        self.medoids
    }

    /// The best exchange of a medoid for `candidate`; `None` if it is one already.
    pub(super) fn best_swap(&self, candidate: usize) -> Option<Swap> {
        if self.medoids.contains(&candidate) {
            return None;
        }
        if self.medoids.len() == 1 {
            let mut loss = 0.0;
            self.points
                .each_squared_distance(candidate, |_, squared| loss += squared.sqrt());
            let change = loss - self.loss;
            return Some(Swap {
                candidate,
                place: 0,
                change,
            });
        }
        // What all points that come nearer gain, whichever medoid goes; and the change if that one goes.
        let mut gain = 0.0;
        let mut changes = self.removal.clone();
        self.points.each_squared_distance(candidate, |point, squared| {
            let ranked = &self.ranked[point];
            let distance = squared.sqrt();
            if distance < ranked.to_nearest {
                gain += ranked.to_nearest - distance;
                changes[ranked.nearest as usize] -= ranked.to_second - ranked.to_nearest;
            } else if distance < ranked.to_second {
                changes[ranked.nearest as usize] -= ranked.to_second - distance;
            }
        });
        let (place, &change) = changes.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1))?;
        let change = change - gain;
        Some(Swap {
            candidate,
            place,
            change,
        })
    }

    /// The assignment after `swap`.
    pub(super) fn after(&self, swap: &Swap) -> Self {
        let mut medoids = self.medoids.clone();
        medoids[swap.place] = swap.candidate;
        let ranked = self
            .ranked
            .par_iter()
            .enumerate()
            .map(|(point, ranked)| rerank(self.points, &medoids, point, ranked, swap))
            .collect();
        Self::with_ranks(self.points, medoids, ranked)
    }
}

impl Ranked {
    const NONE: Self = Self {
        nearest: 0,
        second: 0,
        to_nearest: f64::INFINITY,
        to_second: f64::INFINITY,
    };

    /// With the medoid at `place`, at `distance`, taken into account.
    fn with(self, place: u32, distance: f64) -> Self {
        if distance < self.to_nearest {
            Self {
                nearest: place,
                to_nearest: distance,
                second: self.nearest,
                to_second: self.to_nearest,
            }
        } else if distance < self.to_second {
            Self {
                second: place,
                to_second: distance,
                ..self
            }
        } else {
            self
        }
    }
}

fn rank(points: &Behaviours, medoids: &[usize], point: usize) -> Ranked {
    (0..).zip(medoids).fold(Ranked::NONE, |ranked, (place, &medoid)| {
        ranked.with(place, points.squared_distance(point, medoid).sqrt())
    })
}

/// The rank of `point` after `swap`, `medoids` being those after it: only where one of the two nearest went do
/// all of them have to be looked at.
fn rerank(points: &Behaviours, medoids: &[usize], point: usize, before: &Ranked, swap: &Swap) -> Ranked {
    let place = swap.place as u32;
    if before.nearest == place || before.second == place {
        return rank(points, medoids, point);
    }
    before.with(place, points.squared_distance(point, swap.candidate).sqrt())
}

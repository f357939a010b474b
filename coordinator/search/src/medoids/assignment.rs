//! The assignment of points to medoids, and the change of the loss by a swap.

use crate::{
    interrupt::{Interrupt, Interrupted},
    lanes::{LANES, Lanes, with_dimensions},
    novelty::Behaviours,
};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use std::sync::Arc;

/// Upper bound of the relative error by which a squared distance can exceed the square of its rounded root.
const ROUNDING: f64 = 1e-15;

/// Number of blocks whose distances are computed before any of them is examined.
const STRETCH: usize = 8;

/// A point's two nearest medoids.
#[derive(Debug, Clone, Copy)]
struct Ranked {
    /// Places of the two nearest medoids among all medoids.
    nearest: u32,
    second: u32,
    /// Distances to the two nearest medoids; the second distance is infinite if there is only one medoid.
    to_nearest: f64,
    to_second: f64,
}

/// The exchange of one medoid for a candidate.
#[derive(Debug, Clone, Copy)]
pub(super) struct Swap {
    /// The point that becomes a medoid.
    pub(super) candidate: usize,
    /// Place of the medoid that the candidate replaces.
    pub(super) place: usize,
    /// Change of the loss.
    pub(super) change: f64,
}

/// Medoids, and the two nearest medoids of every point.
#[derive(Debug, Clone)]
pub(super) struct Assignment<'p> {
    points: &'p Behaviours,
    lanes: Arc<Lanes>,
    medoids: Vec<usize>,
    ranked: Vec<Ranked>,
    /// For each point a squared distance; a candidate at this distance or beyond is no nearer than the point's second medoid.
    limits: Vec<[f64; LANES]>,
    /// For each medoid, the growth of the loss if it is dropped (meaningless for a single medoid).
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
        let lanes = Lanes::new(
            points.dims(),
            (0..points.len()).map(|point| points.values_of(point)),
        );
        Ok(Self::with_ranks(points, Arc::new(lanes), medoids, ranked))
    }

    fn with_ranks(
        points: &'p Behaviours,
        lanes: Arc<Lanes>,
        medoids: Vec<usize>,
        ranked: Vec<Ranked>,
    ) -> Self {
        // The sum is in the order of the points, so that the loss depends only on the set of medoids.
        let loss = ranked.iter().fold(0.0, |sum, point| sum + point.to_nearest);
        let mut removal = vec![0.0; medoids.len()];
        for point in &ranked {
            removal[point.nearest as usize] += point.to_second - point.to_nearest;
        }
        let mut limits = vec![[0.0; LANES]; lanes.blocks()];
        for (limit, point) in limits.as_flattened_mut().iter_mut().zip(&ranked) {
            *limit = point.to_second * point.to_second * (1.0 + ROUNDING) + f64::MIN_POSITIVE;
        }
        Self {
            points,
            lanes,
            medoids,
            ranked,
            limits,
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

    /// The best exchange of a medoid for `candidate`; `None` if `candidate` is a medoid already.
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
        let mut changes = self.removal.clone();
        let gain = Weighing {
            assignment: self,
            origin: self.points.values_of(candidate),
            changes: &mut changes,
        }
        .gain();
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
        Self::with_ranks(self.points, Arc::clone(&self.lanes), medoids, ranked)
    }
}

/// A candidate that is weighed against all medoids.
struct Weighing<'a, 'p> {
    assignment: &'a Assignment<'p>,
    /// The candidate's values.
    origin: &'a [f64],
    /// For each medoid, the change of the loss, without the gain, if the candidate replaces that medoid. The initial change
    /// assumes that the candidate is nearer to no point.
    changes: &'a mut [f64],
}

impl Weighing<'_, '_> {
    /// The gain of all points that are nearer to the candidate than to their medoid, whichever medoid is dropped. Also completes
    /// `changes`.
    fn gain(self) -> f64 {
        with_dimensions!(self.origin.len(), weigh, self)
    }
}

fn weigh<const D: usize>(weighing: Weighing<'_, '_>) -> f64 {
    Arch::new().dispatch(Weigh::<D>(weighing))
}

/// The weighing in `D` dimensions, or in any number of dimensions if `D` is 0.
struct Weigh<'a, 'p, const D: usize>(Weighing<'a, 'p>);

impl<const D: usize> WithSimd for Weigh<'_, '_, D> {
    type Output = f64;

    /// Skips most points by their squared distance alone: each of these points has two medoids that are nearer than the
    /// candidate. Sums the other points in their order.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let Weighing {
            assignment,
            origin,
            changes,
        } = self.0;
        let mut gain = 0.0;
        let mut squared = [[0.0; LANES]; STRETCH];
        let mut near = [0_u8; LANES * STRETCH];
        for (first, limits) in (0..).step_by(STRETCH).zip(assignment.limits.chunks(STRETCH)) {
            for (block, squared) in (first..first + limits.len()).zip(&mut squared) {
                *squared = assignment.lanes.squared_distances::<D>(block, origin);
            }
            let squared = squared.as_flattened();
            let mut count = 0;
            for (place, (squared, limit)) in squared.iter().zip(limits.as_flattened()).enumerate() {
                near[count] = place as u8;
                count += usize::from(squared < limit);
            }
            for &place in &near[..count] {
                let ranked = &assignment.ranked[first * LANES + usize::from(place)];
                let distance = squared[usize::from(place)].sqrt();
                gain += (ranked.to_nearest - distance).max(0.0);
                changes[ranked.nearest as usize] -=
                    (ranked.to_second - distance.max(ranked.to_nearest)).max(0.0);
            }
        }
        gain
    }
}

impl Ranked {
    const NONE: Self = Self {
        nearest: 0,
        second: 0,
        to_nearest: f64::INFINITY,
        to_second: f64::INFINITY,
    };

    /// The rank with one more medoid, which is at `place` among the medoids and at `distance` from the point.
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

/// The rank of `point` after `swap`; `medoids` are the medoids after the swap. The function examines all medoids only if the swap
/// dropped one of the point's two nearest medoids.
fn rerank(points: &Behaviours, medoids: &[usize], point: usize, before: &Ranked, swap: &Swap) -> Ranked {
    let place = swap.place as u32;
    if before.nearest == place || before.second == place {
        return rank(points, medoids, point);
    }
    before.with(place, points.squared_distance(point, swap.candidate).sqrt())
}

//! The exact medoid of one cluster, without measuring every pair.
//!
//! The sum of the distances from a place to all members is a convex function of the place. The sum and its gradient at one member
//! give a tangent plane, which bounds the sum from below at every other member. A member whose bound is above the least sum so
//! far need not be evaluated. Members are evaluated in the order of their distance from the geometric median, because the best
//! members are near it. In five dimensions, some tens of evaluations, each over all members, rule out the other members of a
//! cluster of any size.

use super::swaps::LEAST_GAIN;
use crate::{
    interrupt::{Interrupt, Interrupted},
    lanes::{LANES, Lanes, with_dimensions},
    novelty::Behaviours,
};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// Maximum number of evaluated members, which bounds the time in many dimensions, where planes rule out few members.
const MOST_LOOKS: usize = 512;

/// Steps of Weiszfeld's iteration towards the geometric median, which only determines an order and need not be exact.
const WEISZFELD_STEPS: usize = 12;

/// Number of blocks that are summed separately. The bits of the sum depend on this number.
const CHUNK: usize = 512;

struct Members<'a> {
    points: &'a Behaviours,
    indices: &'a [usize],
    lanes: Lanes,
}

/// The sum of distances at a place.
struct Sum {
    distances: f64,
    /// Gradient of the sum (a subgradient if a member lies at the place itself).
    gradient: Vec<f64>,
    /// Sum of the reciprocals of the non-zero distances.
    pull: f64,
}

/// The member with the least total distance to all members. If no member saves more than a rounding error against the member
/// `current`, returns `current`.
pub(super) fn medoid(
    points: &Behaviours,
    indices: &[usize],
    current: usize,
    interrupt: &Interrupt,
) -> Result<usize, Interrupted> {
    let members = Members {
        points,
        indices,
        lanes: Lanes::new(
            points.dims(),
            indices.iter().map(|&index| points.values_of(index)),
        ),
    };
    let mut best = (members.sum(points.values_of(current)).distances, current);
    let median = members.geometric_median(current, interrupt)?;
    let mut open = members.by_distance_from(&median);
    for _ in 0..MOST_LOOKS {
        interrupt.check()?;
        let Some(&(_, next)) = open.last() else {
            break;
        };
        let place = points.values_of(next);
        let sum = members.sum(place);
        if sum.distances < best.0 * (1.0 - LEAST_GAIN) {
            best = (sum.distances, next);
        }
        open.pop();
        open.retain(|&(_, other)| sum.at_least(place, points.values_of(other)) < best.0 * (1.0 - LEAST_GAIN));
    }
    Ok(best.1)
}

impl Sum {
    /// Lower bound of the sum at `other`, from the tangent plane at `place`.
    fn at_least(&self, place: &[f64], other: &[f64]) -> f64 {
        let slope = self.gradient.iter().zip(place.iter().zip(other));
        slope.fold(self.distances, |sum, (gradient, (from, to))| {
            sum + gradient * (to - from)
        })
    }
}

impl Members<'_> {
    /// Sums the distances in each chunk, then over the chunks, so that the bits do not depend on the number of threads.
    fn sum(&self, place: &[f64]) -> Sum {
        let starts = (0..self.lanes.blocks()).step_by(CHUNK).collect::<Vec<_>>();
        let parts: Vec<Sum> = starts
            .into_par_iter()
            .map(|first| {
                let last = (first + CHUNK).min(self.lanes.blocks());
                let task = Summing {
                    lanes: &self.lanes,
                    blocks: first..last,
                    place,
                };
                with_dimensions!(place.len(), sum_of, task)
            })
            .collect();
        let nothing = Sum {
            distances: 0.0,
            gradient: vec![0.0; place.len()],
            pull: 0.0,
        };
        parts.into_iter().fold(nothing, |mut sum, part| {
            sum.distances += part.distances;
            sum.pull += part.pull;
            for (total, gradient) in sum.gradient.iter_mut().zip(part.gradient) {
                *total += gradient;
            }
            sum
        })
    }

    /// Approximate place of the least sum of distances (the geometric median), by Weiszfeld's iteration from `start`.
    fn geometric_median(&self, start: usize, interrupt: &Interrupt) -> Result<Vec<f64>, Interrupted> {
        let mut place = self.points.values_of(start).to_vec();
        for _ in 0..WEISZFELD_STEPS {
            interrupt.check()?;
            let sum = self.sum(&place);
            if sum.pull <= 0.0 || !sum.pull.is_finite() {
                break;
            }
            for (value, gradient) in place.iter_mut().zip(&sum.gradient) {
                *value -= gradient / sum.pull;
            }
        }
        Ok(place)
    }

    /// The members with their squared distances from `median`, the nearest last.
    fn by_distance_from(&self, median: &[f64]) -> Vec<(f64, usize)> {
        let squared = |index: usize| {
            let offsets = self.points.values_of(index).iter().zip(median);
            offsets.map(|(a, b)| (a - b) * (a - b)).sum::<f64>()
        };
        let mut order: Vec<_> = self
            .indices
            .iter()
            .map(|&index| (squared(index), index))
            .collect();
        order.par_sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(b.1.cmp(&a.1)));
        order
    }
}

/// A part of the sum of distances from `place`.
struct Summing<'a> {
    lanes: &'a Lanes,
    blocks: std::ops::Range<usize>,
    place: &'a [f64],
}

fn sum_of<const D: usize>(task: Summing<'_>) -> Sum {
    let mut gradient = vec![[0.0; LANES]; task.place.len()];
    let (distances, pull) = Arch::new().dispatch(SumOf::<D>(task, &mut gradient));
    Sum {
        distances: distances.iter().sum(),
        pull: pull.iter().sum(),
        gradient: gradient.iter().map(|lanes| lanes.iter().sum()).collect(),
    }
}

struct SumOf<'a, const D: usize>(Summing<'a>, &'a mut [[f64; LANES]]);

impl<const D: usize> WithSimd for SumOf<'_, D> {
    type Output = ([f64; LANES], [f64; LANES]);

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        let Self(Summing { lanes, blocks, place }, gradient) = self;
        let (mut distances, mut pull) = ([0.0; LANES], [0.0; LANES]);
        for block in blocks {
            let squared = lanes.squared_distances::<D>(block, place);
            let mut nearness = [0.0; LANES];
            for lane in 0..LANES {
                // The missing points of a block are infinitely far.
                let counts = squared[lane] > 0.0 && squared[lane] < f64::INFINITY;
                let distance = squared[lane].sqrt();
                distances[lane] += if counts { distance } else { 0.0 };
                nearness[lane] = if counts { 1.0 / distance } else { 0.0 };
                pull[lane] += nearness[lane];
            }
            for ((row, from), gradient) in lanes.rows(block).iter().zip(place).zip(gradient.iter_mut()) {
                for lane in 0..LANES {
                    let share = (from - row[lane]) * nearness[lane];
                    gradient[lane] += if nearness[lane] > 0.0 { share } else { 0.0 };
                }
            }
        }
        (distances, pull)
    }
}

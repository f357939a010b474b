//! A centroidal Voronoi tessellation, which divides a region of the behaviour space into cells of about equal size, as in
//! CVT-MAP-Elites (Vassiliades, Chatzilygeroudis and Mouret 2018).
//!
//! The region is the part of the space where points lie, whatever their density: each occupied box of a fine grid counts once.
//! Cells begin at boxes that are far from each other (Gonzalez 1985), and Lloyd's algorithm (1982) moves each cell to the mean of
//! its boxes. Nothing is random, so equal points have equal cells. The module depends neither on archives nor on classes.

#[cfg(test)]
mod tests;

use crate::{
    interrupt::{Interrupt, Interrupted},
    novelty::Behaviours,
};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Boxes along each dimension. An atlas of 194,481 controllers in five dimensions occupies some ten thousand boxes.
const BOXES: usize = 24;
/// Maximum number of steps of Lloyd's algorithm; cells hardly move after some thirty.
const MOST_STEPS: usize = 100;

/// Cells of a behaviour space, each about a centroid.
#[derive(Debug, Clone, PartialEq)]
pub struct Tessellation {
    centroids: Behaviours,
}

impl Tessellation {
    /// Divides the region in which `points` lie into `cells` cells, or into fewer cells if fewer boxes are occupied.
    ///
    /// # Errors
    /// [`Interrupted`] once `interrupt` is raised.
    pub fn of(points: &Behaviours, cells: usize, interrupt: &Interrupt) -> Result<Self, Interrupted> {
        let boxes = one_of_each_box(points);
        let mut tessellation = Self {
            centroids: boxes.among(&far_apart(&boxes, cells, interrupt)?),
        };
        let mut members = Vec::new();
        for _ in 0..MOST_STEPS {
            interrupt.check()?;
            let now = tessellation.cells_of(&boxes);
            if now == members {
                break;
            }
            tessellation.move_to_means(&boxes, &now);
            members = now;
        }
        Ok(tessellation)
    }

    #[must_use]
    pub const fn about(centroids: Behaviours) -> Self {
        Self { centroids }
    }

    /// The centroid of each cell.
    #[must_use]
    pub const fn centroids(&self) -> &Behaviours {
        &self.centroids
    }

    /// The cell of each point: the cell with the nearest centroid, or the first of several cells with equally near centroids.
    /// Without cells, every point has the cell 0.
    ///
    /// # Panics
    /// Panics if the points have other dimensions than the centroids.
    #[must_use]
    pub fn cells_of(&self, points: &Behaviours) -> Vec<usize> {
        let nearest = |point: usize| {
            let point = points.values_of(point);
            let mut nearest = (0, f64::INFINITY);
            for cell in 0..self.centroids.len() {
                let distance = self.centroids.squared_distance_to(cell, point);
                if distance < nearest.1 {
                    nearest = (cell, distance);
                }
            }
            nearest.0
        };
        (0..points.len()).into_par_iter().map(nearest).collect()
    }

    /// Moves each centroid to the mean of its members; a centroid without members stays.
    fn move_to_means(&mut self, points: &Behaviours, cells: &[usize]) {
        let mut means = vec![(0_usize, vec![0.0; points.dims()]); self.centroids.len()];
        for (point, &cell) in cells.iter().enumerate() {
            let (count, sum) = &mut means[cell];
            *count += 1;
            sum.iter_mut()
                .zip(points.values_of(point))
                .for_each(|(sum, value)| *sum += value);
        }
        let mut moved = Behaviours::new(points.dims());
        for (cell, (count, sum)) in means.iter().enumerate() {
            let mean: Vec<f64> = match count {
                0 => self.centroids.values_of(cell).to_vec(),
                count => sum.iter().map(|sum| sum / *count as f64).collect(),
            };
            // The mean of valid values is valid.
            let _ = moved.push(&mean);
        }
        self.centroids = moved;
    }
}

/// The first point in each occupied box, in the order of the points.
fn one_of_each_box(points: &Behaviours) -> Behaviours {
    let ranges: Vec<[f64; 2]> = (0..points.dims()).map(|axis| range(points, axis)).collect();
    let box_of = |point: usize| -> Vec<usize> {
        let values = points.values_of(point).iter().zip(&ranges);
        let place = values.map(|(value, [low, high])| match high > low {
            true => (((value - low) / (high - low) * BOXES as f64) as usize).min(BOXES - 1),
            false => 0,
        });
        place.collect()
    };
    let mut first: BTreeMap<Vec<usize>, usize> = BTreeMap::new();
    for point in 0..points.len() {
        first.entry(box_of(point)).or_insert(point);
    }
    let mut kept: Vec<usize> = first.into_values().collect();
    kept.sort_unstable();
    points.among(&kept)
}

fn range(points: &Behaviours, axis: usize) -> [f64; 2] {
    let values = (0..points.len()).map(|point| points.values_of(point)[axis]);
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
        [low.min(value), high.max(value)]
    })
}

/// At most `count` points far from each other: the first point, then repeatedly the point that is farthest from all points before
/// it. No two of these points coincide.
fn far_apart(points: &Behaviours, count: usize, interrupt: &Interrupt) -> Result<Vec<usize>, Interrupted> {
    let mut distances = vec![f64::INFINITY; points.len()];
    let mut chosen = Vec::new();
    let mut next = (!points.is_empty() && count > 0).then_some(0);
    while let Some(origin) = next {
        interrupt.check()?;
        chosen.push(origin);
        points.each_squared_distance(origin, |point, distance| {
            distances[point] = distances[point].min(distance);
        });
        let farthest = distances.iter().enumerate();
        let farthest = farthest.max_by(|(a, one), (b, other)| one.total_cmp(other).then(b.cmp(a)));
        next = farthest
            .filter(|(_, distance)| **distance > 0.0 && chosen.len() < count)
            .map(|(point, _)| point);
    }
    Ok(chosen)
}

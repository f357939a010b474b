//! Initial medoids.

use crate::{
    interrupt::{Interrupt, Interrupted},
    novelty::Behaviours,
};
use murmuration_swarm::RandomStream;
use rand::RngExt as _;

/// Draws `k` different points (`k` is at most the number of points): the first point uniformly, each other point with a
/// probability proportional to its distance from the nearest chosen point (k-means++ for a loss of distances that are not
/// squared).
///
/// Points that coincide with a chosen point are not drawn. If no other points are left, the points with the lowest free indices
/// are taken.
pub(super) fn seed(
    points: &Behaviours,
    k: usize,
    stream: &mut RandomStream,
    interrupt: &Interrupt,
) -> Result<Vec<usize>, Interrupted> {
    let mut seeds = Vec::with_capacity(k);
    let mut distances = vec![f64::INFINITY; points.len()];
    while seeds.len() < k {
        interrupt.check()?;
        let drawn = match seeds.is_empty() {
            true => Some(stream.below(points.len() as u64) as usize),
            false => draw(&distances, stream),
        };
        let Some(drawn) = drawn else {
            break;
        };
        seeds.push(drawn);
        points.each_squared_distance(drawn, |point, squared| {
            distances[point] = distances[point].min(squared.sqrt());
        });
    }
    let free: Vec<usize> = (0..points.len())
        .filter(|point| !seeds.contains(point))
        .take(k - seeds.len())
        .collect();
    seeds.extend(free);
    Ok(seeds)
}

/// Draws a point with a probability proportional to its distance; `None` if all distances are 0.
fn draw(distances: &[f64], stream: &mut RandomStream) -> Option<usize> {
    let total = distances.iter().fold(0.0, |sum, distance| sum + distance);
    if total <= 0.0 {
        return None;
    }
    let mark = stream.random::<f64>() * total;
    let mut sum = 0.0;
    let mut drawn = None;
    for (point, &distance) in distances.iter().enumerate() {
        if distance > 0.0 {
            drawn = Some(point);
            sum += distance;
            if sum > mark {
                break;
            }
        }
    }
    drawn
}

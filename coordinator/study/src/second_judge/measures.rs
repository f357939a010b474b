//! The second judge's measures of a motion. Reflections, quarter turns and the order of the robots do not change the measures,
//! except for the rounding of the canvas.

use super::{
    canvas::Canvas,
    paths::{Paths, Point, centre, cross, distance, dot, length, minus},
    statistics::{deviation, mean, mean_of, one_way, quantile, quantiles, ratio, share, sorted, spread},
};
use std::f64::consts::PI;

/// Number of measures.
#[cfg(test)]
pub(super) const MEASURES: usize = 193;

/// Measures of a motion, always the same number, in the order that the trees use.
pub(super) fn measures(paths: &Paths) -> Vec<f64> {
    let canvas = Canvas::of(paths);
    [
        neighbours(paths),
        pairs(paths),
        groups(paths),
        rings(paths),
        travels(paths),
        turns(paths),
        order(paths),
        walls(paths),
        canvas.measures(),
    ]
    .concat()
}

/// Distances to the nearest and the third nearest neighbour at the end, and from the middle of a path to the nearest middle of
/// another path; in spacings.
fn neighbours(paths: &Paths) -> Vec<f64> {
    let of = |points: &[Point], place: usize| -> Vec<f64> {
        let one = |&here: &Point| {
            let mut all: Vec<f64> = points.iter().map(|&other| distance(here, other)).collect();
            // The least distance is that of the robot from itself.
            let place = place.min(all.len() - 1);
            let (_, &mut away, _) = all.select_nth_unstable_by(place, f64::total_cmp);
            away / paths.spacing
        };
        sorted(points.iter().map(one))
    };
    let (end, homes) = (paths.end(), paths.homes());
    let (first, third, home) = (of(&end, 1), of(&end, 3), of(&homes, 1));
    let touching = |reach: f64| {
        let reach = reach * paths.radius / paths.spacing;
        share(first.iter().map(|&away| away < reach))
    };
    let mut all = quantiles(&first, &[0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0]);
    all.extend(quantiles(&third, &[0.1, 0.5, 0.9]));
    all.extend(quantiles(&home, &[0.0, 0.1, 0.25, 0.5, 0.75, 0.9]));
    all.extend([2.2, 3.0, 5.0].map(touching));
    all.extend([spread(&first), spread(&third), spread(&home)]);
    all
}

/// Shares of the pairs of robots by their distance at the end, in sides of the arena.
fn pairs(paths: &Paths) -> Vec<f64> {
    let end = paths.end();
    let mut counts = [0.0; 9];
    let limits = [0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.55, 0.75];
    for (place, &here) in end.iter().enumerate() {
        for &other in &end[..place] {
            let away = distance(here, other) / paths.side;
            counts[limits.partition_point(|&limit| limit < away)] += 1.0;
        }
    }
    let all: f64 = counts.iter().sum();
    counts.map(|count| ratio(count, all)).to_vec()
}

/// Sizes of the groups of robots that are linked at the end by distances below a length.
fn groups(paths: &Paths) -> Vec<f64> {
    let end = paths.end();
    let reaches = [
        2.4 * paths.radius,
        4.0 * paths.radius,
        0.5 * paths.spacing,
        0.8 * paths.spacing,
    ];
    let all = end.len() as f64;
    let of = |reach: f64| {
        let mut sizes = linked(&end, reach);
        sizes.sort_by(|a, b| f64::total_cmp(b, a));
        let second = sizes.get(1).copied().unwrap_or(0.0);
        let single = sizes.iter().filter(|&&size| size == 1.0).count() as f64;
        let threes = sizes.iter().filter(|&&size| size >= 3.0).count() as f64;
        [
            sizes.len() as f64 / all,
            sizes[0] / all,
            second / all,
            single / all,
            threes / all,
        ]
    };
    reaches.map(of).concat()
}

/// Sizes of the groups of points that are linked by distances below `reach`.
fn linked(points: &[Point], reach: f64) -> Vec<f64> {
    let mut left: Vec<Point> = points.to_vec();
    let mut sizes = Vec::new();
    while let Some(first) = left.pop() {
        let (mut next, mut size) = (vec![first], 0.0);
        while let Some(here) = next.pop() {
            size += 1.0;
            left.retain(|&other| {
                let near = distance(here, other) < reach;
                if near {
                    next.push(other);
                }
                !near
            });
        }
        sizes.push(size);
    }
    sizes
}

/// How the robots are arranged around the middle of the swarm, and how far the robots move around this middle.
fn rings(paths: &Paths) -> Vec<f64> {
    let homes = paths.homes();
    let middle = centre(&homes);
    let away =
        |path: &Vec<Point>| -> Vec<f64> { path.iter().map(|&point| distance(point, middle)).collect() };
    let away: Vec<Vec<f64>> = paths.paths.iter().map(away).collect();
    let means = sorted(away.iter().map(|of| mean(of)));
    let usual = quantile(&means, 0.5).max(paths.radius);
    let relative: Vec<f64> = means.iter().map(|mean| mean / usual).collect();
    let wobble = sorted(away.iter().map(|of| deviation(of) / usual));
    let swept = swept(paths, middle);
    let at = |time: usize| {
        let points = paths.at(time);
        let middle = centre(&points);
        (
            mean_of(
                points
                    .iter()
                    .map(|&point| dot(minus(point, middle), minus(point, middle))),
            )
            .sqrt(),
            middle,
        )
    };
    let ((begin, from), (end, to)) = (at(0), at(paths.times() - 1));
    let mut all = vec![
        usual / paths.side,
        end / paths.spacing,
        ratio(begin, end).min(3.0),
    ];
    all.push(distance(from, to) / paths.spacing);
    all.extend(quantiles(&relative, &[0.0, 0.05, 0.1, 0.25, 0.75, 0.9, 1.0]));
    all.push(spread(&relative));
    all.extend(quantiles(&wobble, &[0.1, 0.5, 0.9]));
    all.extend(quantiles(&swept, &[0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0]));
    all.push(elongation(&paths.end()));
    all.push(elongation(&homes));
    all.push(cover(&homes, middle));
    all
}

/// How far each robot turns about `middle`, sorted; the sign makes the sum positive.
fn swept(paths: &Paths, middle: Point) -> Vec<f64> {
    let of = |path: &Vec<Point>| -> f64 {
        let steps = path.windows(2);
        steps
            .map(|step| turn(minus(step[0], middle), minus(step[1], middle)))
            .sum::<f64>()
            / PI
    };
    one_way(paths.paths.iter().map(of).collect())
}

/// How far the robots travel; in spacings, as logarithms.
fn travels(paths: &Paths) -> Vec<f64> {
    let log = |length: f64| libm::log(length / paths.spacing + 0.01);
    let of = |measure: &dyn Fn(&Vec<Point>) -> f64| sorted(paths.paths.iter().map(measure));
    let travelled =
        |path: &Vec<Point>| -> f64 { path.windows(2).map(|step| distance(step[0], step[1])).sum() };
    let net = |path: &Vec<Point>| distance(path[0], path[path.len() - 1]);
    let reach = |path: &Vec<Point>| {
        let home = centre(path);
        path.iter()
            .map(|&point| distance(point, home))
            .fold(0.0, f64::max)
    };
    let uneven = |path: &Vec<Point>| {
        let steps: Vec<f64> = path.windows(2).map(|step| distance(step[0], step[1])).collect();
        deviation(&steps) / (mean(&steps) + 0.02 * paths.radius)
    };
    let parts = [0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0];
    let mut all = quantiles(&of(&|path| log(travelled(path))), &parts);
    all.extend(quantiles(&of(&|path| log(net(path))), &parts));
    all.extend(quantiles(&of(&|path| log(reach(path))), &parts));
    all.extend(quantiles(
        &of(&|path| ratio(net(path), travelled(path))),
        &[0.1, 0.5, 0.9],
    ));
    all.extend(quantiles(&of(&uneven), &[0.1, 0.5, 0.9]));
    all
}

/// How far the robots' directions turn, in half turns; the sign makes the sum positive.
fn turns(paths: &Paths) -> Vec<f64> {
    let least = 0.1 * paths.radius;
    let turned = |path: &Vec<Point>| -> [f64; 2] {
        let moves: Vec<Point> = path.windows(2).map(|step| minus(step[1], step[0])).collect();
        let moves: Vec<Point> = moves.into_iter().filter(|&step| length(step) > least).collect();
        let turns = moves.windows(2).map(|pair| turn(pair[0], pair[1]) / PI);
        turns.fold([0.0; 2], |[signed, all], turn| [signed + turn, all + turn.abs()])
    };
    let turned: Vec<[f64; 2]> = paths.paths.iter().map(turned).collect();
    let signed = one_way(turned.iter().map(|of| of[0].clamp(-6.0, 6.0)).collect());
    let every = sorted(turned.iter().map(|of| of[1].min(12.0)));
    let back = turned.iter().map(|of| ratio(of[1] - of[0].abs(), of[1]));
    let mut all = quantiles(&signed, &[0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0]);
    all.extend(quantiles(&every, &[0.1, 0.5, 0.9]));
    all.extend(quantiles(&sorted(back), &[0.1, 0.5, 0.9]));
    all
}

/// How much the robots move the same way, round the middle, or along with their neighbour.
fn order(paths: &Paths) -> Vec<f64> {
    let mut sums = [0.0; 5];
    let times = (4..paths.times()).step_by(4);
    let count = times.len() as f64;
    for time in times {
        let (before, now) = (paths.at(time - 4), paths.at(time));
        let middle = centre(&now);
        let ways: Vec<Point> = before
            .iter()
            .zip(&now)
            .map(|(&a, &b)| unit(minus(b, a), 0.2 * paths.radius))
            .collect();
        let outs: Vec<Point> = now
            .iter()
            .map(|&point| unit(minus(point, middle), paths.radius))
            .collect();
        let round = mean_of(outs.iter().zip(&ways).map(|(&out, &way)| cross(out, way)));
        sums[0] += length(centre(&ways));
        sums[1] += round.abs();
        sums[2] += mean_of(outs.iter().zip(&ways).map(|(&out, &way)| cross(out, way).abs()));
        sums[3] += mean_of(outs.iter().zip(&ways).map(|(&out, &way)| dot(out, way).abs()));
        sums[4] += mean_of((0..now.len()).map(|here| dot(ways[here], ways[nearest(&now, here)])));
    }
    sums.map(|sum| ratio(sum, count)).to_vec()
}

/// How near the walls the robots are, and at how many walls there are robots; zeros without walls.
fn walls(paths: &Paths) -> Vec<f64> {
    let Some([low, high]) = paths.walls else {
        return vec![0.0; 8];
    };
    let gaps = |point: Point| {
        [
            point[0] - low[0],
            high[0] - point[0],
            point[1] - low[1],
            high[1] - point[1],
        ]
    };
    let all = || paths.paths.iter().flatten().map(|&point| gaps(point));
    let near = |reach: f64| {
        let reach = reach * paths.radius;
        share(all().map(|gaps| gaps.iter().any(|&gap| gap < reach)))
    };
    let mut by_wall: Vec<f64> = (0..4)
        .map(|wall| share(all().map(|gaps| gaps[wall] < paths.radius)))
        .collect();
    by_wall.sort_by(f64::total_cmp);
    [0.2, 1.0, 3.0, 8.0]
        .map(near)
        .into_iter()
        .chain(by_wall)
        .collect()
}

/// The place of the robot nearest to the robot at `here`; `here` itself without other robots.
fn nearest(points: &[Point], here: usize) -> usize {
    let others = (0..points.len()).filter(|&other| other != here);
    let away = |&other: &usize| distance(points[here], points[other]);
    others.min_by(|a, b| away(a).total_cmp(&away(b))).unwrap_or(here)
}

/// How much longer than wide a swarm is: 0 for a round swarm, 1 for a line.
fn elongation(points: &[Point]) -> f64 {
    let middle = centre(points);
    let moment = |a: usize, b: usize| {
        mean_of(
            points
                .iter()
                .map(|&point| (point[a] - middle[a]) * (point[b] - middle[b])),
        )
    };
    let (xx, yy, xy) = (moment(0, 0), moment(1, 1), moment(0, 1));
    ratio(((xx - yy).powi(2) + 4.0 * xy * xy).sqrt(), xx + yy)
}

/// The share of a whole turn about `middle` outside the largest sector without a robot.
fn cover(points: &[Point], middle: Point) -> f64 {
    let mut angles: Vec<f64> = points
        .iter()
        .map(|&point| minus(point, middle))
        .map(|out| libm::atan2(out[1], out[0]))
        .collect();
    angles.sort_by(f64::total_cmp);
    let last = angles[angles.len() - 1] - 2.0 * PI;
    let gaps = std::iter::once(last).chain(angles.iter().copied());
    let gaps: Vec<f64> = gaps.collect();
    let largest = gaps.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    1.0 - largest / (2.0 * PI)
}

/// `vector` scaled to about length 1; shorter if it is short compared with `least`.
fn unit(vector: Point, least: f64) -> Point {
    let length = length(vector) + 0.1 * least;
    vector.map(|part| part / length)
}

fn turn(from: Point, to: Point) -> f64 {
    libm::atan2(cross(from, to), dot(from, to))
}

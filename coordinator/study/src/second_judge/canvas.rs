//! Draws the paths on a canvas, and measures the drawing: covered area, enclosed area, and outline.

use super::{
    paths::{Paths, Point, centre, distance, length, minus},
    statistics::{ratio, share},
};
use std::{collections::BTreeMap, f64::consts::TAU};

/// Cells along a side of the canvas.
const CELLS: usize = 54;
/// Cells along a side of the arena; the other cells are a margin around the arena.
const ARENA: f64 = 50.0;
/// Directions in which an outline is measured.
const RAYS: usize = 48;

/// For each cell of the canvas, whether it is covered.
#[derive(Debug, Clone)]
struct Shape(Vec<bool>);

/// The canvas with the drawn paths.
#[derive(Debug)]
pub(super) struct Canvas {
    covered: Shape,
    visits: Vec<Visits>,
    robots: f64,
}

/// The robots that were in a cell.
#[derive(Debug, Default)]
struct Visits {
    last: Option<usize>,
    count: f64,
    /// Sum of the unit vectors of the robots' first moves in the cell.
    ways: Point,
}

impl Canvas {
    pub(super) fn of(paths: &Paths) -> Self {
        let mut visits: BTreeMap<usize, Visits> = BTreeMap::new();
        for (robot, path) in paths.paths.iter().enumerate() {
            for step in path.windows(2) {
                draw(robot, step[0], step[1], paths, &mut visits);
            }
        }
        let mut covered = Shape::empty();
        visits.keys().for_each(|&place| covered.0[place] = true);
        Self {
            covered,
            visits: visits.into_values().collect(),
            robots: paths.paths.len() as f64,
        }
    }

    pub(super) fn measures(&self) -> Vec<f64> {
        let mut all = self.visited().to_vec();
        for widened in [0, 1, 3] {
            let shape = (0..widened).fold(self.covered.clone(), |shape, _| shape.widened());
            all.extend(shape.enclosing());
            if widened > 0 {
                all.extend(shape.outline());
            }
        }
        all
    }

    /// How many robots share cells of their paths, and whether they move the same way in these cells.
    fn visited(&self) -> [f64; 9] {
        let cells = self.visits.len() as f64;
        let by = |low: f64, high: f64| {
            let of = self.visits.iter().filter(|of| of.count >= low && of.count < high);
            ratio(of.count() as f64, cells)
        };
        let shared = self.visits.iter().filter(|of| of.count >= 2.0);
        let agreed: Vec<f64> = shared.map(|of| length(of.ways) / of.count).collect();
        let mean = ratio(self.visits.iter().map(|of| of.count).sum(), cells);
        [
            libm::log(cells.max(1.0) / self.robots),
            cells / (CELLS * CELLS) as f64,
            by(2.0, 3.0),
            by(3.0, 5.0),
            by(5.0, 9.0),
            by(9.0, f64::INFINITY),
            libm::log(mean.max(1.0)),
            ratio(agreed.iter().sum(), agreed.len() as f64),
            share(agreed.iter().map(|&agreed| agreed > 0.9)),
        ]
    }
}

/// Draws a step of a robot, one cell wide, without the parts beyond the canvas.
fn draw(robot: usize, from: Point, to: Point, paths: &Paths, visits: &mut BTreeMap<usize, Visits>) {
    let cell = paths.side / ARENA;
    let way = minus(to, from);
    let far = length(way);
    let unit = match far > 0.05 * paths.radius {
        true => way.map(|part| part / far),
        false => [0.0; 2],
    };
    // A step longer than the canvas is drawn with gaps.
    let parts = (3.0 * far / cell).ceil().clamp(1.0, 1000.0) as usize;
    for part in 0..=parts {
        let part = part as f64 / parts as f64;
        let point = [0, 1].map(|axis| from[axis] + way[axis] * part);
        let [x, y] = minus(point, paths.middle).map(|way| (way / cell + CELLS as f64 / 2.0).floor());
        let inside = |place: f64| (0.0..CELLS as f64).contains(&place);
        if !inside(x) || !inside(y) {
            continue;
        }
        let seen = visits.entry(x as usize * CELLS + y as usize).or_default();
        if seen.last != Some(robot) {
            seen.last = Some(robot);
            seen.count += 1.0;
            seen.ways = [0, 1].map(|axis| seen.ways[axis] + unit[axis]);
        }
    }
}

impl Shape {
    fn empty() -> Self {
        Self(vec![false; CELLS * CELLS])
    }

    fn area(&self) -> f64 {
        self.0.iter().filter(|covered| **covered).count() as f64
    }

    /// The shape with the cells beside it.
    fn widened(&self) -> Self {
        let mut wide = self.clone();
        for place in (0..self.0.len()).filter(|&place| self.0[place]) {
            sides(place).for_each(|side| wide.0[side] = true);
        }
        wide
    }

    /// The connected parts of the covered or uncovered cells, the largest first.
    fn parts(&self, covered: bool, beside: fn(usize) -> Vec<usize>) -> Vec<Vec<usize>> {
        let mut left: Vec<bool> = self.0.iter().map(|is| *is == covered).collect();
        let mut parts = Vec::new();
        for place in 0..left.len() {
            if !left[place] {
                continue;
            }
            left[place] = false;
            let (mut part, mut done) = (vec![place], 0);
            while let Some(&here) = part.get(done) {
                done += 1;
                for next in beside(here) {
                    if left[next] {
                        left[next] = false;
                        part.push(next);
                    }
                }
            }
            parts.push(part);
        }
        parts.sort_by_key(|part| std::cmp::Reverse(part.len()));
        parts
    }

    /// Covered and enclosed areas, and the number of parts.
    fn enclosing(&self) -> [f64; 9] {
        let holes = self.parts(false, |place| sides(place).collect());
        let holes = holes
            .iter()
            .filter(|part| !part.iter().any(|&place| at_edge(place)));
        let holes: Vec<f64> = holes.map(|part| part.len() as f64).collect();
        let parts = self.parts(true, around);
        let (covered, hollow) = (self.area(), holes.iter().sum::<f64>());
        let hole = |place: usize| holes.get(place).copied().unwrap_or(0.0);
        let wide = holes.iter().filter(|&&hole| hole >= 12.0).count();
        let first = parts.first().map_or(0.0, |part| part.len() as f64);
        let all = self.0.len() as f64;
        [
            covered / all,
            hollow / all,
            ratio(hollow, hollow + covered),
            ratio(hole(0), hollow + covered),
            ratio(hole(1), hollow + covered),
            libm::log(1.0 + holes.len() as f64),
            libm::log(1.0 + wide as f64),
            libm::log(1.0 + parts.len() as f64),
            ratio(first, covered),
        ]
    }

    /// The cells of the largest part with the area that it encloses, and the cells of that part alone.
    fn largest(&self) -> Option<(Vec<Point>, Vec<Point>)> {
        let mut parts = self.parts(true, around);
        let part = (!parts.is_empty()).then(|| parts.swap_remove(0))?;
        let mut alone = Self::empty();
        part.iter().for_each(|&place| alone.0[place] = true);
        let mut filled = Self(vec![true; self.0.len()]);
        for outside in alone.parts(false, |place| sides(place).collect()) {
            if outside.iter().any(|&place| at_edge(place)) {
                outside.iter().for_each(|&place| filled.0[place] = false);
            }
        }
        let cells = (0..filled.0.len()).filter(|&place| filled.0[place]);
        Some((cells.map(cell).collect(), part.into_iter().map(cell).collect()))
    }

    /// The outline of the largest part: how well the part fills its hull and its circle, and how far its outline is from a
    /// circle.
    fn outline(&self) -> [f64; 14] {
        let Some((filled, part)) = self.largest() else {
            return [0.0; 14];
        };
        let middle = centre(&filled);
        let far = profile(&filled, middle);
        let mean = far.iter().sum::<f64>() / RAYS as f64;
        let inner = part
            .iter()
            .filter(|&&cell| distance(cell, middle) < 0.5 * mean)
            .count();
        let (area, drawn) = (filled.len() as f64, part.len() as f64);
        let circle = TAU / 2.0 * (mean + 0.5).powi(2);
        let mut all = [0.0; 14];
        all[..8].copy_from_slice(&[
            ratio(area, hull_area(&filled)),
            libm::log(ratio(area, drawn)),
            ratio(far.iter().copied().fold(f64::INFINITY, f64::min), mean),
            ratio(far.iter().copied().fold(0.0, f64::max), mean),
            ratio(inner as f64, drawn),
            ratio(drawn, 1.0 + TAU * mean),
            ratio(area, circle),
            mean / CELLS as f64,
        ]);
        for (crests, wave) in (1..).zip(&mut all[8..]) {
            *wave = ratio(amplitude(&far, crests), mean);
        }
        all
    }
}

/// How far cells reach from `middle` in each direction.
fn profile(cells: &[Point], middle: Point) -> [f64; RAYS] {
    let mut far = [0.0_f64; RAYS];
    for &cell in cells {
        let out = minus(cell, middle);
        let ray = (libm::atan2(out[1], out[0]) / TAU).rem_euclid(1.0) * RAYS as f64;
        let ray = (ray as usize).min(RAYS - 1);
        far[ray] = far[ray].max(length(out));
    }
    far
}

/// Amplitude of the wave with this many crests in a closed profile.
fn amplitude(profile: &[f64], crests: usize) -> f64 {
    let sum = profile.iter().enumerate().fold([0.0; 2], |sum, (place, value)| {
        let (sine, cosine) = libm::sincos(TAU * (place * crests) as f64 / profile.len() as f64);
        [sum[0] + value * cosine, sum[1] + value * sine]
    });
    2.0 * length(sum) / profile.len() as f64
}

/// Area of the convex hull of the cells with these middles.
fn hull_area(cells: &[Point]) -> f64 {
    let mut corners: Vec<Point> = cells
        .iter()
        .flat_map(|&[x, y]| [[x, y], [x + 1.0, y], [x, y + 1.0], [x + 1.0, y + 1.0]])
        .collect();
    corners.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let side = |points: &mut dyn Iterator<Item = Point>| {
        let mut chain: Vec<Point> = Vec::new();
        for point in points {
            while let [.., a, b] = chain[..]
                && (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0]) <= 0.0
            {
                chain.pop();
            }
            chain.push(point);
        }
        chain
    };
    let mut hull = side(&mut corners.iter().copied());
    hull.extend(side(&mut corners.iter().rev().copied()));
    let around = hull
        .windows(2)
        .map(|pair| pair[0][0] * pair[1][1] - pair[0][1] * pair[1][0]);
    around.sum::<f64>() / 2.0
}

fn cell(place: usize) -> Point {
    [(place / CELLS) as f64, (place % CELLS) as f64]
}

fn at_edge(place: usize) -> bool {
    let (x, y) = (place / CELLS, place % CELLS);
    x == 0 || y == 0 || x == CELLS - 1 || y == CELLS - 1
}

/// The cells beside a cell, at most four.
fn sides(place: usize) -> impl Iterator<Item = usize> {
    let (x, y) = (place / CELLS, place % CELLS);
    let inside = move |dx: isize, dy: isize| {
        let (x, y) = (x.checked_add_signed(dx)?, y.checked_add_signed(dy)?);
        (x < CELLS && y < CELLS).then_some(x * CELLS + y)
    };
    [inside(-1, 0), inside(1, 0), inside(0, -1), inside(0, 1)]
        .into_iter()
        .flatten()
}

/// The cells around a cell, at most eight.
fn around(place: usize) -> Vec<usize> {
    let mut all: Vec<usize> = sides(place).collect();
    let (x, y) = (place / CELLS, place % CELLS);
    for (dx, dy) in [(-1, -1), (-1, 1), (1, -1), (1, 1)] {
        if let (Some(x), Some(y)) = (x.checked_add_signed(dx), y.checked_add_signed(dy))
            && x < CELLS
            && y < CELLS
        {
            all.push(x * CELLS + y);
        }
    }
    all
}

//! Convex outlines, and the depth of points within them.

use super::window::Point;

/// A convex polygon with an area.
#[derive(Debug, Clone)]
pub(super) struct Outline {
    corners: Vec<Point>,
    area: f64,
}

impl Outline {
    /// The convex hull of `points` (Andrew's monotone chain); `None` if they lie on one line.
    pub(super) fn around(mut points: Vec<Point>) -> Option<Self> {
        points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        let mut corners = half(points.iter());
        corners.pop();
        let mut upper = half(points.iter().rev());
        upper.pop();
        corners.append(&mut upper);
        let area = edges(&corners).map(|(a, b)| cross(a, b)).sum::<f64>() / 2.0;
        (corners.len() > 2 && area > 0.0).then_some(Self { corners, area })
    }

    /// Radius of the circle with the outline's area.
    pub(super) fn radius(&self) -> f64 {
        (self.area / std::f64::consts::PI).sqrt()
    }

    pub(super) fn centre(&self) -> Point {
        [0, 1].map(|axis| {
            let moment: f64 = edges(&self.corners)
                .map(|(a, b)| (a[axis] + b[axis]) * cross(a, b))
                .sum();
            moment / (6.0 * self.area)
        })
    }

    /// Whether `point` is inside the outline.
    pub(super) fn contains(&self, point: Point) -> bool {
        edges(&self.corners).all(|(a, b)| cross(minus(b, a), minus(point, a)) >= 0.0)
    }

    /// Distance from `point` to the nearest edge, in units of [`Self::radius`].
    pub(super) fn depth(&self, point: Point) -> f64 {
        let square = edges(&self.corners).map(|(a, b)| square_to_segment(point, a, b));
        square.fold(f64::INFINITY, f64::min).sqrt() / self.radius()
    }
}

fn half<'a>(points: impl Iterator<Item = &'a Point>) -> Vec<Point> {
    let mut chain: Vec<Point> = Vec::new();
    for &point in points {
        while let [.., a, b] = chain[..]
            && cross(minus(b, a), minus(point, a)) <= 0.0
        {
            chain.pop();
        }
        chain.push(point);
    }
    chain
}

fn edges(corners: &[Point]) -> impl Iterator<Item = (Point, Point)> {
    let last = corners.last().copied().zip(corners.first().copied());
    corners.windows(2).map(|pair| (pair[0], pair[1])).chain(last)
}

/// Distance from `point` to the nearest point between `a` and `b`.
pub(super) fn distance_to_segment(point: Point, a: Point, b: Point) -> f64 {
    square_to_segment(point, a, b).sqrt()
}

/// The square of the distance from `point` to the nearest point between `a` and `b`.
fn square_to_segment(point: Point, a: Point, b: Point) -> f64 {
    let along = minus(b, a);
    let square = dot(along, along);
    let part = if square > 0.0 {
        (dot(minus(point, a), along) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let away = minus(point, [a[0] + part * along[0], a[1] + part * along[1]]);
    dot(away, away)
}

/// Whether two segments cross each other. Segments that only touch do not cross.
pub(super) fn segments_cross([a, b]: [Point; 2], [c, d]: [Point; 2]) -> bool {
    let side = |from, to, point| cross(minus(to, from), minus(point, from));
    side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0
}

pub(super) fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1]]
}

pub(super) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

pub(super) fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

pub(super) fn length(a: Point) -> f64 {
    dot(a, a).sqrt()
}

/// Angle from one direction to another, in radians in (-pi, pi\].
pub(super) fn angle_between(from: Point, to: Point) -> f64 {
    libm::atan2(cross(from, to), dot(from, to))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_by_hand() {
        let points = vec![
            [0.0, 0.0],
            [2.0, 2.0],
            [2.0, 0.0],
            [1.0, 1.0],
            [0.0, 2.0],
            [1.0, 0.0],
        ];
        let square = Outline::around(points).unwrap();
        assert_eq!(
            (square.corners.len(), square.area, square.centre()),
            (4, 4.0, [1.0, 1.0])
        );
        assert!(square.contains([0.5, 1.9]) && !square.contains([0.5, 2.1]));
        assert!((square.depth([1.5, 1.0]) * square.radius() - 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_line_has_no_outline() {
        assert!(Outline::around(vec![[1.0, 1.0]; 5]).is_none());
        assert!(Outline::around((0..9).map(|k| [f64::from(k), f64::from(k)]).collect()).is_none());
    }

    #[test]
    fn segments_that_touch_do_not_cross() {
        let level = [[0.0, 0.0], [2.0, 0.0]];
        assert!(segments_cross(level, [[1.0, -1.0], [1.0, 1.0]]));
        assert!(!segments_cross(level, [[1.0, 0.0], [1.0, 1.0]]));
        assert!(!segments_cross(level, [[3.0, -1.0], [3.0, 1.0]]));
    }
}

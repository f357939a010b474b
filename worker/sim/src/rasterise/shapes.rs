//! Circles and lines as pixels, by the integer algorithms of the authors' drawing library.

use std::cmp::Ordering;

/// The outline of a circle by the midpoint algorithm, as offsets from the centre's pixel.
///
/// The centre is the corner between four pixels: offsets run from `-radius` to `radius - 1`. `radius` is 1 or more.
pub(super) fn circle(radius: i32) -> Vec<[i32; 2]> {
    let mut offsets = Vec::new();
    let (mut x, mut y) = (0, radius);
    // Twice the circle's function at the midpoint between the two candidate pixels, without its fraction.
    let mut decision = 1 - radius;
    while x < y {
        if decision >= 0 {
            y -= 1;
            decision -= 2 * y;
        }
        x += 1;
        decision += 2 * x + 1;
        for [x, y] in [[x, y], [y, x]] {
            offsets.extend([[x - 1, y - 1], [x - 1, -y], [-x, y - 1], [-x, -y]]);
        }
    }
    offsets.sort_unstable();
    offsets.dedup();
    offsets
}

/// A line by Bresenham's algorithm, both ends included.
#[inline]
pub(super) fn line(from: [i32; 2], to: [i32; 2]) -> impl Iterator<Item = [i32; 2]> {
    let dx = (to[0] - from[0]).abs();
    let dy = (to[1] - from[1]).abs();
    let step = [sign(to[0].cmp(&from[0])), sign(to[1].cmp(&from[1]))];
    let mut error = if dx > dy { dx } else { -dy } / 2;
    let mut next = from;
    (0..=dx.max(dy)).map(move |_| {
        let pixel = next;
        // This loop has no branches, because the CPU would mispredict a line's turns.
        let across = i32::from(error > -dx);
        let along = i32::from(error < dy);
        error += along * dx - across * dy;
        next[0] += across * step[0];
        next[1] += along * step[1];
        pixel
    })
}

const fn sign(ordering: Ordering) -> i32 {
    ordering as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_circle_of_the_papers_robots() {
        let expected = [
            [-5, -2],
            [-5, -1],
            [-5, 0],
            [-5, 1],
            [-4, -3],
            [-4, 2],
            [-3, -4],
            [-3, 3],
            [-2, -5],
            [-2, 4],
            [-1, -5],
            [-1, 4],
            [0, -5],
            [0, 4],
            [1, -5],
            [1, 4],
            [2, -4],
            [2, 3],
            [3, -3],
            [3, 2],
            [4, -2],
            [4, -1],
            [4, 0],
            [4, 1],
        ];
        assert_eq!(circle(5), expected);
    }

    #[test]
    fn the_smallest_circle() {
        assert_eq!(circle(1), [[-1, -1], [-1, 0], [0, -1], [0, 0]]);
    }

    proptest! {
        #[test]
        fn circles_keep_to_their_radius_and_their_symmetries(radius in 1i32..1000) {
            let offsets = circle(radius);
            for &[x, y] in &offsets {
                // Pixel centres lie half a pixel off the circle's centre.
                let (px, py) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
                prop_assert!((px.hypot(py) - f64::from(radius)).abs() < 1.5);
                for twin in [[y, x], [-1 - x, y], [x, -1 - y]] {
                    prop_assert!(offsets.binary_search(&twin).is_ok());
                }
            }
        }

        #[test]
        fn lines_join_their_ends_and_stay_by_their_side(
            from in prop::array::uniform2(-50i32..50),
            to in prop::array::uniform2(-50i32..50),
        ) {
            let pixels: Vec<_> = line(from, to).collect();
            prop_assert_eq!(pixels.first(), Some(&from));
            prop_assert_eq!(pixels.last(), Some(&to));
            let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
            for pixel in &pixels {
                let off = (pixel[0] - from[0]) * dy - (pixel[1] - from[1]) * dx;
                prop_assert!(off.abs() <= dx.abs().max(dy.abs()));
            }
            for pair in pixels.windows(2) {
                prop_assert!((pair[0][0] - pair[1][0]).abs() <= 1 && (pair[0][1] - pair[1][1]).abs() <= 1);
            }
        }
    }
}

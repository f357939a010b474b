//! Pictures of coloured points, without text.

use crate::picture::{PictureError, encoded};
use murmuration_model::colours::Rgb;

/// Margin at each edge of a map, as a share of its side.
const FREE: f64 = 0.03;

/// Positions of points on a square with this side, to the right and down, with the same scale in both directions.
pub fn places(points: &[[f64; 2]], side: f64) -> Vec<[f64; 2]> {
    let range = |axis: usize| {
        let values = points.iter().map(|point| point[axis]);
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
            [low.min(value), high.max(value)]
        })
    };
    let ranges = [range(0), range(1)];
    let span = ranges.iter().map(|[low, high]| high - low).fold(0.0, f64::max);
    let a_unit = if span > 0.0 {
        side * (1.0 - 2.0 * FREE) / span
    } else {
        0.0
    };
    let place = |point: &[f64; 2]| {
        let [x, y]: [f64; 2] = std::array::from_fn(|axis| {
            let [low, high] = ranges[axis];
            side / 2.0 + (point[axis] - f64::midpoint(low, high)) * a_unit
        });
        [x, side - y]
    };
    points.iter().map(place).collect()
}

/// The points as a PNG with this side in pixels; later points cover earlier ones, and the background is transparent.
pub fn png(points: &[([f64; 2], Rgb)], side: usize, radius: i64) -> Result<Vec<u8>, PictureError> {
    let mut pixels = vec![[0; 4]; side * side];
    draw(points, side, radius, |pixel, [red, green, blue]| {
        pixels[pixel] = [red, green, blue, 0xff];
    });
    encoded(pixels.as_flattened(), [side; 2], png::ColorType::Rgba)
}

/// Calls `set` with each pixel of each point, counted row by row, and with the point's colour.
fn draw(points: &[([f64; 2], Rgb)], side: usize, radius: i64, mut set: impl FnMut(usize, Rgb)) {
    let at: Vec<[f64; 2]> = points.iter().map(|(at, _)| *at).collect();
    let inside = |value: i64| usize::try_from(value).ok().filter(|&value| value < side);
    for (place, (_, colour)) in places(&at, side as f64).into_iter().zip(points) {
        let [x, y] = place.map(|pixel| pixel as i64);
        for (across, down) in disc(radius) {
            if let (Some(x), Some(y)) = (inside(x + across), inside(y + down)) {
                set(y * side + x, *colour);
            }
        }
    }
}

/// The pixels of a point, relative to its centre.
fn disc(radius: i64) -> impl Iterator<Item = (i64, i64)> {
    let along = move || -radius..=radius;
    let all = along().flat_map(move |x| along().map(move |y| (x, y)));
    all.filter(move |(x, y)| x * x + y * y <= radius * radius)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::sample::decode_png;

    #[test]
    fn a_unit_is_as_long_across_as_it_is_up() {
        let places = places(&[[-1.0, 0.0], [1.0, 0.5]], 100.0);
        assert_eq!(places, [[3.0, 50.0 + 0.25 * 47.0], [97.0, 50.0 - 0.25 * 47.0]]);
        assert_eq!(super::places(&[[-1.0, 0.0]], 100.0), [[50.0, 50.0]]);
    }

    #[test]
    fn later_points_lie_over_earlier_ones_and_nothing_is_between() {
        let points = [
            ([0.0, 0.0], [9, 9, 9]),
            ([1.0, 1.0], [1, 2, 3]),
            ([0.0, 0.0], [7, 8, 9]),
        ];
        let (width, height, pixels) = decode_png(&png(&points, 100, 2).unwrap());
        assert_eq!((width, height), (100, 100));
        let drawn: Vec<&[u8]> = pixels.chunks(4).filter(|pixel| pixel[3] > 0).collect();
        let of = |colour: [u8; 4]| drawn.iter().filter(|pixel| **pixel == colour).count();
        assert_eq!(
            (of([1, 2, 3, 255]), of([7, 8, 9, 255]), drawn.len()),
            (13, 13, 26)
        );
    }
}

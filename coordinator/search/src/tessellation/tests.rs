//! Tests with points whose tessellation is known.

use super::*;

fn points(values: &[[f64; 2]]) -> Behaviours {
    let mut points = Behaviours::new(2);
    values.iter().for_each(|value| points.push(value).unwrap());
    points
}

fn of(points: &Behaviours, cells: usize) -> Tessellation {
    Tessellation::of(points, cells, &Interrupt::default()).unwrap()
}

/// A square of 20 by 20 points, with `more` further points in its first corner.
fn square(more: usize) -> Behaviours {
    let mut square = Behaviours::new(2);
    for place in 0..400 {
        let place = [place % 20, place / 20].map(|value| f64::from(value) / 19.0);
        square.push(&place).unwrap();
    }
    (0..more).for_each(|_| square.push(&[0.0, 0.0]).unwrap());
    square
}

#[test]
fn two_clumps_are_two_cells_about_their_middles() {
    let clumps = points(&[[0.0, 0.0], [9.0, 9.0], [0.0, 1.0], [9.0, 8.0]]);
    let tessellation = of(&clumps, 2);
    assert_eq!(tessellation.cells_of(&clumps), [0, 1, 0, 1]);
    assert_eq!(tessellation.centroids(), &points(&[[0.0, 0.5], [9.0, 8.5]]));
}

#[test]
fn four_cells_of_a_square_are_its_quarters() {
    let square = square(0);
    let tessellation = of(&square, 4);
    let mut members = [0; 4];
    tessellation
        .cells_of(&square)
        .into_iter()
        .for_each(|cell| members[cell] += 1);
    assert_eq!(members, [100; 4]);
}

#[test]
fn where_points_crowd_there_are_no_more_cells() {
    assert_eq!(of(&square(1000), 16), of(&square(0), 16));
}

#[test]
fn there_are_no_more_cells_than_places() {
    let twice = points(&[[1.0, 1.0], [2.0, 2.0], [1.0, 1.0]]);
    assert_eq!(of(&twice, 5).centroids().len(), 2);
    assert!(of(&Behaviours::new(2), 5).centroids().is_empty());
}

#[test]
fn the_centroids_say_all_of_a_tessellation() {
    let square = square(0);
    let made = of(&square, 9);
    let again = Tessellation::about(made.centroids().clone());
    assert_eq!(again.cells_of(&square), made.cells_of(&square));
}

#[test]
fn a_tessellation_that_nobody_wants_ends() {
    let interrupt = Interrupt::default();
    interrupt.raise();
    assert_eq!(Tessellation::of(&square(0), 3, &interrupt), Err(Interrupted));
}

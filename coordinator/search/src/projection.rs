//! The map of the behaviour space: principal component analysis to two dimensions.
//!
//! The map is for display only. The last bits of nalgebra's eigenvectors can differ between machines, so nothing that a digest
//! covers may depend on the map.

use crate::{
    interrupt::{Interrupt, Interrupted},
    novelty::Behaviours,
};
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Behaviours projected on their two principal axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Projection {
    /// Each behaviour's coordinates along the first and the second axis, from the mean, in the units of the
    /// behaviour space and in the order of the behaviours.
    pub points: Vec<[f64; 2]>,
    /// Share of the variance that each axis explains, 0 to 1, in descending order; both are 0 if all behaviours are equal.
    pub shares: [f64; 2],
    /// The axes as unit vectors of the behaviour space (the loadings); the loading of the largest magnitude is positive. In a
    /// space of one dimension the second axis is all zeros; in a space without dimensions, both axes are empty.
    pub axes: [DVector<f64>; 2],
}

/// The projection of `behaviours` on their two principal axes. The projection is also defined for equal behaviours, and without
/// behaviours.
///
/// # Errors
/// [`Interrupted`] once `interrupt` is raised.
pub fn principal_axes(behaviours: &Behaviours, interrupt: &Interrupt) -> Result<Projection, Interrupted> {
    let dims = behaviours.dims();
    let mean = mean(behaviours);
    let covariance = covariance(behaviours, &mean, interrupt)?;
    let total = covariance.trace();
    let components = components(covariance);

    let axes = [0, 1].map(|place| match components.get(place) {
        Some((_, axis)) => axis.clone(),
        None => DVector::zeros(dims),
    });
    let shares = [0, 1].map(|place| match components.get(place) {
        Some((variance, _)) if total > 0.0 => (variance / total).clamp(0.0, 1.0),
        _ => 0.0,
    });
    let points = (0..behaviours.len())
        .map(|i| {
            let offset = behaviours.point(i) - &mean;
            [axes[0].dot(&offset), axes[1].dot(&offset)]
        })
        .collect();
    Ok(Projection { points, shares, axes })
}

/// The mean behaviour, computed relative to the first behaviour, so that the mean of equal behaviours is exact.
fn mean(behaviours: &Behaviours) -> DVector<f64> {
    if behaviours.is_empty() {
        return DVector::zeros(behaviours.dims());
    }
    let first = behaviours.point(0);
    let sum = (1..behaviours.len()).fold(DVector::zeros(behaviours.dims()), |sum, i| {
        sum + (behaviours.point(i) - first)
    });
    first + sum / behaviours.len() as f64
}

fn covariance(
    behaviours: &Behaviours,
    mean: &DVector<f64>,
    interrupt: &Interrupt,
) -> Result<DMatrix<f64>, Interrupted> {
    let mut covariance = DMatrix::zeros(behaviours.dims(), behaviours.dims());
    for i in 0..behaviours.len() {
        interrupt.check()?;
        let offset = behaviours.point(i) - mean;
        covariance.ger(1.0, &offset, &offset, 1.0);
    }
    Ok(covariance / behaviours.len().max(1) as f64)
}

/// Principal axes with the variance along each, by descending variance.
fn components(covariance: DMatrix<f64>) -> Vec<(f64, DVector<f64>)> {
    if covariance.is_empty() {
        return Vec::new();
    }
    let eigen = SymmetricEigen::new(covariance);
    let axes = eigen.eigenvectors.column_iter();
    let mut components: Vec<_> = eigen
        .eigenvalues
        .iter()
        .copied()
        .zip(axes.map(|axis| with_fixed_sign(axis.into_owned())))
        .collect();
    components.sort_by(|(a, _), (b, _)| b.total_cmp(a));
    components
}

/// Orients the axis so that its loading of the largest magnitude (the first of equal loadings) is positive.
fn with_fixed_sign(axis: DVector<f64>) -> DVector<f64> {
    if axis[axis.iamax()] < 0.0 { -axis } else { axis }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn project(dims: usize, points: &[Vec<f64>]) -> Projection {
        let mut behaviours = Behaviours::new(dims);
        for point in points {
            behaviours.push(point).unwrap();
        }
        principal_axes(&behaviours, &Interrupt::default()).unwrap()
    }

    #[track_caller]
    fn check_close(given: &[f64], expected: &[f64]) {
        let close = given.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(
            close && given.len() == expected.len(),
            "{given:?} is not {expected:?}"
        );
    }

    #[test]
    fn a_cross_lies_along_its_arms() {
        // The cross is long along (0, -3, 4) / 5 and short along x.
        let points = [
            [5.0, 1.0, 1.0],
            [-5.0, 1.0, 1.0],
            [0.0, -5.0, 9.0],
            [0.0, 7.0, -7.0],
        ];
        let projection = project(3, &points.map(Vec::from));
        check_close(&projection.shares, &[0.8, 0.2]);
        check_close(projection.axes[0].as_slice(), &[0.0, -0.6, 0.8]);
        check_close(projection.axes[1].as_slice(), &[1.0, 0.0, 0.0]);
        let expected = [0.0, 5.0, 0.0, -5.0, 10.0, 0.0, -10.0, 0.0];
        check_close(projection.points.as_flattened(), &expected);
    }

    #[test]
    fn points_that_span_less_than_a_plane_have_a_map() {
        assert!(project(5, &[]).points.is_empty());
        assert_eq!(project(0, &[vec![], vec![]]).points, [[0.0; 2]; 2]);
        for same in [0.0, 0.1, -3.7e90] {
            let projection = project(5, &vec![vec![same; 5]; 7]);
            assert_eq!(projection.points, [[0.0; 2]; 7]);
            assert_eq!(projection.shares, [0.0; 2]);
        }
        let line = project(1, &[vec![2.0], vec![4.0]]);
        assert_eq!(line.points, [[-1.0, 0.0], [1.0, 0.0]]);
        assert_eq!(line.shares, [1.0, 0.0]);
    }

    fn points() -> impl Strategy<Value = Vec<Vec<f64>>> {
        prop::collection::vec(prop::collection::vec(-1.0..=1.0f64, 4), 3..40)
    }

    proptest! {
        #[test]
        fn any_scale_has_a_map(points in points(), exponent in -170..=99i32) {
            let scale: f64 = format!("1e{exponent}").parse().unwrap();
            let scaled: Vec<Vec<f64>> = points.iter().map(|p| p.iter().map(|x| x * scale).collect()).collect();
            let projection = project(4, &scaled);
            prop_assert!(projection.points.as_flattened().iter().all(|x| x.is_finite()));
            prop_assert!(projection.axes.iter().all(|axis| (axis.norm() - 1.0).abs() < 1e-9));
        }

        #[test]
        fn coordinates_are_centred_and_uncorrelated_and_their_variance_is_the_share(points in points()) {
            let projection = project(4, &points);
            let count = points.len() as f64;
            let mean = |of: &dyn Fn(&[f64; 2]) -> f64| projection.points.iter().map(of).sum::<f64>() / count;
            prop_assert!(mean(&|p| p[0]).abs() < 1e-12 && mean(&|p| p[1]).abs() < 1e-12);
            prop_assert!(mean(&|p| p[0] * p[1]).abs() < 1e-12);
            let total: f64 = (0..4).map(|d| {
                let centre = points.iter().map(|p| p[d]).sum::<f64>() / count;
                points.iter().map(|p| (p[d] - centre).powi(2)).sum::<f64>() / count
            }).sum();
            for axis in 0..2 {
                let share = mean(&|p| p[axis] * p[axis]) / total;
                prop_assert!((share - projection.shares[axis]).abs() < 1e-9);
                prop_assert!((projection.axes[axis].norm() - 1.0).abs() < 1e-12);
            }
            prop_assert!(projection.shares[0] >= projection.shares[1]);
        }

        #[test]
        fn no_direction_has_more_variance_than_the_first_axis(
            points in points(),
            direction in prop::array::uniform4(-1.0..=1.0f64),
        ) {
            let projection = project(4, &points);
            let variance = |axis: &DVector<f64>| {
                let along: Vec<f64> = points.iter().map(|p| axis.dot(&DVector::from_row_slice(p))).collect();
                let centre = along.iter().sum::<f64>() / along.len() as f64;
                along.iter().map(|x| (x - centre).powi(2)).sum::<f64>()
            };
            let direction = DVector::from_row_slice(&direction);
            prop_assume!(direction.norm() > 0.1);
            prop_assert!(variance(&direction.normalize()) <= variance(&projection.axes[0]) * (1.0 + 1e-9));
        }

        #[test]
        fn an_axis_points_the_same_way_in_a_mirrored_space(points in points()) {
            let negated: Vec<Vec<f64>> = points.iter().map(|p| p.iter().map(|x| -x).collect()).collect();
            let axes = project(4, &points).axes;
            prop_assert!(axes.iter().all(|axis| axis[axis.iamax()] > 0.0));
            prop_assert_eq!(project(4, &negated).axes, axes);
        }
    }
}

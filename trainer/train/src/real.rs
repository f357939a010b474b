//! The two kinds of real numbers of networks: f32 for use, f64 for tests of gradients.

use crate::vectors::Vectors;
use ndarray::{ArrayView2, ArrayViewMut2, LinalgScalar, linalg::general_mat_mul};
use std::{
    fmt::Debug,
    ops::{AddAssign, Neg},
};

/// f32 or f64.
pub trait Real:
    Vectors + LinalgScalar + PartialOrd + Neg<Output = Self> + AddAssign + Send + Sync + Debug
{
    /// The nearest value to `value`.
    fn of(value: f64) -> Self;

    /// The value as f64, exactly.
    fn wide(self) -> f64;

    #[must_use]
    fn root(self) -> Self;
}

impl Real for f32 {
    fn of(value: f64) -> Self {
        value as Self
    }

    fn wide(self) -> f64 {
        f64::from(self)
    }

    fn root(self) -> Self {
        self.sqrt()
    }
}

impl Real for f64 {
    fn of(value: f64) -> Self {
        value
    }

    fn wide(self) -> f64 {
        self
    }

    fn root(self) -> Self {
        self.sqrt()
    }
}

/// A matrix over `data`, row after row.
#[expect(
    clippy::expect_used,
    reason = "the layers' shapes are checked when a network is made"
)]
pub(crate) fn matrix<T>(rows: usize, columns: usize, data: &[T]) -> ArrayView2<'_, T> {
    ArrayView2::from_shape((rows, columns), data).expect("rows x columns values")
}

/// Computes `into = a b`, or `into += a b` if `add` is true. The bits of the result depend only on the values, the shapes and the
/// kind of CPU.
#[expect(
    clippy::expect_used,
    reason = "the layers' shapes are checked when a network is made"
)]
pub(crate) fn multiply<T: Real>(a: ArrayView2<T>, b: ArrayView2<T>, add: bool, into: &mut [T]) {
    let shape = (a.nrows(), b.ncols());
    let mut product = ArrayViewMut2::from_shape(shape, into).expect("rows x columns values");
    let kept = if add { T::one() } else { T::zero() };
    general_mat_mul(T::one(), &a, &b, kept, &mut product);
}

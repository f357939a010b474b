//! Behaviour vectors that all have the same number of values.

use nalgebra::{DMatrixView, DVectorView};

/// Largest magnitude of a coordinate. The sum of the squares of such coordinates over any number of points is still finite.
pub const MAX_COORDINATE: f64 = 1e100;

/// Why a vector cannot be added.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Misfit {
    /// The vector has another number of values than the other vectors.
    #[error("a behaviour vector of {given} values among vectors of {expected}")]
    Dimensions {
        /// Number of values of the vector.
        given: usize,
        /// Number of values of the other vectors.
        expected: usize,
    },
    /// A value is not a number, or its magnitude is over [`MAX_COORDINATE`].
    #[error(
        "value {place} of a behaviour vector is {value}: must be at most {MAX_COORDINATE:e} in magnitude"
    )]
    Value {
        /// Place of the value, from 0.
        place: usize,
        value: f64,
    },
}

/// The behaviour vectors of an archive, in the order of the individuals. All vectors have the same number of values, and all
/// values are finite.
#[derive(Debug, Clone, PartialEq)]
pub struct Behaviours {
    dims: usize,
    len: usize,
    /// The values of one point after another, `dims * len` in all.
    values: Vec<f64>,
}

impl Behaviours {
    /// An empty set of behaviours, whose vectors will have `dims` values.
    #[must_use]
    pub const fn new(dims: usize) -> Self {
        Self {
            dims,
            len: 0,
            values: Vec::new(),
        }
    }

    /// Adds a behaviour at the end. Negative zero becomes zero.
    ///
    /// # Errors
    /// [`Misfit`] if the vector does not have [`Behaviours::dims`] values, or if a value is NaN or above [`MAX_COORDINATE`] in
    /// magnitude. After an error, nothing is added.
    pub fn push(&mut self, vector: &[f64]) -> Result<(), Misfit> {
        if vector.len() != self.dims {
            return Err(Misfit::Dimensions {
                given: vector.len(),
                expected: self.dims,
            });
        }
        let fits = |value: f64| (-MAX_COORDINATE..=MAX_COORDINATE).contains(&value);
        if let Some(place) = vector.iter().position(|&value| !fits(value)) {
            return Err(Misfit::Value {
                place,
                value: vector[place],
            });
        }
        self.values.extend(vector.iter().map(|value| value + 0.0));
        self.len += 1;
        Ok(())
    }

    /// The behaviours at `indices`, in the order of `indices`.
    ///
    /// # Panics
    /// Panics if an index is not below [`Behaviours::len`].
    #[must_use]
    pub fn among(&self, indices: &[usize]) -> Self {
        Self {
            dims: self.dims,
            len: indices.len(),
            values: indices
                .iter()
                .flat_map(|&index| self.values_of(index))
                .copied()
                .collect(),
        }
    }

    /// Number of values of every vector.
    #[must_use]
    pub const fn dims(&self) -> usize {
        self.dims
    }

    #[must_use]
    pub const fn len(&self) -> usize {
        self.len
    }

    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Behaviour `index` as a column vector of [`Behaviours::dims`] rows.
    ///
    /// # Panics
    /// Panics if `index` is not below [`Behaviours::len`].
    #[must_use]
    pub fn point(&self, index: usize) -> DVectorView<'_, f64> {
        DVectorView::from_slice(self.values_of(index), self.dims)
    }

    /// All behaviours as a matrix of [`Behaviours::dims`] rows and [`Behaviours::len`] columns.
    #[must_use]
    pub fn matrix(&self) -> DMatrixView<'_, f64> {
        DMatrixView::from_slice(&self.values, self.dims, self.len)
    }

    /// All values, point after point, as arrays of `D`. If [`Behaviours::dims`] is `D`, each array is a behaviour.
    pub fn arrays<const D: usize>(&self) -> &[[f64; D]] {
        self.values.as_chunks::<D>().0
    }

    /// Squared Euclidean distance between two behaviours, summed from the first dimension to the last.
    ///
    /// # Panics
    /// Panics if an index is not below [`Behaviours::len`].
    #[must_use]
    pub fn squared_distance(&self, one: usize, other: usize) -> f64 {
        squared_distance(self.values_of(one), self.values_of(other))
    }

    /// Squared Euclidean distance from behaviour `index` to a vector of [`Behaviours::dims`] values.
    ///
    /// # Panics
    /// Panics if the index is not below [`Behaviours::len`].
    #[must_use]
    pub fn squared_distance_to(&self, index: usize, vector: &[f64]) -> f64 {
        squared_distance(self.values_of(index), vector)
    }

    /// Visits every behaviour, in order, with its squared distance from behaviour `origin`: the values of
    /// [`Behaviours::squared_distance`].
    ///
    /// # Panics
    /// Panics if `origin` is not below [`Behaviours::len`].
    #[inline]
    pub(crate) fn each_squared_distance(&self, origin: usize, visit: impl FnMut(usize, f64)) {
        // A loop of constant length takes half the time.
        match self.dims {
            2 => self.each_from::<2>(origin, visit),
            3 => self.each_from::<3>(origin, visit),
            4 => self.each_from::<4>(origin, visit),
            5 => self.each_from::<5>(origin, visit),
            6 => self.each_from::<6>(origin, visit),
            8 => self.each_from::<8>(origin, visit),
            _ => self.each_from_slice(origin, visit),
        }
    }

    #[inline]
    fn each_from<const D: usize>(&self, origin: usize, mut visit: impl FnMut(usize, f64)) {
        let points = self.arrays::<D>();
        let from = points[origin];
        for (index, point) in points.iter().enumerate() {
            visit(index, squared_distance(&from, point));
        }
    }

    fn each_from_slice(&self, origin: usize, mut visit: impl FnMut(usize, f64)) {
        let from = self.values_of(origin);
        for index in 0..self.len {
            visit(index, squared_distance(from, self.values_of(index)));
        }
    }

    /// The values of behaviour `index`.
    pub(crate) fn values_of(&self, index: usize) -> &[f64] {
        &self.values[index * self.dims..][..self.dims]
    }
}

#[inline]
fn squared_distance(one: &[f64], other: &[f64]) -> f64 {
    one.iter()
        .zip(other)
        .map(|(a, b)| (a - b) * (a - b))
        .fold(0.0, |sum, square| sum + square)
}

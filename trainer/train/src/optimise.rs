//! Adam (Kingma & Ba 2015).

use crate::real::Real;

/// Decay of the mean gradient, and of the mean squared gradient.
const DECAYS: [f64; 2] = [0.9, 0.999];
/// Small number that is added to the root of the mean squared gradient.
const EPSILON: f64 = 1e-8;

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Adam<T> {
    /// Mean gradient of each weight.
    pub(crate) means: Vec<T>,
    /// Mean squared gradient of each weight.
    pub(crate) squares: Vec<T>,
    /// Each decay, raised to the power of the number of steps.
    pub(crate) powers: [f64; 2],
}

impl<T: Real> Adam<T> {
    /// The state before the first step, for this number of weights.
    pub(crate) fn new(weights: usize) -> Self {
        Self {
            means: vec![T::zero(); weights],
            squares: vec![T::zero(); weights],
            powers: [1.0; 2],
        }
    }

    /// Adds `decay` times the weights to the gradient, and moves the weights one step against the result.
    pub(crate) fn step(&mut self, weights: &mut [T], gradient: &[T], rate: f64, decay: f64) {
        for (power, factor) in self.powers.iter_mut().zip(DECAYS) {
            *power *= factor;
        }
        let [first, second] = DECAYS.map(T::of);
        let [first_rest, second_rest] = DECAYS.map(|factor| T::of(1.0 - factor));
        let stride = T::of(rate / (1.0 - self.powers[0]));
        let root = T::of((1.0 - self.powers[1]).sqrt());
        let (decay, epsilon) = (T::of(decay), T::of(EPSILON));
        let state = self.means.iter_mut().zip(&mut self.squares);
        for ((weight, &gradient), (mean, square)) in weights.iter_mut().zip(gradient).zip(state) {
            let gradient = gradient + *weight * decay;
            *mean = *mean * first + gradient * first_rest;
            *square = *square * second + gradient * gradient * second_rest;
            *weight = *weight - *mean * stride / (square.root() / root + epsilon);
        }
    }
}

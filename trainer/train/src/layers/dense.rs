//! Dense layers: every input is connected to every unit.

use super::Backward;
use crate::real::{Real, matrix, multiply};
use murmuration_swarm::training::Shape;

/// Parameters: one row of weights per unit, in the order of the input's values, then the biases.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Dense {
    pub(crate) input: Shape,
    pub(crate) units: usize,
}

impl Dense {
    pub(crate) fn forward<T: Real>(self, parameters: &[T], input: &[T], output: &mut [T]) {
        let values = self.input.len();
        let (weights, biases) = parameters.split_at(self.units * values);
        for row in output.chunks_exact_mut(self.units) {
            row.copy_from_slice(biases);
        }
        let samples = input.len() / values;
        let weights = matrix(self.units, values, weights);
        multiply(matrix(samples, values, input), weights.t(), true, output);
    }

    pub(crate) fn backward<T: Real>(self, pass: Backward<T>) {
        let values = self.input.len();
        let samples = pass.input.len() / values;
        let input = matrix(samples, values, pass.input);
        let d_output = matrix(samples, self.units, pass.d_output);
        let (d_weights, d_biases) = pass.d_parameters.split_at_mut(self.units * values);
        multiply(d_output.t(), input, true, d_weights);
        for row in pass.d_output.chunks_exact(self.units) {
            for (sum, &value) in d_biases.iter_mut().zip(row) {
                *sum += value;
            }
        }
        if let Some(d_input) = pass.d_input {
            let weights = &pass.parameters[..self.units * values];
            multiply(d_output, matrix(self.units, values, weights), false, d_input);
        }
    }
}

//! Compares each layer's gradient with finite differences, in f64.

use super::{Backward, Operation};
use murmuration_swarm::{
    Purpose, RandomStream,
    training::{Layer, Shape, parameters},
};
use rand::RngExt as _;

const SAMPLES: usize = 3;

struct Case {
    operation: Operation,
    output: Shape,
    parameters: Vec<f64>,
    input: Vec<f64>,
    /// The loss is the sum of the outputs times these weights.
    weights: Vec<f64>,
}

impl Case {
    fn new(layer: Layer, input: Shape, output: Shape) -> Self {
        let mut stream = RandomStream::derive(1, Purpose::Initialise, 0);
        let mut values =
            |count: usize| -> Vec<f64> { (0..count).map(|_| stream.random_range(-1.0..1.0)).collect() };
        Self {
            operation: Operation::of(layer, input, output).unwrap(),
            output,
            parameters: values(parameters(layer, input)),
            input: values(SAMPLES * input.len()),
            weights: values(SAMPLES * output.len()),
        }
    }

    fn forward(&self) -> (Vec<f64>, Vec<f64>) {
        let mut output = vec![0.0; SAMPLES * self.output.len()];
        let mut notes = vec![0.0; SAMPLES * self.operation.notes()];
        self.operation.forward(
            &self.parameters,
            &self.input,
            &mut output,
            &mut notes,
            &mut Vec::new(),
        );
        (output, notes)
    }

    fn loss(&self) -> f64 {
        self.forward()
            .0
            .iter()
            .zip(&self.weights)
            .map(|(a, b)| a * b)
            .sum()
    }

    /// The gradients with respect to the parameters and to the input.
    fn gradients(&self) -> (Vec<f64>, Vec<f64>) {
        // The buffers do not start at zero: the test checks that parameter gradients are added and the input gradient is
        // overwritten.
        let mut d_parameters = vec![1.0; self.parameters.len()];
        let mut d_input = vec![7.0; self.input.len()];
        self.operation.backward(Backward {
            parameters: &self.parameters,
            input: &self.input,
            notes: &self.forward().1,
            d_output: &self.weights,
            d_input: Some(&mut d_input),
            d_parameters: &mut d_parameters,
            scratch: &mut vec![9.0; 5],
        });
        (d_parameters.iter().map(|value| value - 1.0).collect(), d_input)
    }

    fn slope(&mut self, of: impl Fn(&mut Self) -> &mut f64) -> f64 {
        const STEP: f64 = 1e-5;
        let value = *of(self);
        *of(self) = value + STEP;
        let above = self.loss();
        *of(self) = value - STEP;
        let below = self.loss();
        *of(self) = value;
        (above - below) / (2.0 * STEP)
    }
}

#[track_caller]
fn check(layer: Layer, input: (usize, usize), output: (usize, usize)) {
    let shape = |(channels, side)| Shape { channels, side };
    let mut case = Case::new(layer, shape(input), shape(output));
    let (d_parameters, d_input) = case.gradients();
    for (i, &gradient) in d_parameters.iter().enumerate() {
        let slope = case.slope(|case| &mut case.parameters[i]);
        assert!(
            (gradient - slope).abs() < 1e-7,
            "parameter {i}: {gradient}, not {slope}"
        );
    }
    for (i, &gradient) in d_input.iter().enumerate() {
        let slope = case.slope(|case| &mut case.input[i]);
        assert!(
            (gradient - slope).abs() < 1e-7,
            "input {i}: {gradient}, not {slope}"
        );
    }
}

fn convolution(channels: usize, kernel: usize, stride: usize, padding: usize) -> Layer {
    Layer::Convolution {
        channels,
        kernel,
        stride,
        padding,
    }
}

#[test]
fn convolutions() {
    check(convolution(4, 3, 2, 1), (2, 7), (4, 4));
    check(convolution(3, 2, 1, 0), (2, 5), (3, 4));
    check(convolution(1, 4, 3, 3), (3, 5), (1, 3));
    check(convolution(2, 1, 1, 0), (1, 4), (2, 4));
}

#[test]
fn convolutions_of_one_channel() {
    check(convolution(1, 3, 1, 0), (1, 12), (1, 10));
    check(convolution(1, 3, 1, 0), (1, 18), (1, 16));
    check(convolution(1, 3, 1, 0), (1, 23), (1, 21));
    check(convolution(1, 4, 1, 0), (1, 20), (1, 17));
    check(convolution(1, 5, 1, 0), (1, 5), (1, 1));
    check(convolution(1, 3, 1, 1), (1, 6), (1, 6));
}

#[test]
fn group_normalisation() {
    for groups in [1, 2, 6] {
        check(Layer::GroupNormalisation { groups }, (6, 4), (6, 4));
    }
}

#[test]
fn average_pooling() {
    check(Layer::AveragePooling { grid: 2 }, (3, 7), (3, 2));
    check(Layer::AveragePooling { grid: 3 }, (1, 6), (1, 3));
    check(Layer::AveragePooling { grid: 1 }, (2, 5), (2, 1));
}

#[test]
fn dense_layers() {
    check(Layer::Dense { units: 4 }, (2, 3), (4, 1));
    check(Layer::Dense { units: 1 }, (5, 1), (1, 1));
}

//! The layers, each with its forward and its backward pass over a chunk of images.
//!
//! Pictures lie pixel after pixel, the channels of a pixel together: a convolution then copies its patches in
//! runs and multiplies a whole chunk at once. ONNX and PyTorch keep channel after channel, so weights are put in
//! order when they leave ([`crate::onnx`]).

mod activation;
mod average_pooling;
mod convolution;
mod dense;
#[cfg(test)]
mod finite_differences;
mod group_normalisation;
mod plane;

pub(crate) use activation::Activation;
pub(crate) use average_pooling::AveragePooling;
pub(crate) use convolution::Convolution;
pub(crate) use dense::Dense;
pub(crate) use group_normalisation::{EPSILON, GroupNormalisation};

use crate::real::Real;
use murmuration_proto::training::{Layer, Shape};

/// A layer that computes something new (activations change values in place instead).
#[derive(Debug, Clone, Copy)]
pub(crate) enum Operation {
    Convolution(Convolution),
    GroupNormalisation(GroupNormalisation),
    AveragePooling(AveragePooling),
    Dense(Dense),
}

/// What a backward pass is given and what it fills in. Gradients are those of the loss.
pub(crate) struct Backward<'a, T> {
    pub(crate) parameters: &'a [T],
    /// What went in when the layer ran forward.
    pub(crate) input: &'a [T],
    /// What the layer noted then.
    pub(crate) notes: &'a [T],
    /// By what came out.
    pub(crate) d_output: &'a [T],
    /// By what went in, to be overwritten; `None` if nobody asks (the first layer).
    pub(crate) d_input: Option<&'a mut [T]>,
    /// By the parameters, to be added to.
    pub(crate) d_parameters: &'a mut [T],
    /// Room for anything.
    pub(crate) scratch: &'a mut Vec<T>,
}

impl Operation {
    /// The operation of a layer that takes `input`; `None` for an activation.
    pub(crate) fn of(layer: Layer, input: Shape, output: Shape) -> Option<Self> {
        match layer {
            Layer::Convolution {
                kernel,
                stride,
                padding,
                ..
            } => Some(Self::Convolution(Convolution {
                input,
                output,
                kernel,
                stride,
                padding,
            })),
            Layer::GroupNormalisation { groups } => Some(Self::GroupNormalisation(GroupNormalisation {
                shape: input,
                groups,
            })),
            Layer::AveragePooling { .. } => Some(Self::AveragePooling(AveragePooling { input, output })),
            Layer::Dense { units } => Some(Self::Dense(Dense { input, units })),
            Layer::LeakyRelu { .. } | Layer::Relu => None,
        }
    }

    /// Values a sample that it notes for the backward pass.
    pub(crate) const fn notes(&self) -> usize {
        match self {
            Self::GroupNormalisation(layer) => 2 * layer.groups,
            Self::Convolution(_) | Self::AveragePooling(_) | Self::Dense(_) => 0,
        }
    }

    /// How many values meet in one value that comes out; decides the size of the first weights.
    pub(crate) const fn fan_in(&self) -> usize {
        match self {
            Self::Convolution(layer) => layer.patch(),
            Self::Dense(layer) => layer.input.len(),
            Self::GroupNormalisation(_) | Self::AveragePooling(_) => 0,
        }
    }

    pub(crate) fn forward<T: Real>(
        &self,
        parameters: &[T],
        input: &[T],
        output: &mut [T],
        notes: &mut [T],
        scratch: &mut Vec<T>,
    ) {
        match self {
            Self::Convolution(layer) => layer.forward(parameters, input, output, scratch),
            Self::GroupNormalisation(layer) => layer.forward(parameters, input, output, notes),
            Self::AveragePooling(layer) => layer.forward(input, output),
            Self::Dense(layer) => layer.forward(parameters, input, output),
        }
    }

    pub(crate) fn backward<T: Real>(&self, pass: Backward<T>) {
        match self {
            Self::Convolution(layer) => layer.backward(pass),
            Self::GroupNormalisation(layer) => layer.backward(pass),
            Self::AveragePooling(layer) => layer.backward(pass),
            Self::Dense(layer) => layer.backward(pass),
        }
    }
}

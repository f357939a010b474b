//! The layers, each with its forward and its backward pass over a chunk of images.
//!
//! The layout is channels-last: the channels of a pixel are adjacent, so that a convolution reads the values under a row of its
//! kernel as one run. ONNX and PyTorch are channels-first, so weights are reordered at export ([`crate::onnx`]).

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
use murmuration_swarm::training::{Layer, Shape};

/// A layer with its own output (activations change values in place).
#[derive(Debug, Clone)]
pub(crate) enum Operation {
    Convolution(Convolution),
    GroupNormalisation(GroupNormalisation),
    AveragePooling(AveragePooling),
    Dense(Dense),
}

/// Inputs and outputs of a backward pass. All gradients are gradients of the loss.
pub(crate) struct Backward<'a, T> {
    pub(crate) parameters: &'a [T],
    /// The input of the forward pass.
    pub(crate) input: &'a [T],
    /// The values that the forward pass kept.
    pub(crate) notes: &'a [T],
    /// The gradient with respect to the output.
    pub(crate) d_output: &'a [T],
    /// The gradient with respect to the input, which the pass overwrites; `None` for the first layer, which needs no such
    /// gradient.
    pub(crate) d_input: Option<&'a mut [T]>,
    /// The gradient with respect to the parameters, which the pass adds to.
    pub(crate) d_parameters: &'a mut [T],
    pub(crate) scratch: &'a mut Vec<T>,
}

impl Operation {
    /// The operation of a layer with this input shape; `None` for an activation.
    pub(crate) fn of(layer: Layer, input: Shape, output: Shape) -> Option<Self> {
        match layer {
            Layer::Convolution {
                kernel,
                stride,
                padding,
                ..
            } => Some(Self::Convolution(Convolution::new(
                input, output, kernel, stride, padding,
            ))),
            Layer::GroupNormalisation { groups } => Some(Self::GroupNormalisation(GroupNormalisation {
                shape: input,
                groups,
                activation: None,
            })),
            Layer::AveragePooling { .. } => Some(Self::AveragePooling(AveragePooling { input, output })),
            Layer::Dense { units } => Some(Self::Dense(Dense { input, units })),
            Layer::LeakyRelu { .. } | Layer::Relu => None,
        }
    }

    /// Fuses the activation that follows into the operation's own passes, if possible.
    pub(crate) const fn fuse(&mut self, activation: Layer) {
        if let Self::GroupNormalisation(layer) = self {
            layer.activation = Activation::of(activation);
        }
    }

    /// Whether the operation's own passes contain the activation that follows.
    pub(crate) const fn is_fused(&self) -> bool {
        matches!(self, Self::GroupNormalisation(layer) if layer.activation.is_some())
    }

    /// Number of values per sample that the forward pass keeps for the backward pass.
    pub(crate) const fn notes(&self) -> usize {
        match self {
            Self::GroupNormalisation(layer) => 2 * layer.groups,
            Self::Convolution(_) | Self::AveragePooling(_) | Self::Dense(_) => 0,
        }
    }

    /// Number of inputs of one output value, which determines the size of the initial weights.
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

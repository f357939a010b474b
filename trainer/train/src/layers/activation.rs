//! Leaky rectifiers, computed in place. The derivative follows from the output, so the forward pass keeps no other values.

use crate::real::Real;
use murmuration_swarm::training::Layer;

/// The function that returns x, or `slope` times x if x is negative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Activation {
    pub(super) slope: f64,
}

impl Activation {
    /// The activation that `layer` describes; `None` if the layer is not an activation.
    pub(crate) const fn of(layer: Layer) -> Option<Self> {
        match layer {
            Layer::LeakyRelu { slope } => Some(Self { slope }),
            Layer::Relu => Some(Self { slope: 0.0 }),
            _ => None,
        }
    }

    pub(crate) fn forward<T: Real>(self, values: &mut [T]) {
        let slope = T::of(self.slope);
        for value in values {
            *value = if *value > T::zero() {
                *value
            } else {
                *value * slope
            };
        }
    }

    /// Turns gradients with respect to the output into gradients with respect to the input.
    pub(crate) fn backward<T: Real>(self, output: &[T], gradient: &mut [T]) {
        let slope = T::of(self.slope);
        for (gradient, &output) in gradient.iter_mut().zip(output) {
            let factor = if output > T::zero() { T::one() } else { slope };
            *gradient = *gradient * factor;
        }
    }
}

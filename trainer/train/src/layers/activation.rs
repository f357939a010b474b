//! Leaky rectifiers, in place. The derivative follows from the output, so nothing else is kept.

use crate::real::Real;
use murmuration_swarm::training::Layer;

/// x, or `slope` x if x is negative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Activation {
    pub(super) slope: f64,
}

impl Activation {
    /// The activation of a layer, if it is one.
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

    /// Turns gradients by the output into gradients by the input.
    pub(crate) fn backward<T: Real>(self, output: &[T], gradient: &mut [T]) {
        let slope = T::of(self.slope);
        for (gradient, &output) in gradient.iter_mut().zip(output) {
            let factor = if output > T::zero() { T::one() } else { slope };
            *gradient = *gradient * factor;
        }
    }
}

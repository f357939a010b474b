//! What comes out of one simulation.

use crate::{ImageFormat, Invalid, v1};

/// The five hand-crafted features of Brown et al. (paper, Table 1), each a mean over the last 100 steps:
/// average speed, angular momentum, radial variance (times 20), scatter, group rotation.
pub type Features = [f64; 5];

/// Names of the [`Features`], in order, as columns and axes show them.
pub const FEATURE_NAMES: [&str; 5] = [
    "average_speed",
    "angular_momentum",
    "radial_variance_x20",
    "scatter",
    "group_rotation",
];

/// The outcome of simulating one controller from one start.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    features: Features,
    image: Vec<u8>,
}

impl Evaluation {
    /// An evaluation with its picture in `format`: grey values, index `x * resolution + y`.
    ///
    /// # Errors
    /// Names a feature that is not finite, or a picture of the wrong length.
    pub fn new(features: Features, image: Vec<u8>, format: &ImageFormat) -> Result<Self, Invalid> {
        for (name, value) in FEATURE_NAMES.iter().zip(features) {
            if !value.is_finite() {
                return Err(Invalid::new(format!("features.{name}"), value, "finite"));
            }
        }
        if image.len() != format.pixels() {
            let allowed = format!("{} bytes", format.pixels());
            return Err(Invalid::new("image", format!("{} bytes", image.len()), allowed));
        }
        Ok(Self { features, image })
    }

    /// Takes an evaluation in from a worker that was asked for `format`.
    ///
    /// # Errors
    /// As [`Evaluation::new`], and where there are not five features.
    pub fn for_format(message: v1::Evaluation, format: &ImageFormat) -> Result<Self, Invalid> {
        let features = Features::try_from(message.features.as_slice()).map_err(|_| {
            Invalid::new(
                "features",
                format!("{} values", message.features.len()),
                "5 values",
            )
        })?;
        Self::new(features, message.image, format)
    }

    /// The hand-crafted features.
    #[must_use]
    pub const fn features(&self) -> &Features {
        &self.features
    }

    /// Grey values, index `x * resolution + y`.
    #[must_use]
    pub fn image(&self) -> &[u8] {
        &self.image
    }

    /// The picture alone.
    #[must_use]
    pub fn into_image(self) -> Vec<u8> {
        self.image
    }

    /// Whether the two are the same bits.
    #[must_use]
    pub fn same_bits(&self, other: &Self) -> bool {
        let bits = |features: &Features| features.map(f64::to_bits);
        bits(&self.features) == bits(&other.features) && self.image == other.image
    }
}

impl From<Evaluation> for v1::Evaluation {
    fn from(evaluation: Evaluation) -> Self {
        Self {
            features: evaluation.features.to_vec(),
            image: evaluation.image,
        }
    }
}

//! The architecture of a network: its layers as data, by name or from a configuration, with every shape checked.

use crate::PictureShape;

/// The values of one image between two layers: channels of square pictures, with side 1 after flattening.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    pub channels: usize,
    /// Number of pixels along a side of each channel.
    pub side: usize,
}

impl Shape {
    /// Number of values.
    #[must_use]
    pub const fn len(self) -> usize {
        self.channels * self.pixels()
    }

    /// Whether there are no values, which never happens in a checked architecture.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// Number of pixels of one channel.
    #[must_use]
    pub const fn pixels(self) -> usize {
        self.side * self.side
    }
}

impl From<PictureShape> for Shape {
    fn from(pictures: PictureShape) -> Self {
        Self {
            channels: pictures.channels(),
            side: pictures.side(),
        }
    }
}

/// One layer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Layer {
    /// Square kernels over all channels, with a bias.
    Convolution {
        /// Number of output channels, 1 to 1,024.
        channels: usize,
        /// Side of the kernel, pixels, 1 or more.
        kernel: usize,
        /// Stride of the kernel, pixels, 1 or more.
        stride: usize,
        /// Zeros around the picture, pixels, less than the kernel.
        padding: usize,
    },
    /// Normalises each image's mean and variance over groups of channels to 0 and 1, then scales and shifts each channel.
    GroupNormalisation {
        /// Number of groups; must divide the channels.
        groups: usize,
    },
    /// x, or `slope` x where x is negative.
    LeakyRelu {
        /// Slope for negative x, 0 to 1.
        slope: f64,
    },
    /// x, or 0 where x is negative.
    Relu,
    /// Means over a grid of equal windows. For a picture of side s, a window has side s - (grid - 1) (s / grid), with s / grid
    /// rounded down. Windows overlap if grid does not divide s.
    AveragePooling {
        /// Number of windows along a side, 1 or more.
        grid: usize,
    },
    /// Connects every value to every unit, with a bias. The input is flattened.
    Dense {
        /// Number of output values, 1 to 65,536.
        units: usize,
    },
}

/// Error in a list of layers. `layer` counts from 0.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ArchitectureError {
    #[error("no network is called \"{0}\": there are \"compact\" and \"paper\", or give its layers")]
    UnknownName(String),
    /// There is no layer, or the last layer is not dense with 1 to 256 units.
    #[error("the last layer must be dense: its units are the embedding's dimensions (1 to 256)")]
    NoEmbedding,
    /// There are more than a hundred layers.
    #[error("{0} layers: at most 100 are allowed")]
    TooManyLayers(usize),
    #[error("layer {layer}: {field} = {value}: must be {allowed}")]
    OutOfRange {
        layer: usize,
        /// The name of the number that is out of range.
        field: &'static str,
        value: String,
        allowed: String,
    },
    /// An activation is the first layer, or follows another activation.
    #[error("layer {layer}: an activation must follow a layer that computes")]
    LooseActivation { layer: usize },
    /// A convolution or pooling follows a dense layer.
    #[error("layer {layer}: it needs a picture, but follows a dense layer")]
    Flattened { layer: usize },
    /// One layer has too many values, or the network too many weights.
    #[error("layer {layer}: more than {limit} {what}")]
    TooLarge {
        layer: usize,
        /// `values` or `weights`.
        what: &'static str,
        limit: usize,
    },
}

/// Maximum number of values of one image between two layers.
const MAX_VALUES: usize = 1 << 22;
/// Maximum number of weights of a network, which take 64 MB.
const MAX_PARAMETERS: usize = 1 << 24;

/// A checked list of layers for pictures of one shape.
#[derive(Debug, Clone, PartialEq)]
pub struct Architecture {
    pictures: PictureShape,
    layers: Vec<Layer>,
    /// The input shape of each layer, and the output shape of the last layer.
    shapes: Vec<Shape>,
}

impl Architecture {
    /// Layers for pictures of this shape.
    ///
    /// # Errors
    /// The error names the layer that cannot follow the layer before it.
    pub fn new(pictures: PictureShape, layers: Vec<Layer>) -> Result<Self, ArchitectureError> {
        if layers.len() > 100 {
            return Err(ArchitectureError::TooManyLayers(layers.len()));
        }
        match layers.last() {
            Some(Layer::Dense { units: 1..=256 }) => {}
            _ => return Err(ArchitectureError::NoEmbedding),
        }
        let mut shapes = vec![Shape::from(pictures)];
        let mut check = Check::default();
        for (layer, &spec) in layers.iter().enumerate() {
            let shape = check.follow(layer, spec, shapes[layer])?;
            shapes.push(shape);
        }
        Ok(Self {
            pictures,
            layers,
            shapes,
        })
    }

    /// The network with this name, `compact` or `paper`, for pictures of this shape and embeddings of `dimensions`.
    ///
    /// # Errors
    /// If the name is unknown, or the pictures are too small or too large for the network.
    pub fn named(name: &str, pictures: PictureShape, dimensions: usize) -> Result<Self, ArchitectureError> {
        match name {
            "compact" => Self::compact(pictures, dimensions),
            "paper" => Self::paper(pictures, dimensions),
            _ => Err(ArchitectureError::UnknownName(name.to_owned())),
        }
    }

    /// The paper's network: three 3 x 3 convolutions of one channel, then dense layers of 256, 64 and `dimensions`
    /// units ("Simulation and Data": one channel of 50 x 50 pixels, and 5 dimensions).
    ///
    /// # Errors
    /// If the side is under 7, or too large for the dense layers, or `dimensions` is not 1 to 256.
    pub fn paper(pictures: PictureShape, dimensions: usize) -> Result<Self, ArchitectureError> {
        let convolution = Layer::Convolution {
            channels: 1,
            kernel: 3,
            stride: 1,
            padding: 0,
        };
        let leaky = Layer::LeakyRelu { slope: 0.01 };
        let mut layers = [convolution, leaky].repeat(3);
        layers.extend([Layer::Dense { units: 256 }, Layer::Relu]);
        layers.extend([Layer::Dense { units: 64 }, Layer::Relu]);
        layers.push(Layer::Dense { units: dimensions });
        Self::new(pictures, layers)
    }

    /// The default network: three 3 x 3 convolutions of 16, 32 and 64 channels and stride 2, each normalised in
    /// four groups, pooled to 2 x 2, then dense layers of 64 and `dimensions` units.
    ///
    /// # Errors
    /// If the side is under 9, or `dimensions` is not 1 to 256.
    pub fn compact(pictures: PictureShape, dimensions: usize) -> Result<Self, ArchitectureError> {
        let mut layers = Vec::new();
        for channels in [16, 32, 64] {
            layers.push(Layer::Convolution {
                channels,
                kernel: 3,
                stride: 2,
                padding: 1,
            });
            layers.push(Layer::GroupNormalisation { groups: 4 });
            layers.push(Layer::LeakyRelu { slope: 0.01 });
        }
        layers.push(Layer::AveragePooling { grid: 2 });
        layers.extend([Layer::Dense { units: 64 }, Layer::Relu]);
        layers.push(Layer::Dense { units: dimensions });
        Self::new(pictures, layers)
    }

    #[must_use]
    pub const fn pictures(&self) -> PictureShape {
        self.pictures
    }

    /// Number of weights, at most 16,777,216.
    #[must_use]
    pub fn weights(&self) -> usize {
        let weights = |(layer, input, _)| parameters(layer, input);
        self.shaped_layers().map(weights).sum()
    }

    /// Length of the embedding.
    #[must_use]
    pub fn dimensions(&self) -> usize {
        self.shapes.last().map_or(0, |shape| shape.channels)
    }

    #[must_use]
    pub fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// Each layer with its input and output shapes.
    pub fn shaped_layers(&self) -> impl Iterator<Item = (Layer, Shape, Shape)> {
        let between = self.shapes.windows(2).map(|pair| (pair[0], pair[1]));
        self.layers
            .iter()
            .zip(between)
            .map(|(&layer, (input, output))| (layer, input, output))
    }
}

/// The state while layers are checked one after the other.
#[derive(Debug, Default)]
struct Check {
    flattened: bool,
    activation_may_follow: bool,
    parameters: usize,
}

impl Check {
    /// The output shape of `spec` for `input`.
    fn follow(&mut self, layer: usize, spec: Layer, input: Shape) -> Result<Shape, ArchitectureError> {
        let out_of_range = |field, value: String, allowed: String| ArchitectureError::OutOfRange {
            layer,
            field,
            value,
            allowed,
        };
        let whole = |field, value: usize, least: usize, most: usize| {
            let error = || out_of_range(field, value.to_string(), format!("{least} to {most}"));
            if (least..=most).contains(&value) {
                Ok(value)
            } else {
                Err(error())
            }
        };
        let is_activation = matches!(spec, Layer::LeakyRelu { .. } | Layer::Relu);
        if is_activation && !self.activation_may_follow {
            return Err(ArchitectureError::LooseActivation { layer });
        }
        self.activation_may_follow = !is_activation;
        if self.flattened && matches!(spec, Layer::Convolution { .. } | Layer::AveragePooling { .. }) {
            return Err(ArchitectureError::Flattened { layer });
        }
        let output = match spec {
            Layer::Relu => input,
            Layer::LeakyRelu { slope } if (0.0..=1.0).contains(&slope) => input,
            Layer::LeakyRelu { slope } => {
                return Err(out_of_range("slope", slope.to_string(), "0 to 1".to_owned()));
            }
            Layer::GroupNormalisation { groups } => {
                whole("groups", groups, 1, input.channels)?;
                if !input.channels.is_multiple_of(groups) {
                    let allowed = format!("a divisor of the {} channels", input.channels);
                    return Err(out_of_range("groups", groups.to_string(), allowed));
                }
                input
            }
            Layer::AveragePooling { grid } => Shape {
                side: whole("grid", grid, 1, input.side)?,
                ..input
            },
            Layer::Convolution {
                channels,
                kernel,
                stride,
                padding,
            } => {
                whole("channels", channels, 1, 1024)?;
                whole("padding", padding, 0, kernel.saturating_sub(1))?;
                whole("kernel", kernel, 1, (input.side + 2 * padding).min(99))?;
                whole("stride", stride, 1, input.side)?;
                let side = (input.side + 2 * padding - kernel) / stride + 1;
                Shape { channels, side }
            }
            Layer::Dense { units } => {
                self.flattened = true;
                Shape {
                    channels: whole("units", units, 1, 65_536)?,
                    side: 1,
                }
            }
        };
        self.parameters += parameters(spec, input);
        let too_large = |what, limit| ArchitectureError::TooLarge { layer, what, limit };
        if output.len() > MAX_VALUES {
            return Err(too_large("values", MAX_VALUES));
        }
        if self.parameters > MAX_PARAMETERS {
            return Err(too_large("weights", MAX_PARAMETERS));
        }
        Ok(output)
    }
}

/// Number of weights of a layer.
#[must_use]
pub const fn parameters(layer: Layer, input: Shape) -> usize {
    match layer {
        Layer::Convolution { channels, kernel, .. } => channels * (kernel * kernel * input.channels + 1),
        Layer::GroupNormalisation { .. } => 2 * input.channels,
        Layer::Dense { units } => units * (input.len() + 1),
        Layer::LeakyRelu { .. } | Layer::Relu | Layer::AveragePooling { .. } => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::Configuration;

    fn sides(architecture: &Architecture) -> Vec<(usize, usize)> {
        architecture
            .shapes
            .iter()
            .map(|shape| (shape.channels, shape.side))
            .collect()
    }

    #[test]
    fn the_papers_network_flattens_to_1936_values() {
        let paper = Architecture::paper(PictureShape::PAPER, 5).unwrap();
        assert_eq!(paper.shapes[6].len(), 1936);
        assert_eq!(paper.dimensions(), 5);
    }

    #[test]
    fn the_compact_network_pools_to_256_values() {
        let compact = Architecture::compact(PictureShape::PAPER, 5).unwrap();
        let expected = [
            (1, 50),
            (16, 25),
            (16, 25),
            (16, 25),
            (32, 13),
            (32, 13),
            (32, 13),
            (64, 7),
        ];
        assert_eq!(sides(&compact)[..8], expected);
        assert_eq!(compact.shapes[10].len(), 256);
    }

    #[track_caller]
    fn check_refused(layers: &str, expected: &str) {
        let configuration = Configuration::from_toml(&format!("network.layers = [{layers}]")).unwrap();
        let error = configuration
            .architecture(PictureShape::PAPER)
            .unwrap_err()
            .to_string();
        assert!(error.contains(expected), "{error:?} does not say {expected:?}");
    }

    #[test]
    fn what_does_not_fit_is_named() {
        const DENSE: &str = "{ dense = { units = 5 } }";
        assert_eq!(
            Architecture::new(PictureShape::PAPER, Vec::new()),
            Err(ArchitectureError::NoEmbedding)
        );
        check_refused("{ dense = { units = 300 } }", "1 to 256");
        check_refused(&format!("\"relu\", {DENSE}"), "layer 0: an activation");
        check_refused(
            &format!("{DENSE}, \"relu\", \"relu\", {DENSE}"),
            "layer 2: an activation",
        );
        check_refused(
            &format!("{DENSE}, {{ average-pooling = {{ grid = 1 }} }}, {DENSE}"),
            "layer 1: it needs a picture",
        );
        check_refused(
            &format!("{{ convolution = {{ channels = 6, kernel = 51 }} }}, {DENSE}"),
            "layer 0: kernel = 51: must be 1 to 50",
        );
        check_refused(
            &format!("{{ convolution = {{ channels = 6, kernel = 3, stride = 0 }} }}, {DENSE}"),
            "stride = 0",
        );
        check_refused(
            &format!(
                "{{ convolution = {{ channels = 6, kernel = 3 }} }}, {{ group-normalisation = {{ groups = 4 }} }}, {DENSE}"
            ),
            "layer 1: groups = 4: must be a divisor of the 6 channels",
        );
        check_refused(
            &format!("{DENSE}, {{ leaky-relu = {{ slope = nan }} }}, {DENSE}"),
            "layer 1: slope = NaN",
        );
        check_refused(
            &format!("{{ dense = {{ units = 65536 }} }}, {DENSE}"),
            "layer 0: more than 16777216 weights",
        );
    }
}

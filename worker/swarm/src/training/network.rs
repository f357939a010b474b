//! The network of a training: by name, or layer by layer.

use super::{Architecture, ArchitectureError, Layer};
use crate::{Invalid, PictureShape};
use murmuration_proto::v1::{self, layer::Kind};

/// Names of networks. The first is the default.
const NAMES: [&str; 2] = ["compact", "paper"];
/// Default length of the embedding: the number of hand-crafted features.
const DIMENSIONS: usize = 5;

/// A network, which is not checked for pictures of any shape.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Network {
    Named { name: &'static str, dimensions: usize },
    Layers(Vec<Layer>),
}

impl Network {
    /// The network for pictures of this shape.
    ///
    /// # Errors
    /// If the network does not fit such pictures.
    pub(super) fn architecture(&self, pictures: PictureShape) -> Result<Architecture, ArchitectureError> {
        match self {
            Self::Named { name, dimensions } => Architecture::named(name, pictures, *dimensions),
            Self::Layers(layers) => Architecture::new(pictures, layers.clone()),
        }
    }
}

impl Default for Network {
    fn default() -> Self {
        Self::Named {
            name: NAMES[0],
            dimensions: DIMENSIONS,
        }
    }
}

impl TryFrom<v1::Network> for Network {
    type Error = Invalid;

    fn try_from(message: v1::Network) -> Result<Self, Invalid> {
        let v1::Network {
            name,
            dimensions,
            layers,
        } = message;
        if layers.is_empty() {
            return Ok(Self::Named {
                name: known_name(name.as_deref())?,
                dimensions: dimensions.map_or(DIMENSIONS, |dimensions| dimensions as usize),
            });
        }
        if name.is_some() || dimensions.is_some() {
            let allowed = "absent if the network has a name or dimensions";
            return Err(Invalid::new("layers", "given", allowed));
        }
        let layers = layers.into_iter().enumerate();
        let layers = layers.map(|(place, layer)| {
            let missing = || Invalid::missing(format!("layers[{place}]"), "a layer");
            layer.kind.map(Layer::from).ok_or_else(missing)
        });
        layers.collect::<Result<_, _>>().map(Self::Layers)
    }
}

/// The name of a network; without a name, the default.
fn known_name(name: Option<&str>) -> Result<&'static str, Invalid> {
    let Some(name) = name else {
        return Ok(NAMES[0]);
    };
    let known = NAMES.into_iter().find(|known| *known == name);
    known.ok_or_else(|| Invalid::new("name", format!("{name:?}"), "\"compact\" or \"paper\""))
}

/// The message has every field, because another version may have other defaults.
impl From<&Network> for v1::Network {
    fn from(network: &Network) -> Self {
        match network {
            Network::Named { name, dimensions } => Self {
                name: Some((*name).to_owned()),
                dimensions: Some(*dimensions as u32),
                layers: Vec::new(),
            },
            Network::Layers(layers) => Self {
                name: None,
                dimensions: None,
                layers: layers.iter().map(Into::into).collect(),
            },
        }
    }
}

impl From<Kind> for Layer {
    fn from(kind: Kind) -> Self {
        match kind {
            Kind::Convolution(layer) => Self::Convolution {
                channels: layer.channels as usize,
                kernel: layer.kernel as usize,
                stride: layer.stride.unwrap_or(1) as usize,
                padding: layer.padding.unwrap_or(0) as usize,
            },
            Kind::GroupNormalisation(layer) => Self::GroupNormalisation {
                groups: layer.groups as usize,
            },
            Kind::LeakyRelu(layer) => Self::LeakyRelu { slope: layer.slope },
            Kind::Relu(_) => Self::Relu,
            Kind::AveragePooling(layer) => Self::AveragePooling {
                grid: layer.grid as usize,
            },
            Kind::Dense(layer) => Self::Dense {
                units: layer.units as usize,
            },
        }
    }
}

impl From<&Layer> for v1::Layer {
    fn from(layer: &Layer) -> Self {
        let kind = match *layer {
            Layer::Convolution {
                channels,
                kernel,
                stride,
                padding,
            } => Kind::Convolution(v1::Convolution {
                channels: channels as u32,
                kernel: kernel as u32,
                stride: Some(stride as u32),
                padding: Some(padding as u32),
            }),
            Layer::GroupNormalisation { groups } => Kind::GroupNormalisation(v1::GroupNormalisation {
                groups: groups as u32,
            }),
            Layer::LeakyRelu { slope } => Kind::LeakyRelu(v1::LeakyRelu { slope }),
            Layer::Relu => Kind::Relu(v1::Relu {}),
            Layer::AveragePooling { grid } => Kind::AveragePooling(v1::AveragePooling { grid: grid as u32 }),
            Layer::Dense { units } => Kind::Dense(v1::Dense { units: units as u32 }),
        };
        Self { kind: Some(kind) }
    }
}

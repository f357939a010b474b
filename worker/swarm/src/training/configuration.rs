//! Validated settings, which together with the pictures determine the result of a training.

use super::{Architecture, ArchitectureError, Layer, Recipe};
use crate::{
    Invalid, PictureShape,
    invalid::{real, whole},
};
use serde::{Deserialize, Serialize};

/// The default network.
const NETWORK: &str = "compact";
/// Default length of the embedding: the number of hand-crafted features.
const DIMENSIONS: usize = 5;

/// A configuration as written, not yet checked. Absent fields take their defaults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Seed of every random stream, 0 to 2^63 - 1. Default 1.
    pub seed: u64,
    /// Share of the behaviours held out of the training to judge the embedding, over 0 to 0.5 (at most 1,000 behaviours).
    /// Default 0.1.
    pub held_out: f64,
    pub network: NetworkSettings,
    pub recipe: Recipe,
}

/// A network: by name, or layer by layer.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NetworkSettings {
    /// `compact` (the default) or `paper`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Length of the embedding of a named network, 1 to 256. Default 5, the number of hand-crafted features.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dimensions: Option<usize>,
    /// The network's layers, instead of a name and dimensions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub layers: Option<Vec<Layer>>,
}

impl NetworkSettings {
    /// Fills in the defaults, because another version may have other defaults.
    fn spell_out(&mut self) {
        if self.layers.is_none() {
            self.name.get_or_insert_with(|| NETWORK.to_owned());
            self.dimensions.get_or_insert(DIMENSIONS);
        }
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            seed: 1,
            held_out: 0.1,
            network: NetworkSettings::default(),
            recipe: Recipe::default(),
        }
    }
}

/// A checked configuration. On one machine, the same configuration and pictures give the same embedder, bit for bit.
#[derive(Debug, Clone, PartialEq)]
pub struct Configuration {
    settings: Settings,
}

impl Default for Configuration {
    /// The configuration of an empty table.
    fn default() -> Self {
        let mut settings = Settings::default();
        settings.network.spell_out();
        Self { settings }
    }
}

/// Error in a training configuration.
#[derive(Debug, thiserror::Error)]
pub enum ConfigurationError {
    /// A text that is not TOML, an unknown field, or a value of the wrong type, with the place in the text.
    #[error(transparent)]
    Syntax(#[from] toml::de::Error),
    #[error(transparent)]
    Value(#[from] Invalid),
}

impl Configuration {
    /// Reads a configuration (TOML; the fields are those of [`Settings`]).
    ///
    /// # Errors
    /// The error names the place that is not TOML, the unknown field, or the value that is not allowed.
    pub fn from_toml(text: &str) -> Result<Self, ConfigurationError> {
        let settings: Settings = toml::from_str(text)?;
        Ok(settings.try_into()?)
    }

    /// A copy with another seed, 0 to 2^63 - 1.
    ///
    /// # Errors
    /// If the seed is out of range.
    pub fn with_seed(&self, seed: u64) -> Result<Self, Invalid> {
        let settings = Settings {
            seed,
            ..self.settings.clone()
        };
        settings.try_into()
    }

    /// A copy with another recipe.
    ///
    /// # Errors
    /// If a number of the recipe is out of range.
    pub fn with_recipe(&self, recipe: Recipe) -> Result<Self, Invalid> {
        let settings = Settings {
            recipe,
            ..self.settings.clone()
        };
        settings.try_into()
    }

    /// Writes the configuration with every field, as in a checkpoint's `configuration`. [`Configuration::from_toml`] reads the
    /// same configuration from it.
    #[must_use]
    pub fn to_toml(&self) -> String {
        toml::to_string(&self.settings).unwrap_or_default()
    }

    /// Seed of every random stream.
    #[must_use]
    pub const fn seed(&self) -> u64 {
        self.settings.seed
    }

    /// How the network is trained.
    #[must_use]
    pub const fn recipe(&self) -> &Recipe {
        &self.settings.recipe
    }

    /// Number of held-out behaviours out of `behaviours`: at least 2 and at most 1,000, with at least 2 left to train on.
    #[must_use]
    pub fn held_out(&self, behaviours: usize) -> usize {
        let share = (self.settings.held_out * behaviours as f64) as usize;
        share.min(1000).clamp(2, behaviours - 2)
    }

    /// Whether embedders of both configurations are judged by the same triplets if they are trained on the same pictures.
    #[must_use]
    pub fn judges_as(&self, other: &Self) -> bool {
        let triplets = |of: &Self| {
            let Settings {
                seed,
                held_out,
                recipe,
                ..
            } = &of.settings;
            (*seed, *held_out, recipe.unlabelled_crop(), recipe.reflects())
        };
        triplets(self) == triplets(other)
    }

    /// The network for pictures of this shape.
    ///
    /// # Errors
    /// If the network does not fit such pictures.
    pub fn architecture(&self, pictures: PictureShape) -> Result<Architecture, ArchitectureError> {
        let NetworkSettings {
            name,
            dimensions,
            layers,
        } = &self.settings.network;
        match layers {
            Some(layers) => Architecture::new(pictures, layers.clone()),
            None => Architecture::named(
                name.as_deref().unwrap_or(NETWORK),
                pictures,
                dimensions.unwrap_or(DIMENSIONS),
            ),
        }
    }
}

impl Configuration {
    /// Maximum number of bytes of a snapshot of this training on pictures of this shape. A snapshot has four numbers per weight
    /// (the weight, the optimiser's two moments, the best weight so far), a loss per epoch, the configuration, and some figures.
    ///
    /// # Errors
    /// If the network does not fit such pictures.
    pub fn saved_bytes(&self, pictures: PictureShape) -> Result<usize, ArchitectureError> {
        const FIGURES: usize = 64 << 10;
        let weights = self.architecture(pictures)?.weights() * size_of::<[f32; 4]>();
        let losses = self.recipe().epochs() as usize * size_of::<f64>();
        Ok(weights + losses + self.to_toml().len() + FIGURES)
    }
}

impl TryFrom<Settings> for Configuration {
    type Error = Invalid;

    fn try_from(mut settings: Settings) -> Result<Self, Invalid> {
        whole("seed", settings.seed, 0..=i64::MAX as u64)?;
        real("held_out", settings.held_out, f64::MIN_POSITIVE..=0.5)?;
        settings.recipe.check().map_err(|error| error.within("recipe"))?;
        let network = &settings.network;
        if network.layers.is_some() && (network.name.is_some() || network.dimensions.is_some()) {
            let allowed = "absent where a name or dimensions are given";
            return Err(Invalid::new("network.layers", "given", allowed));
        }
        if let Some(name) = network
            .name
            .as_deref()
            .filter(|name| !["compact", "paper"].contains(name))
        {
            let allowed = "\"compact\" or \"paper\"";
            return Err(Invalid::new("network.name", format!("{name:?}"), allowed));
        }
        settings.network.spell_out();
        Ok(Self { settings })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check_refused(text: &str, expected: &str) {
        let error = Configuration::from_toml(text).unwrap_err().to_string();
        assert!(error.contains(expected), "{error:?} does not say {expected:?}");
    }

    #[test]
    fn embedders_are_judged_by_the_same_triplets_where_pictures_are_held_out_and_changed_alike() {
        let judges = |one: &str, other: &str| {
            let [one, other] = [one, other].map(|text| Configuration::from_toml(text).unwrap());
            one.judges_as(&other)
        };
        assert!(judges("", "[recipe.labelled]"));
        assert!(judges("[recipe.paper]", "[recipe.paper-labelled]"));
        assert!(!judges("", "[recipe.paper-labelled]"));
        assert!(!judges("", "seed = 2"));
        assert!(!judges("", "held_out = 0.2"));
        assert!(!judges("", "[recipe.labelled]\nunlabelled_crop = [0.8, 1.0]"));
    }

    #[test]
    fn the_paper_by_name() {
        let text = "[network]\nname = \"paper\"\n[recipe.paper]\n";
        let paper = Configuration::from_toml(text).unwrap();
        let Recipe::Paper(recipe) = paper.recipe() else {
            panic!("not the paper's recipe");
        };
        assert_eq!(recipe.batch * recipe.steps, 16_384);
        assert_eq!(
            paper.architecture(PictureShape::PAPER).unwrap(),
            Architecture::paper(PictureShape::PAPER, 5).unwrap()
        );
    }

    #[test]
    fn the_default_is_the_compact_network_and_in_batch_triplets() {
        let default = Configuration::from_toml("").unwrap();
        assert_eq!(default, Configuration::default());
        assert_eq!(default.recipe().name(), "in-batch");
        assert_eq!(
            default.architecture(PictureShape::PAPER).unwrap(),
            Architecture::compact(PictureShape::PAPER, 5).unwrap()
        );
    }

    #[test]
    fn what_is_written_reads_back() {
        let layers = "[network]\nlayers = [{ convolution = { channels = 2, kernel = 3 } }, \"relu\", { dense = { units = 3 } }]";
        for text in [
            "seed = 7",
            "[recipe.paper]\nmargin = 0.1",
            "[recipe.labelled]\nper_class = 3",
            "[recipe.paper-labelled]\naugmented = 0.1",
            layers,
        ] {
            let configuration = Configuration::from_toml(text).unwrap();
            assert_eq!(
                Configuration::from_toml(&configuration.to_toml()).unwrap(),
                configuration
            );
        }
        let architecture = Configuration::from_toml(layers)
            .unwrap()
            .architecture(PictureShape::new(1, 9).unwrap())
            .unwrap();
        assert_eq!((architecture.dimensions(), architecture.layers().len()), (3, 3));
    }

    #[test]
    fn what_is_wrong_is_named() {
        check_refused("sed = 1", "unknown field `sed`");
        check_refused("held_out = 0", "held_out = 0");
        check_refused("held_out = nan", "held_out = NaN");
        check_refused(
            "[network]\nname = \"large\"",
            "network.name = \"large\": must be \"compact\"",
        );
        check_refused("[network]\nname = \"paper\"\nlayers = []", "network.layers");
        check_refused("[recipe.paper]\nmargin = 0.0", "recipe.paper.margin = 0");
        check_refused("[recipe.in-batch]\nbatch = 1", "recipe.in-batch.batch = 1");
        check_refused(
            "[recipe.in-batch]\ncrop = [0.6, 2.1]",
            "recipe.in-batch.crop[1] = 2.1",
        );
        check_refused(
            "[recipe.labelled]\nper_class = 1",
            "recipe.labelled.per_class = 1",
        );
        check_refused(
            "[recipe.labelled]\nunlabelled_crop = [0, 1]",
            "recipe.labelled.unlabelled_crop[0] = 0",
        );
        check_refused(
            "[recipe.paper-labelled]\naugmented = 1.5",
            "recipe.paper-labelled.augmented = 1.5",
        );
        check_refused(
            "[recipe.paper-labelled]\nmargin = 0",
            "recipe.paper-labelled.margin = 0",
        );
        check_refused("[recipe.in-batch]\ncrop = [0.6, 0.5]", "a number from 0.6 to 2");
        check_refused("[recipe.supervised]\n", "unknown variant `supervised`");
    }
}

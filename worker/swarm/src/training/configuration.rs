//! Validated settings, which together with the pictures determine the result of a training.

use super::{Architecture, ArchitectureError, Recipe, network::Network};
use crate::{
    Invalid, PictureShape, TomlError,
    invalid::{real, whole},
    toml_file::read_toml,
};
use murmuration_proto::v1;

/// A checked configuration. On one machine, the same configuration and pictures give the same embedder, bit for bit.
#[derive(Debug, Clone, PartialEq)]
pub struct Configuration {
    seed: u64,
    held_out: f64,
    network: Network,
    recipe: Recipe,
}

impl Default for Configuration {
    /// The configuration of an empty table.
    fn default() -> Self {
        Self {
            seed: 1,
            held_out: 0.1,
            network: Network::default(),
            recipe: Recipe::default(),
        }
    }
}

/// Error in a training configuration.
#[derive(Debug, thiserror::Error)]
pub enum ConfigurationError {
    /// A text that is not TOML, an unknown field, or a value of the wrong type, with the place in the text.
    #[error(transparent)]
    Syntax(#[from] TomlError),
    #[error(transparent)]
    Value(#[from] Invalid),
}

impl Configuration {
    /// Reads a configuration (TOML; the fields are those of the message `Training`).
    ///
    /// # Errors
    /// The error names the place that is not TOML, the unknown field, or the value that is not allowed.
    pub fn from_toml(text: &str) -> Result<Self, ConfigurationError> {
        let message: v1::Training = read_toml(text)?;
        Ok(message.try_into()?)
    }

    /// A copy with another seed, 0 to 2^63 - 1.
    ///
    /// # Errors
    /// If the seed is out of range.
    pub fn with_seed(&self, seed: u64) -> Result<Self, Invalid> {
        let seed = Some(seed);
        v1::Training { seed, ..self.into() }.try_into()
    }

    /// A copy with another recipe.
    ///
    /// # Errors
    /// If a number of the recipe is out of range.
    pub fn with_recipe(&self, recipe: Recipe) -> Result<Self, Invalid> {
        let recipe = Some((&recipe).into());
        v1::Training {
            recipe,
            ..self.into()
        }
        .try_into()
    }

    /// Writes the configuration with every field, as in a checkpoint's `configuration`. [`Configuration::from_toml`] reads the
    /// same configuration from it.
    #[must_use]
    pub fn to_toml(&self) -> String {
        toml::to_string(&v1::Training::from(self)).unwrap_or_default()
    }

    /// Seed of every random stream.
    #[must_use]
    pub const fn seed(&self) -> u64 {
        self.seed
    }

    /// How the network is trained.
    #[must_use]
    pub const fn recipe(&self) -> &Recipe {
        &self.recipe
    }

    /// Number of held-out behaviours out of `behaviours`: at least 2 and at most 1,000, with at least 2 left to train on.
    #[must_use]
    pub fn held_out(&self, behaviours: usize) -> usize {
        let share = (self.held_out * behaviours as f64) as usize;
        share.min(1000).clamp(2, behaviours - 2)
    }

    /// Whether embedders of both configurations are judged by the same triplets if they are trained on the same pictures.
    #[must_use]
    pub fn judges_as(&self, other: &Self) -> bool {
        let triplets = |of: &Self| {
            (
                of.seed,
                of.held_out,
                of.recipe.unlabelled_crop(),
                of.recipe.reflects(),
            )
        };
        triplets(self) == triplets(other)
    }

    /// The network for pictures of this shape.
    ///
    /// # Errors
    /// If the network does not fit such pictures.
    pub fn architecture(&self, pictures: PictureShape) -> Result<Architecture, ArchitectureError> {
        self.network.architecture(pictures)
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

impl TryFrom<v1::Training> for Configuration {
    type Error = Invalid;

    fn try_from(message: v1::Training) -> Result<Self, Invalid> {
        let default = Self::default();
        let seed = message.seed.unwrap_or(default.seed);
        let held_out = message.held_out.unwrap_or(default.held_out);
        Ok(Self {
            seed: whole("seed", seed, 0..=i64::MAX as u64)?,
            held_out: real("held_out", held_out, f64::MIN_POSITIVE..=0.5)?,
            recipe: match message.recipe {
                Some(recipe) => recipe.try_into().map_err(|e: Invalid| e.within("recipe"))?,
                None => default.recipe,
            },
            network: match message.network {
                Some(network) => network.try_into().map_err(|e: Invalid| e.within("network"))?,
                None => default.network,
            },
        })
    }
}

/// The message has every field, because another version may have other defaults.
impl From<&Configuration> for v1::Training {
    fn from(configuration: &Configuration) -> Self {
        Self {
            seed: Some(configuration.seed),
            held_out: Some(configuration.held_out),
            network: Some((&configuration.network).into()),
            recipe: Some((&configuration.recipe).into()),
        }
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
        check_refused(
            "seed = 1\n[recipe.in-batch]\nepoch = 1",
            "3 | epoch = 1\n  | ^^^^^\nunknown field `epoch` in [recipe.in-batch]: did you mean `epochs`?",
        );
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
        check_refused(
            "[recipe.supervised]\n",
            "unknown value `supervised` of recipe. It may be `in-batch`, `paper`, `untrained`,",
        );
    }
}

//! How a network is trained: recipes by name, with all their numbers as written.

use super::{
    labelled_recipe::{Labelled, PaperLabelled},
    unlabelled_recipe::{InBatch, RandomTriplets},
};
use crate::Invalid;
use murmuration_proto::v1::{self, recipe::Kind};

/// A way to train.
#[derive(Debug, Clone, PartialEq)]
pub enum Recipe {
    /// The paper's recipe, with random negatives and a large margin.
    Paper(RandomTriplets),
    /// The default recipe, in which every other picture of a batch is a negative.
    InBatch(InBatch),
    /// Trains a trained network further, on all labelled triplets of a batch and on unlabelled triplets.
    Labelled(Labelled),
    /// Trains a trained network further, on random labelled triplets, as the paper does.
    PaperLabelled(PaperLabelled),
    /// No training: the network stays as it was initialised (the paper's baseline).
    Untrained,
}

impl Recipe {
    /// The recipe with this name, `paper`, `in-batch`, `labelled`, `paper-labelled` or `untrained`, with its default numbers.
    ///
    /// # Errors
    /// If there is no recipe with this name.
    pub fn named(name: &str) -> Result<Self, Invalid> {
        match name {
            "paper" => Ok(Self::Paper(RandomTriplets::default())),
            "in-batch" => Ok(Self::InBatch(InBatch::default())),
            "labelled" => Ok(Self::Labelled(Labelled::default())),
            "paper-labelled" => Ok(Self::PaperLabelled(PaperLabelled::default())),
            "untrained" => Ok(Self::Untrained),
            _ => Err(Invalid::new(
                "recipe",
                format!("\"{name}\""),
                "\"in-batch\", \"paper\", \"labelled\", \"paper-labelled\" or \"untrained\"",
            )),
        }
    }

    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Paper(_) => "paper",
            Self::InBatch(_) => "in-batch",
            Self::Labelled(_) => "labelled",
            Self::PaperLabelled(_) => "paper-labelled",
            Self::Untrained => "untrained",
        }
    }

    /// Whether the recipe trains a trained network further, on labels.
    #[must_use]
    pub const fn is_labelled(&self) -> bool {
        matches!(self, Self::Labelled(_) | Self::PaperLabelled(_))
    }

    /// The in-batch recipe's flattening; 0 for other recipes. If the flattening is not 0, training needs the features of the
    /// behaviours.
    #[must_use]
    pub const fn flattening(&self) -> u32 {
        match self {
            Self::InBatch(recipe) => recipe.flattening,
            Self::Paper(_) | Self::Labelled(_) | Self::PaperLabelled(_) | Self::Untrained => 0,
        }
    }

    /// Smallest and largest share of width and height that a random crop of a picture without a class keeps. Above 1, the picture
    /// shrinks on a black background. Pictures that judge an embedder get such crops, too.
    #[must_use]
    pub fn unlabelled_crop(&self) -> [f64; 2] {
        match self {
            Self::Paper(recipe) => recipe.crop,
            Self::InBatch(recipe) => recipe.crop,
            Self::Labelled(recipe) => recipe.unlabelled_crop,
            Self::PaperLabelled(recipe) => recipe.triplets.crop,
            Self::Untrained => Self::default().unlabelled_crop(),
        }
    }

    /// Whether pictures are also mirrored at random, and can stay unchanged. The paper's recipes always rotate pictures, and
    /// never mirror them.
    #[must_use]
    pub const fn reflects(&self) -> bool {
        match self {
            Self::Paper(_) | Self::PaperLabelled(_) => false,
            Self::InBatch(_) | Self::Labelled(_) | Self::Untrained => true,
        }
    }

    /// Maximum number of epochs of the training.
    #[must_use]
    pub const fn epochs(&self) -> u64 {
        match self {
            Self::Paper(recipe) => recipe.epochs,
            Self::InBatch(recipe) => recipe.epochs,
            Self::Labelled(recipe) => recipe.epochs,
            Self::PaperLabelled(recipe) => recipe.triplets.epochs,
            Self::Untrained => 0,
        }
    }

    /// The first learning rate.
    #[must_use]
    pub const fn learning_rate(&self) -> f64 {
        match self {
            Self::Paper(recipe) => recipe.learning_rate,
            Self::InBatch(recipe) => recipe.learning_rate,
            Self::Labelled(recipe) => recipe.learning_rate,
            Self::PaperLabelled(recipe) => recipe.triplets.learning_rate,
            Self::Untrained => 0.0,
        }
    }
}

impl Default for Recipe {
    fn default() -> Self {
        Self::InBatch(InBatch::default())
    }
}

impl TryFrom<v1::Recipe> for Recipe {
    type Error = Invalid;

    fn try_from(message: v1::Recipe) -> Result<Self, Invalid> {
        let kind = message.kind.ok_or_else(|| Invalid::missing("kind", "a recipe"))?;
        let (name, recipe) = match kind {
            Kind::InBatch(numbers) => ("in-batch", numbers.try_into().map(Self::InBatch)),
            Kind::Paper(numbers) => ("paper", numbers.try_into().map(Self::Paper)),
            Kind::Untrained(_) => ("untrained", Ok(Self::Untrained)),
            Kind::Labelled(numbers) => ("labelled", numbers.try_into().map(Self::Labelled)),
            Kind::PaperLabelled(numbers) => ("paper-labelled", numbers.try_into().map(Self::PaperLabelled)),
        };
        recipe.map_err(|error: Invalid| error.within(name))
    }
}

impl From<&Recipe> for v1::Recipe {
    fn from(recipe: &Recipe) -> Self {
        let kind = match recipe {
            Recipe::Paper(numbers) => Kind::Paper(numbers.into()),
            Recipe::InBatch(numbers) => Kind::InBatch(numbers.into()),
            Recipe::Labelled(numbers) => Kind::Labelled(numbers.into()),
            Recipe::PaperLabelled(numbers) => Kind::PaperLabelled(numbers.into()),
            Recipe::Untrained => Kind::Untrained(v1::Untrained {}),
        };
        Self { kind: Some(kind) }
    }
}

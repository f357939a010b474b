//! The behaviour space, in which novelty, clusters, queries and maps are measured.

use crate::{Features, Invalid, Method};
use std::fmt;

/// The measurements that make up a behaviour vector.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BehaviourSpace {
    /// The five hand-crafted features, unscaled (Brown et al.).
    Features,
    /// The embedding of the picture, unscaled, as in the paper.
    Embedding,
    /// The embedding followed by the features, each part scaled ([`Scale`]).
    Both,
}

impl BehaviourSpace {
    /// Name of the space in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Features => "features",
            Self::Embedding => "embedding",
            Self::Both => "both",
        }
    }

    /// Whether the embedding is a part of the space.
    #[must_use]
    pub const fn embeds(self) -> bool {
        matches!(self, Self::Embedding | Self::Both)
    }

    /// Whether the features are a part of the space.
    #[must_use]
    pub const fn has_features(self) -> bool {
        matches!(self, Self::Features | Self::Both)
    }

    /// The spaces that a campaign of this method can use, the default first.
    const fn of_method(method: Method) -> &'static [Self] {
        match method {
            Method::Random => &[Self::Features, Self::Embedding, Self::Both],
            Method::HandCrafted | Method::Exhaustive => &[Self::Features],
            Method::Latent | Method::Untrained => &[Self::Both, Self::Embedding],
        }
    }

    /// The space of this name, or the default of `method`.
    ///
    /// # Errors
    /// If there is no such space, or `method` cannot use it.
    pub fn from_field(name: Option<&str>, method: Method) -> Result<Self, Invalid> {
        let spaces = Self::of_method(method);
        let Some(name) = name else {
            return Ok(spaces[0]);
        };
        let found = spaces.iter().find(|space| space.name() == name);
        found.copied().ok_or_else(|| {
            let names = spaces.iter().map(|space| format!("\"{space}\""));
            let names = names.collect::<Vec<_>>().join(" or ");
            let allowed = format!("{names} with the method \"{method}\"");
            Invalid::new("space", crate::text::quoted(name), allowed)
        })
    }
}

impl fmt::Display for BehaviourSpace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A behaviour space with the factors of its values.
///
/// In [`BehaviourSpace::Both`], each feature is divided by its standard deviation over the first generation and by the root of
/// five. The embedding is divided by the root of its total variance over the first generation. Each part then has a total
/// variance of 1 in the first generation, and distances depend on both parts. In the other spaces, every factor is 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    space: BehaviourSpace,
    features: Features,
    embedding: f64,
}

impl Scale {
    /// The scale of an archive whose first generation has these features and embeddings, all embeddings of one length. A value
    /// that does not vary keeps the factor 1.
    #[must_use]
    pub fn of(space: BehaviourSpace, first: &[(Features, Vec<f32>)]) -> Self {
        let unscaled = Self::unscaled(space);
        if space != BehaviourSpace::Both {
            return unscaled;
        }
        let features = std::array::from_fn(|place| {
            let values = first.iter().map(|(features, _)| features[place]);
            factor(variance(values) * unscaled.features.len() as f64)
        });
        let dimensions = first.first().map_or(0, |(_, embedding)| embedding.len());
        let total = (0..dimensions)
            .map(|place| {
                let value = |embedding: &[f32]| embedding.get(place).copied().map_or(0.0, f64::from);
                variance(first.iter().map(|(_, embedding)| value(embedding)))
            })
            .fold(0.0, |sum, variance| sum + variance);
        Self {
            features,
            embedding: factor(total),
            ..unscaled
        }
    }

    /// The space with all factors 1.
    #[must_use]
    pub const fn unscaled(space: BehaviourSpace) -> Self {
        Self {
            space,
            features: [1.0; 5],
            embedding: 1.0,
        }
    }

    /// The behaviour vector of an individual.
    #[must_use]
    pub fn behaviour(&self, features: &Features, embedding: &[f32]) -> Vec<f64> {
        let embedding = embedding.iter().map(|&value| f64::from(value) * self.embedding);
        let embedding = embedding.filter(|_| self.space.embeds());
        let features = features.iter().zip(self.features);
        let features = features.map(|(value, factor)| value * factor);
        embedding
            .chain(features.filter(|_| self.space.has_features()))
            .collect()
    }
}

/// The population variance: the sum of squares divided by the number of values.
fn variance(values: impl ExactSizeIterator<Item = f64> + Clone) -> f64 {
    let count = values.len().max(1) as f64;
    let mean = values.clone().fold(0.0, |sum, value| sum + value) / count;
    values.fold(0.0, |sum, value| sum + (value - mean) * (value - mean)) / count
}

/// Factor that brings a variance to 1.
fn factor(variance: f64) -> f64 {
    let factor = 1.0 / variance.sqrt();
    if factor.is_finite() { factor } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_behaviour_has_the_parts_of_its_space() {
        let behaviour = |space| Scale::unscaled(space).behaviour(&[1.0, 2.0, 3.0, 4.0, 5.0], &[0.5, -0.5]);
        assert_eq!(behaviour(BehaviourSpace::Features), [1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(behaviour(BehaviourSpace::Embedding), [0.5, -0.5]);
        let both = [0.5, -0.5, 1.0, 2.0, 3.0, 4.0, 5.0];
        assert_eq!(behaviour(BehaviourSpace::Both), both);
    }

    #[test]
    fn each_part_has_a_variance_of_1_in_the_first_generation() {
        let first: Vec<(Features, Vec<f32>)> = (0..7_u8)
            .map(|i| {
                let at = f64::from(i * i);
                let features = [at, 100.0 * at, -3.0 * at, at.sin(), 7.0];
                (features, vec![at as f32, -5.0, at.cos() as f32])
            })
            .collect();
        let scale = Scale::of(BehaviourSpace::Both, &first);
        let behaviours: Vec<_> = first
            .iter()
            .map(|(features, embedding)| scale.behaviour(features, embedding))
            .collect();
        let total = |places: std::ops::Range<usize>| -> f64 {
            places
                .map(|place| variance(behaviours.iter().map(|behaviour| behaviour[place])))
                .sum()
        };
        assert!((total(0..3) - 1.0).abs() < 1e-12);
        // The last feature does not vary.
        assert!((total(3..8) - 0.8).abs() < 1e-12);
        assert_eq!(behaviours[0][7], 7.0);
    }

    #[test]
    fn other_spaces_are_not_scaled() {
        let first = [([3.0; 5], vec![2.0]), ([9.0; 5], vec![7.0])];
        for space in [BehaviourSpace::Features, BehaviourSpace::Embedding] {
            assert_eq!(Scale::of(space, &first), Scale::unscaled(space));
        }
    }
}

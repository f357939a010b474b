//! The outcome of one simulation.

use crate::{ImageFormat, Invalid, Verdict, counted};
use murmuration_proto::v1;

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

/// Largest magnitude of a feature: well above any value in a world of [`World::MAX_SIDE`](crate::World::MAX_SIDE), and small
/// enough to compute distances.
pub const MAX_FEATURE: f64 = 1e12;

/// Largest magnitude of a number of an embedding: well above those of a network that tells pictures apart, and small enough to
/// compute distances.
pub const MAX_EMBEDDING: f32 = 1e12;

/// Mean features of an individual's trials; zeros without trials. The mean of one trial has that trial's bits.
pub fn mean_features<'a>(trials: impl Iterator<Item = &'a Features>) -> Features {
    let mut count = 0_u32;
    let sum = trials
        .inspect(|_| count += 1)
        .copied()
        .reduce(|sum, next| std::array::from_fn(|i| sum[i] + next[i]));
    sum.unwrap_or_default().map(|sum| sum / f64::from(count.max(1)))
}

/// Mean embedding of an individual's trials, all of one length; empty without trials. Each number is summed in f64 and rounded
/// once, so the mean of one trial has that trial's bits.
pub fn mean_embedding<'a>(trials: impl Iterator<Item = &'a [f32]>) -> Vec<f32> {
    let mut count = 0_u32;
    let trials = trials.inspect(|_| count += 1);
    let widened = |trial: &[f32]| -> Vec<f64> { trial.iter().copied().map(f64::from).collect() };
    let sum = trials.map(widened).reduce(|mut sum, next| {
        sum.iter_mut().zip(next).for_each(|(sum, next)| *sum += next);
        sum
    });
    let mean = |sum: f64| (sum / f64::from(count.max(1))) as f32;
    sum.unwrap_or_default().into_iter().map(mean).collect()
}

/// The outcome of simulating one controller from one start.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    features: Features,
    image: Vec<u8>,
    /// Empty if not requested.
    embedding: Vec<f32>,
    /// `None` if not requested.
    verdict: Option<Verdict>,
}

/// Optional outputs of an evaluation, besides features and picture.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Extras {
    /// Length of the requested embedding; `None` if none is requested.
    pub dimensions: Option<usize>,
    /// Whether the judge names the class of the motion.
    pub judge: bool,
}

impl Evaluation {
    /// An evaluation with its picture in `format`.
    ///
    /// # Errors
    /// Names a feature that is not finite or over [`MAX_FEATURE`], or a picture of the wrong length.
    pub fn new(features: Features, image: Vec<u8>, format: &ImageFormat) -> Result<Self, Invalid> {
        for (name, value) in FEATURE_NAMES.iter().zip(features) {
            if !value.is_finite() {
                return Err(Invalid::new(format!("features.{name}"), value, "finite"));
            }
            if value.abs() > MAX_FEATURE {
                let value = format!("{value:e}");
                let allowed = format!("at most {MAX_FEATURE:e} in magnitude");
                return Err(Invalid::new(format!("features.{name}"), value, allowed));
            }
        }
        if image.len() != format.bytes() {
            let allowed = format!("{} bytes", format.bytes());
            return Err(Invalid::new("image", format!("{} bytes", image.len()), allowed));
        }
        Ok(Self {
            features,
            image,
            embedding: Vec::new(),
            verdict: None,
        })
    }

    /// Adds the judge's verdict on the motion.
    #[must_use]
    pub fn judged(self, verdict: Option<Verdict>) -> Self {
        Self { verdict, ..self }
    }

    /// Adds the embedding of the picture, which must have `dimensions` numbers.
    ///
    /// # Errors
    /// As [`check_embedding`].
    pub fn embedded(self, embedding: Vec<f32>, dimensions: usize) -> Result<Self, Invalid> {
        Ok(Self {
            embedding: check_embedding(embedding, dimensions)?,
            ..self
        })
    }

    /// Validates an evaluation from a worker that was asked for pictures in `format` and for these `extras`.
    ///
    /// # Errors
    /// As [`Evaluation::new`] and [`Evaluation::embedded`]. Also if there are not five features, if there is a verdict that was
    /// not requested, or if a requested verdict is missing.
    pub fn for_format(
        message: v1::Evaluation,
        format: &ImageFormat,
        extras: Extras,
    ) -> Result<Self, Invalid> {
        let features = Features::try_from(message.features.as_slice()).map_err(|_| {
            Invalid::new(
                "features",
                counted(message.features.len() as u64, "value"),
                "5 values",
            )
        })?;
        let verdict = match (extras.judge, message.verdict) {
            (false, 0) => None,
            (false, number) => return Err(Invalid::new("verdict", number, "absent: nobody asked for it")),
            (true, number) => Some(Verdict::try_from(number)?),
        };
        let evaluation = Self::new(features, message.image, format)?;
        let embedded = evaluation.embedded(message.embedding, extras.dimensions.unwrap_or(0))?;
        Ok(embedded.judged(verdict))
    }

    /// The hand-crafted features.
    #[must_use]
    pub const fn features(&self) -> &Features {
        &self.features
    }

    /// The picture: grey values, channel by channel, each with index `x * resolution + y`.
    #[must_use]
    pub fn image(&self) -> &[u8] {
        &self.image
    }

    /// The picture alone.
    #[must_use]
    pub fn into_image(self) -> Vec<u8> {
        self.image
    }

    /// The embedding of the picture; empty if it was not requested.
    #[must_use]
    pub fn embedding(&self) -> &[f32] {
        &self.embedding
    }

    /// The judge's verdict on the motion; `None` if it was not requested.
    #[must_use]
    pub const fn verdict(&self) -> Option<Verdict> {
        self.verdict
    }

    /// Whether both have the same bits.
    #[must_use]
    pub fn same_bits(&self, other: &Self) -> bool {
        self.same_simulation(other) && same_embedding(&self.embedding, &other.embedding)
    }

    /// Whether features and image have the same bits, and the verdicts are the same; embeddings are ignored.
    #[must_use]
    pub fn same_simulation(&self, other: &Self) -> bool {
        let bits = |features: &Features| features.map(f64::to_bits);
        let seen = bits(&self.features) == bits(&other.features) && self.image == other.image;
        seen && self.verdict == other.verdict
    }
}

/// Kind of a machine that embeds. Machines of one kind embed a picture to the same bits, machines of different kinds to nearly
/// equal numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EmbeddingKind(u64);

impl EmbeddingKind {
    /// The kind of machines that do not embed, and of embeddings whose machine is unknown.
    pub const UNKNOWN: Self = Self(0);

    /// The kind with this description.
    #[must_use]
    pub fn of(description: &str) -> Self {
        let hash = blake3::hash(description.as_bytes());
        let first = hash.as_bytes().first_chunk().copied().unwrap_or_default();
        // 0 means unknown.
        Self(u64::from_le_bytes(first) | 1)
    }

    #[must_use]
    pub const fn number(self) -> u64 {
        self.0
    }

    /// Whether the kind is known; a machine without a known kind does not embed.
    #[must_use]
    pub const fn is_known(self) -> bool {
        self.0 != Self::UNKNOWN.0
    }
}

impl From<u64> for EmbeddingKind {
    fn from(number: u64) -> Self {
        Self(number)
    }
}

/// Largest difference between embeddings of one picture by machines of different kinds, relative to their size and absolute.
/// Rounding a thousand sums in another order differs by a hundredth of this.
const NEAR: f32 = 1e-3;

/// Whether two embeddings, each with the kind of its machine, can be of the same picture. Embeddings by machines of one known
/// kind must have the same bits. Others may differ by a thousandth of the largest value, or of 1 if that is larger.
#[must_use]
pub fn embeddings_agree(
    (one, kind): (&[f32], EmbeddingKind),
    (other, other_kind): (&[f32], EmbeddingKind),
) -> bool {
    if kind == other_kind && kind.is_known() {
        same_embedding(one, other)
    } else {
        near_embedding(one, other)
    }
}

fn near_embedding(one: &[f32], other: &[f32]) -> bool {
    let size = one
        .iter()
        .chain(other)
        .fold(1.0_f32, |size, value| size.max(value.abs()));
    one.len() == other.len() && one.iter().zip(other).all(|(a, b)| (a - b).abs() <= NEAR * size)
}

fn same_embedding(one: &[f32], other: &[f32]) -> bool {
    let bits = |embedding: &[f32]| -> Vec<u32> { embedding.iter().map(|value| value.to_bits()).collect() };
    bits(one) == bits(other)
}

/// Validates an embedding from outside, which must have `dimensions` numbers, finite and at most [`MAX_EMBEDDING`].
///
/// # Errors
/// If the length or a number is not allowed.
pub fn check_embedding(embedding: Vec<f32>, dimensions: usize) -> Result<Vec<f32>, Invalid> {
    if embedding.len() != dimensions {
        let allowed = counted(dimensions as u64, "value");
        return Err(Invalid::new(
            "embedding",
            counted(embedding.len() as u64, "value"),
            allowed,
        ));
    }
    let fits = |value: &f32| value.abs() <= MAX_EMBEDDING;
    match embedding.iter().position(|value| !fits(value)) {
        Some(place) => Err(Invalid::new(
            format!("embedding[{place}]"),
            format!("{:e}", embedding[place]),
            format!("finite, and at most {MAX_EMBEDDING:e} in magnitude"),
        )),
        None => Ok(embedding),
    }
}

impl From<Evaluation> for v1::Evaluation {
    fn from(evaluation: Evaluation) -> Self {
        Self {
            features: evaluation.features.to_vec(),
            image: evaluation.image,
            embedding: evaluation.embedding,
            verdict: evaluation.verdict.map_or(0, |verdict| verdict.number().into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Class;

    #[test]
    fn means_are_over_trials_and_of_one_trial_they_are_its_own() {
        let features = [[-0.0, 1.0, 2.0, 3.0, 4.0], [1.0, 2.0, 2.0, 0.0, -4.0]];
        assert_eq!(mean_features(features.iter()), [0.5, 1.5, 2.0, 1.5, 0.0]);
        let alone = mean_features(features[..1].iter());
        assert_eq!(alone.map(f64::to_bits), features[0].map(f64::to_bits));
        assert_eq!(mean_features([].iter()), [0.0; 5]);

        let embeddings: [&[f32]; 3] = [&[-0.0, 0.1], &[3.0, 0.1], &[0.0, 0.4]];
        assert_eq!(mean_embedding(embeddings.into_iter()), [1.0, 0.2]);
        let alone = mean_embedding(embeddings.into_iter().take(1));
        assert!(same_embedding(&alone, embeddings[0]));
        assert!(mean_embedding([].into_iter()).is_empty());
    }

    #[test]
    fn a_verdict_comes_if_and_only_if_it_was_requested() {
        let format = ImageFormat::default();
        let evaluation = Evaluation::new([0.0; 5], vec![0; format.bytes()], &format).unwrap();
        let take = |verdict: Option<Verdict>, judge| {
            let message = evaluation.clone().judged(verdict).into();
            let extras = Extras {
                judge,
                ..Extras::default()
            };
            Evaluation::for_format(message, &format, extras)
        };
        let milling = Some(Verdict::Class(Class::Milling));
        let taken = take(milling, true).unwrap();
        assert_eq!(
            (taken.verdict(), take(None, false).unwrap().verdict()),
            (milling, None)
        );
        assert!(!taken.same_simulation(&evaluation));
        assert!(take(None, true).is_err() && take(milling, false).is_err());
    }

    #[test]
    fn embeddings_are_what_a_network_can_have() {
        let check = |value: f32| check_embedding(vec![0.0, value], 2);
        for value in [0.0, -1.5, MAX_EMBEDDING, -MAX_EMBEDDING] {
            assert!(check(value).is_ok(), "{value}");
        }
        for value in [1e30, -1e13, f32::NAN, f32::INFINITY] {
            let refused = check(value).unwrap_err().to_string();
            assert!(refused.starts_with("embedding[1] = "), "{refused}");
            assert!(refused.contains("at most 1e12"), "{refused}");
        }
    }

    #[test]
    fn features_are_what_a_swarm_can_have() {
        let format = ImageFormat::default();
        let with =
            |value: f64| Evaluation::new([0.0, value, 0.0, 0.0, 0.0], vec![0; format.bytes()], &format);
        for value in [0.0, -1.5, MAX_FEATURE, -MAX_FEATURE] {
            assert!(with(value).is_ok(), "{value}");
        }
        for value in [1e13, -1e300, f64::MAX, f64::NAN, f64::INFINITY] {
            let refused = with(value).unwrap_err().to_string();
            assert!(refused.contains("features.angular_momentum"), "{refused}");
            assert!(refused.len() < 200, "{refused}");
        }
    }
}

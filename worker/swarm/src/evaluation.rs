//! The outcome of one simulation.

use crate::{CompressedImage, Compressor, Decompressor, ImageFormat, Invalid, NoImage, Verdict, counted};
use murmuration_proto::v1;
use std::io;

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

/// Largest magnitude of a number of an embedding: well above the numbers of a network that distinguishes pictures, and small
/// enough to compute distances.
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

/// The outcome of simulating one controller from one start. `I` is its picture: the grey values, channel by channel, each with
/// index `x * resolution + y`, or a [`CompressedImage`] of them if a worker sent it.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation<I = Vec<u8>> {
    features: Features,
    image: I,
    /// Empty if the embedding was not requested.
    embedding: Vec<f32>,
    /// `None` if the verdict was not requested.
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
    /// The error names a feature that is not finite or over [`MAX_FEATURE`], or a picture of the wrong length.
    pub fn new(features: Features, image: Vec<u8>, format: &ImageFormat) -> Result<Self, Invalid> {
        check_features(&features)?;
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
    /// The errors of [`check_embedding`].
    pub fn embedded(self, embedding: Vec<f32>, dimensions: usize) -> Result<Self, Invalid> {
        Ok(Self {
            embedding: check_embedding(&embedding, dimensions).map(|()| embedding)?,
            ..self
        })
    }

    /// The evaluations as a worker sends them, with their pictures compressed by `compressor`.
    ///
    /// # Errors
    /// If there is no memory to compress the pictures.
    pub fn message(evaluations: &[Self], compressor: &mut Compressor) -> io::Result<v1::Evaluations> {
        let mut message = v1::Evaluations::default();
        for evaluation in evaluations {
            let image = compressor.compress(&evaluation.image)?;
            message.features.extend_from_slice(&evaluation.features);
            message.pictures.extend_from_slice(image.frame());
            message.embeddings.extend_from_slice(&evaluation.embedding);
            let verdict = evaluation.verdict.map(|verdict| i32::from(verdict.number()));
            message.verdicts.extend(verdict);
        }
        Ok(message)
    }
}

impl Evaluation<CompressedImage> {
    /// Validates the evaluations of a worker that was asked for this many `trials`, for pictures in `format` and for these
    /// `extras`.
    ///
    /// # Errors
    /// Names what is wrong, with the number of the trial: a feature that is not finite or over [`MAX_FEATURE`], a picture that
    /// cannot be decompressed or has the wrong size, or an embedding as in [`check_embedding`]. Also if columns are missing, were
    /// not requested, or have different numbers of trials.
    pub fn received(
        message: &v1::Evaluations,
        trials: usize,
        format: &ImageFormat,
        extras: Extras,
    ) -> Result<Vec<Self>, Invalid> {
        let column = |name: &str, found: usize, wanted: usize| match found == wanted {
            true => Ok(()),
            false => Err(Invalid::new(
                name,
                counted(found as u64, "value"),
                wanted.to_string(),
            )),
        };
        let dimensions = extras.dimensions.unwrap_or(0);
        // The number of trials comes first: what is decompressed must be what was asked for.
        column("features", message.features.len(), trials * FEATURE_NAMES.len())?;
        let (features, _) = message.features.as_chunks();
        column("embeddings", message.embeddings.len(), trials * dimensions)?;
        column(
            "verdicts",
            message.verdicts.len(),
            if extras.judge { trials } else { 0 },
        )?;
        let no_memory = |error: io::Error| Invalid::new("pictures", error, "small enough to decompress");
        let mut decompressor = Decompressor::new(format.bytes()).map_err(no_memory)?;
        let mut pictures = message.pictures.as_slice();
        let trial = |(place, &features): (usize, &Features)| {
            check_features(&features)?;
            let embedding = &message.embeddings[place * dimensions..][..dimensions];
            check_embedding(embedding, dimensions)?;
            let verdict = message.verdicts.get(place).copied();
            Ok(Self {
                features,
                image: decompressor
                    .take_frame(&mut pictures)
                    .map_err(|error| no_image(&error))?,
                embedding: embedding.to_vec(),
                verdict: verdict.map(Verdict::try_from).transpose()?,
            })
        };
        let within = |(place, trial): (usize, Result<_, Invalid>)| {
            trial.map_err(|error| error.within(&format!("evaluations[{place}]")))
        };
        let evaluations = features.iter().enumerate().map(trial).enumerate().map(within);
        let evaluations = evaluations.collect::<Result<_, _>>()?;
        match pictures {
            [] => Ok(evaluations),
            rest => Err(Invalid::new(
                "pictures",
                format!("{} bytes too many", rest.len()),
                "a frame for each trial",
            )),
        }
    }

    /// The compressed picture.
    #[must_use]
    pub const fn image(&self) -> &CompressedImage {
        &self.image
    }

    /// The evaluation with its grey values.
    ///
    /// # Errors
    /// If there is no memory for them.
    pub fn decompressed(self) -> io::Result<Evaluation> {
        Ok(Evaluation {
            features: self.features,
            image: self.image.pixels()?,
            embedding: self.embedding,
            verdict: self.verdict,
        })
    }

    /// Whether features and pictures have the same bits, and the verdicts are the same; embeddings are ignored.
    #[must_use]
    pub fn same_simulation(&self, other: &Self) -> bool {
        self.same_measures(other) && self.image.same_pixels(&other.image)
    }
}

impl Evaluation {
    /// The picture: grey values, channel by channel. Within a channel, pixel (x, y) has index `x * resolution + y`.
    #[must_use]
    pub fn image(&self) -> &[u8] {
        &self.image
    }

    /// Whether both have the same bits.
    #[must_use]
    pub fn same_bits(&self, other: &Self) -> bool {
        let seen = self.same_measures(other) && self.image == other.image;
        seen && same_embedding(&self.embedding, &other.embedding)
    }
}

impl<I> Evaluation<I> {
    /// The hand-crafted features.
    #[must_use]
    pub const fn features(&self) -> &Features {
        &self.features
    }

    /// The picture alone.
    #[must_use]
    pub fn into_image(self) -> I {
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

    fn same_measures(&self, other: &Self) -> bool {
        let bits = |features: &Features| features.map(f64::to_bits);
        bits(&self.features) == bits(&other.features) && self.verdict == other.verdict
    }
}

fn check_features(features: &Features) -> Result<(), Invalid> {
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
    Ok(())
}

fn no_image(error: &NoImage) -> Invalid {
    let allowed = "a zstd frame with a checksum, of as many grey values as the format asks for";
    Invalid::new("picture", error, allowed)
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
        // Kind 0 means unknown.
        Self(u64::from_le_bytes(first) | 1)
    }

    #[must_use]
    pub const fn number(self) -> u64 {
        self.0
    }

    /// Whether the kind is known. A machine without a known kind does not embed.
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

/// Largest difference between embeddings of one picture by machines of different kinds, as a share of the largest value (or of
/// 1). A thousand sums in another order differ by a hundredth of this.
const NEAR: f32 = 1e-3;

/// Whether two embeddings, each with the kind of its machine, can be of the same picture. Embeddings by machines of one known
/// kind must have the same bits. Other embeddings can differ by a thousandth of the largest value, or of 1 if 1 is larger.
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
pub fn check_embedding(embedding: &[f32], dimensions: usize) -> Result<(), Invalid> {
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
        None => Ok(()),
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
            let evaluation = evaluation.clone().judged(verdict);
            let extras = Extras {
                judge,
                ..Extras::default()
            };
            let message = Evaluation::message(&[evaluation], &mut Compressor::new().unwrap()).unwrap();
            let received = Evaluation::received(&message, 1, &format, extras)?.pop();
            received
                .unwrap()
                .decompressed()
                .map_err(|error| Invalid::missing("memory", error.to_string()))
        };
        let milling = Some(Verdict::Class(Class::Milling));
        let taken = take(milling, true).unwrap();
        assert_eq!(
            (taken.verdict(), take(None, false).unwrap().verdict()),
            (milling, None)
        );
        assert!(!taken.same_bits(&evaluation));
        assert!(take(None, true).is_err() && take(milling, false).is_err());
    }

    #[test]
    fn columns_hold_the_same_trials_or_the_error_says_which_does_not() {
        let format = ImageFormat::default();
        let evaluation = |value: u8| {
            let image = vec![value; format.bytes()];
            let evaluation = Evaluation::new([f64::from(value); 5], image, &format).unwrap();
            evaluation.embedded(vec![f32::from(value); 2], 2).unwrap()
        };
        let evaluations = [1, 2, 3].map(evaluation);
        let extras = Extras {
            dimensions: Some(2),
            judge: false,
        };
        let sound = Evaluation::message(&evaluations, &mut Compressor::new().unwrap()).unwrap();
        let received = |message: &v1::Evaluations| Evaluation::received(message, 3, &format, extras);
        let taken = received(&sound)
            .unwrap()
            .into_iter()
            .map(|one| one.decompressed().unwrap());
        assert_eq!(taken.collect::<Vec<_>>(), evaluations);
        let refused = |change: fn(&mut v1::Evaluations)| {
            let mut message = sound.clone();
            change(&mut message);
            received(&message).unwrap_err().to_string()
        };
        let errors = [
            refused(|message| message.features.truncate(13)),
            refused(|message| message.embeddings.push(0.0)),
            refused(|message| message.verdicts.push(1)),
            refused(|message| message.embeddings[3] = f32::NAN),
            refused(|message| message.pictures.truncate(30)),
            refused(|message| message.pictures.push(0)),
            refused(|message| message.features[7] = f64::NAN),
        ];
        let expected = [
            "features = 13 values: must be 15",
            "embeddings = 7 values: must be 6",
            "verdicts = 1 value: must be 0",
            "evaluations[1].embedding[1] = NaN",
            "evaluations[1].picture = damaged",
            "pictures = 1 bytes too many",
            "evaluations[1].features.radial_variance_x20 = NaN",
        ];
        for (error, expected) in errors.iter().zip(expected) {
            assert!(
                error.starts_with(expected),
                "{error:?} does not begin with {expected:?}"
            );
        }
    }

    #[test]
    fn embeddings_are_what_a_network_can_have() {
        let check = |value: f32| check_embedding(&[0.0, value], 2);
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

//! Random streams that depend only on a seed, a purpose and an index.

use rand::{RngExt as _, SeedableRng as _, TryRng};
use rand_chacha::ChaCha8Rng;
use std::convert::Infallible;

/// The purpose of a stream. Streams of different purposes are independent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// Seeds of starts; the index is the individual's.
    Start,
    /// Proposing a generation: sampling, selection and variation; the index is the generation's.
    Propose,
    /// First medoids of the taxonomy; the index is 0.
    Medoids,
    /// Jitter of collisions; the seed is the start's, the index 0.
    Jitter,
    /// First weights of a network; the index is the layer's.
    Initialise,
    /// Assignment of images to an epoch's batches; the seed is the training's, the index the epoch's.
    Train,
    /// Augmentation of one image; the seed is one of a batch, the index the image's place in the batch.
    Augment,
    /// Choice of the images held out of a training, and of the triplets of these images; the index is 0.
    HeldOut,
    /// Sampling a controller of a dataset; the index is the controller's.
    Dataset,
    /// Seeds of a dataset's starts; the index is the picture's.
    DatasetStart,
    /// Choice of the behaviours to ask annotators about; the index is 0.
    Query,
    /// Substitute for an individual whose task is poisoned; the index combines the indices of individual and attempt.
    Substitute,
    /// Substitute for a dataset's controller whose task is poisoned; the index combines the indices of controller and attempt.
    DatasetSubstitute,
    /// Choice of the tasks to audit; the seed is the coordinator's epoch, the index 0. No result depends on this stream.
    Audit,
    /// Seeds of the further starts of labelled controllers; the index is 16 times the individual's plus the start's.
    FurtherStart,
    /// Slip of a robot's drive, two numbers per step; the seed is the start's, the index the robot's.
    Slip,
    /// A robot's own gains; the seed is the start's, the index the robot's.
    Gain,
    /// Missed and false readings of a robot's sensors, one number per sensor and step; the seed is the start's, the index the
    /// robot's.
    Misreading,
    /// Seeds of the further starts of an individual; the seed is that of the first start, the index the start's, from 1.
    FurtherTrial,
    /// Resampling of a study's trials and of the judge's errors; the seed is 0, the index that of a table's row. No campaign's
    /// result depends on this stream.
    Resample,
    /// Permutation of the digits of an evenly spread sample, and its shift; the index is the gene's.
    Spread,
    /// Controllers around the one that a campaign is begun with; the index is 0.
    Around,
}

impl Purpose {
    const fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Propose => "propose",
            Self::Medoids => "medoids",
            Self::Jitter => "jitter",
            Self::Initialise => "initialise",
            Self::Train => "train",
            Self::Augment => "augment",
            Self::HeldOut => "held out",
            Self::Dataset => "dataset",
            Self::DatasetStart => "dataset start",
            Self::Query => "query",
            Self::Substitute => "substitute",
            Self::DatasetSubstitute => "dataset substitute",
            Self::Audit => "audit",
            // The name is that of an earlier version, because the digests of campaigns with feedback depend on the name.
            Self::FurtherStart => "lesson start",
            Self::Slip => "slip",
            Self::Gain => "gain",
            Self::Misreading => "misreading",
            Self::FurtherTrial => "further trial",
            Self::Resample => "resample",
            Self::Spread => "spread",
            Self::Around => "around",
        }
    }
}

/// A reproducible stream of random numbers (ChaCha with 8 rounds, keyed by BLAKE3 of seed, purpose and index).
///
/// Implements [`rand`]'s generator, whose `random` returns uniform bits, or numbers from 0 to 1. Campaigns' digests depend on the
/// bits that the methods of this type return, so rand's own methods cannot replace these methods. rand draws the same
/// distributions from other bits, and its next version can change how. Where no stored result depends on the numbers, callers use
/// rand's methods.
#[derive(Debug, Clone)]
pub struct RandomStream(ChaCha8Rng);

impl RandomStream {
    /// The stream of `purpose` and `index` under a campaign's seed.
    #[must_use]
    pub fn derive(seed: u64, purpose: Purpose, index: u64) -> Self {
        let mut hasher = blake3::Hasher::new_derive_key("murmuration random stream v1");
        hasher.update(&seed.to_le_bytes());
        hasher.update(&index.to_le_bytes());
        hasher.update(purpose.name().as_bytes());
        Self(ChaCha8Rng::from_seed(*hasher.finalize().as_bytes()))
    }

    /// Uniform in \[`low`, `high`).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + self.random::<f64>() * (high - low)
    }

    /// Uniform in 0..`count` (`count` over 0), exactly: values that would favour the low end are drawn again.
    pub fn below(&mut self, count: u64) -> u64 {
        let fair = u64::MAX - u64::MAX % count;
        loop {
            let bits = self.random::<u64>();
            if bits < fair {
                return bits % count;
            }
        }
    }

    /// True with `probability`.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.random::<f64>() < probability
    }

    /// Puts a list into random order (Fisher and Yates).
    pub fn shuffle<T>(&mut self, list: &mut [T]) {
        for last in (1..list.len()).rev() {
            list.swap(last, self.below(last as u64 + 1) as usize);
        }
    }
}

/// Seed of the first start of controller `number` in an evaluation without a campaign.
#[must_use]
pub fn start_seed(seed: u64, number: u64) -> u64 {
    RandomStream::derive(seed, Purpose::Start, number).random()
}

impl TryRng for RandomStream {
    type Error = Infallible;

    #[inline]
    fn try_next_u32(&mut self) -> Result<u32, Infallible> {
        self.0.try_next_u32()
    }

    #[inline]
    fn try_next_u64(&mut self) -> Result<u64, Infallible> {
        self.0.try_next_u64()
    }

    #[inline]
    fn try_fill_bytes(&mut self, bytes: &mut [u8]) -> Result<(), Infallible> {
        self.0.try_fill_bytes(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If these numbers change, the digest of every campaign changes.
    #[test]
    fn the_streams_are_the_same_for_ever() {
        let mut stream = RandomStream::derive(1, Purpose::Start, 7);
        assert_eq!(
            stream.random::<[u64; 2]>(),
            [8382917169329880773, 14253264017393074045]
        );
    }

    /// A stream is also the same beyond the blocks that the generator computes at once.
    #[test]
    fn long_streams_are_the_same_for_ever() {
        let mut stream = RandomStream::derive(1, Purpose::Start, 7);
        let mut hasher = blake3::Hasher::new();
        for _ in 0..100_000 {
            hasher.update(&stream.random::<u64>().to_le_bytes());
        }
        let digest = hasher.finalize().to_hex();
        assert_eq!(&digest[..16], "17cd55a6e60d1e29");
    }

    /// The numbers that `rand` computes must stay the same for ever.
    #[test]
    fn distributions_are_the_same_for_ever() {
        let mut stream = RandomStream::derive(1, Purpose::Start, 7);
        assert_eq!(stream.random::<f64>(), 0.4544388503376745);
        assert_eq!(stream.between(-1.0, 3.0), 2.0906839625334075);
        let below = [(); 8].map(|()| stream.below(1000));
        assert_eq!(below, [992, 565, 783, 382, 850, 436, 573, 62]);
        assert_eq!(stream.below((1 << 63) + 1), 6670947447661383948);
        let chances = [(); 8].map(|()| stream.chance(0.3));
        assert_eq!(chances, [false, true, false, false, false, true, false, false]);
        // A chance of 1 consumes a number too.
        assert!(stream.chance(1.0));
        let mut list = [0, 1, 2, 3, 4, 5, 6, 7];
        stream.shuffle(&mut list);
        assert_eq!(list, [4, 1, 6, 0, 2, 7, 3, 5]);
        assert_eq!(stream.random::<u64>(), 7599504338469415278);
    }

    #[test]
    fn purposes_and_indices_are_independent() {
        let first = |seed, purpose, index| RandomStream::derive(seed, purpose, index).random::<u64>();
        let one = first(1, Purpose::Start, 0);
        assert_ne!(one, first(1, Purpose::Propose, 0));
        assert_ne!(one, first(1, Purpose::Start, 1));
        assert_ne!(one, first(2, Purpose::Start, 0));
    }
}

//! A saved training, as bytes.

use super::{Training, TrainingError, schedule::ScheduleState};
use prost::Message;

/// Version of the format. The version must change when the saved fields change, or when the same training would continue
/// differently.
const VERSION: &str = "murmuration training 4";

/// The message of a saved training. Byte fields contain little-endian floats.
#[derive(Clone, PartialEq, Message)]
struct Saved {
    #[prost(string, tag = "1")]
    version: String,
    #[prost(string, tag = "2")]
    configuration: String,
    #[prost(string, tag = "3")]
    data_digest: String,
    #[prost(uint64, tag = "4")]
    epoch: u64,
    #[prost(bytes = "vec", tag = "5")]
    parameters: Vec<u8>,
    #[prost(bytes = "vec", tag = "6")]
    adam_means: Vec<u8>,
    #[prost(bytes = "vec", tag = "7")]
    adam_squares: Vec<u8>,
    /// The two powers of Adam's decays.
    #[prost(double, repeated, tag = "8")]
    adam_powers: Vec<f64>,
    #[prost(double, tag = "9")]
    learning_rate: f64,
    #[prost(double, repeated, tag = "10")]
    losses: Vec<f64>,
    #[prost(double, tag = "11")]
    lowest_loss: f64,
    #[prost(uint64, tag = "12")]
    waited: u64,
    #[prost(bytes = "vec", tag = "13")]
    best_parameters: Vec<u8>,
    #[prost(uint64, tag = "14")]
    best_epoch: u64,
    #[prost(double, tag = "15")]
    best_triplet_accuracy: f64,
    /// Digest of the labels; empty if the training has no labels.
    #[prost(string, tag = "17")]
    label_digest: String,
    /// The checkpoint that the training started from; empty if the training started from initial weights.
    #[prost(string, tag = "18")]
    parent: String,
    /// BLAKE3 of the message without this field.
    #[prost(bytes = "vec", tag = "16")]
    check: Vec<u8>,
}

pub(super) fn save(training: &Training) -> Vec<u8> {
    let state = &training.state;
    let ScheduleState {
        learning_rate,
        losses,
        lowest,
        waited,
    } = state.schedule.state.clone();
    let (label_digest, parent) = fine_tuned(training);
    let mut saved = Saved {
        version: VERSION.to_owned(),
        configuration: training.configuration.to_toml(),
        data_digest: training.pictures.digest(),
        epoch: state.epoch,
        parameters: bytes(state.network.parameters()),
        adam_means: bytes(&state.adam.means),
        adam_squares: bytes(&state.adam.squares),
        adam_powers: state.adam.powers.to_vec(),
        learning_rate,
        losses,
        lowest_loss: lowest,
        waited,
        best_parameters: bytes(&state.best.parameters),
        best_epoch: state.best.epoch,
        best_triplet_accuracy: state.best.triplet_accuracy,
        label_digest,
        parent,
        check: Vec::new(),
    };
    saved.check = check(&saved);
    saved.encode_to_vec()
}

pub(super) fn restore(training: &mut Training, bytes: &[u8]) -> Result<(), TrainingError> {
    let damaged = |what: &str| TrainingError::Damaged(what.to_owned());
    let mut saved = Saved::decode(bytes).map_err(|error| TrainingError::Damaged(error.to_string()))?;
    if saved.version != VERSION {
        return Err(damaged("it belongs to another version of the trainer"));
    }
    let expected = std::mem::take(&mut saved.check);
    if check(&saved) != expected {
        return Err(damaged("its bytes have changed"));
    }
    if saved.configuration != training.configuration.to_toml() {
        return Err(TrainingError::Other("configuration"));
    }
    if saved.data_digest != training.pictures.digest() {
        return Err(TrainingError::Other("set of pictures"));
    }
    let (label_digest, parent) = fine_tuned(training);
    if saved.label_digest != label_digest {
        return Err(TrainingError::Other("set of labels"));
    }
    if saved.parent != parent {
        return Err(TrainingError::Other("parent"));
    }
    let state = &mut training.state;
    let all_read = [
        read(&saved.parameters, state.network.parameters_mut()),
        read(&saved.adam_means, &mut state.adam.means),
        read(&saved.adam_squares, &mut state.adam.squares),
        read(&saved.best_parameters, &mut state.best.parameters),
    ];
    if all_read.contains(&false) || saved.best_epoch > saved.epoch {
        return Err(damaged("its parts do not fit"));
    }
    let powers = saved.adam_powers.try_into();
    state.adam.powers = powers.map_err(|_| damaged("its parts do not fit"))?;
    state.epoch = saved.epoch;
    state.schedule.state = ScheduleState {
        learning_rate: saved.learning_rate,
        losses: saved.losses,
        lowest: saved.lowest_loss,
        waited: saved.waited,
    };
    state.best.epoch = saved.best_epoch;
    state.best.triplet_accuracy = saved.best_triplet_accuracy;
    Ok(())
}

/// Digests of the labels and of the parent.
fn fine_tuned(training: &Training) -> (String, String) {
    let fine_tuned = training.fine_tuned.as_ref();
    fine_tuned.map_or_else(Default::default, |fine_tuned| {
        (fine_tuned.labelled.digest(), fine_tuned.parent.to_string())
    })
}

fn check(saved: &Saved) -> Vec<u8> {
    blake3::hash(&saved.encode_to_vec()).as_bytes().to_vec()
}

fn bytes(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// Decodes `bytes` into `values`; false if the number of values differs.
fn read(bytes: &[u8], values: &mut [f32]) -> bool {
    let (quads, rest) = bytes.as_chunks::<4>();
    let fits = quads.len() == values.len() && rest.is_empty();
    for (value, quad) in values.iter_mut().zip(quads) {
        *value = f32::from_le_bytes(*quad);
    }
    fits
}

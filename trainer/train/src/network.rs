//! A network: an architecture with weights. A network runs forward and backward over a chunk of images at a time.

use crate::{
    layers::{Activation, Backward, Operation},
    real::Real,
};
use murmuration_swarm::{
    PictureShape, Purpose, RandomStream,
    training::{Architecture, Layer, Shape, parameters},
};
use rayon::prelude::*;
use std::ops::Range;

/// An embedder that can be trained: an architecture and its weights.
#[derive(Debug, Clone)]
pub struct Network<T = f32> {
    architecture: Architecture,
    stages: Vec<Stage>,
    parameters: Vec<T>,
}

/// A layer with its own output, and the activation that may follow it.
#[derive(Debug, Clone)]
pub(crate) struct Stage {
    pub(crate) operation: Operation,
    pub(crate) activation: Option<Layer>,
    pub(crate) output: Shape,
    /// The range of the stage's weights among the network's weights.
    pub(crate) parameters: Range<usize>,
}

impl Stage {
    /// The activation that needs a pass of its own; `None` if the operation's passes contain the activation.
    fn separate_activation(&self) -> Option<Activation> {
        let activation = self.activation.filter(|_| !self.operation.is_fused());
        activation.and_then(Activation::of)
    }
}

/// Number of images per chunk outside of training.
const EMBEDDED_AT_ONCE: usize = 32;

// `embed` is not generic. Generic functions are compiled in the calling crate, without this crate's optimisation in the dev
// profile, and took thirty times as long.
impl Network<f32> {
    /// Embeds pictures, given as consecutive bytes. Returns `dimensions` numbers for each picture. A remainder shorter than a
    /// picture is ignored. The bits of the embeddings do not depend on the number of threads.
    #[must_use]
    pub fn embed(&self, pictures: &[u8]) -> Vec<f32> {
        self.embed_pictures(pictures)
    }
}

impl<T: Real> Network<T> {
    /// A network with initial weights: weights and biases are uniform within ±1 / sqrt(inputs of a unit), as in PyTorch; scales
    /// are 1 and shifts 0.
    #[must_use]
    pub fn initialise(architecture: Architecture, seed: u64) -> Self {
        let stages = stages(&architecture);
        let mut parameters = Vec::new();
        for (index, stage) in stages.iter().enumerate() {
            let mut stream = RandomStream::derive(seed, Purpose::Initialise, index as u64);
            let count = stage.parameters.len();
            match stage.operation.fan_in() {
                0 => {
                    let scales = std::iter::repeat_n(T::one(), count / 2);
                    parameters.extend(scales.chain(std::iter::repeat_n(T::zero(), count / 2)));
                }
                fan_in => {
                    let bound = 1.0 / (fan_in as f64).sqrt();
                    parameters.extend((0..count).map(|_| T::of(stream.between(-bound, bound))));
                }
            }
        }
        Self {
            architecture,
            stages,
            parameters,
        }
    }

    #[must_use]
    pub const fn architecture(&self) -> &Architecture {
        &self.architecture
    }

    /// All weights, layer after layer.
    #[must_use]
    pub fn parameters(&self) -> &[T] {
        &self.parameters
    }

    pub(crate) fn parameters_mut(&mut self) -> &mut [T] {
        &mut self.parameters
    }

    pub(crate) fn stages(&self) -> &[Stage] {
        &self.stages
    }

    /// Number of values of all stages for one image.
    pub(crate) fn values_per_image(&self) -> usize {
        self.stages.iter().map(|stage| stage.output.len()).sum()
    }

    /// Embeds pictures as [`Network::embed`] does, with any kind of number.
    pub(crate) fn embed_pictures(&self, pictures: &[u8]) -> Vec<T> {
        let shape = self.architecture.pictures();
        self.embed_by_chunk(pictures, |chunk| {
            let mut images = Vec::with_capacity(chunk.len());
            for picture in chunk.chunks_exact(shape.bytes()) {
                append_image(shape, picture, &mut images);
            }
            images
        })
    }

    /// Embeds images (see [`append_image`]) as [`Network::embed`] embeds pictures.
    pub(crate) fn embed_scaled(&self, images: &[T]) -> Vec<T> {
        self.embed_by_chunk(images, <[T]>::to_vec)
    }

    fn embed_by_chunk<P: Sync>(&self, pictures: &[P], images: impl Fn(&[P]) -> Vec<T> + Sync) -> Vec<T> {
        let each = self.architecture.pictures().bytes();
        let whole = &pictures[..pictures.len() / each * each];
        let chunks: Vec<Vec<T>> = whole
            .par_chunks(EMBEDDED_AT_ONCE * each)
            .map_init(
                Default::default,
                |(tape, room): &mut (Tape<T>, Room<T>), chunk| {
                    self.forward(&images(chunk), tape, room).to_vec()
                },
            )
            .collect();
        chunks.concat()
    }

    /// Embeds images (see [`append_image`]), and records on `tape` what the backward pass needs.
    pub(crate) fn forward<'a>(&self, images: &[T], tape: &'a mut Tape<T>, room: &mut Room<T>) -> &'a [T] {
        let samples = images.len() / self.architecture.pictures().bytes();
        tape.fit(&self.stages, samples);
        let Tape { outputs, notes } = tape;
        for (i, stage) in self.stages.iter().enumerate() {
            let (before, after) = outputs.split_at_mut(i);
            let input = before.last().map_or(images, Vec::as_slice);
            let parameters = &self.parameters[stage.parameters.clone()];
            let output = &mut after[0];
            stage
                .operation
                .forward(parameters, input, output, &mut notes[i], &mut room.scratch);
            if let Some(activation) = stage.separate_activation() {
                activation.forward(output);
            }
        }
        tape.embeddings()
    }

    /// Adds the gradient with respect to the weights to `sum`, given the gradient with respect to the embeddings. `images` are
    /// the images of the last forward pass on `tape`.
    pub(crate) fn backward(
        &self,
        images: &[T],
        tape: &Tape<T>,
        room: &mut Room<T>,
        d_embeddings: &[T],
        sum: &mut [T],
    ) {
        let Tape { outputs, notes } = tape;
        let Room {
            gradients: [d_output, d_input],
            scratch,
        } = room;
        // The buffers only grow, because resizing them for each stage would fill them each time.
        let largest = outputs.iter().map(Vec::len).max().unwrap_or(0);
        for gradient in [&mut *d_output, &mut *d_input] {
            gradient.resize(largest.max(gradient.len()), T::zero());
        }
        d_output[..d_embeddings.len()].copy_from_slice(d_embeddings);
        for (i, stage) in self.stages.iter().enumerate().rev() {
            let d_here = &mut d_output[..outputs[i].len()];
            if let Some(activation) = stage.separate_activation() {
                activation.backward(&outputs[i], d_here);
            }
            let input = if i == 0 { images } else { &outputs[i - 1] };
            stage.operation.backward(Backward {
                parameters: &self.parameters[stage.parameters.clone()],
                input,
                notes: &notes[i],
                d_output: d_here,
                d_input: (i > 0).then(|| &mut d_input[..input.len()]),
                d_parameters: &mut sum[stage.parameters.clone()],
                scratch,
            });
            std::mem::swap(d_output, d_input);
        }
    }
}

impl Network<f32> {
    /// Changes the last layer, which is dense, so that `mean` is subtracted from every embedding and the result is multiplied by
    /// `factor`.
    pub(crate) fn move_and_scale(&mut self, mean: &[f64], factor: f64) {
        let last = self.stages.last().map_or(0..0, |stage| stage.parameters.clone());
        let last = &mut self.parameters[last];
        let (weights, biases) = last.split_at_mut(last.len() - mean.len());
        for weight in weights {
            *weight = (f64::from(*weight) * factor) as f32;
        }
        for (bias, mean) in biases.iter_mut().zip(mean) {
            *bias = ((f64::from(*bias) - mean) * factor) as f32;
        }
    }
}

/// A grey value, scaled to the input range of networks, 0 to 1.
pub(crate) fn scaled<T: Real>(grey: u8) -> T {
    T::of(f64::from(grey)) / T::of(255.0)
}

/// Appends a picture as an image, the input of networks: values of 0 to 1, with the channels of a pixel adjacent.
pub(crate) fn append_image<T: Real>(shape: PictureShape, picture: &[u8], images: &mut Vec<T>) {
    match shape.channels() {
        1 => images.extend(picture.iter().map(|&grey| scaled::<T>(grey))),
        _ => images.extend((0..shape.pixels()).flat_map(|pixel| {
            let channels = picture.chunks_exact(shape.pixels());
            channels.map(move |channel| scaled::<T>(channel[pixel]))
        })),
    }
}

/// The values of a chunk's forward pass. The next chunk reuses the buffers.
#[derive(Debug, Clone)]
pub(crate) struct Tape<T> {
    /// The output of each stage.
    outputs: Vec<Vec<T>>,
    notes: Vec<Vec<T>>,
}

impl<T> Default for Tape<T> {
    fn default() -> Self {
        Self {
            outputs: Vec::new(),
            notes: Vec::new(),
        }
    }
}

/// Scratch buffers of a pass.
#[derive(Debug, Clone)]
pub(crate) struct Room<T> {
    gradients: [Vec<T>; 2],
    scratch: Vec<T>,
}

impl<T> Default for Room<T> {
    fn default() -> Self {
        Self {
            gradients: [Vec::new(), Vec::new()],
            scratch: Vec::new(),
        }
    }
}

impl<T> Tape<T> {
    /// The output of the last stage.
    pub(crate) fn embeddings(&self) -> &[T] {
        self.outputs.last().map_or(&[], Vec::as_slice)
    }
}

impl<T: Real> Tape<T> {
    fn fit(&mut self, stages: &[Stage], samples: usize) {
        self.outputs.resize_with(stages.len(), Vec::new);
        self.notes.resize_with(stages.len(), Vec::new);
        for (stage, (output, notes)) in stages.iter().zip(self.outputs.iter_mut().zip(&mut self.notes)) {
            output.resize(samples * stage.output.len(), T::zero());
            notes.resize(samples * stage.operation.notes(), T::zero());
        }
    }
}

fn stages(architecture: &Architecture) -> Vec<Stage> {
    let mut stages: Vec<Stage> = Vec::new();
    let mut start = 0;
    for (layer, input, output) in architecture.shaped_layers() {
        if let Some(operation) = Operation::of(layer, input, output) {
            let end = start + parameters(layer, input);
            stages.push(Stage {
                operation,
                activation: None,
                output,
                parameters: start..end,
            });
            start = end;
        } else if let Some(stage) = stages.last_mut() {
            stage.activation = Some(layer);
            stage.operation.fuse(layer);
        }
    }
    stages
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pictures::tests::grey;

    #[test]
    fn the_networks_have_the_papers_number_of_weights() {
        let paper = Network::<f32>::initialise(Architecture::paper(PictureShape::PAPER, 5).unwrap(), 1);
        assert_eq!(paper.parameters().len(), 3 * 10 + 1937 * 256 + 257 * 64 + 65 * 5);
        let compact = Network::<f32>::initialise(Architecture::compact(PictureShape::PAPER, 5).unwrap(), 1);
        let convolutions = (9 + 3) * 16 + (16 * 9 + 3) * 32 + (32 * 9 + 3) * 64;
        assert_eq!(compact.parameters().len(), convolutions + 257 * 64 + 65 * 5);
    }

    #[test]
    fn an_embedding_does_not_depend_on_the_others() {
        let network = Network::<f32>::initialise(Architecture::compact(grey(20), 3).unwrap(), 1);
        let pictures: Vec<u8> = (0..50 * 400).map(|i| (i * i % 251) as u8).collect();
        let all = network.embed(&pictures);
        assert_eq!(all.len(), 150);
        let some = network.embed(&pictures[33 * 400..40 * 400]);
        for (one, other) in all[99..120].iter().zip(some) {
            assert!((one - other).abs() < 1e-6);
        }
    }

    #[test]
    fn an_image_has_the_channels_of_a_pixel_side_by_side() {
        let shape = PictureShape::new(3, 2).unwrap();
        let picture: Vec<u8> = (0..12).collect();
        let mut image = Vec::<f64>::new();
        append_image(shape, &picture, &mut image);
        let greys: Vec<u8> = image.iter().map(|value| (value * 255.0).round() as u8).collect();
        assert_eq!(greys, [0, 4, 8, 1, 5, 9, 2, 6, 10, 3, 7, 11]);
    }

    /// A network whose weights for a species' channel are 0 does not see the species.
    #[test]
    fn a_channel_without_weights_is_not_seen() {
        let shape = PictureShape::new(2, 20).unwrap();
        let one = Network::<f64>::initialise(Architecture::compact(grey(20), 3).unwrap(), 1);
        let mut two = Network::<f64>::initialise(Architecture::compact(shape, 3).unwrap(), 1);
        // The first weights are sixteen rows of nine places of the kernel. Each weight of the single channel becomes one weight
        // for each of two channels.
        let (first, rest) = one.parameters().split_at(16 * 9);
        let spread = first
            .iter()
            .flat_map(|&weight| [0.0, weight])
            .chain(rest.iter().copied());
        let spread: Vec<f64> = spread.collect();
        two.parameters_mut().copy_from_slice(&spread);
        let noise = |seed: u64| (0..400).map(|i| (i * i * seed % 251) as u8).collect::<Vec<u8>>();
        let embedded = two.embed_pictures(&[noise(7), noise(3)].concat());
        for (value, expected) in embedded.iter().zip(one.embed_pictures(&noise(3))) {
            assert!((value - expected).abs() < 1e-12, "{value} {expected}");
        }
    }
}

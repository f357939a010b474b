//! The held-out behaviours, and their triplets.

use crate::{augment::Augmentation, network::Network, pictures::Pictures, quality::Quality};
use murmuration_swarm::{Purpose, RandomStream, training::Configuration};
use rand::RngExt as _;
use rayon::prelude::*;

/// Held-out behaviours, augmented once, so that every epoch is measured with the same triplets.
#[derive(Debug)]
pub(super) struct HeldOut {
    trained_on: Vec<usize>,
    /// Images of the anchors, one after the other.
    anchors: Vec<f32>,
    positives: Vec<f32>,
    /// The bytes of the first views, without augmentation.
    plain: Vec<u8>,
}

impl HeldOut {
    pub(super) fn new(configuration: &Configuration, pictures: &Pictures) -> Self {
        let mut stream = RandomStream::derive(configuration.seed(), Purpose::HeldOut, 0);
        let mut order: Vec<usize> = (0..pictures.behaviours()).collect();
        stream.shuffle(&mut order);
        let trained_on = order.split_off(configuration.held_out(order.len()));
        let [anchor_key, positive_key] = [stream.random(), stream.random()];
        let augmented = |key: u64, view: usize| {
            let shape = pictures.shape();
            let mut images = vec![0.0; order.len() * shape.bytes()];
            let behaviours = images.par_chunks_mut(shape.bytes()).zip(&order).enumerate();
            behaviours.for_each(|(i, (image, &behaviour))| {
                let mut stream = RandomStream::derive(key, Purpose::Augment, i as u64);
                let augmentation = Augmentation::from(configuration.recipe());
                augmentation.apply(pictures.picture(behaviour, view), shape, &mut stream, image);
            });
            images
        };
        Self {
            anchors: augmented(anchor_key, 0),
            positives: augmented(positive_key, pictures.views() - 1),
            plain: order
                .iter()
                .flat_map(|&behaviour| pictures.picture(behaviour, 0))
                .copied()
                .collect(),
            trained_on,
        }
    }

    /// The behaviours that are not held out, in no particular order.
    pub(super) fn trained_on(&self) -> &[usize] {
        &self.trained_on
    }

    /// The held-out pictures without augmentation, one after the other.
    pub(super) fn plain(&self) -> &[u8] {
        &self.plain
    }

    pub(super) fn quality(&self, network: &Network) -> Quality {
        let anchors = network.embed_scaled(&self.anchors);
        let positives = network.embed_scaled(&self.positives);
        let plain = network.embed(&self.plain);
        Quality::of(&anchors, &positives, &plain, network.architecture().dimensions())
    }
}

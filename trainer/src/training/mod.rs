//! A training, stepped an epoch at a time.

use crate::{
    architecture::{Architecture, ArchitectureError},
    lanes::Lanes,
    loss::{in_batch, triplets},
    network::{Network, scaled},
    optimise::Adam,
    pictures::Pictures,
    recipe::{InBatch, RandomTriplets, Recipe},
};
use murmuration_proto::{Purpose, Stream};
use rayon::prelude::*;

/// x
pub struct Training<'a> {
    pictures: &'a Pictures,
    recipe: Recipe,
    seed: u64,
    network: Network,
    averaged: Vec<f32>,
    adam: Adam<f32>,
    lanes: Lanes<f32>,
    epoch: usize,
    gradient: Vec<f32>,
    rate: f64,
    best_loss: f64,
    bad: usize,
}

impl<'a> Training<'a> {
    /// x
    pub fn new(pictures: &'a Pictures, architecture: Architecture, recipe: Recipe, seed: u64) -> Self {
        let network = Network::initialise(architecture, seed);
        let n = network.parameters().len();
        let rate = match &recipe { Recipe::Paper(r) => r.learning_rate, Recipe::InBatch(r) => r.learning_rate };
        Self {
            pictures,
            recipe,
            seed,
            averaged: network.parameters().to_vec(),
            adam: Adam::new(n),
            lanes: Lanes::new(&network),
            epoch: 0,
            gradient: vec![0.0; n],
            network,
            rate,
            best_loss: f64::INFINITY,
            bad: 0,
        }
    }
    /// x
    pub fn network(&self) -> Network {
        match &self.recipe {
            Recipe::InBatch(r) if r.ema > 0.0 => self.network.with_parameters(&self.averaged).unwrap(),
            _ => self.network.clone(),
        }
    }
    /// x
    pub fn rate(&self) -> f64 { self.rate }

    /// x
    pub fn epoch(&mut self) -> (f64, f64) {
        let mut stream = Stream::derive(self.seed, Purpose::Train, self.epoch as u64);
        self.epoch += 1;
        match self.recipe.clone() {
            Recipe::Paper(recipe) => self.paper(&recipe, &mut stream),
            Recipe::InBatch(recipe) => self.in_batch(&recipe, &mut stream),
        }
    }

    fn paper(&mut self, recipe: &RandomTriplets, stream: &mut Stream) -> (f64, f64) {
        let dims = self.network.architecture().dimensions();
        let side = self.pictures.side();
        let pictures = self.pictures;
        let augmentation = recipe.augmentation();
        let mut total = 0.0;
        let steps = recipe.triplets / recipe.batch;
        for _ in 0..steps {
            let n = pictures.controllers() as u64;
            let pairs: Vec<(usize, usize)> = (0..recipe.batch).map(|_| {
                let a = stream.below(n); let mut b = stream.below(n - 1); if b >= a { b += 1; }
                (a as usize, b as usize)
            }).collect();
            let key = stream.bits();
            let chunk = 64;
            let loss = self.lanes.gradient_by_chunk(&self.network, recipe.batch.div_ceil(chunk), |c, images| {
                let pairs = &pairs[c * chunk..((c + 1) * chunk).min(pairs.len())];
                for p in pairs { images.extend(pictures.picture(p.0, 0).iter().map(|&g| scaled::<f32>(g))); }
                for (i, p) in pairs.iter().enumerate() {
                    let start = images.len();
                    images.resize(start + side * side, 0.0);
                    let mut s = Stream::derive(key, Purpose::Augment, (c * chunk + i) as u64);
                    augmentation.apply(pictures.picture(p.0, 0), side, &mut s, &mut images[start..]);
                }
                for p in pairs { images.extend(pictures.picture(p.1, 0).iter().map(|&g| scaled::<f32>(g))); }
            }, |_, e, g| triplets::loss(e, dims, recipe.margin, recipe.batch, g), &mut self.gradient);
            total += loss / recipe.batch as f64;
            self.adam.step(self.network.parameters_mut(), &self.gradient, self.rate, recipe.weight_decay);
        }
        let loss = total / steps as f64;
        if loss < self.best_loss * (1.0 - 1e-4) { self.best_loss = loss; self.bad = 0; } else { self.bad += 1; }
        if self.bad > recipe.plateau { self.rate *= recipe.plateau_factor; self.bad = 0; }
        (loss, 0.0)
    }

    fn in_batch(&mut self, recipe: &InBatch, stream: &mut Stream) -> (f64, f64) {
        let dims = self.network.architecture().dimensions();
        let side = self.pictures.side();
        let pixels = side * side;
        let pictures = self.pictures;
        let n = pictures.controllers();
        let augmentation = recipe.augmentation();
        let mut order: Vec<usize> = (0..n).collect();
        for i in (1..n).rev() { order.swap(i, stream.below(i as u64 + 1) as usize); }
        let mut total = 0.0;
        let mut violated = 0.0;
        let steps = n / recipe.batch;
        let chunk = 16;
        let total_steps = (steps * recipe.epochs) as f64;
        for step in 0..steps {
            let batch = &order[step * recipe.batch..(step + 1) * recipe.batch];
            let key = stream.bits();
            let b = recipe.batch;
            let mut images = vec![0f32; 2 * b * pixels];
            images.par_chunks_mut(pixels).enumerate().for_each(|(i, image)| {
                let mut s = Stream::derive(key, Purpose::Augment, i as u64);
                let start = if pictures.starts() == 1 { 0 } else { let f = s.below(pictures.starts() as u64) as usize; if i < b { f } else {
                    // other start than the anchor's
                    let mut t = Stream::derive(key, Purpose::Augment, (i - b) as u64);
                    let a = t.below(pictures.starts() as u64) as usize;
                    let o = s.below(pictures.starts() as u64 - 1) as usize;
                    if o >= a { o + 1 } else { o }
                }};
                augmentation.apply(pictures.picture(batch[i % b], start), side, &mut s, image);
            });
            let loss = self.lanes.gradient_at_once(&self.network, &images, chunk, |e, d| {
                if recipe.temperature > 0.0 { in_batch::ntxent(e, dims, recipe.temperature, d) } else { in_batch::loss(e, dims, recipe.margin, d) }
            }, &mut self.gradient);
            total += loss.mean;
            violated += loss.violated as f64 / (b * (b - 1)) as f64;
            let t = ((self.epoch - 1) * steps + step) as f64 / total_steps;
            self.rate = if recipe.cosine { recipe.learning_rate * 0.5 * (1.0 + (std::f64::consts::PI * t).cos()) } else { recipe.learning_rate };
            self.adam.step(self.network.parameters_mut(), &self.gradient, self.rate, recipe.weight_decay);
            if recipe.ema > 0.0 {
                let k = ((self.epoch - 1) * steps + step) as f64;
                let decay = recipe.ema.min((1.0 + k) / (10.0 + k)) as f32;
                for (a, &p) in self.averaged.iter_mut().zip(self.network.parameters()) { *a = *a * decay + p * (1.0 - decay); }
            }
        }
        (total / steps as f64, violated / steps as f64)
    }
}

/// x
pub type Unused = ArchitectureError;

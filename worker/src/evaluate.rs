//! The evaluation of a controller: simulate, take the features, draw the picture.

use crate::{
    features::{FEATURE_STEPS, FeatureMeans},
    rasterise::Rasteriser,
    simulate::{Start, Swarm},
};
use murmuration_proto::{Controller, Evaluation, ImageFormat, Invalid, World};
use pulp::Arch;

/// Evaluates controllers in one world, with buffers that it keeps from one to the next.
#[derive(Debug)]
pub struct Evaluator {
    world: World,
    format: ImageFormat,
    rasteriser: Rasteriser,
    arch: Arch,
}

impl Evaluator {
    /// An evaluator on the fastest instructions that this CPU has.
    ///
    /// # Errors
    /// Where the world is smaller than the picture.
    pub fn new(world: &World, format: &ImageFormat) -> Result<Self, Invalid> {
        Self::on(Arch::new(), world, format)
    }

    /// As [`Evaluator::new`], on the instructions of `arch`: the bits are the same.
    ///
    /// # Errors
    /// As [`Evaluator::new`].
    pub fn on(arch: Arch, world: &World, format: &ImageFormat) -> Result<Self, Invalid> {
        Ok(Self {
            world: *world,
            format: *format,
            rasteriser: Rasteriser::new(world, format)?,
            arch,
        })
    }

    /// Simulates `controller` from `start` over the world's horizon.
    ///
    /// The features are means over the last 100 steps, the picture shows all but the first step of the format's
    /// window: the first clears the canvas.
    ///
    /// # Errors
    /// Where `start` does not fit the world, or a feature is not finite (no robot of a sensible size gets there).
    pub fn evaluate(&mut self, controller: &Controller, start: &Start) -> Result<Evaluation, Invalid> {
        let mut swarm = Swarm::on(self.arch, controller, &self.world, start)?;
        let mut ending = Ending::new(&self.world, &self.format, &mut self.rasteriser);
        swarm.advance(ending.first_step());
        while swarm.steps() < self.world.horizon() {
            swarm.step();
            ending.observe(&swarm);
        }
        Evaluation::new(ending.features.means(), ending.rasteriser.image(), &self.format)
    }
}

/// Evaluates one controller. [`Evaluator`] does many faster.
///
/// # Errors
/// As [`Evaluator::new`] and [`Evaluator::evaluate`].
pub fn evaluate(
    controller: &Controller,
    world: &World,
    format: &ImageFormat,
    start: &Start,
) -> Result<Evaluation, Invalid> {
    Evaluator::new(world, format)?.evaluate(controller, start)
}

/// What is taken from the last steps of a simulation: features and picture.
pub(crate) struct Ending<'a> {
    pub(crate) features: FeatureMeans,
    pub(crate) rasteriser: &'a mut Rasteriser,
    /// Steps after which features are taken.
    features_after: u32,
    /// Steps after which agents are drawn.
    drawn_after: u32,
}

impl<'a> Ending<'a> {
    pub(crate) fn new(world: &World, format: &ImageFormat, rasteriser: &'a mut Rasteriser) -> Self {
        rasteriser.clear();
        Self {
            features: FeatureMeans::new(world),
            rasteriser,
            features_after: world.horizon().saturating_sub(FEATURE_STEPS),
            drawn_after: world.horizon().saturating_sub(format.window() - 1),
        }
    }

    /// Steps before which there is nothing to observe.
    pub(crate) fn first_step(&self) -> u32 {
        self.features_after.min(self.drawn_after)
    }

    /// Takes what is wanted of the swarm after a step.
    pub(crate) fn observe(&mut self, swarm: &Swarm) {
        if swarm.steps() > self.features_after {
            self.features.observe(swarm);
        }
        if swarm.steps() > self.drawn_after {
            self.rasteriser.draw(swarm);
        }
    }
}

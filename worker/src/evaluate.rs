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

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_proto::{CapabilityModel, v1};
    use std::thread;

    fn world(horizon: u32) -> World {
        let message = v1::World {
            horizon: Some(horizon),
            ..World::default().into()
        };
        World::try_from(message).unwrap()
    }

    fn controllers() -> Vec<Controller> {
        let two = [0.8, 0.5, 0.6, -0.5, -0.5, 0.0, -0.2, 0.5, -1.0];
        vec![
            Controller::new(CapabilityModel::SingleSensor, &[0.6, 1.0, 0.4, 0.5]).unwrap(),
            Controller::new(CapabilityModel::TwoSensor, &two).unwrap(),
        ]
    }

    /// Each controller from two starts, the way `evaluate` does it.
    fn all(mut evaluate: impl FnMut(&Controller, &Start) -> Evaluation) -> Vec<Evaluation> {
        let mut outcomes = Vec::new();
        for controller in controllers() {
            outcomes.extend([0, 1].map(|seed| evaluate(&controller, &Start::seeded(seed))));
        }
        outcomes
    }

    fn assert_same(left: &[Evaluation], right: &[Evaluation]) {
        assert_eq!(left.len(), right.len());
        assert!(left.iter().zip(right).all(|(a, b)| a.same_bits(b)));
    }

    #[test]
    fn the_bits_depend_neither_on_the_evaluator_nor_on_the_cpu_nor_on_the_thread() {
        let (world, format) = (world(400), ImageFormat::default());
        let fresh = all(|controller, start| evaluate(controller, &world, &format, start).unwrap());
        let reused = |arch| {
            let mut evaluator = Evaluator::on(arch, &world, &format).unwrap();
            all(|controller, start| evaluator.evaluate(controller, start).unwrap())
        };
        assert_same(&reused(Arch::Scalar), &fresh);
        thread::scope(|scope| {
            let threads = [(); 4].map(|()| scope.spawn(|| reused(Arch::new())));
            for thread in threads {
                assert_same(&thread.join().unwrap(), &fresh);
            }
        });
        assert!(!fresh[0].same_bits(&fresh[1]), "the start matters");
    }

    #[test]
    fn a_horizon_shorter_than_the_window_shows_every_step() {
        let format = ImageFormat::default();
        let controller = &controllers()[0];
        for horizon in [1, 7, 99, 100, 101, 158, 159] {
            let world = world(horizon);
            let evaluation = evaluate(controller, &world, &format, &Start::seeded(2)).unwrap();
            let mut swarm = Swarm::new(controller, &world, &Start::seeded(2)).unwrap();
            let mut rasteriser = Rasteriser::new(&world, &format).unwrap();
            let mut features = FeatureMeans::new(&world);
            for step in 1..=horizon {
                swarm.step();
                rasteriser.draw(&swarm);
                if step + FEATURE_STEPS > horizon {
                    features.observe(&swarm);
                }
            }
            assert_eq!(evaluation.image(), rasteriser.image(), "{horizon}");
            assert_eq!(evaluation.features(), &features.means(), "{horizon}");
        }
    }

    #[test]
    fn a_picture_larger_than_the_world_is_refused() {
        let format = ImageFormat::for_world(v1::ImageFormat::default(), &World::default()).unwrap();
        let small = v1::World {
            width: Some(45.5),
            ..World::default().into()
        };
        let error = Evaluator::new(&World::try_from(small).unwrap(), &format).unwrap_err();
        assert_eq!(
            error.to_string(),
            "image.resolution = 50: must be a whole number from 1 to 45"
        );
    }

    #[test]
    fn a_number_that_is_not_finite_is_an_error() {
        let speck = v1::World {
            radius: Some(1e-308),
            dt: Some(1000.0),
            ..World::default().into()
        };
        let world = World::try_from(speck).unwrap();
        let error = evaluate(
            &controllers()[0],
            &world,
            &ImageFormat::default(),
            &Start::seeded(1),
        )
        .unwrap_err();
        assert!(error.field.starts_with("features."), "{error}");
    }
}

//! Evaluates controllers: simulates them, computes the features, draws the picture. Also evaluates recorded motions.

mod batch;
mod observed;
mod recorder;

pub use observed::observe;

use crate::{
    features::{FEATURE_STEPS, FeatureMeans},
    rasterise::Rasteriser,
    simulate::{Start, Swarm, batch_is_for},
};
use murmuration_swarm::{Controller, Evaluation, ImageFormat, Invalid, World};
use pulp::Arch;
use recorder::{Recorder, quiet};

/// Evaluates controllers in one world, and reuses its buffers.
#[derive(Debug)]
pub struct Evaluator {
    world: World,
    format: ImageFormat,
    rasteriser: Rasteriser,
    arch: Arch,
    /// Number of controllers that are evaluated at once.
    lanes: usize,
    judges: bool,
}

impl Evaluator {
    /// An evaluator that uses the fastest instructions of this CPU.
    ///
    /// # Errors
    /// Fails if the world is smaller than the picture.
    pub fn new(world: &World, format: &ImageFormat) -> Result<Self, Invalid> {
        Self::on(Arch::new(), world, format)
    }

    /// Like [`Evaluator::new`], but with the instructions of `arch`. Evaluations have the same bits.
    ///
    /// # Errors
    /// The errors of [`Evaluator::new`].
    pub fn on(arch: Arch, world: &World, format: &ImageFormat) -> Result<Self, Invalid> {
        Ok(Self {
            world: world.clone(),
            format: *format,
            rasteriser: Rasteriser::on(arch, world, format)?,
            arch,
            lanes: batch::lanes(arch, world),
            judges: false,
        })
    }

    /// Sets whether the judge also names the class of each motion.
    #[must_use]
    pub fn judging(self, judges: bool) -> Self {
        Self { judges, ..self }
    }

    /// Simulates `controller` from `start` over the world's horizon.
    ///
    /// The features are means over the last 100 steps. The picture shows all steps of the format's window except the first, which
    /// clears the canvas. The evaluation has the judge's verdict if this evaluator judges.
    ///
    /// # Errors
    /// The errors of [`Swarm::new`]. Fails if the picture's channels are for another number of species, or if a feature is not
    /// finite. Features are finite for robots of a sensible size.
    pub fn evaluate(&mut self, controller: &Controller, start: &Start) -> Result<Evaluation, Invalid> {
        self.format
            .check_species(controller.model())
            .map_err(|error| error.within("image"))?;
        let mut swarm = Swarm::on(self.arch, controller, &self.world, start)?;
        let mut ending = Ending::new(&self.world, &self.format, &mut self.rasteriser);
        let mut recorder = self.judges.then(|| Recorder::new(&self.world, 1));
        let record = |recorder: &mut Option<Recorder>, swarm: &Swarm| {
            if let Some(recorder) = recorder {
                recorder.observe(swarm.steps(), |_| swarm.agents().map(|agent| agent.position));
            }
        };
        record(&mut recorder, &swarm);
        while swarm.steps() < self.world.horizon() {
            swarm.advance(quiet(swarm.steps(), ending.first_step(), recorder.as_ref()));
            swarm.step();
            ending.observe(&swarm);
            record(&mut recorder, &swarm);
        }
        let evaluation = Evaluation::new(ending.features.means(), ending.rasteriser.image(), &self.format)?;
        let verdicts = recorder
            .map(|recorder| {
                recorder.verdicts(&controller.species_of_robots(self.world.agents()), &self.world)
            })
            .transpose()?;
        Ok(evaluation.judged(verdicts.and_then(|verdicts| verdicts.first().copied())))
    }

    /// Evaluates each of `tasks`, with the same bits as [`Evaluator::evaluate`]. Evaluating tasks together is faster for swarms
    /// of one species with up to 64 robots whose sensors see only robots. Worlds with noise, obstacles or a torus gain nothing.
    ///
    /// # Errors
    /// The first error of [`Evaluator::evaluate`].
    pub fn evaluate_all(&mut self, tasks: &[(Controller, Start)]) -> Result<Vec<Evaluation>, Invalid> {
        let mut evaluations = Vec::with_capacity(tasks.len());
        for alike in tasks.chunk_by(|(a, _), (b, _)| a.model() == b.model()) {
            let one_channel = self.format.shape().channels() == 1;
            let can_batch = one_channel && self.lanes > 1 && batch_is_for(alike[0].0.model(), &self.world);
            for tasks in alike.chunks(self.lanes) {
                // A vector with half of its lanes empty is no faster than its swarms one by one.
                let batch = (can_batch && 2 * tasks.len() > self.lanes).then(|| self.evaluate_batch(tasks));
                if let Some(batch) = batch.flatten() {
                    evaluations.extend(batch?);
                } else {
                    for (controller, start) in tasks {
                        evaluations.push(self.evaluate(controller, start)?);
                    }
                }
            }
        }
        Ok(evaluations)
    }

    /// Evaluates the tasks as one batch; `None` if the instructions have no vectors.
    fn evaluate_batch(&mut self, tasks: &[(Controller, Start)]) -> Option<Result<Vec<Evaluation>, Invalid>> {
        let tasks = batch::Tasks {
            world: &self.world,
            format: &self.format,
            rasteriser: &mut self.rasteriser,
            judges: self.judges,
            tasks,
        };
        tasks.evaluate_on(self.arch)
    }
}

/// Evaluates one controller. For many controllers, an [`Evaluator`] is faster.
///
/// # Errors
/// The errors of [`Evaluator::new`] and [`Evaluator::evaluate`].
pub fn evaluate(
    controller: &Controller,
    world: &World,
    format: &ImageFormat,
    start: &Start,
) -> Result<Evaluation, Invalid> {
    Evaluator::new(world, format)?.evaluate(controller, start)
}

/// Observations of the last steps of a simulation: features and picture.
pub(crate) struct Ending<'a> {
    pub(crate) features: FeatureMeans,
    pub(crate) rasteriser: &'a mut Rasteriser,
    window: Window,
}

impl<'a> Ending<'a> {
    pub(crate) fn new(world: &World, format: &ImageFormat, rasteriser: &'a mut Rasteriser) -> Self {
        rasteriser.clear();
        Self {
            features: FeatureMeans::new(world),
            rasteriser,
            window: Window::new(world, format),
        }
    }

    /// Number of initial steps without observations.
    pub(crate) const fn first_step(&self) -> u32 {
        self.window.first_step()
    }

    /// Observes the swarm after a step.
    pub(crate) fn observe(&mut self, swarm: &Swarm) {
        if self.window.has_features(swarm.steps()) {
            self.features.observe(swarm);
        }
        if self.window.is_drawn(swarm.steps()) {
            self.rasteriser.draw(swarm);
        }
    }
}

/// The steps from which features and picture are computed.
#[derive(Debug, Clone, Copy)]
struct Window {
    /// Features are computed after this number of steps.
    features_after: u32,
    /// Agents are drawn after this number of steps.
    drawn_after: u32,
}

impl Window {
    const fn new(world: &World, format: &ImageFormat) -> Self {
        Self {
            features_after: world.horizon().saturating_sub(FEATURE_STEPS),
            drawn_after: world.horizon().saturating_sub(format.window() - 1),
        }
    }

    /// Number of initial steps without features or drawing.
    const fn first_step(self) -> u32 {
        if self.features_after < self.drawn_after {
            self.features_after
        } else {
            self.drawn_after
        }
    }

    const fn has_features(self, step: u32) -> bool {
        step > self.features_after
    }

    const fn is_drawn(self, step: u32) -> bool {
        step > self.drawn_after
    }
}

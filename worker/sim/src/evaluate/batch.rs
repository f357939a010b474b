//! Evaluates several controllers at once, one swarm per lane of a vector.

use super::{
    Window,
    recorder::{Recorder, quiet},
};
use crate::{
    features::LaneMeans,
    lanes::point,
    rasterise::Rasteriser,
    simulate::{Batch, MOST_AGENTS, Start},
};
use murmuration_swarm::{Controller, Evaluation, ImageFormat, Invalid, Sensor, World};
use pulp::{Arch, Simd, WithSimd};

/// Maximum number of pixels of a canvas if each lane has a canvas. Larger canvases do not fit the CPU's caches.
const MOST_PIXELS: f64 = 1_048_576.0;

/// Number of swarms of this world to simulate at once with the instructions of `arch`; 1 if a vector of swarms would be no
/// faster.
pub(super) fn lanes(arch: Arch, world: &World) -> usize {
    if world.agents() <= MOST_AGENTS && world.width() * world.height() <= MOST_PIXELS {
        arch.dispatch(Lanes)
    } else {
        1
    }
}

struct Lanes;

impl WithSimd for Lanes {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> usize {
        S::F64_LANES
    }
}

/// Swarms to evaluate at once: at least one, at most one per lane. The swarms differ only in controllers and starts, and their
/// model suits a batch.
pub(super) struct Tasks<'a> {
    pub(super) world: &'a World,
    pub(super) format: &'a ImageFormat,
    pub(super) rasteriser: &'a mut Rasteriser,
    pub(super) judges: bool,
    pub(super) tasks: &'a [(Controller, Start)],
}

impl WithSimd for Tasks<'_> {
    type Output = Result<Vec<Evaluation>, Invalid>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        if self.sensors().iter().all(Sensor::is_plain_ray) {
            self.evaluate_all::<S, false>(simd)
        } else {
            self.evaluate_all::<S, true>(simd)
        }
    }
}

impl Tasks<'_> {
    /// Evaluates the tasks on the vectors of `arch`; `None` if `arch` has no vectors. A batch of one lane is no faster than a
    /// single swarm, and omitting such batches saves a third of this crate's compile time.
    pub(super) fn evaluate_on(self, arch: Arch) -> Option<Result<Vec<Evaluation>, Invalid>> {
        match arch {
            #[cfg(target_arch = "x86_64")]
            Arch::V4(simd) => Some(Simd::vectorize(simd, self)),
            #[cfg(target_arch = "x86_64")]
            Arch::V3(simd) => Some(Simd::vectorize(simd, self)),
            #[cfg(target_arch = "aarch64")]
            Arch::Neon(simd) => Some(Simd::vectorize(simd, self)),
            _ => None,
        }
    }

    fn sensors(&self) -> &[Sensor] {
        self.tasks[0].0.model().species()[0].robot().sensors()
    }

    #[inline(always)]
    fn evaluate_all<S: Simd, const CONES: bool>(self, simd: S) -> Result<Vec<Evaluation>, Invalid> {
        match self.sensors().len() {
            1 => self.evaluate::<S, 1, CONES>(simd),
            2 => self.evaluate::<S, 2, CONES>(simd),
            3 => self.evaluate::<S, 3, CONES>(simd),
            4 => self.evaluate::<S, 4, CONES>(simd),
            5 => self.evaluate::<S, 5, CONES>(simd),
            _ => self.evaluate::<S, 6, CONES>(simd),
        }
    }

    #[inline(always)]
    fn evaluate<S: Simd, const SENSORS: usize, const CONES: bool>(
        self,
        simd: S,
    ) -> Result<Vec<Evaluation>, Invalid> {
        let lanes = self.tasks.len();
        let window = Window::new(self.world, self.format);
        let mut batch = Batch::<S, SENSORS, CONES>::new(simd, self.world, self.tasks)?;
        let mut features = LaneMeans::new(simd, self.world);
        self.rasteriser.clear_lanes(lanes);
        let mut recorder = self.judges.then(|| Recorder::new(self.world, lanes));
        record(simd, &mut recorder, &batch);
        while batch.steps() < self.world.horizon() {
            let quiet = quiet(batch.steps(), window.first_step(), recorder.as_ref());
            if quiet > 0 {
                batch.advance(simd, quiet);
            }
            batch.watch();
            batch.advance(simd, 1);
            if window.has_features(batch.steps()) {
                features.observe(simd, batch.agents(simd));
            }
            if window.is_drawn(batch.steps()) {
                self.rasteriser.draw_lanes(simd, &batch, lanes);
            }
            record(simd, &mut recorder, &batch);
        }
        let verdicts = recorder
            // All robots of a batch are of one species.
            .map(|recorder| recorder.verdicts(&[], self.world))
            .transpose()?;
        let evaluation = |lane: usize| {
            let image = self.rasteriser.image_of(lane);
            let evaluation = Evaluation::new(features.means(lane), image, self.format)?;
            let verdict = verdicts.as_ref().and_then(|verdicts| verdicts.get(lane));
            Ok(evaluation.judged(verdict.copied()))
        };
        (0..lanes).map(evaluation).collect()
    }
}

/// Records the positions of a batch if there is a recorder.
#[inline(always)]
fn record<S: Simd, const SENSORS: usize, const CONES: bool>(
    simd: S,
    recorder: &mut Option<Recorder>,
    batch: &Batch<S, SENSORS, CONES>,
) {
    if let Some(recorder) = recorder {
        recorder.observe(batch.steps(), |lane| {
            batch
                .agents(simd)
                .map(move |agent| point::<S>(&agent.position, lane))
        });
    }
}

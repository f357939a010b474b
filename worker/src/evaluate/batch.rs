//! Several controllers evaluated at once, a swarm a lane.

use super::Window;
use crate::{
    features::LaneMeans,
    rasterise::Rasteriser,
    simulate::{Batch, MOST_AGENTS, Start},
};
use murmuration_proto::{Controller, Evaluation, ImageFormat, Invalid, World};
use pulp::{Arch, Simd, WithSimd};

/// Most pixels of a canvas of which there is one a lane: beyond, they leave the caches.
const MOST_PIXELS: f64 = 1_048_576.0;

/// How many swarms of this world are simulated at once on the instructions of `arch`; one where a vector of swarms does not
/// pay.
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

/// Tasks with controllers of one model, at least one and at most as many as there are lanes.
pub(super) struct Tasks<'a> {
    pub(super) world: &'a World,
    pub(super) format: &'a ImageFormat,
    pub(super) rasteriser: &'a mut Rasteriser,
    pub(super) tasks: &'a [(Controller, Start)],
}

impl WithSimd for Tasks<'_> {
    type Output = Result<Vec<Evaluation>, Invalid>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        if self
            .tasks
            .iter()
            .any(|(controller, _)| controller.angle().is_some())
        {
            self.evaluate::<S, 2>(simd)
        } else {
            self.evaluate::<S, 1>(simd)
        }
    }
}

impl Tasks<'_> {
    #[inline(always)]
    fn evaluate<S: Simd, const SENSORS: usize>(self, simd: S) -> Result<Vec<Evaluation>, Invalid> {
        let lanes = self.tasks.len();
        let window = Window::new(self.world, self.format);
        let mut batch = Batch::<S, SENSORS>::new(simd, self.world, self.tasks)?;
        let mut features = LaneMeans::new(simd, self.world);
        self.rasteriser.clear_lanes(lanes);
        batch.advance(simd, window.first_step());
        while batch.steps() < self.world.horizon() {
            batch.advance(simd, 1);
            if window.has_features(batch.steps()) {
                features.observe(simd, batch.agents());
            }
            if window.is_drawn(batch.steps()) {
                self.rasteriser.draw_lanes(simd, &batch, lanes);
            }
        }
        let evaluation =
            |lane| Evaluation::new(features.means(lane), self.rasteriser.image_of(lane), self.format);
        (0..lanes).map(evaluation).collect()
    }
}

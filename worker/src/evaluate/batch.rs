//! Several controllers evaluated at once, a swarm a lane.

use super::Window;
use crate::{
    features::LaneMeans,
    rasterise::Rasteriser,
    simulate::{Batch, MOST_AGENTS, Start},
};
use murmuration_proto::{
    Boundary, Controller, Evaluation, ImageFormat, Invalid, Sensor, SwarmController, World,
};
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

/// Tasks to do at once.
pub(super) struct Tasks<'a> {
    pub(super) world: &'a World,
    pub(super) format: &'a ImageFormat,
    pub(super) rasteriser: &'a mut Rasteriser,
    pub(super) swarms: Swarms<'a>,
}

/// Swarms of robots that are alike but for their controllers, at least one and at most as many as there are lanes.
#[derive(Clone, Copy)]
pub(super) enum Swarms<'a> {
    /// Of one of the paper's models.
    Paper(&'a [(Controller, Start)]),
    /// Of one population that a batch is for.
    Described(Boundary, &'a [(SwarmController, Start)]),
}

impl WithSimd for Tasks<'_> {
    type Output = Result<Vec<Evaluation>, Invalid>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        if self.swarms.have_cones() {
            self.evaluate_all::<S, true>(simd)
        } else {
            self.evaluate_all::<S, false>(simd)
        }
    }
}

impl Swarms<'_> {
    fn sensors(&self) -> usize {
        match self {
            Self::Paper(tasks) => 1 + tasks[0].0.model().angles(),
            Self::Described(_, tasks) => tasks[0].0.population().species()[0].robot().sensors().len(),
        }
    }

    fn have_cones(&self) -> bool {
        match self {
            Self::Paper(_) => false,
            Self::Described(_, tasks) => {
                let sensors = tasks[0].0.population().species()[0].robot().sensors();
                !sensors.iter().all(Sensor::is_plain_ray)
            }
        }
    }

    const fn len(&self) -> usize {
        match self {
            Self::Paper(tasks) => tasks.len(),
            Self::Described(_, tasks) => tasks.len(),
        }
    }

    fn batch<S: Simd, const SENSORS: usize, const CONES: bool>(
        &self,
        simd: S,
        world: &World,
    ) -> Result<Batch<S, SENSORS, CONES>, Invalid> {
        match self {
            Self::Paper(tasks) => Batch::new(simd, world, tasks),
            Self::Described(boundary, tasks) => Batch::of_species(simd, world, *boundary, tasks),
        }
    }
}

impl Tasks<'_> {
    #[inline(always)]
    fn evaluate_all<S: Simd, const CONES: bool>(self, simd: S) -> Result<Vec<Evaluation>, Invalid> {
        match self.swarms.sensors() {
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
        let lanes = self.swarms.len();
        let window = Window::new(self.world, self.format);
        let mut batch = self.swarms.batch::<S, SENSORS, CONES>(simd, self.world)?;
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

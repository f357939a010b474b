//! The picture of a behaviour: where its agents went in the last steps, as grey values.

mod brush;
mod canvas;
mod grey;
mod shapes;
mod stamps;

use crate::simulate::{Agent, Agents, Batch, Swarm};
use brush::{Brush, Ends};
use canvas::Canvas;
use grey::Cells;
use murmuration_proto::{ImageFormat, Invalid, Robot, World};
use pulp::{Arch, Scalar, Simd, WithSimd};

/// Draws swarms on a canvas of one pixel a unit and averages it down (paper, "Simulation and Data").
///
/// For each agent in turn: its sensor rays in black, which erase, then its outline and its heading in white.
#[derive(Debug)]
pub struct Rasteriser {
    arch: Arch,
    size: [usize; 2],
    /// The first for a swarm alone, one a lane for several at once.
    canvases: Vec<Canvas>,
    cells: Cells,
    brush: Brush,
}

impl Rasteriser {
    /// A black canvas for swarms in `world`.
    ///
    /// # Errors
    /// Where the world is smaller than the picture.
    pub fn new(world: &World, format: &ImageFormat) -> Result<Self, Invalid> {
        Self::on(Arch::new(), world, format)
    }

    /// As [`Rasteriser::new`], on the instructions of `arch`: the pictures are the same.
    ///
    /// # Errors
    /// As [`Rasteriser::new`].
    pub fn on(arch: Arch, world: &World, format: &ImageFormat) -> Result<Self, Invalid> {
        let format =
            ImageFormat::for_world((*format).into(), world).map_err(|error| error.within("image"))?;
        let size = [world.width() as usize, world.height() as usize];
        Ok(Self {
            arch,
            size,
            canvases: vec![Canvas::new(size)],
            cells: Cells::new(size, format.resolution() as usize),
            brush: Brush::new(world.radius()),
        })
    }

    /// Makes the canvas black again.
    pub fn clear(&mut self) {
        self.canvases[0].clear();
    }

    /// Makes as many canvases black.
    pub(crate) fn clear_lanes(&mut self, lanes: usize) {
        let size = self.size;
        if self.canvases.len() < lanes {
            self.canvases.resize_with(lanes, || Canvas::new(size));
        }
        self.canvases.iter_mut().take(lanes).for_each(Canvas::clear);
    }

    /// Draws every agent as it is now, in index order, over what is there.
    pub fn draw(&mut self, swarm: &Swarm) {
        self.arch.dispatch(Drawing {
            brush: &self.brush,
            canvas: &mut self.canvases[0],
            swarm,
        });
    }

    /// Draws the agents of each swarm on its canvas, those of the first `lanes` lanes.
    #[inline(always)]
    pub(crate) fn draw_lanes<S: Simd, const SENSORS: usize, const CONES: bool>(
        &mut self,
        simd: S,
        batch: &Batch<S, SENSORS, CONES>,
        lanes: usize,
    ) {
        for Agents {
            position, heading, ..
        } in batch.agents()
        {
            let rays = batch.sensor_directions(simd, heading);
            let ends = Ends::new(simd, &self.brush, position, heading, rays);
            // All lanes in between: a load of what was stored just before, at another address, would wait for the store.
            for (lane, canvas) in self.canvases.iter_mut().take(lanes).enumerate() {
                self.brush.erase_rays(canvas, &ends.lane(lane));
            }
            for (lane, canvas) in self.canvases.iter_mut().take(lanes).enumerate() {
                self.brush.paint_body(canvas, &ends.lane(lane));
            }
        }
    }

    /// The picture: the share of white in each cell, stretched to the picture's own minimum and maximum.
    ///
    /// Grey values, index `x * resolution + y`. It is what the network sees.
    #[must_use]
    pub fn image(&self) -> Vec<u8> {
        self.image_of(0)
    }

    /// The picture of the swarm in one lane.
    pub(crate) fn image_of(&self, lane: usize) -> Vec<u8> {
        grey::stretched(&self.cells.average(self.arch, &self.canvases[lane]))
    }

    /// The picture before it is stretched: 255 times the share of white, rounded half to even.
    #[must_use]
    pub fn raw_image(&self) -> Vec<u8> {
        self.cells.average(self.arch, &self.canvases[0])
    }
}

/// The drawing of a swarm, as something that can be compiled for several kinds of CPU.
struct Drawing<'a> {
    brush: &'a Brush,
    canvas: &'a mut Canvas,
    swarm: &'a Swarm,
}

impl WithSimd for Drawing<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        for (i, agent) in self.swarm.agents().enumerate() {
            let mut directions = self.swarm.sensor_directions(i, agent.heading);
            let first = directions.next().unwrap_or(agent.heading);
            match (directions.next(), directions.next()) {
                (None, _) => self.draw(&agent, [first]),
                (Some(second), None) => self.draw(&agent, [first, second]),
                (Some(second), Some(third)) => {
                    // To erase a ray twice changes nothing.
                    let mut rays = [third; Robot::MAX_SENSORS];
                    rays[..2].copy_from_slice(&[first, second]);
                    rays[3..]
                        .iter_mut()
                        .zip(directions)
                        .for_each(|(ray, next)| *ray = next);
                    self.draw(&agent, rays);
                }
            }
        }
    }
}

impl Drawing<'_> {
    #[inline(always)]
    fn draw<const SENSORS: usize>(&mut self, agent: &Agent, rays: [[f64; 2]; SENSORS]) {
        let ends = Ends::new(Scalar::new(), self.brush, agent.position, agent.heading, rays);
        self.brush.draw(self.canvas, &ends.lane(0));
    }
}

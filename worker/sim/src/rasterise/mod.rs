//! The picture of a behaviour: the paths of its agents in the last steps, as grey values.

mod brush;
mod canvas;
mod grey;
mod shapes;
mod stamps;

use crate::simulate::{Agent, Agents, Batch, Swarm};
use brush::{Brush, Ends};
use canvas::Canvas;
use grey::Cells;
use murmuration_swarm::{ImageFormat, Invalid, Robot, World};
use pulp::{Arch, Scalar, Simd, WithSimd};

/// Draws swarms on a canvas of one pixel per world unit, and averages the canvas to the picture's resolution (paper, "Simulation
/// and Data").
///
/// Draws each agent in turn: its sensor rays in black, which erase, then its outline and its heading in white.
///
/// There is one canvas per channel of the picture. With several channels, agents are drawn on the canvas of their species, and
/// each canvas is averaged and stretched separately. So a ray erases no agent of another species, and a channel is the picture
/// that its species would have alone.
#[derive(Debug)]
pub struct Rasteriser {
    arch: Arch,
    size: [usize; 2],
    /// Number of canvases for one swarm.
    channels: usize,
    /// A single swarm uses the first `channels` canvases, one per channel. Several swarms at once use one canvas per lane.
    canvases: Vec<Canvas>,
    cells: Cells,
    /// A brush for each body size drawn so far. The first brush is for the world's radius, the largest size.
    brushes: Vec<Brush>,
}

impl Rasteriser {
    /// A black canvas for swarms in `world`.
    ///
    /// # Errors
    /// Fails if the world is smaller than the picture.
    pub fn new(world: &World, format: &ImageFormat) -> Result<Self, Invalid> {
        Self::on(Arch::new(), world, format)
    }

    /// Like [`Rasteriser::new`], but with the instructions of `arch`. The pictures are the same.
    ///
    /// # Errors
    /// The errors of [`Rasteriser::new`].
    pub fn on(arch: Arch, world: &World, format: &ImageFormat) -> Result<Self, Invalid> {
        format.check_world(world).map_err(|error| error.within("image"))?;
        let channels = format.shape().channels();
        let size = [world.width() as usize, world.height() as usize];
        Ok(Self {
            arch,
            size,
            channels,
            canvases: vec![Canvas::new(size); channels],
            cells: Cells::new(size, format.resolution() as usize),
            brushes: vec![Brush::new(world.radius())],
        })
    }

    /// Makes the picture black again.
    pub fn clear(&mut self) {
        let canvases = self.canvases.iter_mut().take(self.channels);
        canvases.for_each(Canvas::clear);
    }

    /// Makes one canvas per lane black, for swarms whose pictures have one channel.
    pub(crate) fn clear_lanes(&mut self, lanes: usize) {
        let size = self.size;
        if self.canvases.len() < lanes {
            self.canvases.resize_with(lanes, || Canvas::new(size));
        }
        self.canvases.iter_mut().take(lanes).for_each(Canvas::clear);
    }

    /// Draws the current state of every agent, in index order, over the existing pixels.
    pub fn draw(&mut self, swarm: &Swarm) {
        for radius in swarm.radii() {
            if self.brushes.iter().all(|brush| brush.radius() != radius) {
                self.brushes.push(Brush::new(radius));
            }
        }
        self.arch.dispatch(Drawing {
            brushes: &self.brushes,
            canvases: &mut self.canvases[..self.channels],
            swarm,
        });
    }

    /// Draws the swarms of the first `lanes` lanes, each on its own canvas.
    #[inline(always)]
    pub(crate) fn draw_lanes<S: Simd, const SENSORS: usize, const CONES: bool>(
        &mut self,
        simd: S,
        batch: &Batch<S, SENSORS, CONES>,
        lanes: usize,
    ) {
        for Agents {
            position, heading, ..
        } in batch.agents(simd)
        {
            let rays = batch.sensor_directions(simd, heading);
            // All bodies of a batch have the same size.
            let brush = &self.brushes[0];
            let size = self.size.map(|side| side as u32);
            let ends = Ends::new(simd, brush, size, position, heading, rays);
            // Alternate between lanes, because a load must wait if it overlaps the previous store at another address.
            for sensor in 0..SENSORS {
                for (lane, canvas) in self.canvases.iter_mut().take(lanes).enumerate() {
                    brush.erase_ray(canvas, &ends, lane, sensor);
                }
            }
            for (lane, canvas) in self.canvases.iter_mut().take(lanes).enumerate() {
                brush.paint_body(canvas, &ends, lane);
            }
        }
    }

    /// The picture: the share of white in each cell of each channel, stretched from the channel's own minimum and maximum to the
    /// full range.
    ///
    /// The grey values are ordered channel by channel; a cell of a channel has index `x * resolution + y`. The picture is the
    /// network's input.
    #[must_use]
    pub fn image(&self) -> Vec<u8> {
        self.of_channels(|canvas| grey::stretched(&self.cells.average(self.arch, canvas)))
    }

    /// The picture of the swarm in one lane.
    pub(crate) fn image_of(&self, lane: usize) -> Vec<u8> {
        grey::stretched(&self.cells.average(self.arch, &self.canvases[lane]))
    }

    /// The picture before it is stretched: 255 times the share of white, rounded half to even.
    #[must_use]
    pub fn raw_image(&self) -> Vec<u8> {
        self.of_channels(|canvas| self.cells.average(self.arch, canvas))
    }

    /// Concatenates the values of all channels.
    fn of_channels(&self, values: impl Fn(&Canvas) -> Vec<u8>) -> Vec<u8> {
        let canvases = self.canvases.iter().take(self.channels);
        canvases.map(values).collect::<Vec<_>>().concat()
    }
}

/// Draws a swarm. As a type, this code is compiled for several kinds of CPU.
struct Drawing<'a> {
    brushes: &'a [Brush],
    /// One canvas per channel.
    canvases: &'a mut [Canvas],
    swarm: &'a Swarm,
}

impl WithSimd for Drawing<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        for (i, agent) in self.swarm.agents().enumerate() {
            let brush = self.brush_for(i);
            let mut directions = self.swarm.sensor_directions(i, agent.heading);
            let first = directions.next().unwrap_or(agent.heading);
            match (directions.next(), directions.next()) {
                (None, _) => self.draw(i, brush, &agent, [first]),
                (Some(second), None) => self.draw(i, brush, &agent, [first, second]),
                (Some(second), Some(third)) => {
                    // Erasing a ray twice changes nothing.
                    let mut rays = [third; Robot::MAX_SENSORS];
                    rays[..2].copy_from_slice(&[first, second]);
                    rays[3..]
                        .iter_mut()
                        .zip(directions)
                        .for_each(|(ray, next)| *ray = next);
                    self.draw(i, brush, &agent, rays);
                }
            }
        }
    }
}

impl<'a> Drawing<'a> {
    /// The brush for the body of agent `i`.
    #[inline(always)]
    fn brush_for(&self, i: usize) -> &'a Brush {
        match self.brushes {
            [only] => only,
            several => {
                let radius = self.swarm.radius(i);
                let found = several.iter().find(|brush| brush.radius() == radius);
                found.unwrap_or(&several[0])
            }
        }
    }

    #[inline(always)]
    fn draw<const SENSORS: usize>(
        &mut self,
        i: usize,
        brush: &Brush,
        agent: &Agent,
        rays: [[f64; 2]; SENSORS],
    ) {
        if let Some(canvas) = self.canvas_for(i) {
            let size = canvas.size();
            let ends = Ends::new(Scalar::new(), brush, size, agent.position, agent.heading, rays);
            brush.draw(canvas, &ends, 0);
        }
    }

    /// The canvas for agent `i`. `None` if the agent's species has no channel; evaluations refuse such a picture before they
    /// draw.
    #[inline(always)]
    fn canvas_for(&mut self, i: usize) -> Option<&mut Canvas> {
        match &mut *self.canvases {
            [only] => Some(only),
            several => several.get_mut(self.swarm.species(i)),
        }
    }
}

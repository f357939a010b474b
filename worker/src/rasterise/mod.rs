//! The picture of a behaviour: where its agents went in the last steps, as grey values.

mod canvas;
mod grey;
mod shapes;

use crate::simulate::Swarm;
use canvas::Canvas;
use grey::Cells;
use murmuration_proto::{ImageFormat, Invalid, World};

/// Length of a drawn sensor ray, in radii.
const RAY_RADII: f64 = 3.0;
/// Length of a drawn heading, in radii.
const HEADING_RADII: f64 = 2.0;

/// Draws swarms on a canvas of one pixel a unit and averages it down (paper, "Simulation and Data").
///
/// For each agent in turn: its sensor rays in black, which erase, then its outline and its heading in white.
#[derive(Debug)]
pub struct Rasteriser {
    canvas: Canvas,
    cells: Cells,
    outline: Vec<[i32; 2]>,
    radius: f64,
}

impl Rasteriser {
    /// A black canvas for swarms in `world`.
    ///
    /// # Errors
    /// Where the world is smaller than the picture.
    pub fn new(world: &World, format: &ImageFormat) -> Result<Self, Invalid> {
        let format =
            ImageFormat::for_world((*format).into(), world).map_err(|error| error.within("image"))?;
        let size = [world.width() as usize, world.height() as usize];
        Ok(Self {
            canvas: Canvas::new(size),
            cells: Cells::new(size, format.resolution() as usize),
            outline: shapes::circle((world.radius() as i32).max(1)),
            radius: world.radius(),
        })
    }

    /// Makes the canvas black again.
    pub fn clear(&mut self) {
        self.canvas.clear();
    }

    /// Draws every agent as it is now, in index order, over what is there.
    pub fn draw(&mut self, swarm: &Swarm) {
        for agent in swarm.agents() {
            let centre = agent.position.map(|value| value as i32);
            let end = |direction: [f64; 2], radii: f64| {
                let length = radii * self.radius;
                let [x, y] = agent.position;
                [
                    (x + length * direction[0]) as i32,
                    (y + length * direction[1]) as i32,
                ]
            };
            for direction in swarm.sensor_directions(agent.heading) {
                let ray = shapes::line(centre, end(direction, RAY_RADII));
                self.canvas.erase(ray);
            }
            let outline = self.outline.iter().map(|&[x, y]| [centre[0] + x, centre[1] + y]);
            let heading = shapes::line(centre, end(agent.heading, HEADING_RADII));
            self.canvas.paint(outline);
            self.canvas.paint(heading);
        }
    }

    /// The picture: the share of white in each cell, stretched to the picture's own minimum and maximum.
    ///
    /// Grey values, index `x * resolution + y`. It is what the network sees.
    #[must_use]
    pub fn image(&self) -> Vec<u8> {
        grey::stretched(&self.raw_image())
    }

    /// The picture before it is stretched: 255 times the share of white, rounded half to even.
    #[must_use]
    pub fn raw_image(&self) -> Vec<u8> {
        self.cells.average(&self.canvas)
    }
}

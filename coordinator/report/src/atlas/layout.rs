//! Position of each controller in the picture of an atlas.

use super::Atlas;
use murmuration_swarm::{CampaignSpec, Controller, Enumeration, GeneSpace};

/// The picture of all controllers of four speeds: the tiles by the first two, the pixels in each tile by the last two. The first
/// speed of a pair increases to the right, the second upwards.
#[derive(Debug, Clone)]
pub struct Layout {
    /// The values of each of the four speeds, ascending.
    speeds: [Vec<f64>; 4],
}

/// The controller at a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Place {
    /// Index among the atlas's entries, of the controller or of the simulated one whose mirror image it is.
    pub(super) entry: u32,
    pub(super) mirrored: bool,
}

impl Layout {
    /// Most values of a speed; the picture is then 4,096 pixels wide.
    const MOST_VALUES: usize = 64;

    /// The layout of a campaign's atlas; `None` unless it evaluates all controllers of a space of four speeds.
    pub fn of(spec: &CampaignSpec) -> Option<Self> {
        let all = Enumeration::of(spec.controllers(), spec.world())?;
        if all.len() != spec.search().evaluations() {
            return None;
        }
        let speeds = |gene: &GeneSpace| match gene {
            GeneSpace::Speed { .. } => gene
                .values()
                .map(|values| (0..values).map(|place| gene.value(place)).collect()),
            GeneSpace::Among(_) | GeneSpace::Within(_) | GeneSpace::Ratio(_) => None,
        };
        let speeds: Vec<Vec<f64>> = spec
            .controllers()
            .genes()
            .iter()
            .map(speeds)
            .collect::<Option<_>>()?;
        let speeds: [Vec<f64>; 4] = speeds.try_into().ok()?;
        (speeds[0].len() <= Self::MOST_VALUES).then_some(Self { speeds })
    }

    /// Number of values of a speed; also of tiles in a row, and of pixels in a row of a tile.
    pub fn values(&self) -> usize {
        self.speeds[0].len()
    }

    /// Side of the picture, pixels.
    pub fn side(&self) -> usize {
        self.values() * self.values()
    }

    /// The values of each of the four speeds, ascending.
    pub(super) const fn speeds(&self) -> &[Vec<f64>; 4] {
        &self.speeds
    }

    /// The pixel of a controller, x to the right and y down; `None` if the controller is not in the space.
    pub fn pixel(&self, controller: &Controller) -> Option<[usize; 2]> {
        let genes = <&[f64; 4]>::try_from(controller.genes()).ok()?;
        let place = |gene: usize| self.speeds[gene].iter().position(|speed| *speed == genes[gene]);
        let [a, b, c, d] = [place(0)?, place(1)?, place(2)?, place(3)?];
        let last = self.values() - 1;
        Some([a * self.values() + c, (last - b) * self.values() + (last - d)])
    }

    /// The controller at each pixel, row by row; `None` if none was evaluated.
    pub(super) fn places(&self, atlas: &Atlas) -> Vec<Option<Place>> {
        let all = Enumeration::of(atlas.spec.controllers(), atlas.spec.world());
        let mut places = vec![None; self.side() * self.side()];
        for (entry, controller) in (0..).zip(atlas.entries.iter().map(|entry| &entry.controller)) {
            let mirrored = all.and_then(|all| all.mirrored(controller));
            if let Some([x, y]) = mirrored.and_then(|mirrored| self.pixel(&mirrored)) {
                places[y * self.side() + x] = Some(Place {
                    entry,
                    mirrored: true,
                });
            }
            if let Some([x, y]) = self.pixel(controller) {
                places[y * self.side() + x] = Some(Place {
                    entry,
                    mirrored: false,
                });
            }
        }
        places
    }
}

//! Position of each controller in the picture of an atlas.

use super::Atlas;
use murmuration_swarm::{CampaignSpec, Controller, Enumeration, GeneSpace};

/// The picture of all controllers of four speeds: the first two speeds choose the tile, the last two the pixel in the tile. The
/// first speed of a pair increases to the right, the second upwards.
#[derive(Debug, Clone)]
pub struct Layout {
    /// The values of each of the four speeds, ascending.
    speeds: [Vec<f64>; 4],
}

/// The controller at a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Place {
    /// Index of the controller among the atlas's entries; if `mirrored`, the index of its mirror image, which was simulated.
    pub(super) entry: u32,
    pub(super) mirrored: bool,
}

impl Layout {
    /// Maximum number of values of a speed: the picture is at most 4,096 pixels wide.
    const MOST_VALUES: usize = 64;

    /// The layout of a campaign's atlas; `None` unless the campaign evaluates all controllers of a space of four speeds.
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

    /// Number of values of a speed, which is also the number of tiles in a row and of pixels in a row of a tile.
    pub fn values(&self) -> usize {
        self.speeds[0].len()
    }

    /// Side of the picture in pixels.
    pub fn side(&self) -> usize {
        self.values() * self.values()
    }

    /// The values of each of the four speeds, ascending.
    pub(super) const fn speeds(&self) -> &[Vec<f64>; 4] {
        &self.speeds
    }

    /// The pixel of a controller, x to the right and y down; `None` if the controller's speeds are not in the layout.
    pub fn pixel(&self, controller: &Controller) -> Option<[usize; 2]> {
        let genes = <&[f64; 4]>::try_from(controller.genes()).ok()?;
        let place = |gene: usize| self.speeds[gene].iter().position(|speed| *speed == genes[gene]);
        let [a, b, c, d] = [place(0)?, place(1)?, place(2)?, place(3)?];
        let last = self.values() - 1;
        Some([a * self.values() + c, (last - b) * self.values() + (last - d)])
    }

    /// The controller at each pixel, row by row; `None` for a controller that was not evaluated.
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

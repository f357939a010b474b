//! The palette that all frames of an animation share, and pixels as indices into it.

use super::sketch::Sketch;
use murmuration_model::colours::{AGENTS, LINE, PAPER, Rgb, over};
use std::collections::HashMap;

/// Index that marks a pixel as unchanged since the frame before.
pub(super) const UNCHANGED: u8 = 0;
/// Index of the background.
const BACKGROUND: u8 = 1;
/// Number of opacities of an agent's colour in the palette; the last opacity is that of the body.
const SHADES: u8 = 10;

/// The palette of all frames, with a cache of requested colours.
pub(super) struct Palette {
    colours: Vec<Rgb>,
    /// The index of each requested colour. The order of this map does not matter, because no code iterates over it.
    places: HashMap<(Rgb, u8), u8>,
}

impl Palette {
    /// A palette of every agent's colour in ten shades on the background, and of the colours of the walls.
    pub(super) fn new() -> Self {
        let part = |shade: u8| (u32::from(shade) * 255 / u32::from(SHADES)) as u8;
        let shades = |colour: Rgb| (1..=SHADES).map(move |shade| over(colour, part(shade), PAPER));
        let lines = [over(LINE, 140, PAPER), over(LINE, 70, PAPER)];
        Self {
            colours: [PAPER, PAPER]
                .into_iter()
                .chain(lines)
                .chain(AGENTS.into_iter().flat_map(shades))
                .collect(),
            places: HashMap::new(),
        }
    }

    /// Red, green and blue of every index, in the format of a GIF.
    pub(super) fn bytes(&self) -> Vec<u8> {
        self.colours.as_flattened().to_vec()
    }

    /// The sketch on the background, as indices into the palette, row by row.
    pub(super) fn index(&mut self, sketch: &Sketch) -> Vec<u8> {
        sketch
            .pixels()
            .map(|(colour, part)| match part {
                0 => BACKGROUND,
                _ => *self
                    .places
                    .entry((colour, part))
                    .or_insert_with(|| nearest(&self.colours, over(colour, part, PAPER))),
            })
            .collect()
    }
}

/// The index of the colour nearest to `wanted` by red, green and blue; the first index, if several colours are equally near.
fn nearest(colours: &[Rgb], wanted: Rgb) -> u8 {
    let distance = |&colour: &Rgb| -> i32 {
        (0..3)
            .map(|i| (i32::from(colour[i]) - i32::from(wanted[i])).pow(2))
            .sum()
    };
    let candidates = colours.iter().enumerate().skip(BACKGROUND.into());
    candidates
        .min_by_key(|(_, colour)| distance(colour))
        .map_or(BACKGROUND, |(place, _)| place as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_palette_fits_and_finds_its_own_colours() {
        let palette = Palette::new();
        assert!(palette.colours.len() <= 256);
        for colour in AGENTS.into_iter().chain([PAPER]) {
            let place = nearest(&palette.colours, colour);
            assert_eq!(palette.colours[usize::from(place)], colour);
            assert_ne!(place, UNCHANGED);
        }
    }
}

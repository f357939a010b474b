//! The picture: a pixel a controller.

use super::{
    Tally,
    layout::{Layout, Place},
};
use crate::picture::PictureError;
use murmuration_model::colours::{self, Rgb, class_colour};

/// Under everything: what is not sure is dark.
const DARK: Rgb = [0; 3];
/// Where nothing was evaluated.
const NOTHING: Rgb = [0xff; 3];

/// The colour of a controller: its class's, as bright as the class is sure.
pub(super) fn shade(tally: &Tally) -> Rgb {
    let part = (tally.sureness() * 255.0).round() as u8;
    colours::over(class_colour(tally.class), part, DARK)
}

/// The picture as a PNG, every controller a square of `scale` pixels a side.
pub(super) fn png(
    layout: &Layout,
    places: &[Option<Place>],
    tallies: &[Tally],
    scale: usize,
) -> Result<Vec<u8>, PictureError> {
    let shade = |place: &Option<Place>| place.map_or(NOTHING, |place| shade(&tallies[place.entry as usize]));
    let colours: Vec<Rgb> = places.iter().map(shade).collect();
    let side = layout.side() * scale;
    let pixel = |at: usize| colours[at / side / scale * layout.side() + at % side / scale];
    let pixels: Vec<Rgb> = (0..side * side).map(pixel).collect();
    square_png(pixels.as_flattened(), side, png::ColorType::Rgb)
}

/// Pixels, row by row, as a PNG of this side.
pub(crate) fn square_png(
    pixels: &[u8],
    side: usize,
    colours: png::ColorType,
) -> Result<Vec<u8>, PictureError> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, side as u32, side as u32);
    encoder.set_color(colours);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels)?;
    writer.finish()?;
    Ok(file)
}

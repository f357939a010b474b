//! SVG as PNG, for papers and programs that do not read SVG. It uses one font of its own and none of the system's, so that the same
//! drawing gives the same bytes on every machine.

use crate::picture::PictureError;
use resvg::{
    tiny_skia::{Pixmap, Transform},
    usvg::{Options, Tree, fontdb::Database},
};
use std::sync::{Arc, LazyLock};

/// As wide as Arial, for which the drawings leave room (`fonts/OFL.txt` has its licence).
const FONTS: [&[u8]; 2] = [
    include_bytes!("../fonts/Arimo-Regular.ttf"),
    include_bytes!("../fonts/Arimo-Bold.ttf"),
];
const FAMILY: &str = "Arimo";
/// Longest side of a PNG, pixels.
const MOST_SIDE: u32 = 8192;

static DATABASE: LazyLock<Arc<Database>> = LazyLock::new(|| {
    let mut database = Database::new();
    for font in FONTS {
        database.load_font_data(font.to_vec());
    }
    database.set_sans_serif_family(FAMILY);
    Arc::new(database)
});

/// A drawing with so many pixels for each of its units.
///
/// # Errors
/// [`PictureError::Svg`] if it is no SVG or too large; [`PictureError::Png`].
pub(crate) fn png(svg: &str, scale: f32) -> Result<Vec<u8>, PictureError> {
    let options = Options {
        fontdb: Arc::clone(&DATABASE),
        font_family: FAMILY.to_owned(),
        ..Options::default()
    };
    let tree = Tree::from_str(svg, &options).map_err(|error| PictureError::Svg(error.to_string()))?;
    let size = tree.size();
    let [width, height] = [size.width(), size.height()].map(|side| (side * scale).round() as u32);
    let pixmap = match width.max(height) <= MOST_SIDE {
        true => Pixmap::new(width, height),
        false => None,
    };
    let mut pixels = pixmap.ok_or_else(|| PictureError::Svg(format!("{width} by {height} pixels")))?;
    resvg::render(&tree, Transform::from_scale(scale, scale), &mut pixels.as_mut());
    encoded(&pixels)
}

/// Without opacity: every drawing has a background.
fn encoded(pixels: &Pixmap) -> Result<Vec<u8>, PictureError> {
    let mut colours = Vec::with_capacity(pixels.data().len() / 4 * 3);
    for pixel in pixels.data().chunks_exact(4) {
        colours.extend_from_slice(&pixel[..3]);
    }
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, pixels.width(), pixels.height());
    encoder.set_color(png::ColorType::Rgb);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&colours)?;
    writer.finish()?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        picture::sample::decode_png,
        svg::{Drawing, WHITE},
    };
    use maud::html;

    fn drawn(content: maud::Markup, scale: f32) -> (u32, u32, Vec<u8>) {
        let drawing = Drawing {
            size: [60.0, 20.0],
            font_size: 16,
            title: "a drawing",
            label: None,
            paper: WHITE,
            shrinks: false,
        };
        decode_png(&png(&drawing.with(&content).into_string(), scale).unwrap())
    }

    #[test]
    fn words_are_drawn_and_bold_ones_are_darker() {
        let dark = |content| {
            drawn(content, 2.0)
                .2
                .iter()
                .map(|value| 255 - u64::from(*value))
                .sum::<u64>()
        };
        let plain = dark(html! { text x="2" y="16" { "Milling" } });
        let bold = dark(html! { text x="2" y="16" font-weight="bold" { "Milling" } });
        assert!(plain > 0 && bold > plain + plain / 10, "{plain} {bold}");
        assert_eq!(dark(html! {}), 0);
    }

    #[test]
    fn a_point_of_a_path_is_a_dot_and_pictures_stay_sharp() {
        let (width, height, pixels) = drawn(
            html! { path d="M10 10h0" stroke="#ff0000" stroke-width="8" stroke-linecap="round" {} },
            1.0,
        );
        assert_eq!((width, height), (60, 20));
        assert_eq!(pixels[3 * (10 * 60 + 10)..][..3], [255, 0, 0]);
        let two = crate::picture::image_row_png(
            &[&[0], &[0]],
            murmuration_proto::PictureShape::new(1, 1).unwrap(),
            1,
        );
        let address = format!(
            "data:image/png;base64,{}",
            base64::Engine::encode(&base64::engine::general_purpose::STANDARD, two.unwrap())
        );
        let (_, _, pixels) = drawn(
            html! { image href=(address) x="0" y="0" width="60" height="20" style="image-rendering: pixelated" {} },
            1.0,
        );
        let row: Vec<u8> = (0..60).map(|x| pixels[3 * (10 * 60 + x)]).collect();
        assert!(row.iter().all(|value| [0, 255].contains(value)), "{row:?}");
        assert!(row[5] == 0 && row[30] == 255 && row[55] == 0, "{row:?}");
    }

    #[test]
    fn what_is_no_drawing_is_refused() {
        assert!(matches!(png("<p>", 1.0), Err(PictureError::Svg(_))));
        assert!(matches!(
            png(
                "<svg xmlns='http://www.w3.org/2000/svg' width='1e5' height='1e5'/>",
                100.0
            ),
            Err(PictureError::Svg(_))
        ));
    }
}

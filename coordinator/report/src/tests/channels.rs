//! The report of a campaign whose pictures have a channel for each species.

use super::*;

/// A sample campaign with two species, each with its own channel.
const CHANNELS: Sample = Sample {
    spec: "name = \"sample\"\nmethod = \"latent\"\n[[species]]\nname = \"a\"\ncount = 2\nrobot.sensors = [{}]\n\
           [[species]]\nname = \"b\"\ncount = 4\nrobot.sensors = [{}]\n[image]\nchannels = \"species\"\n\
           [taxonomy]\nmedoids = 3\n[world]\nhorizon = 200",
    ..SMALL
};

#[test]
fn images_with_channels_are_in_the_colours_of_the_species() {
    let report = sample::report(&CHANNELS);
    let (_place, files) = written(&report);
    let image = fs::read(files.page.with_file_name("medoids/01-image.png")).unwrap();
    let (width, height, pixels) = decode_png(&image);
    assert_eq!((width, height, pixels.len()), (400, 400, 400 * 400 * 3));
    let lit = |channel: usize| {
        let [red, green, _] = murmuration_model::colours::AGENTS[channel];
        let (pixels, _) = pixels.as_chunks::<3>();
        pixels
            .iter()
            .any(|pixel| (pixel[0] > pixel[1]) == (red > green) && pixel[0] != pixel[1])
    };
    assert!(lit(0) && lit(1));
    let page = page(&report);
    for expected in [
        "computes from a coloured image, and by the five hand-crafted features",
        "<figure title=\"coloured image\">",
        "50 × 50 grey values of each species, shown in its colour",
    ] {
        assert!(page.contains(expected), "{expected}");
    }
    assert!(!page.contains("\"grey image\""));
}

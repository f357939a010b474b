//! The colours of agents, of clusters and of classes.

use murmuration_proto::Class;

/// Red, green and blue in sRGB.
pub type Rgb = [u8; 3];

/// The background of pictures that have one.
pub const PAPER: Rgb = [0xfb, 0xfa, 0xf7];

/// Thin lines such as walls, on any background.
pub const LINE: Rgb = [0x9c, 0x9a, 0x94];

/// Colours of agents: agent `i` has colour `i` modulo their number.
///
/// Twenty-four even steps of hue in OKLCH at chroma 0.155 (less where sRGB ends), so that none is louder than another.
/// Every seventh is taken, so that even a few agents are spread over the whole circle; lightness goes through 0.56, 0.65
/// and 0.74, so that hues that look alike to a colour-blind person differ in lightness.
#[rustfmt::skip]
pub const AGENTS: [Rgb; 24] = [
    [0xbe, 0x46, 0x4d], [0x7a, 0x9e, 0x1a], [0x03, 0x7f, 0xa9], [0xc7, 0x66, 0xb4], [0xb9, 0x84, 0x08], [0x0d, 0xc5, 0xb5],
    [0x8f, 0x7b, 0xe6], [0xdd, 0x66, 0x49], [0x72, 0xc2, 0x60], [0x1d, 0x96, 0xe6], [0xf2, 0x7e, 0xb8], [0xc9, 0xa8, 0x06],
    [0x0b, 0xa3, 0xa9], [0xc2, 0x8f, 0xf9], [0xf7, 0x8a, 0x47], [0x06, 0x8b, 0x4f], [0x78, 0xab, 0xfe], [0xbb, 0x44, 0x68],
    [0x79, 0x7a, 0x04], [0x0f, 0xbf, 0xdd], [0x9b, 0x51, 0xac], [0xa5, 0x62, 0x02], [0x0b, 0xa7, 0x83], [0x5c, 0x68, 0xce],
];

/// Muted colours of clusters, made in the same way at chroma 0.085 and lightness 0.62, 0.68 and 0.74.
#[rustfmt::skip]
pub const CLUSTERS: [Rgb; 24] = [
    [0xb4, 0x71, 0x71], [0x8c, 0xa2, 0x67], [0x4a, 0x90, 0xb0], [0xb9, 0x84, 0xad], [0xb4, 0x93, 0x5a], [0x67, 0xbd, 0xb2],
    [0x97, 0x90, 0xca], [0xc7, 0x85, 0x75], [0x8e, 0xb8, 0x85], [0x6a, 0x9e, 0xca], [0xd4, 0x95, 0xb2], [0xbb, 0xab, 0x6b],
    [0x4f, 0xa8, 0xad], [0xb7, 0x9d, 0xd6], [0xd7, 0x9b, 0x7a], [0x5a, 0x95, 0x70], [0x8c, 0xac, 0xe1], [0xb2, 0x70, 0x7f],
    [0x89, 0x8b, 0x4c], [0x66, 0xb9, 0xcc], [0x9d, 0x75, 0xa6], [0xaa, 0x7b, 0x4d], [0x5e, 0xa9, 0x90], [0x77, 0x82, 0xba],
];

/// The colour of the cluster at `place`.
pub const fn cluster(place: usize) -> Rgb {
    CLUSTERS[place % CLUSTERS.len()]
}

/// The colour that the class at `place` has until it is given another.
pub const fn class(place: usize) -> Rgb {
    AGENTS[place % AGENTS.len()]
}

/// The colour of a class that the judge names, the same in every report and on every page; a behaviour without one is grey.
pub const fn class_colour(class: Class) -> Rgb {
    match class {
        Class::CyclicPursuit => AGENTS[9],
        Class::Milling => AGENTS[13],
        Class::Aggregation => AGENTS[7],
        Class::Dispersal => AGENTS[8],
        Class::WallFollowing => AGENTS[11],
        Class::NestedCycle => AGENTS[5],
        Class::ConcavePath => AGENTS[10],
        Class::Random => LINE,
    }
}

/// `#rrggbb`.
pub fn hex([red, green, blue]: Rgb) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// `colour` laid over `under` with an opacity of `part` / 255.
pub fn over(colour: Rgb, part: u8, under: Rgb) -> Rgb {
    let mix = |top: u8, bottom: u8| {
        let sum = u32::from(top) * u32::from(part) + u32::from(bottom) * (255 - u32::from(part));
        ((sum + 127) / 255) as u8
    };
    std::array::from_fn(|i| mix(colour[i], under[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_agents_share_a_colour_until_all_are_used() {
        let distance =
            |a: Rgb, b: Rgb| -> i32 { (0..3).map(|i| (i32::from(a[i]) - i32::from(b[i])).pow(2)).sum() };
        for (i, &a) in AGENTS.iter().enumerate() {
            for &b in &AGENTS[..i] {
                assert!(distance(a, b) > 300, "{} and {} are alike", hex(a), hex(b));
            }
        }
    }

    #[test]
    fn mixing_ends_at_both_colours() {
        assert_eq!(over(AGENTS[0], 255, PAPER), AGENTS[0]);
        assert_eq!(over(AGENTS[0], 0, PAPER), PAPER);
        assert_eq!(over([100, 0, 0], 128, [0, 0, 100]), [50, 0, 50]);
    }
}

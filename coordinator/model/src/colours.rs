//! The colours of agents, of clusters and of classes.

use murmuration_swarm::Class;

/// Red, green and blue in sRGB.
pub type Rgb = [u8; 3];

/// The background colour of pictures with a background.
pub const PAPER: Rgb = [0xfb, 0xfa, 0xf7];

/// The colour of thin lines such as walls, on any background.
pub const LINE: Rgb = [0x9c, 0x9a, 0x94];

/// Colours of agents: agent `i` has colour `i` modulo the number of colours.
///
/// The colours are twenty-four even steps of hue in OKLCH at chroma 0.155 (less at the edge of sRGB), so that all are equally
/// vivid. The order takes every seventh step, so that the colours of a few agents spread over the whole circle of hues. Lightness
/// cycles through 0.56, 0.65 and 0.74, so that hues that look alike to a colour-blind person differ in lightness.
#[rustfmt::skip]
pub const AGENTS: [Rgb; 24] = [
    [0xbe, 0x46, 0x4d], [0x7a, 0x9e, 0x1a], [0x03, 0x7f, 0xa9], [0xc7, 0x66, 0xb4], [0xb9, 0x84, 0x08], [0x0d, 0xc5, 0xb5],
    [0x8f, 0x7b, 0xe6], [0xdd, 0x66, 0x49], [0x72, 0xc2, 0x60], [0x1d, 0x96, 0xe6], [0xf2, 0x7e, 0xb8], [0xc9, 0xa8, 0x06],
    [0x0b, 0xa3, 0xa9], [0xc2, 0x8f, 0xf9], [0xf7, 0x8a, 0x47], [0x06, 0x8b, 0x4f], [0x78, 0xab, 0xfe], [0xbb, 0x44, 0x68],
    [0x79, 0x7a, 0x04], [0x0f, 0xbf, 0xdd], [0x9b, 0x51, 0xac], [0xa5, 0x62, 0x02], [0x0b, 0xa7, 0x83], [0x5c, 0x68, 0xce],
];

/// Colours of clusters, less vivid than the colours of agents (chroma 0.07 to 0.135, lightness 0.60 to 0.82 in OKLCH). Dark
/// numbers are legible on these colours, and points of these colours are visible on white and on black.
///
/// Each colour is as far as possible in OKLab from all earlier colours, as seen with full colour vision or, at half the distance,
/// without red or green vision (Machado et al. 2009). So the first twelve colours, enough for most taxonomies, differ most.
#[rustfmt::skip]
pub const CLUSTERS: [Rgb; 24] = [
    [0xdf, 0x89, 0xcc], [0x25, 0x97, 0x5b], [0xd9, 0xc6, 0x54], [0x61, 0x7a, 0xd0], [0x8e, 0xcb, 0xff], [0xc0, 0x6f, 0x1d],
    [0x50, 0xd2, 0xa2], [0xb7, 0x5c, 0x92], [0xf9, 0x91, 0x6d], [0x61, 0xa6, 0xa9], [0xa4, 0xa5, 0x30], [0x95, 0x9a, 0xf7],
    [0xc0, 0x87, 0x86], [0xe8, 0xb2, 0xca], [0x16, 0x8d, 0xb1], [0x3e, 0xba, 0xe4], [0x48, 0xdc, 0xe3], [0xde, 0xb5, 0x8e],
    [0xb2, 0x7f, 0xd6], [0x84, 0xb3, 0x85], [0x78, 0x8a, 0x38], [0xcb, 0xa0, 0xfc], [0xd1, 0x66, 0x71], [0xb8, 0x8a, 0x01],
];

pub const fn cluster(place: usize) -> Rgb {
    CLUSTERS[place % CLUSTERS.len()]
}

/// The default colour of the class at `place`.
pub const fn class(place: usize) -> Rgb {
    AGENTS[place % AGENTS.len()]
}

/// The colour of a class that the judge names, the same in every report and on every page. The class `random` is grey.
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

/// The colour as text, `#rrggbb`.
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

    /// Matrices that turn linear red, green and blue into the colours seen without red cones and without green cones (Machado et
    /// al. 2009, severity 1).
    const DEFICIENCIES: [[[f64; 3]; 3]; 2] = [
        [
            [0.152_286, 1.052_583, -0.204_868],
            [0.114_503, 0.786_281, 0.099_216],
            [-0.003_882, -0.048_116, 1.051_998],
        ],
        [
            [0.367_322, 0.860_646, -0.227_968],
            [0.280_085, 0.672_501, 0.047_413],
            [-0.011_820, 0.042_940, 0.968_881],
        ],
    ];

    fn times(rows: [[f64; 3]; 3], column: [f64; 3]) -> [f64; 3] {
        rows.map(|row| row.into_iter().zip(column).map(|(a, b)| a * b).sum())
    }

    fn linear(colour: Rgb) -> [f64; 3] {
        colour.map(|part| {
            let part = f64::from(part) / 255.0;
            if part <= 0.04045 {
                part / 12.92
            } else {
                ((part + 0.055) / 1.055).powf(2.4)
            }
        })
    }

    /// The OKLab coordinates (Ottosson 2020) of linear red, green and blue: lightness, green to red, and blue to yellow.
    fn oklab(colour: [f64; 3]) -> [f64; 3] {
        let cones = [
            [0.412_221, 0.536_333, 0.051_446],
            [0.211_903, 0.680_700, 0.107_397],
            [0.088_302, 0.281_719, 0.629_979],
        ];
        let axes = [
            [0.210_454, 0.793_618, -0.004_072],
            [1.977_998, -2.428_592, 0.450_594],
            [0.025_904, 0.782_772, -0.808_676],
        ];
        times(axes, times(cones, colour).map(f64::cbrt))
    }

    fn apart(a: [f64; 3], b: [f64; 3]) -> f64 {
        let squares = oklab(a).into_iter().zip(oklab(b)).map(|(a, b)| (a - b).powi(2));
        squares.sum::<f64>().sqrt()
    }

    #[test]
    fn the_clusters_of_most_taxonomies_are_told_apart() {
        for (i, &a) in CLUSTERS.iter().enumerate() {
            for &b in &CLUSTERS[..i] {
                let seen = apart(linear(a), linear(b));
                let [full, deficient] = if i < 12 { [0.12, 0.06] } else { [0.07, 0.035] };
                assert!(seen > full, "{} and {} are {seen:.3} apart", hex(a), hex(b));
                for rows in DEFICIENCIES {
                    // Values that a screen cannot show are clamped.
                    let [a, b] =
                        [a, b].map(|colour| times(rows, linear(colour)).map(|part| part.clamp(0.0, 1.0)));
                    assert!(
                        apart(a, b) > deficient,
                        "{a:?} and {b:?} are {:.3} apart",
                        apart(a, b)
                    );
                }
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

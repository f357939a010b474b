//! Numbers along an axis of a plot.

/// Parts of its axis that a tick must be away from zero; what is nearer is zero, and a rounding error.
const NEAR: f64 = 1e-9;

/// The number at a tick of an axis that is `span` long: with as many decimals as tell neighbours apart, none that say
/// nothing, and powers of ten where there would be too many digits.
pub fn axis_number(value: f64, span: f64) -> String {
    if value.abs() <= span * NEAR {
        return "0".to_owned();
    }
    if !(1e-3..1e6).contains(&span) {
        let text = format!("{value:.3e}");
        return match text.split_once('e') {
            Some((digits, power)) => format!("{}e{power}", without_noughts(digits)),
            None => text,
        };
    }
    // Four, and more where the axis is shorter than a tenth.
    let decimals = (3.0 - span.log10().floor()).clamp(4.0, 6.0) as usize;
    without_noughts(&format!("{value:.decimals$}")).to_owned()
}

/// Without the decimals that say nothing.
fn without_noughts(digits: &str) -> &str {
    if digits.contains('.') {
        digits.trim_end_matches('0').trim_end_matches('.')
    } else {
        digits
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_neighbours_differ() {
        for (value, span, expected) in [
            (0.0, 1.0, "0"),
            (-2e-16, 1.0, "0"),
            (2e-16, 1e-15, "2e-16"),
            (-0.25, 2.0, "-0.25"),
            (0.1 + 0.2, 1.0, "0.3"),
            (0.005, 0.01, "0.005"),
            (0.000_25, 0.002, "0.00025"),
            (0.002_5, 0.02, "0.0025"),
            (2.5e-5, 1e-4, "2.5e-5"),
            (1200.0, 5000.0, "1200"),
            (2.5e300, 1e301, "2.5e300"),
            (10.0, 100.0, "10"),
        ] {
            assert_eq!(axis_number(value, span), expected);
        }
    }
}

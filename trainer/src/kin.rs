//! Pairs of controllers that show the same behaviour, known without a label.
//!
//! A robot whose wheels all turn faster by the same factor drives the same paths in less time. Its swarm does what
//! the first one's does, only faster; so a picture of it, from another start, is another view of the behaviour.

use murmuration_proto::{Controller, Invalid, Stream};

/// Least and greatest factor between the wheel speeds of kin.
const FACTORS: [f64; 2] = [0.7, 1.4];

/// A controller whose wheel speeds are all those of `controller` times one random factor, 0.7 to 1.4 and such that
/// none exceeds 1; the second sensor's angle stays.
///
/// # Errors
/// Never for a controller that this crate can be given; the check belongs to [`Controller::new`].
pub fn kin(controller: &Controller, stream: &mut Stream) -> Result<Controller, Invalid> {
    let fastest = controller
        .speeds()
        .iter()
        .fold(0.0, |fastest: f64, speed| fastest.max(speed.abs()));
    let most = if fastest * FACTORS[1] > 1.0 {
        1.0 / fastest
    } else {
        FACTORS[1]
    };
    let factor = stream.between(FACTORS[0], most);
    let mut genes = controller.genes().to_vec();
    for speed in &mut genes[..controller.speeds().len()] {
        *speed = (*speed * factor).clamp(-1.0, 1.0);
    }
    Controller::new(controller.model(), &genes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_proto::{CapabilityModel, Purpose};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn kin_drive_the_same_paths(speeds in prop::collection::vec(-1.0..=1.0f64, 8), angle in -3.0..3.0f64, seed: u64) {
            let genes: Vec<f64> = speeds.into_iter().chain([angle]).collect();
            let controller = Controller::new(CapabilityModel::TwoSensor, &genes).unwrap();
            let kin = kin(&controller, &mut Stream::derive(seed, Purpose::Propose, 0)).unwrap();
            prop_assert_eq!(kin.angle(), Some(angle));
            let factor = kin.genes()[0] / controller.genes()[0];
            prop_assert!((0.7 - 1e-12..1.4 + 1e-12).contains(&factor));
            for (kin, speed) in kin.speeds().iter().zip(controller.speeds()) {
                prop_assert!((kin - speed * factor).abs() < 1e-12);
            }
        }
    }
}

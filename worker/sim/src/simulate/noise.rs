//! Noise: drives that slip, sensors that misread, readings that arrive late.
//!
//! Each robot draws from its own streams, in the order of its steps. So the noise of a robot does not depend on other robots or
//! on how the steps are computed.

use super::{
    Start,
    drive::{Drivetrain, Gait},
};
use murmuration_swarm::{self as proto, Purpose, RandomStream, World};
use rand::RngExt as _;
use std::{collections::VecDeque, f64::consts::TAU};

/// Noise of the robots of a swarm.
#[derive(Debug, Clone)]
pub(super) struct Noise {
    asked: proto::Noise,
    robots: Vec<Own>,
}

/// Noise of one robot.
#[derive(Debug, Clone)]
struct Own {
    gains: [f64; 2],
    /// Random stream of the robot's slip, if its drive slips.
    slip: Option<RandomStream>,
    /// Random stream of the robot's misreadings, if its sensors misread.
    misreading: Option<RandomStream>,
    /// The delayed readings that the robot has not acted on yet, oldest first.
    late: VecDeque<u8>,
}

impl Noise {
    /// The noise of a world; `None` if noise is off.
    pub(super) fn new(world: &World, start: &Start) -> Option<Self> {
        let asked = world.noise();
        let robots = (0..u64::from(world.agents())).map(|robot| Own::new(asked, start.seed(), robot));
        (!asked.is_off()).then(|| Self {
            asked,
            robots: robots.collect(),
        })
    }

    /// The delayed reading that robot `i` acts on when it has just sensed `sensed`.
    pub(super) fn delayed(&mut self, i: usize, sensed: u8) -> u8 {
        let late = &mut self.robots[i].late;
        late.push_back(sensed);
        late.pop_front().unwrap_or(sensed)
    }

    /// The noisy gait of robot `i` for `pair`; `None` if noise does not change gaits.
    pub(super) fn gait(&mut self, i: usize, drive: Drivetrain, pair: [f64; 2]) -> Option<Gait> {
        if !self.asked.moves() {
            return None;
        }
        let robot = &mut self.robots[i];
        let mut factors = robot.gains;
        if let Some(stream) = &mut robot.slip {
            let slips = factors_about_one(stream, self.asked.slip());
            factors = [factors[0] * slips[0], factors[1] * slips[1]];
        }
        Some(drive.gait([pair[0] * factors[0], pair[1] * factors[1]]))
    }

    /// Noisy reading of robot `i` with this number of `sensors`, in the sensor state `sensed`.
    ///
    /// Draws one number per sensor, whether the sensor is on or off, so that the stream does not depend on what the robot sees.
    pub(super) fn read(&mut self, i: usize, sensors: usize, sensed: u8) -> u8 {
        let Some(stream) = &mut self.robots[i].misreading else {
            return sensed;
        };
        let mut read = sensed;
        for sensor in (0..sensors).rev() {
            let bit = 1 << sensor;
            let wrong = match sensed & bit {
                0 => self.asked.false_detection(),
                _ => self.asked.missed(),
            };
            if stream.chance(wrong) {
                read ^= bit;
            }
        }
        read
    }
}

impl Own {
    fn new(asked: proto::Noise, seed: u64, robot: u64) -> Self {
        let stream = |purpose| RandomStream::derive(seed, purpose, robot);
        Self {
            gains: match asked.gain() > 0.0 {
                true => factors_about_one(&mut stream(Purpose::Gain), asked.gain()),
                false => [1.0; 2],
            },
            slip: (asked.slip() > 0.0).then(|| stream(Purpose::Slip)),
            misreading: asked.misreads().then(|| stream(Purpose::Misreading)),
            // Zeros, because the robot senses nothing before the first step.
            late: vec![0; asked.delay() as usize].into(),
        }
    }
}

/// Two random factors, each 1 plus a normal number with this standard deviation.
fn factors_about_one(stream: &mut RandomStream, deviation: f64) -> [f64; 2] {
    normals(stream).map(|normal| 1.0 + deviation * normal)
}

/// Two independent normal numbers with mean 0 and standard deviation 1, by Box and Muller's method. The pair is redrawn if a
/// number exceeds [`proto::Noise::MAX_DEVIATIONS`], which happens one time in 8,000.
fn normals(stream: &mut RandomStream) -> [f64; 2] {
    loop {
        // The random number is less than 1, so the logarithm is finite.
        let radius = (-2.0 * libm::log(1.0 - stream.random::<f64>())).sqrt();
        let angle = TAU * stream.random::<f64>();
        let pair = [radius * libm::cos(angle), radius * libm::sin(angle)];
        if pair
            .iter()
            .all(|normal| normal.abs() <= proto::Noise::MAX_DEVIATIONS)
        {
            return pair;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_numbers_are_normal_and_the_same_for_ever() {
        let mut stream = RandomStream::derive(1, Purpose::Slip, 0);
        let first = normals(&mut stream).map(f64::to_bits);
        assert_eq!(first, FIRST_NORMALS, "{first:?}");
        let numbers: Vec<f64> = (0..100_000).flat_map(|_| normals(&mut stream)).collect();
        let share = |from: f64, to: f64| {
            let within = |&&number: &&f64| from <= number && number < to;
            numbers.iter().filter(within).count() as f64 / numbers.len() as f64
        };
        // The shares of the normal distribution, within four standard errors.
        for (from, to, expected) in [
            (-9.0, 0.0, 0.5),
            (-1.0, 1.0, 0.682_69),
            (2.0, 9.0, 0.022_75),
            (3.0, 9.0, 0.001_35),
        ] {
            let error = 4.0 * f64::sqrt(expected * (1.0 - expected) / numbers.len() as f64);
            assert!(
                (share(from, to) - expected).abs() < error,
                "{from} to {to}: {}",
                share(from, to)
            );
        }
        assert!(numbers.iter().all(|number| number.abs() <= 4.0));
        let products = numbers.chunks(2).map(|pair| pair[0] * pair[1]);
        assert!(
            (products.sum::<f64>() / 100_000.0).abs() < 0.013,
            "a pair is independent"
        );
    }

    /// If these bits change, every evaluation with noise changes.
    const FIRST_NORMALS: [u64; 2] = [4604181779928804211, 4601090845706885158];
}

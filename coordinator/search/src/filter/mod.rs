//! The heuristic filter: which controllers are not worth a simulation (paper, appendix "Informed Heuristic
//! Filtering").
//!
//! Five metrics of a controller's wheel speeds say how slow, passive or neglectful its robots are. A metric
//! under its threshold counts as a penalty of -5, the others count as their own value, and a controller
//! passes if the sum is at least 4.0. Of a two-sensor controller only the first four wheel speeds (nothing
//! seen, and only the second sensor sees) are looked at.
//!
//! # Ties
//!
//! A metric equal to its threshold is not under it, and a total equal to the cutoff passes; but on a grid of
//! tenths many metrics that are equal to a threshold on paper are not so in floating point: 0.3 - 0.1 is a
//! hair under 0.2. This module takes the grid speeds as the doubles they are and evaluates the formulas as
//! they are written, without a tolerance:
//!
//! * max magnitude: the largest absolute value;
//! * L2 norm: the square root of `a*a + b*b + c*c + d*d`, summed from the left;
//! * displacement: `|a + b| + |c + d|`;
//! * mirror distance: the square root of `(c + a)^2 + (d + b)^2`;
//! * neglect distance: the square root of `(c - a)^2 + (d - b)^2`;
//! * the total is summed in this order.
//!
//! Of the 21^4 = 194,481 single-sensor controllers of the paper's grid that discards 43,065. In exact
//! arithmetic it would be 42,057: rounding only ever puts a tie *under* its threshold, and for 1,008
//! controllers that decides (496 by displacement, 400 by mirror distance, 112 by neglect distance; the other
//! two metrics never round). The paper says 43,251, which neither gives. Plain doubles come nearer and need no
//! tolerance to be agreed on. It matters little: of the 967 labelled behaviours that were drawn through a filter
//! with exact ties, three are discarded here.

use murmuration_proto::Controller;

/// One metric of the filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Metric {
    /// Its name, as people see it.
    pub name: &'static str,
    /// The psi of the paper: a value under it costs [`PENALTY`].
    pub threshold: f64,
    /// What a value under the threshold says about the robots.
    pub meaning: &'static str,
}

/// The five metrics, in the order of the paper's equations (and of psi 1 to 5).
pub const METRICS: [Metric; 5] = [
    Metric {
        name: "max magnitude",
        threshold: 0.4,
        meaning: "slow: no wheel ever turns fast",
    },
    Metric {
        name: "L2 norm",
        threshold: 0.65,
        meaning: "slow: the wheels together turn slowly",
    },
    Metric {
        name: "displacement",
        threshold: 0.5,
        meaning: "passive: the robot spins in place",
    },
    Metric {
        name: "mirror distance",
        threshold: 0.2,
        meaning: "passive: sensing another robot undoes the motion made before",
    },
    Metric {
        name: "neglect distance",
        threshold: 0.3,
        meaning: "neglectful: sensing another robot hardly changes anything",
    },
];

/// What a metric under its threshold contributes to the total instead of its value.
pub const PENALTY: f64 = -5.0;

/// The least total that passes.
pub const CUTOFF: f64 = 4.0;

/// What the filter makes of one controller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Score {
    metrics: [f64; 5],
    total: f64,
}

impl Score {
    /// Scores a controller of either model.
    #[must_use]
    pub fn of(controller: &Controller) -> Self {
        let metrics = match *controller.speeds() {
            [a, b, c, d, ..] => measure(a, b, c, d),
            // A controller has four or eight wheel speeds; one that had fewer would stand still.
            _ => [0.0; 5],
        };
        let total = contributions(&metrics)
            .into_iter()
            .fold(0.0, |sum, part| sum + part);
        Self { metrics, total }
    }

    /// The values of the [`METRICS`], each at least 0.
    #[must_use]
    pub const fn metrics(&self) -> &[f64; 5] {
        &self.metrics
    }

    /// What each of the [`METRICS`] adds to the total: its value, or [`PENALTY`].
    #[must_use]
    pub fn contributions(&self) -> [f64; 5] {
        contributions(&self.metrics)
    }

    /// The sum of the contributions.
    #[must_use]
    pub const fn total(&self) -> f64 {
        self.total
    }

    /// Whether the controller is worth a simulation: whether the total is at least [`CUTOFF`].
    #[must_use]
    pub fn passes(&self) -> bool {
        self.total >= CUTOFF
    }
}

fn measure(a: f64, b: f64, c: f64, d: f64) -> [f64; 5] {
    let length = |x: f64, y: f64| (x * x + y * y).sqrt();
    [
        a.abs().max(b.abs()).max(c.abs()).max(d.abs()),
        (a * a + b * b + c * c + d * d).sqrt(),
        (a + b).abs() + (c + d).abs(),
        length(c + a, d + b),
        length(c - a, d - b),
    ]
}

fn contributions(metrics: &[f64; 5]) -> [f64; 5] {
    std::array::from_fn(|i| {
        if metrics[i] < METRICS[i].threshold {
            PENALTY
        } else {
            metrics[i]
        }
    })
}

#[cfg(test)]
mod tests;

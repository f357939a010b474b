//! Mean and spread of the figures of several trials.

/// Mean and spread of at least one figure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Summary {
    /// The mean, in the unit of the figures.
    pub mean: f64,
    /// The sample standard deviation (over n - 1), in the same unit; `None` for a single figure.
    pub deviation: Option<f64>,
}

impl Summary {
    /// Summarises finite figures; `None` if there are none.
    #[must_use]
    pub fn of(figures: &[f64]) -> Option<Self> {
        let count = figures.len() as f64;
        let mean = (!figures.is_empty()).then(|| figures.iter().sum::<f64>() / count)?;
        let squares: f64 = figures
            .iter()
            .map(|figure| (figure - mean) * (figure - mean))
            .sum();
        Some(Self {
            mean,
            deviation: (figures.len() > 1).then(|| (squares / (count - 1.0)).sqrt()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_summary_by_hand() {
        let summary = |mean, deviation| Some(Summary { mean, deviation });
        assert_eq!(
            Summary::of(&[2.0, 4.0, 4.0, 6.0, 9.0]),
            summary(5.0, Some(7.0_f64.sqrt()))
        );
        assert_eq!(Summary::of(&[3.0]), summary(3.0, None));
        assert_eq!(Summary::of(&[]), None);
    }
}

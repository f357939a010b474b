//! The k smallest of many distances.

/// Keeps the `k` smallest squared distances that it is offered.
///
/// It gathers up to twice as many before it drops the larger half, so that an offer takes constant time on
/// average, however large `k` is.
pub(super) struct Nearest {
    k: usize,
    /// Nothing at or above this can be among the `k` smallest any more.
    limit: f64,
    squared: Vec<f64>,
}

impl Nearest {
    pub(super) const fn new(k: usize) -> Self {
        Self {
            k,
            limit: f64::INFINITY,
            squared: Vec::new(),
        }
    }

    /// Takes a finite squared distance into account.
    #[inline]
    pub(super) fn offer(&mut self, squared: f64) {
        if squared < self.limit {
            self.keep(squared);
        }
    }

    fn keep(&mut self, squared: f64) {
        self.squared.push(squared);
        if self.k > 0 && self.squared.len() >= self.k.saturating_mul(2) {
            let (_, &mut largest, _) = self.squared.select_nth_unstable_by(self.k - 1, f64::total_cmp);
            self.limit = largest;
            self.squared.truncate(self.k);
        }
    }

    /// The mean of the `k` smallest distances offered (of all, if they are fewer; 0 if there is none), summed
    /// in ascending order. It is as new afterwards.
    pub(super) fn take_mean(&mut self) -> f64 {
        self.squared.sort_unstable_by(f64::total_cmp);
        self.squared.truncate(self.k);
        let sum = self.squared.iter().fold(0.0, |sum, squared| sum + squared.sqrt());
        let count = self.squared.len().max(1);
        self.squared.clear();
        self.limit = f64::INFINITY;
        sum / count as f64
    }
}

//! The k smallest of many squared distances.

use super::walk::Collect;

/// Numbers of a step of [`Smallest::insert`].
const STEP: usize = 8;

/// Keeps the `k` smallest of the squared distances that it is offered.
///
/// They are in ascending order. Putting one in its place shifts eight at a time with vector instructions: for the usual `k` of
/// some 16 this takes a fourth of a heap's instructions.
pub(super) struct Smallest {
    k: usize,
    /// Negative infinity, then at least `k` numbers, in steps; infinity where none was offered.
    sorted: Vec<f64>,
    limit: f64,
}

impl Smallest {
    pub(super) fn new(k: usize) -> Self {
        let mut sorted = vec![f64::INFINITY; 1 + k.next_multiple_of(STEP)];
        sorted[0] = f64::NEG_INFINITY;
        Self {
            k,
            limit: sorted[k].max(0.0),
            sorted,
        }
    }

    /// Takes the mean of the kept distances except the `passed` smallest, summed in ascending order; 0 if there are none. Resets.
    pub(super) fn take_mean(&mut self, passed: usize) -> f64 {
        let kept = &mut self.sorted[1..];
        let counted = kept[..self.k].iter().skip(passed);
        let (mut sum, mut count) = (0.0, 0_usize);
        for squared in counted.take_while(|squared| squared.is_finite()) {
            sum += squared.sqrt();
            count += 1;
        }
        kept.fill(f64::INFINITY);
        self.limit = self.sorted[self.k].max(0.0);
        sum / count.max(1) as f64
    }

    /// Puts a number in its place, and leaves out the largest.
    #[inline(always)]
    fn insert(&mut self, new: f64) {
        let mut end = self.sorted.len();
        while end > STEP {
            let step = &mut self.sorted[end - STEP - 1..end];
            let before: [f64; STEP] = std::array::from_fn(|place| step[place]);
            let own: [f64; STEP] = std::array::from_fn(|place| step[place + 1]);
            // The greater of the number before and the new one, unless the number here is smaller.
            let moved = before.map(|before| if before > new { before } else { new });
            for place in 0..STEP {
                step[place + 1] = if own[place] < moved[place] {
                    own[place]
                } else {
                    moved[place]
                };
            }
            if before[0] <= new {
                break;
            }
            end -= STEP;
        }
        self.limit = self.sorted[self.k];
    }
}

impl Collect for Smallest {
    #[inline(always)]
    fn limit(&self) -> f64 {
        self.limit
    }

    #[inline(always)]
    fn offer(&mut self, squared: f64, _: u32) {
        if squared < self.limit {
            self.insert(squared);
        }
    }
}

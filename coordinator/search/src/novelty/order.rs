//! The order of points in a new tree.

use super::Behaviours;
use crate::lanes::LANES;

/// Minimum number of points in the left half for ordering both halves in parallel.
const PARALLEL: usize = 8192;

/// About how many points of a range say in which dimension it is widest.
const SAMPLE: usize = 32;

/// The indices of all behaviours in an order in which every eight, every 64 and so on lie together: halves, halved again in the
/// dimension in which each is widest.
pub(super) fn order(behaviours: &Behaviours) -> Vec<u32> {
    // The upper half of each word is for a sort key.
    let mut words: Vec<u64> = (0..behaviours.len() as u64).collect();
    halve(behaviours, &mut words);
    words.into_iter().map(|word| word as u32).collect()
}

fn halve(behaviours: &Behaviours, words: &mut [u64]) {
    let leaves = words.len().div_ceil(LANES);
    if leaves <= 1 {
        return;
    }
    // All blocks but the last are full, on every level.
    let middle = leaves.next_power_of_two() / 2 * LANES;
    if let Some((widest, least)) = widest(behaviours, words) {
        for word in &mut *words {
            let index = *word as u32;
            let value = behaviours.values_of(index as usize)[widest] - least;
            *word = u64::from(key(value)) << 32 | u64::from(index);
        }
        words.select_nth_unstable(middle);
    }
    let (left, right) = words.split_at_mut(middle);
    if left.len() < PARALLEL {
        halve(behaviours, left);
        halve(behaviours, right);
    } else {
        rayon::join(|| halve(behaviours, left), || halve(behaviours, right));
    }
}

/// The dimension in which a sample of the points is widest, and its least value there.
fn widest(behaviours: &Behaviours, words: &[u64]) -> Option<(usize, f64)> {
    let sample = || words.iter().step_by(words.len().div_ceil(SAMPLE));
    let mut widest = None;
    let mut width = f64::NEG_INFINITY;
    for d in 0..behaviours.dims() {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for &word in sample() {
            let value = behaviours.values_of(word as u32 as usize)[d];
            // Comparisons are cheaper than `f64::min` and `f64::max`.
            low = if value < low { value } else { low };
            high = if value > high { value } else { high };
        }
        if high - low > width {
            (widest, width) = (Some((d, low)), high - low);
        }
    }
    widest
}

/// An integer in the order of the values, rounded to single precision.
fn key(value: f64) -> u32 {
    let bits = (value as f32).to_bits();
    if bits >> 31 == 0 { bits | 1 << 31 } else { !bits }
}

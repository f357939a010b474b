//! Estimates the number of kinds from how often each kind was met: Chao1 and ACE.
//!
//! Chao1 and ACE assume independent draws from one distribution, and that kinds are recognised without error. The kinds that were
//! met once or twice then show how many kinds were not met. Chao1 is a lower bound on the number of kinds: kinds too rare to be
//! met add nothing.

use serde::{Deserialize, Serialize};

/// ACE treats a kind that was met at most this often as rare (Chao, Hwang, Chen and Kuo 2000).
const RARE: u64 = 10;
/// Two-sided 95 % point of the standard normal distribution.
const NORMAL_95: f64 = 1.959_963_984_540_054;

/// An estimate of the number of kinds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Richness {
    /// Kinds that were met.
    pub seen: u64,
    /// Number of kinds by Chao1, bias-corrected; at least [`Richness::seen`].
    pub chao1: f64,
    /// The standard error of Chao1, kinds.
    pub standard_error: f64,
    /// The 95 % confidence interval of Chao1, kinds.
    pub interval: [f64; 2],
    /// Number of kinds by ACE; `None` if every rare kind was met once, because ACE is then undefined.
    pub ace: Option<f64>,
}

impl Richness {
    /// Estimates the number of kinds from how often each kind was met. Kinds that were met 0 times are ignored. Returns `None` if
    /// no kind was met.
    ///
    /// Chao1 is S + f1 (f1 - 1) / (2 (f2 + 1)) for S kinds, f1 of them met once and f2 twice (Chao 1984; bias-corrected as in
    /// Chao 2005). Its variance and its interval, which is log-normal and never below S, are those of Chao 1987 and of Colwell's
    /// EstimateS 9, appendix B. ACE is the estimate of Chao and Lee 1992, with the rare kinds apart (Chao and others 2000).
    pub fn of(abundances: &[u64]) -> Option<Self> {
        let met: Vec<u64> = abundances.iter().copied().filter(|&count| count > 0).collect();
        if met.is_empty() {
            return None;
        }
        let times = |times: u64| met.iter().filter(|&&count| count == times).count() as f64;
        let (seen, once, twice) = (met.len() as f64, times(1), times(2));
        let chao1 = seen + once * (once - 1.0) / (2.0 * (twice + 1.0));
        let draws: u64 = met.iter().sum();
        let variance = variance(seen, once, twice, draws as f64, chao1).max(0.0);
        Some(Self {
            seen: met.len() as u64,
            chao1,
            standard_error: variance.sqrt(),
            interval: interval(seen, chao1, variance, draws as f64),
            ace: ace(&met),
        })
    }
}

/// The variance of the bias-corrected Chao1 (EstimateS 9, appendix B, equations 6 to 8).
fn variance(seen: f64, once: f64, twice: f64, draws: f64, chao1: f64) -> f64 {
    if once == 0.0 {
        let unmet = (-draws / seen).exp();
        return seen * unmet * (1.0 - unmet);
    }
    let pairs = once * (once - 1.0);
    if twice == 0.0 {
        return pairs / 2.0 + once * (2.0 * once - 1.0).powi(2) / 4.0 - once.powi(4) / (4.0 * chao1);
    }
    let more = twice + 1.0;
    pairs / (2.0 * more)
        + once * (2.0 * once - 1.0).powi(2) / (4.0 * more.powi(2))
        + once.powi(2) * twice * (once - 1.0).powi(2) / (4.0 * more.powi(4))
}

/// The 95 % interval of Chao1 (EstimateS 9, appendix B, equations 13 and 14).
fn interval(seen: f64, chao1: f64, variance: f64, draws: f64) -> [f64; 2] {
    let unmet = chao1 - seen;
    if unmet > 0.0 {
        let factor = (NORMAL_95 * (1.0 + variance / unmet.powi(2)).ln().sqrt()).exp();
        return [seen + unmet / factor, seen + unmet * factor];
    }
    let met = 1.0 - (-draws / seen).exp();
    let spread = NORMAL_95 * (seen * (1.0 - met) / met).sqrt();
    [(seen / met - spread).max(seen), seen / met + spread]
}

/// Number of kinds by ACE; `None` if all rare kinds were met once.
fn ace(met: &[u64]) -> Option<f64> {
    let (rare, abundant): (Vec<u64>, Vec<u64>) = met.iter().partition(|&&count| count <= RARE);
    let abundant = abundant.len() as f64;
    if rare.is_empty() {
        return Some(abundant);
    }
    let draws = rare.iter().sum::<u64>() as f64;
    let once = rare.iter().filter(|&&count| count == 1).count() as f64;
    let coverage = 1.0 - once / draws;
    if coverage <= 0.0 {
        return None;
    }
    let covered = rare.len() as f64 / coverage;
    let pairs: u64 = rare.iter().map(|count| count * (count - 1)).sum();
    // The squared coefficient of variation: how much the rare kinds differ in abundance.
    let variation = (covered * pairs as f64 / (draws * (draws - 1.0)) - 1.0).max(0.0);
    Some(abundant + covered + once / coverage * variation)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts of many rare kinds.
    const SKEWED: [u64; 39] = [
        752, 276, 194, 126, 121, 97, 95, 83, 72, 44, 39, 16, 15, 13, 9, 9, 9, 8, 7, 4, 3, 3, 2, 2, 2, 2, 2,
        2, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1,
    ];

    #[track_caller]
    fn check(abundances: &[u64], chao1: f64, interval: [f64; 2], ace: Option<f64>) {
        let of = Richness::of(abundances).unwrap();
        let near = |value: f64, expected: f64| (value - expected).abs() < 1e-4 * expected.abs();
        assert!(near(of.chao1, chao1), "{of:?}");
        assert!(
            near(of.interval[0], interval[0]) && near(of.interval[1], interval[1]),
            "{of:?}"
        );
        match (of.ace, ace) {
            (Some(value), Some(expected)) => assert!(near(value, expected), "{of:?}"),
            (value, expected) => assert_eq!(value, expected),
        }
    }

    #[test]
    fn estimates_are_those_of_scikit_bio() {
        // Values of chao1, chao1_ci and ace of scikit-bio 0.7.
        check(
            &[0, 1, 1, 0, 0, 2, 0, 0, 2, 1, 0, 0],
            6.0,
            [5.093_649, 15.678_164],
            Some(8.75),
        );
        check(&[1, 1, 1, 5, 9], 8.0, [5.369_122, 29.382_198], Some(9.909_439));
        check(&SKEWED, 46.857_143, [40.961_855, 70.467_511], Some(54.222_333));
        check(
            &[4, 4, 4, 11, 12, 40, 1, 1, 2],
            9.5,
            [9.030_262, 17.261_169],
            Some(10.053_061),
        );
        check(&[2, 2, 2, 2], 4.0, [4.0, 6.176_913], Some(4.0));
        check(&[20, 30], 2.0, [2.0, 2.000_010], Some(2.0));
    }

    #[test]
    fn by_hand() {
        // Of five kinds, three were met once and two twice: Chao1 is 5 + 3 * 2 / (2 * 3). For ACE, the coverage is 1 - 3 / 7,
        // without variation beyond chance.
        let of = Richness::of(&[1, 1, 2, 2, 1]).unwrap();
        assert_eq!((of.seen, of.chao1, of.ace), (5, 6.0, Some(8.75)));
        let variance = 1.0 + 3.0 * 25.0 / 36.0 + 9.0 * 2.0 * 4.0 / (4.0 * 81.0);
        assert!((of.standard_error - f64::sqrt(variance)).abs() < 1e-12);
    }

    #[test]
    fn of_kinds_met_once_each_ace_says_nothing() {
        assert_eq!(Richness::of(&[1, 1, 1]).unwrap().ace, None);
        assert_eq!(Richness::of(&[0, 0]), None);
        assert_eq!(Richness::of(&[]), None);
    }
}

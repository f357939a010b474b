//! Quantiles, shares and ratios.

/// The `part` quantile (0 to 1) of at least one value.
pub(super) fn quantile(values: impl Iterator<Item = f64>, part: f64) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    let place = (part * sorted.len().saturating_sub(1) as f64).round() as usize;
    sorted.get(place).copied().unwrap_or(0.0)
}

/// Share of true values; 0 if there are none.
pub(super) fn share(values: impl Iterator<Item = bool>) -> f64 {
    let (mut held, mut all) = (0.0, 0.0);
    for value in values {
        held += if value { 1.0 } else { 0.0 };
        all += 1.0;
    }
    ratio(held, all)
}

/// `part / whole`; 0 if `whole` is 0.
pub(super) fn ratio(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { part / whole } else { 0.0 }
}

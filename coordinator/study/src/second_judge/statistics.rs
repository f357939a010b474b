//! Statistics over the robots of a swarm.

/// The values sorted, with their signs flipped if their sum is negative.
pub(super) fn one_way(values: Vec<f64>) -> Vec<f64> {
    let sign = if values.iter().sum::<f64>() < 0.0 {
        -1.0
    } else {
        1.0
    };
    sorted(values.into_iter().map(|value| sign * value))
}

pub(super) fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

pub(super) fn quantiles(sorted: &[f64], parts: &[f64]) -> Vec<f64> {
    parts.iter().map(|&part| quantile(sorted, part)).collect()
}

/// A quantile of one or more sorted values; interpolated.
pub(super) fn quantile(sorted: &[f64], part: f64) -> f64 {
    let place = part * (sorted.len() - 1) as f64;
    let (low, high) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    low + (high - low) * place.fract()
}

pub(super) fn mean(values: &[f64]) -> f64 {
    mean_of(values.iter().copied())
}

pub(super) fn mean_of(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    ratio(values.sum(), count)
}

pub(super) fn deviation(values: &[f64]) -> f64 {
    let mean = mean(values);
    mean_of(values.iter().map(|value| (value - mean).powi(2))).sqrt()
}

/// Standard deviation over mean.
pub(super) fn spread(values: &[f64]) -> f64 {
    ratio(deviation(values), mean(values))
}

pub(super) fn share(held: impl Iterator<Item = bool>) -> f64 {
    let (held, all) = held.fold((0.0, 0.0), |(held, all), is| {
        (held + f64::from(u8::from(is)), all + 1.0)
    });
    ratio(held, all)
}

/// `part / whole`; 0 if `whole` is 0.
pub(super) fn ratio(part: f64, whole: f64) -> f64 {
    if whole == 0.0 { 0.0 } else { part / whole }
}

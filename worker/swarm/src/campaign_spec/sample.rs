//! Campaigns whose taxonomy covers a sample, so that the memory of a coordinator does not grow with the archive.

use crate::{BehaviourSpace, Invalid, Method, Search, grouped, invalid};
use std::ops::RangeInclusive;

/// Number of individuals that a sample can have.
const SIZES: RangeInclusive<u32> = 1000..=1_000_000;

/// Maximum number of evaluations of a campaign with or without a sample.
pub(super) const fn most_evaluations(sample: Option<u32>) -> u64 {
    match sample {
        Some(_) => Search::MAX_SAMPLED_EVALUATIONS,
        None => Search::MAX_EVALUATIONS,
    }
}

/// The sample of a campaign that searches as `search` says, from the field `taxonomy.sample`.
///
/// # Errors
/// The error names the field to change: a sample of the wrong size, a sample of a campaign whose first individuals do not stand
/// for the others, or more evaluations than a campaign can have.
pub(super) fn checked(
    sample: Option<u32>,
    method: Method,
    space: BehaviourSpace,
    search: &Search,
) -> Result<Option<u32>, Invalid> {
    let (evaluations, most) = (search.evaluations(), most_evaluations(sample));
    if evaluations > most {
        let mut allowed = format!("at most {} evaluations (population x generations)", grouped(most));
        if is_possible(method, space) && sample.is_none() {
            allowed += &format!(
                ", or {} with taxonomy.sample, for example sample = {} in [taxonomy]",
                grouped(Search::MAX_SAMPLED_EVALUATIONS),
                SIZES.end()
            );
        }
        return Err(Invalid::new("search.generations", search.generations(), allowed));
    }
    let Some(size) = sample else {
        return Ok(None);
    };
    if !is_possible(method, space) {
        let allowed = format!(
            "absent: only the methods \"random\" and \"exhaustive\" in the space \"{}\" can have a sample",
            BehaviourSpace::Features
        );
        return Err(Invalid::new("taxonomy.sample", size, allowed));
    }
    let size = invalid::whole("taxonomy.sample", size, SIZES)?;
    if u64::from(size) >= evaluations {
        let allowed = format!("below {}, the number of evaluations", grouped(evaluations));
        return Err(Invalid::new("taxonomy.sample", size, allowed));
    }
    Ok(Some(size))
}

/// Whether the first individuals can stand for all others: the search proposes controllers independently of its results, and the
/// campaign has no embedder.
fn is_possible(method: Method, space: BehaviourSpace) -> bool {
    matches!(method, Method::Random | Method::Exhaustive) && !space.embeds()
}

#[cfg(test)]
mod tests {
    use crate::CampaignSpec;

    fn spec(method: &str, rest: &str) -> Result<CampaignSpec, String> {
        let text = format!("model = \"two-sensor\"\nmethod = \"{method}\"\n{rest}");
        CampaignSpec::from_toml(&text).map_err(|error| error.to_string())
    }

    #[test]
    fn a_campaign_with_a_sample_can_be_ten_times_as_long() {
        let long = "[search]\npopulation = 10000\ngenerations = 10000\n[taxonomy]\nsample = 1000000";
        for method in ["random", "exhaustive"] {
            let spec = spec(method, long).unwrap();
            assert_eq!(spec.evaluations(), 100_000_000);
            assert_eq!(spec.sample(), Some(1_000_000));
            assert!(!spec.has_novelty());
            assert_eq!(CampaignSpec::from_toml(&spec.to_toml()).unwrap(), spec);
        }
        let refused = spec(
            "random",
            &long.replace("generations = 10000", "generations = 10001"),
        );
        let refused = refused.unwrap_err();
        assert!(
            refused.contains("search.generations = 10001: must be at most 100,000,000"),
            "{refused}"
        );
    }

    #[test]
    fn who_wants_more_evaluations_is_told_of_the_sample() {
        let search = "[search]\npopulation = 10000\ngenerations = 1001";
        let refused = spec("random", search).unwrap_err();
        assert!(refused.contains("sample = 1000000 in [taxonomy]"), "{refused}");
        let refused = spec("hand-crafted", search).unwrap_err();
        assert!(!refused.contains("sample"), "{refused}");
    }

    #[test]
    fn a_sample_that_would_not_stand_for_the_others_is_refused() {
        let with = |sample: u32| format!("[search]\ngenerations = 20\n[taxonomy]\nsample = {sample}");
        let refused = |method, rest: &str| spec(method, rest).unwrap_err();
        assert!(refused("hand-crafted", &with(1000)).contains("taxonomy.sample = 1000: must be absent"));
        let embeds = format!("space = \"embedding\"\n{}", with(1000));
        assert!(refused("random", &embeds).contains("taxonomy.sample = 1000: must be absent"));
        assert!(refused("random", &with(999)).contains("a whole number from 1000 to 1000000"));
        assert!(refused("random", &with(2000)).contains("below 2,000, the number of evaluations"));
        assert!(spec("random", &with(1999)).is_ok());
    }
}

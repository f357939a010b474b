//! Campaigns that evaluate every controller of a space: their number of generations, and the fields that they cannot have.

use crate::{ControllerSpace, Enumeration, Invalid, Method, Search, World, counted, grouped};
use murmuration_proto::v1;

/// Largest population that is chosen if the file gives no population.
const POPULATION: u64 = 1000;

/// Completes the search. If the file gives no number of generations, that number and an absent population follow from the number
/// of controllers, at most `most`.
///
/// # Errors
/// The error names the field to change: a population that does not divide the number of controllers, more evaluations than
/// controllers, or absent generations if there are too many controllers for a campaign.
pub(super) fn search(
    search: v1::Search,
    method: Method,
    controllers: &ControllerSpace,
    world: &World,
    most: u64,
) -> Result<v1::Search, Invalid> {
    if method != Method::Exhaustive {
        return Ok(search);
    }
    let all = Enumeration::of(controllers, world).map(|all| all.len());
    let Some(generations) = search.generations else {
        return match all {
            Some(all) if all <= most => whole(search, all),
            _ => Err(too_many(all, most)),
        };
    };
    let population = search.population.unwrap_or(Search::default().population());
    match all {
        Some(all) if u64::from(population) * u64::from(generations) > all => {
            let value = format!("{} x {population}", grouped(generations.into()));
            let allowed = format!(
                "at most {} evaluations: the space has no more controllers, mirror images counted once",
                grouped(all)
            );
            Err(Invalid::new("search.generations", value, allowed))
        }
        _ => Ok(search),
    }
}

/// The search over all controllers, whose number is `all`.
fn whole(search: v1::Search, all: u64) -> Result<v1::Search, Invalid> {
    let population = match search.population {
        None => (1..=POPULATION.min(all))
            .rev()
            .find(|&population| all.is_multiple_of(population))
            .unwrap_or(1),
        Some(population) if population > 0 && all.is_multiple_of(population.into()) => population.into(),
        Some(population) => {
            let near = (1..=u64::from(population).min(all))
                .rev()
                .find(|&near| all.is_multiple_of(near));
            let allowed = format!(
                "a number that divides {} evenly, such as {}",
                counted(all, "controller"),
                near.unwrap_or(1)
            );
            return Err(Invalid::new("search.population", population, allowed));
        }
    };
    let number = |count: u64| Some(u32::try_from(count).unwrap_or(u32::MAX));
    Ok(v1::Search {
        population: number(population),
        generations: number(all / population),
        ..search
    })
}

fn too_many(all: Option<u64>, most: u64) -> Invalid {
    let space = match all {
        Some(all) => format!("the space has {}", counted(all, "controller")),
        None => "the space has more controllers than can be counted".to_owned(),
    };
    let allowed = format!(
        "given: {space}, and the campaign can evaluate at most {}: it takes an evenly spread sample of search.population x \
         search.generations controllers",
        grouped(most)
    );
    Invalid::missing("search.generations", allowed)
}

/// Refuses fields that an exhaustive campaign does not use.
///
/// # Errors
/// The error names the field.
pub(super) fn check_unused(
    method: Method,
    filter: bool,
    controllers: &ControllerSpace,
) -> Result<(), Invalid> {
    if method != Method::Exhaustive {
        return Ok(());
    }
    if filter {
        let allowed = "false with the method \"exhaustive\": it evaluates every controller, and an atlas has their scores";
        return Err(Invalid::new("filter", "true", allowed));
    }
    if !controllers.initial().is_empty() {
        let value = counted(controllers.initial().len() as u64, "controller");
        let allowed = "absent with the method \"exhaustive\": the order of the controllers is given";
        return Err(Invalid::new("controllers.initial", value, allowed));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::{CampaignSpec, Search};

    fn spec(rest: &str) -> Result<CampaignSpec, String> {
        let text = format!("model = \"single-sensor\"\nmethod = \"exhaustive\"\n{rest}");
        CampaignSpec::from_toml(&text).map_err(|error| error.to_string())
    }

    fn generations(search: &Search) -> (u32, u32) {
        (search.population(), search.generations())
    }

    #[test]
    fn all_controllers_are_divided_evenly_into_generations() {
        let whole = spec("").unwrap();
        assert_eq!(generations(whole.search()), (833, 117));
        assert_eq!(whole.evaluations(), 97_461);
        assert!(whole.judges());
        assert_eq!(CampaignSpec::from_toml(&whole.to_toml()).unwrap(), whole);
        let coarse = spec("[controllers]\nstep = 0.5\n[search]\npopulation = 13").unwrap();
        assert_eq!(generations(coarse.search()), (13, 25));
        let sample = spec("[search]\ngenerations = 3").unwrap();
        assert_eq!(generations(sample.search()), (100, 3));
    }

    #[test]
    fn what_cannot_be_exhaustive_is_refused() {
        let check = |rest: &str, expected: &str| {
            let refused = spec(rest).unwrap_err();
            assert!(
                refused.contains(expected),
                "{refused:?} does not say {expected:?}"
            );
        };
        check(
            "[search]\npopulation = 1000",
            "search.population = 1000: must be a number that divides 97,461 controllers evenly, such as 833",
        );
        check(
            "[controllers]\nstep = 1\n[search]\npopulation = 10\ngenerations = 5\n[taxonomy]\nmedoids = 3",
            "search.generations = 5 x 10: must be at most 45 evaluations",
        );
        check(
            "[controllers]\nstep = 0",
            "search.generations is missing: must be given: the space has more controllers than can be counted, and the \
             campaign can evaluate at most 10,000,000: it takes",
        );
        check(
            "[controllers]\nstep = 0.025",
            "the space has 21,526,641 controllers",
        );
        check(
            "[controllers]\nstep = 0.05\n[evaluation]\nstarts = 16",
            "evaluate at most 625,000: ",
        );
        check(
            "[controllers]\ninitial = [[0, 0, 0, 0]]",
            "controllers.initial = 1 controller: must be absent",
        );
        let filtered =
            CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"exhaustive\"\nfilter = true");
        assert!(
            filtered
                .unwrap_err()
                .to_string()
                .starts_with("filter = true: must be false")
        );
        check("[feedback]\nrounds = 1", "feedback = given");
        check("[dataset]\ncontrollers = 10", "dataset = given");
    }

    #[test]
    fn other_methods_judge_where_the_file_says_so() {
        let text = "model = \"single-sensor\"\nmethod = \"random\"\n";
        let plain = CampaignSpec::from_toml(text).unwrap();
        assert!(!plain.judges() && !plain.to_toml().contains("judge"));
        let judged = CampaignSpec::from_toml(&format!("{text}[evaluation]\njudge = true")).unwrap();
        assert!(judged.judges());
        assert_eq!(CampaignSpec::from_toml(&judged.to_toml()).unwrap(), judged);
        assert!(!spec("[evaluation]\njudge = false").unwrap().judges());
    }
}

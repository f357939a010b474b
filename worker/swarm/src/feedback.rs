//! How people, or the synthetic annotator, teach a campaign.

use crate::{Invalid, Purpose, RandomStream, invalid, toml_file, training::Recipe};
use murmuration_proto::v1;
use rand::RngExt as _;
use std::fmt;

/// How queries are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Strategy {
    Random,
    /// The medoids of the archive, then the members of their clusters that nearly belong to another cluster.
    Medoids,
    /// The medoids of the archive, then further individuals, each the farthest from all before it.
    Coverage,
}

/// How a campaign learns from labels. In each round, annotators label individuals, a trainer fine-tunes the embedder on all
/// labels, the archive moves to the new embedder, and the search continues.
#[derive(Debug, Clone, PartialEq)]
pub struct Feedback {
    rounds: u32,
    labels: u32,
    strategy: Strategy,
    generations: u32,
    recipe: Recipe,
    starts: u32,
}

impl Feedback {
    /// Number of unattended rounds, in which the synthetic annotator labels, 0 to 1,000. Other rounds begin on request.
    #[must_use]
    pub const fn rounds(&self) -> u32 {
        self.rounds
    }

    /// Number of individuals that the synthetic annotator labels per round, 2 to 50,000.
    #[must_use]
    pub const fn labels(&self) -> u32 {
        self.labels
    }

    /// How the individuals that the synthetic annotator labels are chosen.
    #[must_use]
    pub const fn strategy(&self) -> Strategy {
        self.strategy
    }

    /// Number of generations that each round adds to the search, 0 to 100,000.
    #[must_use]
    pub const fn generations(&self) -> u32 {
        self.generations
    }

    /// How the embedder is fine-tuned: a recipe that [learns from labels](Recipe::is_labelled).
    #[must_use]
    pub const fn recipe(&self) -> &Recipe {
        &self.recipe
    }

    /// Number of simulations of each labelled controller that training learns from, 1 to 16: the labelled simulation, and others
    /// from random starts.
    #[must_use]
    pub const fn starts(&self) -> u32 {
        self.starts
    }

    /// Seeds of the further starts of a labelled individual; `seed` is the campaign's.
    pub fn further_starts(&self, seed: u64, index: u64) -> impl Iterator<Item = u64> + use<> {
        let first = index * 16;
        let places = first + 1..first + u64::from(self.starts);
        places.map(move |place| RandomStream::derive(seed, Purpose::FurtherStart, place).random())
    }
}

impl TryFrom<v1::Feedback> for Feedback {
    type Error = Invalid;

    fn try_from(message: v1::Feedback) -> Result<Self, Invalid> {
        let strategy = message.strategy.as_deref().unwrap_or("medoids").parse()?;
        Ok(Self {
            starts: invalid::whole("starts", message.starts.unwrap_or(4), 1..=16)?,
            rounds: invalid::whole("rounds", message.rounds.unwrap_or(0), 0..=1_000)?,
            labels: invalid::whole("labels", message.labels.unwrap_or(100), 2..=50_000)?,
            strategy,
            generations: invalid::whole("generations", message.generations.unwrap_or(20), 0..=100_000)?,
            recipe: recipe(message.recipe.as_deref())?,
        })
    }
}

/// Reads the recipe; the default is `labelled`.
fn recipe(text: Option<&str>) -> Result<Recipe, Invalid> {
    let Some(text) = text else {
        return Recipe::named("labelled");
    };
    let unreadable = |error| Invalid::new("recipe", "a table", format!("a recipe for labels: {error}"));
    let message: v1::Recipe = toml_file::read_section("feedback.recipe", text).map_err(unreadable)?;
    let recipe = Recipe::try_from(message).map_err(|error| error.within("recipe"))?;
    if recipe.is_labelled() {
        return Ok(recipe);
    }
    let named = format!("\"{}\"", recipe.name());
    Err(Invalid::new(
        "recipe",
        named,
        "\"labelled\" or \"paper-labelled\"",
    ))
}

impl From<&Feedback> for v1::Feedback {
    fn from(feedback: &Feedback) -> Self {
        Self {
            rounds: Some(feedback.rounds),
            labels: Some(feedback.labels),
            strategy: Some(feedback.strategy.to_string()),
            generations: Some(feedback.generations),
            recipe: Some(toml::to_string(&v1::Recipe::from(&feedback.recipe)).unwrap_or_default()),
            starts: Some(feedback.starts),
        }
    }
}

impl Strategy {
    pub const ALL: [Self; 3] = [Self::Random, Self::Medoids, Self::Coverage];

    /// Name of the strategy in files and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::Medoids => "medoids",
            Self::Coverage => "coverage",
        }
    }
}

impl fmt::Display for Strategy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for Strategy {
    type Err = Invalid;

    fn from_str(name: &str) -> Result<Self, Invalid> {
        let named = Self::ALL.into_iter().find(|strategy| strategy.name() == name);
        named.ok_or_else(|| {
            let names = Self::ALL.map(|strategy| format!("\"{strategy}\""));
            Invalid::new("strategy", format!("\"{name}\""), names.join(" or "))
        })
    }
}

impl TryFrom<v1::QueryStrategy> for Strategy {
    type Error = Invalid;

    fn try_from(strategy: v1::QueryStrategy) -> Result<Self, Invalid> {
        match strategy {
            v1::QueryStrategy::Random => Ok(Self::Random),
            v1::QueryStrategy::Medoids => Ok(Self::Medoids),
            v1::QueryStrategy::Coverage => Ok(Self::Coverage),
            v1::QueryStrategy::Unspecified => {
                Err(Invalid::missing("strategy", "random, medoids or coverage"))
            }
        }
    }
}

impl From<Strategy> for v1::QueryStrategy {
    fn from(strategy: Strategy) -> Self {
        match strategy {
            Strategy::Random => Self::Random,
            Strategy::Medoids => Self::Medoids,
            Strategy::Coverage => Self::Coverage,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::CampaignSpec;

    fn spec(text: &str) -> Result<CampaignSpec, String> {
        let text = format!("model = \"single-sensor\"\nmethod = \"latent\"\n{text}");
        CampaignSpec::from_toml(&text).map_err(|error| error.to_string())
    }

    #[track_caller]
    fn check_refused(text: &str, expected: &str) {
        let error = spec(text).unwrap_err();
        assert!(error.contains(expected), "{error:?} does not say {expected:?}");
    }

    #[test]
    fn nobody_labels_unless_asked() {
        let spec = spec("").unwrap();
        let feedback = spec.feedback().unwrap();
        assert_eq!((feedback.rounds(), feedback.recipe().name()), (0, "labelled"));
        let spec = CampaignSpec::from_toml("model = \"two-sensor\"\nmethod = \"hand-crafted\"").unwrap();
        assert!(spec.feedback().is_none());
    }

    #[test]
    fn what_is_written_reads_back() {
        let spec = spec(
            "[feedback]\nrounds = 2\nlabels = 30\nstrategy = \"random\"\ngenerations = 0\n\
             [feedback.recipe.paper-labelled]\nepochs = 7",
        )
        .unwrap();
        assert_eq!(CampaignSpec::from_toml(&spec.to_toml()).unwrap(), spec);
        let feedback = spec.feedback().unwrap();
        assert_eq!(
            (feedback.rounds(), feedback.labels(), feedback.generations()),
            (2, 30, 0)
        );
        assert_eq!(
            (feedback.recipe().name(), feedback.recipe().epochs()),
            ("paper-labelled", 7)
        );
    }

    #[test]
    fn every_labelled_individual_has_further_starts_of_its_own() {
        let spec = spec("[feedback]\nstarts = 16").unwrap();
        let feedback = spec.feedback().unwrap();
        let seeds = |seed| (0..9).flat_map(move |index| feedback.further_starts(seed, index));
        let all: std::collections::BTreeSet<u64> = seeds(1).chain(seeds(2)).collect();
        assert_eq!(all.len(), 2 * 9 * 15);
        check_refused(
            "[feedback]\nstarts = 0",
            "feedback.starts = 0: must be a whole number from 1",
        );
    }

    #[test]
    fn what_is_wrong_is_named() {
        check_refused("[feedback]\nround = 1", "unknown field `round`");
        check_refused(
            "[feedback]\nlabels = 1",
            "feedback.labels = 1: must be a whole number from 2",
        );
        check_refused(
            "[feedback]\nstrategy = \"best\"",
            "feedback.strategy = \"best\": must be \"random\"",
        );
        check_refused(
            "[feedback.recipe.in-batch]",
            "feedback.recipe = \"in-batch\": must be \"labelled\"",
        );
        check_refused(
            "[feedback.recipe.labelled]\nper_class = 1",
            "feedback.recipe.labelled.per_class = 1",
        );
        let text = "model = \"single-sensor\"\nmethod = \"random\"\n[feedback]";
        let error = CampaignSpec::from_toml(text).unwrap_err().to_string();
        assert!(error.contains("feedback = given: must be absent"), "{error}");
    }
}

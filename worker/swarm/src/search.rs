//! The parameters of novelty search.

use crate::{Invalid, invalid, record::record};
use murmuration_proto::v1;

record! {
    /// Population, novelty and variation of the search. The defaults of population and generations are the paper's, the other
    /// defaults this project's.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Search {
        /// Controllers per generation, 1 to 100,000.
        population: u32,
        /// Number of generations, including the sampled first generation, 1 to 100,000.
        generations: u32,
        /// Number of nearest neighbours, the k of the novelty metric (paper, Eq. 1), 1 to 100,000.
        neighbours: u32,
        /// Number of candidates in a tournament, 1 to 100,000.
        tournament: u32,
        /// Probability p that the best candidate of a tournament wins, over 0 and at most 1. Otherwise the second best wins with
        /// p, and so on.
        tournament_pressure: f64,
        /// Probability of one-point crossover, 0 to 1.
        crossover: f64,
        /// Probability that a gene mutates, 0 to 1.
        mutation: f64,
        /// Largest change of a mutated speed, as a share of the largest speed, over 0 and at most 2.
        mutation_step: f64,
        /// Probability that a mutated speed also changes its sign, 0 to 1.
        sign_flip: f64,
        /// Number of generations between a generation and the generation of its parents, 0 or 1.
        lag: u32,
    }
}

impl Search {
    /// Maximum number of evaluations in one campaign without a sample, see [`CampaignSpec::sample`](crate::CampaignSpec::sample).
    pub const MAX_EVALUATIONS: u64 = 10_000_000;
    /// Maximum number of evaluations in one campaign with a sample.
    pub const MAX_SAMPLED_EVALUATIONS: u64 = 100_000_000;

    /// Evaluations of a whole campaign: population times generations.
    #[must_use]
    pub const fn evaluations(&self) -> u64 {
        self.population as u64 * self.generations as u64
    }
}

impl Default for Search {
    fn default() -> Self {
        Self {
            population: 100,
            generations: 100,
            neighbours: 15,
            tournament: 10,
            tournament_pressure: 0.9,
            crossover: 0.7,
            mutation: 0.15,
            mutation_step: 0.4,
            sign_flip: 0.2,
            lag: 0,
        }
    }
}

impl TryFrom<v1::Search> for Search {
    type Error = Invalid;

    fn try_from(message: v1::Search) -> Result<Self, Invalid> {
        let default = Self::default();
        let count = |field, value: Option<u32>, otherwise| {
            invalid::whole(field, value.unwrap_or(otherwise), 1..=100_000)
        };
        let probability = |field, value: Option<f64>, otherwise| {
            invalid::real(field, value.unwrap_or(otherwise), 0.0..=1.0)
        };
        let search = Self {
            population: count("population", message.population, default.population)?,
            generations: count("generations", message.generations, default.generations)?,
            neighbours: count("neighbours", message.neighbours, default.neighbours)?,
            tournament: count("tournament", message.tournament, default.tournament)?,
            tournament_pressure: invalid::positive(
                "tournament_pressure",
                message.tournament_pressure.unwrap_or(default.tournament_pressure),
                1.0,
            )?,
            crossover: probability("crossover", message.crossover, default.crossover)?,
            mutation: probability("mutation", message.mutation, default.mutation)?,
            mutation_step: invalid::positive(
                "mutation_step",
                message.mutation_step.unwrap_or(default.mutation_step),
                2.0,
            )?,
            sign_flip: probability("sign_flip", message.sign_flip, default.sign_flip)?,
            lag: invalid::whole("lag", message.lag.unwrap_or(default.lag), 0..=1)?,
        };
        Ok(search)
    }
}

impl From<Search> for v1::Search {
    fn from(search: Search) -> Self {
        Self {
            population: Some(search.population),
            generations: Some(search.generations),
            neighbours: Some(search.neighbours),
            tournament: Some(search.tournament),
            tournament_pressure: Some(search.tournament_pressure),
            crossover: Some(search.crossover),
            mutation: Some(search.mutation),
            mutation_step: Some(search.mutation_step),
            sign_flip: Some(search.sign_flip),
            // Left out if 0, so that files of earlier versions stay as they are.
            lag: (search.lag > 0).then_some(search.lag),
        }
    }
}

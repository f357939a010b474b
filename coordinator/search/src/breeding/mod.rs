//! Proposals: the controllers that a generation evaluates (paper, "Evolution and Clustering").
//!
//! The first generation, and every generation of [`Method::Random`], is sampled uniformly from the controller space. The first
//! generation begins with the controllers that the specification names, if any; the filter does not apply to these controllers.
//! Every other generation is bred from the generation before: parents win tournaments by novelty, and a child is crossed over and
//! mutated. With a lag of 1, a generation is bred from the last generation but one, and the second generation is sampled too. A
//! controller that fails the filter is drawn or bred anew.
//!
//! Generations of [`Method::Exhaustive`] are slices of the ordered list of all controllers. If there are more controllers than
//! the campaign evaluates, the generations are slices of an evenly spread sequence (the module `spread`).
//!
//! A generation is a pure function of the arguments of [`propose`]. All random numbers of a generation come from one stream,
//! derived from the campaign's seed, [`Purpose::Propose`] and the generation. The stream serves the controllers one after the
//! other. Each attempt at a controller draws either
//!
//! * for a sample: the genes in order, or
//! * for a child: the first tournament; whether to cross over; if so, the second tournament and the cut; then, for each gene,
//!   whether the gene mutates and, if so, how.

mod spread;

use crate::filter::Score;
use murmuration_swarm::{
    CampaignSpec, CapabilityModel, Controller, ControllerSpace, GeneSpace, Method, Purpose, RandomStream,
    Search,
};
use rand::RngExt as _;
use spread::Spread;

/// Maximum number of attempts at one controller before the search fails.
///
/// The filter discards about a fifth of the space, so samples need few attempts. Children can reach the maximum if hardly any
/// gene mutates and every parent fails.
pub const MOST_ATTEMPTS: u32 = 100_000;

/// Maximum number of attempts at evaluating one individual. Each attempt after the first has another controller and start
/// ([`substitute`]).
pub const EVALUATION_ATTEMPTS: u64 = 5;

/// The controllers of a generation.
#[derive(Debug, Clone, PartialEq)]
pub struct Proposal {
    /// As many controllers as the population has individuals, in the order of the individuals.
    pub controllers: Vec<Controller>,
    /// Number of controllers that the filter discarded; 0 without a filter.
    pub filtered: u64,
}

/// An individual that a generation is bred from.
#[derive(Debug, Clone, PartialEq)]
pub struct Parent {
    pub controller: Controller,
    /// The individual's novelty (paper, Eq. 1); an individual with more novelty is fitter.
    pub novelty: f64,
}

/// Why a generation cannot be proposed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ProposeError {
    /// A generation after the first must be bred, but there are no parents.
    #[error("generation {generation} has no parents")]
    NoParents {
        /// The generation, from 0.
        generation: u32,
    },
    /// A parent is of another capability model than the campaign.
    #[error("parent {parent} is a {given} controller in a campaign of the {expected} model")]
    ForeignParent {
        /// The parent's index among all parents, from 0.
        parent: usize,
        given: CapabilityModel,
        /// The campaign's model.
        expected: CapabilityModel,
    },
    /// The filter discarded [`MOST_ATTEMPTS`] controllers in a row.
    #[error(
        "the filter discarded {MOST_ATTEMPTS} controllers in a row in generation {generation}: \
         turn it off, or let more genes mutate"
    )]
    AllFiltered {
        /// The generation, from 0.
        generation: u32,
    },
}

/// The generation whose individuals are the parents of `generation`; `None` if `generation` is not bred.
#[must_use]
pub fn parents_of(spec: &CampaignSpec, generation: u32) -> Option<u32> {
    match spec.method() {
        Method::Exhaustive | Method::Random => None,
        _ => generation.checked_sub(1 + spec.search().lag()),
    }
}

/// The controllers of `generation` (from 0), as many as the population. `parents` are the individuals of the generation that
/// [`parents_of`] returns, in order; only breeding uses them.
///
/// # Errors
/// [`ProposeError`] if a generation must be bred without parents or from parents of another model, or if the
/// filter lets nothing through.
pub fn propose(spec: &CampaignSpec, generation: u32, parents: &[Parent]) -> Result<Proposal, ProposeError> {
    if spec.method() == Method::Exhaustive {
        return Ok(slice(spec, generation));
    }
    if parents_of(spec, generation).is_none() {
        let initial = match generation {
            0 => spec.controllers().initial(),
            _ => &[],
        };
        return fill(spec, generation, initial, |stream| {
            spec.controllers().sample(stream)
        });
    }
    if parents.is_empty() {
        return Err(ProposeError::NoParents { generation });
    }
    let expected = spec.model();
    for (parent, given) in parents.iter().map(|parent| parent.controller.model()).enumerate() {
        if given != expected {
            return Err(ProposeError::ForeignParent {
                parent,
                given: given.clone(),
                expected: expected.clone(),
            });
        }
    }
    fill(spec, generation, &[], |stream| breed(spec, parents, stream))
}

fn slice(spec: &CampaignSpec, generation: u32) -> Proposal {
    let population = u64::from(spec.search().population());
    let first = u64::from(generation) * population;
    let indices = first..first + population;
    let all = spec.enumeration();
    let controllers = match all.filter(|all| all.len() == spec.search().evaluations()) {
        Some(all) => indices.map(|index| all.controller(index)).collect(),
        None => {
            let spread = Spread::over(spec.controllers(), spec.seed());
            indices.map(|index| spread.controller(index)).collect()
        }
    };
    Proposal {
        controllers,
        filtered: 0,
    }
}

/// A uniform sample of the space; if `filter` is true, a sample that passes the filter.
///
/// # Errors
/// [`ProposeError::AllFiltered`] if the filter lets nothing through.
pub fn sample(
    space: &ControllerSpace,
    filter: bool,
    stream: &mut RandomStream,
) -> Result<Controller, ProposeError> {
    (0..MOST_ATTEMPTS)
        .map(|_| space.sample(stream))
        .find(|controller| !filter || Score::of(controller).passes())
        .ok_or(ProposeError::AllFiltered { generation: 0 })
}

/// The seed of the first start of an individual.
#[must_use]
pub fn start_seed(spec: &CampaignSpec, index: u64) -> u64 {
    RandomStream::derive(spec.seed(), Purpose::Start, index).random()
}

/// The replacement for an individual whose task is poisoned: another sample of the space, and the seed of another start.
/// `attempt` counts from 1.
///
/// # Errors
/// Fails as [`sample`] does.
pub fn substitute(spec: &CampaignSpec, index: u64, attempt: u64) -> Result<(Controller, u64), ProposeError> {
    let mut stream = RandomStream::derive(spec.seed(), Purpose::Substitute, index << 8 | attempt);
    let controller = sample(spec.controllers(), spec.filter(), &mut stream)?;
    Ok((controller, stream.random()))
}

/// Whether `seed` can be the seed of an individual's first start: the individual's own seed, or the seed of a substitute with the
/// same controller.
#[must_use]
pub fn is_start_of(spec: &CampaignSpec, index: u64, controller: &Controller, seed: u64) -> bool {
    let is_substitute = |attempt| {
        let substitute = substitute(spec, index, attempt);
        substitute.is_ok_and(|(own, of)| of == seed && own == *controller)
    };
    seed == start_seed(spec, index) || (1..EVALUATION_ATTEMPTS).any(is_substitute)
}

/// Fills a population with `first`, then with results of `attempt`. If the campaign has a filter, the results of `attempt` must
/// pass it.
fn fill(
    spec: &CampaignSpec,
    generation: u32,
    first: &[Controller],
    mut attempt: impl FnMut(&mut RandomStream) -> Controller,
) -> Result<Proposal, ProposeError> {
    let mut stream = RandomStream::derive(spec.seed(), Purpose::Propose, generation.into());
    let mut controllers = first.to_vec();
    let mut filtered = 0;
    let mut in_a_row = 0;
    while controllers.len() < spec.search().population() as usize {
        let controller = attempt(&mut stream);
        if !spec.filter() || Score::of(&controller).passes() {
            controllers.push(controller);
            in_a_row = 0;
            continue;
        }
        filtered += 1;
        in_a_row += 1;
        if in_a_row == MOST_ATTEMPTS {
            return Err(ProposeError::AllFiltered { generation });
        }
    }
    Ok(Proposal {
        controllers,
        filtered,
    })
}

fn breed(spec: &CampaignSpec, parents: &[Parent], stream: &mut RandomStream) -> Controller {
    let search = spec.search();
    let first = tournament(parents, search, stream);
    let mut genes = first.controller.genes().to_vec();
    if stream.chance(search.crossover()) {
        let second = tournament(parents, search, stream);
        cross_over(&mut genes, second.controller.genes(), stream);
    }
    mutate(&mut genes, spec.controllers(), search, stream);
    spec.controllers().controller(&genes)
}

/// The winner of one tournament among `parents` (at least one).
///
/// Candidates are drawn uniformly with replacement and ranked by descending novelty; candidates of equal novelty are ranked by
/// their index. The first candidate wins with probability p, or else the second with probability p, and so on; the last candidate
/// wins with the remaining probability.
fn tournament<'p>(parents: &'p [Parent], search: &Search, stream: &mut RandomStream) -> &'p Parent {
    let mut candidates: Vec<usize> = (0..search.tournament())
        .map(|_| stream.below(parents.len() as u64) as usize)
        .collect();
    candidates.sort_unstable_by(|&a, &b| {
        let by_novelty = parents[b].novelty.total_cmp(&parents[a].novelty);
        by_novelty.then(a.cmp(&b))
    });
    let last = candidates.len() - 1;
    let rank = (0..last)
        .find(|_| stream.chance(search.tournament_pressure()))
        .unwrap_or(last);
    &parents[candidates[rank]]
}

/// One-point crossover: `genes` keeps its head and takes the tail of `other`, at least one gene each.
fn cross_over(genes: &mut [f64], other: &[f64], stream: &mut RandomStream) {
    let cut = 1 + stream.below(genes.len() as u64 - 1) as usize;
    genes[cut..].copy_from_slice(&other[cut..]);
}

/// Mutates each gene with the search's probability.
///
/// A speed moves by a uniform amount within the mutation step (a share of its limit), may change its sign, and is rounded to
/// the nearest speed of the space. Every other gene is drawn anew.
fn mutate(genes: &mut [f64], space: &ControllerSpace, search: &Search, stream: &mut RandomStream) {
    for (gene, values) in genes.iter_mut().zip(space.genes()) {
        if !stream.chance(search.mutation()) {
            continue;
        }
        *gene = match values {
            GeneSpace::Speed { limit, .. } => {
                let step = search.mutation_step();
                let moved = *gene / limit + stream.between(-step, step);
                let flipped = stream.chance(search.sign_flip());
                values.nearest_speed(if flipped { -moved } else { moved })
            }
            GeneSpace::Among(_) | GeneSpace::Within(_) | GeneSpace::Ratio(_) => values.sample(stream),
        };
    }
}

#[cfg(test)]
mod tests;

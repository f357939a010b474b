//! Maps of controllers and of behaviours by t-SNE, as in the paper's appendix, with classes and heuristic scores. The maps show
//! the first generation of a campaign, which is sampled uniformly. Campaigns with the same seed therefore map the same swarms,
//! unless a filter or given controllers select other swarms. Campaigns that list controllers in order have no maps.

use crate::reference::Judged;
use murmuration_report::{atlas::Tally, score_histogram::MOST_SCORE};
use murmuration_search::{
    filter::Score,
    interrupt::{Interrupt, Interrupted},
    novelty::{Behaviours, Misfit},
    projection::principal_axes,
};
use murmuration_swarm::{CampaignSpec, Class, Invalid};
use serde::{Deserialize, Serialize};

/// Largest number of individuals on a map: more individuals do not make a map easier to read.
const MOST: usize = 5000;

/// Largest coordinate that t-SNE may give; maps of thousands of individuals are a few hundred units wide.
const MOST_PLACE: f64 = 1e9;

/// Why behaviours cannot be counted.
#[derive(Debug, thiserror::Error)]
pub enum BehavioursError {
    #[error("the archive holds vectors that cannot be compared: {0}")]
    Misfit(#[from] Misfit),
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
    #[error("individual {index} cannot be simulated: {error}")]
    Simulation {
        /// Index in the archive.
        index: u64,
        error: Invalid,
    },
    #[error("the archive is empty")]
    Empty,
}

/// Maps of the first generation of an archive.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Maps {
    /// The first individuals, at most 5,000; at least one.
    pub individuals: Vec<MappedIndividual>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MappedIndividual {
    pub index: u64,
    /// Name of the class of most trials.
    pub class: String,
    /// The heuristic score of the controller.
    pub score: f64,
    /// Position on the map of controllers, in the units of t-SNE.
    pub controller: [f64; 2],
    /// Position on the map of behaviours, in the units of t-SNE.
    pub behaviour: [f64; 2],
}

impl Maps {
    /// Whether the maps can be drawn: there are individuals, and every number is finite and in range. Maps from a damaged file
    /// may be unsound.
    pub fn is_sound(&self) -> bool {
        let is_sound = |individual: &MappedIndividual| {
            let places = [individual.controller, individual.behaviour];
            let is_near = |value: &f64| value.abs() <= MOST_PLACE;
            places.as_flattened().iter().all(is_near) && individual.score.abs() <= MOST_SCORE
        };
        !self.individuals.is_empty() && self.individuals.iter().all(is_sound)
    }

    /// Share of the individuals not of the class `random` whose nearest neighbour on a map has the same class, percent. `at`
    /// returns the position on that map. `None` if all individuals are random, or if there is only one individual.
    pub fn alike(&self, at: impl Fn(&MappedIndividual) -> [f64; 2]) -> Option<f64> {
        let places: Vec<([f64; 2], Class)> = self
            .individuals
            .iter()
            .map(|individual| (at(individual), individual.class()))
            .collect();
        let nearest = |(own, ([x, y], _)): (usize, &([f64; 2], Class))| {
            let others = places.iter().enumerate().filter(|(other, _)| *other != own);
            let distance = |([a, b], _): &([f64; 2], Class)| (a - x).hypot(b - y);
            let near = others.min_by(|(_, one), (_, other)| distance(one).total_cmp(&distance(other)));
            near.map(|(_, (_, class))| *class)
        };
        let named = places
            .iter()
            .enumerate()
            .filter(|(_, (_, class))| *class != Class::Random);
        let pairs: Vec<bool> = named.filter_map(|of| Some(nearest(of)? == of.1.1)).collect();
        let alike = pairs.iter().filter(|is_alike| **is_alike).count();
        (!pairs.is_empty()).then(|| 100.0 * alike as f64 / pairs.len() as f64)
    }
}

impl MappedIndividual {
    /// The class of the individual; `random` if a damaged file names no class.
    pub fn class(&self) -> Class {
        let named = Class::ALL.into_iter().find(|class| class.name() == self.class);
        named.unwrap_or(Class::Random)
    }
}

/// Maps the first generation of an archive, which is in the order of its individuals. `interrupt` ends the computation.
pub fn measure_maps(
    spec: &CampaignSpec,
    archive: &[Judged],
    interrupt: &Interrupt,
) -> Result<Maps, BehavioursError> {
    let mapped = || {
        archive
            .iter()
            .take(spec.search().population() as usize)
            .take(MOST)
    };
    let controllers = placed(mapped().map(|judged| judged.controller.genes()), interrupt)?;
    let behaviours = placed(mapped().map(|judged| judged.behaviour.as_slice()), interrupt)?;
    let places = controllers.into_iter().zip(behaviours);
    let individual = |((index, judged), (controller, behaviour)): ((u64, &Judged), _)| MappedIndividual {
        index,
        class: Tally::of(&judged.verdicts).class.name().to_owned(),
        score: Score::of(&judged.controller).total(),
        controller,
        behaviour,
    };
    Ok(Maps {
        individuals: (0..).zip(mapped()).zip(places).map(individual).collect(),
    })
}

fn placed<'a>(
    vectors: impl Iterator<Item = &'a [f64]>,
    interrupt: &Interrupt,
) -> Result<Vec<[f64; 2]>, BehavioursError> {
    let mut vectors = vectors.peekable();
    let dims = vectors.peek().ok_or(BehavioursError::Empty)?.len();
    let mut points = Behaviours::new(dims);
    for vector in vectors {
        points.push(vector)?;
    }
    let axes = principal_axes(&points, interrupt)?.points;
    Ok(murmuration_tsne::embed(&points, &axes, interrupt)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_swarm::{Controller, Verdict};

    fn spec(more: &str) -> CampaignSpec {
        let text = "name = \"a\"\nmodel = \"single-sensor\"\nmethod = \"random\"";
        CampaignSpec::from_toml(&format!("{text}\n{more}")).unwrap()
    }

    fn archive(count: usize) -> Vec<Judged> {
        let spec = spec("");
        let judged = |index: usize| {
            let far = if index.is_multiple_of(2) { 0.0 } else { 50.0 };
            let speed = (index % 21) as f64 / 10.0 - 1.0;
            Judged {
                controller: Controller::new(spec.model(), &[speed, 0.5, -0.5, 1.0]).unwrap(),
                features: [0.0; 5],
                behaviour: vec![far + index as f64 / count as f64, far],
                verdicts: vec![Verdict::Class(if index.is_multiple_of(2) {
                    Class::Milling
                } else {
                    Class::Random
                })],
            }
        };
        (0..count).map(judged).collect()
    }

    #[test]
    fn what_is_near_in_the_behaviour_space_is_near_on_its_map() {
        let maps = measure_maps(&spec(""), &archive(60), &Interrupt::default()).unwrap();
        let distance = |one: [f64; 2], other: [f64; 2]| (one[0] - other[0]).hypot(one[1] - other[1]);
        for individual in &maps.individuals {
            let others = maps
                .individuals
                .iter()
                .filter(|other| other.index != individual.index);
            let nearest = others.min_by(|a, b| {
                distance(a.behaviour, individual.behaviour)
                    .total_cmp(&distance(b.behaviour, individual.behaviour))
            });
            assert_eq!(
                nearest.unwrap().class(),
                individual.class(),
                "{}",
                individual.index
            );
        }
    }

    #[test]
    fn the_share_of_neighbours_of_a_class_leaves_random_out() {
        // The places are from left to right. Of the individuals that mill, only the second has a nearest neighbour of another
        // class.
        let places = [
            (0.0, "milling"),
            (1.0, "milling"),
            (1.5, "random"),
            (9.0, "dispersal"),
            (9.5, "dispersal"),
        ];
        let individual = |&(x, class): &(f64, &str)| MappedIndividual {
            index: 0,
            class: class.to_owned(),
            score: 0.0,
            controller: [x, 0.0],
            behaviour: [0.0, 0.0],
        };
        let maps = |places: &[(f64, &str)]| Maps {
            individuals: places.iter().map(individual).collect(),
        };
        assert_eq!(maps(&places).alike(|of| of.controller), Some(75.0));
        assert_eq!(maps(&places[..1]).alike(|of| of.controller), None);
        assert_eq!(maps(&places[2..3]).alike(|of| of.controller), None);
    }

    #[test]
    fn maps_with_numbers_that_nothing_has_are_damaged() {
        let sound = measure_maps(&spec(""), &archive(30), &Interrupt::default()).unwrap();
        assert!(sound.is_sound());
        let with = |change: fn(&mut MappedIndividual)| {
            let mut maps = sound.clone();
            change(&mut maps.individuals[7]);
            maps
        };
        assert!(!with(|of| of.score = 1e300).is_sound());
        assert!(!with(|of| of.score = f64::NAN).is_sound());
        assert!(!with(|of| of.behaviour[1] = f64::INFINITY).is_sound());
        let nobody = Maps {
            individuals: Vec::new(),
        };
        assert!(!nobody.is_sound());
    }

    #[test]
    fn what_was_bred_is_on_no_map() {
        let spec = spec("search.population = 20");
        let maps = measure_maps(&spec, &archive(60), &Interrupt::default()).unwrap();
        assert_eq!(maps.individuals.len(), 20);
    }

    #[test]
    fn an_empty_archive_has_no_maps() {
        assert!(matches!(
            measure_maps(&spec(""), &[], &Interrupt::default()),
            Err(BehavioursError::Empty)
        ));
    }
}

//! Small campaigns that begin with given controllers.

use super::CampaignSpec;
use crate::{
    CapabilityModel, Controller, ControllerSpace, GeneSpace, Invalid, Purpose, RandomStream, World, counted,
    robot,
};
use murmuration_proto::v1;

/// Controllers per generation. With [`GENERATIONS`] generations, a campaign with the paper's robots takes half a minute on two
/// cores, like `examples/quick.toml`.
const POPULATION: u32 = 100;
const GENERATIONS: u32 = 30;
/// Number of genes by which controllers of a sweep may differ from its centre, if all combinations are too many. The first number
/// with few enough controllers counts.
const CHANGED: [usize; 2] = [2, 1];

/// The name, the world and the seed of a campaign that begins with given controllers.
#[derive(Debug, Clone, Copy)]
pub struct Begun<'a> {
    /// The campaign's name.
    pub name: &'a str,
    pub world: &'a World,
    /// The campaign's seed, see [`CampaignSpec::seed_of`].
    pub seed: u64,
}

impl CampaignSpec {
    /// Number of evaluations of a search that begins with given controllers.
    pub const BEGUN_EVALUATIONS: u32 = POPULATION * GENERATIONS;
    /// Number of controllers with which the first generation of such a search begins. The rest of the generation is sampled from
    /// the whole space, so that the search can also leave the surroundings of these controllers.
    pub const BEGUN_CONTROLLERS: usize = POPULATION as usize / 2;

    /// The seed of a campaign that begins from an individual or a swarm with the seed `of`: campaigns have only 63 bits.
    #[must_use]
    pub const fn seed_of(of: u64) -> u64 {
        of & i64::MAX as u64
    }

    /// A small campaign with hand-crafted features, for the robots of `controller`. Half of the first generation is `controller`
    /// and controllers near it.
    ///
    /// # Errors
    /// If the name or the seed is not allowed, the robots do not fit the world, or the search does not fit in memory.
    pub fn begun_around(controller: &Controller, begun: Begun<'_>) -> Result<Self, Invalid> {
        Self::begun_with(controller.model(), &around(controller, begun.seed)?, begun)
    }

    /// A small campaign with hand-crafted features, whose first generation begins with `controllers`.
    ///
    /// # Errors
    /// As for [`CampaignSpec::begun_around`], or if a controller is not of the model.
    pub fn begun_with(
        model: &CapabilityModel,
        controllers: &[Controller],
        begun: Begun<'_>,
    ) -> Result<Self, Invalid> {
        let search = v1::Search {
            population: Some(POPULATION),
            generations: Some(GENERATIONS),
            ..v1::Search::default()
        };
        small(model, controllers, begun, search)
    }

    /// A campaign of one generation with hand-crafted features: `controller`, and all controllers within a step of it
    /// ([`GeneSpace::beside`]) in every gene. If these are too many, the campaign has those that differ in at most two genes, or
    /// else in one gene. The first individual is `controller`.
    ///
    /// # Errors
    /// If the name or the seed is not allowed, or the robots do not fit the world or have too many genes.
    pub fn sweep_around(controller: &Controller, begun: Begun<'_>) -> Result<Self, Invalid> {
        let controllers = within_a_step(controller)?;
        let search = v1::Search {
            population: Some(controllers.len() as u32),
            generations: Some(1),
            ..v1::Search::default()
        };
        small(controller.model(), &controllers, begun, search)
    }

    /// The centre of the sweep that is the first generation; `None` if the first generation is no sweep.
    #[must_use]
    pub fn sweep_centre(&self) -> Option<&Controller> {
        let initial = self.controllers.initial();
        let centre = initial.first()?;
        let is_whole = initial.len() == self.search.population() as usize;
        let is_sweep = is_whole && within_a_step(centre).is_ok_and(|sweep| sweep == initial);
        is_sweep.then_some(centre)
    }
}

/// A campaign with hand-crafted features whose first generation begins with `controllers`.
fn small(
    model: &CapabilityModel,
    controllers: &[Controller],
    Begun { name, world, seed }: Begun<'_>,
    search: v1::Search,
) -> Result<CampaignSpec, Invalid> {
    let robots = robot::Written::from(model);
    CampaignSpec::try_from(v1::CampaignSpec {
        name: Some(name.to_owned()),
        seed: Some(seed),
        model: robots.model,
        robot: robots.robot,
        species: robots.species,
        ratios: robots.ratios,
        method: v1::Method::HandCrafted as i32,
        world: Some(world.clone().into()),
        controllers: Some(v1::ControllerSpace {
            initial: controllers.iter().map(Into::into).collect(),
            ..v1::ControllerSpace::default()
        }),
        search: Some(search),
        ..v1::CampaignSpec::default()
    })
}

/// The controller, and controllers of its space near it, each once. A small space can have fewer than
/// [`CampaignSpec::BEGUN_CONTROLLERS`].
fn around(controller: &Controller, seed: u64) -> Result<Vec<Controller>, Invalid> {
    let space = ControllerSpace::for_model(v1::ControllerSpace::default(), controller.model())?;
    let mut stream = RandomStream::derive(seed, Purpose::Around, 0);
    let mut around = vec![controller.clone()];
    for _ in 0..10 * CampaignSpec::BEGUN_CONTROLLERS {
        let near = space.near(controller, &mut stream);
        if around.len() < CampaignSpec::BEGUN_CONTROLLERS && !around.contains(&near) {
            around.push(near);
        }
    }
    Ok(around)
}

/// The controllers of a sweep, see [`CampaignSpec::sweep_around`], the centre first.
///
/// # Errors
/// If there are too many controllers that differ in one gene.
fn within_a_step(centre: &Controller) -> Result<Vec<Controller>, Invalid> {
    let model = centre.model();
    let genes: Vec<(f64, Vec<f64>)> = centre
        .genes()
        .iter()
        .zip(GeneSpace::of_model(model))
        .map(|(&own, gene)| (own, gene.beside(own)))
        .collect();
    let most = ControllerSpace::MAX_INITIAL;
    let is_small = |changed: &usize| number_within(&genes, *changed) <= most;
    let changed = [genes.len()].into_iter().chain(CHANGED).find(is_small);
    let changed = changed.ok_or_else(|| {
        let value = counted(number_within(&genes, 1) as u64, "controller");
        Invalid::new("a sweep", value, format!("at most {most} controllers"))
    })?;
    let mut combinations = vec![(Vec::with_capacity(genes.len()), 0)];
    for (own, beside) in &genes {
        let extended = combinations
            .into_iter()
            .flat_map(|(before, count): (Vec<f64>, usize)| {
                let with = |value: f64, count| ([&before[..], &[value]].concat(), count);
                let others = beside.iter().filter(|_| count < changed);
                let others: Vec<_> = others.map(|&value| with(value, count + 1)).collect();
                [with(*own, count)].into_iter().chain(others)
            });
        combinations = extended.collect();
    }
    combinations
        .iter()
        .map(|(genes, _)| Controller::new(model, genes))
        .collect()
}

/// Number of combinations of genes in which at most `changed` genes have another value than their own.
fn number_within(genes: &[(f64, Vec<f64>)], changed: usize) -> usize {
    // The number of combinations by their number of changed genes.
    let mut numbers = vec![0_usize; changed + 1];
    numbers[0] = 1;
    for (_, beside) in genes {
        for count in (1..=changed).rev() {
            let more = numbers[count - 1].saturating_mul(beside.len());
            numbers[count] = numbers[count].saturating_add(more);
        }
    }
    numbers.into_iter().fold(0, usize::saturating_add)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn begun(world: &World, seed: u64) -> Begun<'_> {
        Begun {
            name: "begun",
            world,
            seed,
        }
    }

    #[test]
    fn a_campaign_has_the_robots_the_world_and_the_controller_that_it_is_begun_with() {
        let species = "ratios = [[3, 4], [2, 5]]\n[[species]]\nname = \"a\"\nrobot.sensors = [{}]\n\
                       [[species]]\nname = \"b\"\nrobot = { radius = 8, sensors = [{ angle = \"free\", angle_range = [0, 1] }] }\n";
        for robots in [
            "model = \"two-sensor\"\n[world]\nagents = 30\nboundary = \"torus\"\n",
            "model = \"turbopi\"\n",
            "[robot]\nradius = 7\nsensors = [{ half_angle = 0.2, range = 120 }]\n",
            species,
        ] {
            let (model, world) = CampaignSpec::robots_from_toml(robots).unwrap();
            let controller = Controller::new(&model, &vec![0.0; model.genes()]).unwrap();
            let spec = CampaignSpec::begun_around(&controller, begun(&world, 5)).unwrap();
            assert_eq!(
                (spec.name().as_str(), spec.model(), spec.world(), spec.seed()),
                ("begun", &model, &world, 5),
                "{robots}"
            );
            let initial = spec.controllers().initial();
            assert_eq!((&initial[0], initial.len()), (&controller, 50), "{robots}");
            assert!((1..50).all(|place| !initial[..place].contains(&initial[place])));
            let again = CampaignSpec::begun_around(&controller, begun(&world, 5)).unwrap();
            let other = CampaignSpec::begun_around(&controller, begun(&world, 6)).unwrap();
            assert_eq!(again, spec);
            assert_ne!(other.controllers().initial(), initial);
            assert_eq!(CampaignSpec::from_toml(&spec.to_toml()).unwrap(), spec);
        }
    }

    #[test]
    fn a_campaign_begins_from_every_seed_of_a_swarm() {
        let (model, world) = CampaignSpec::robots_from_toml("model = \"single-sensor\"").unwrap();
        let controller = Controller::new(&model, &[0.0; 4]).unwrap();
        for (of, seed) in [(7, 7), ((1 << 63) | 7, 7), (u64::MAX, i64::MAX as u64)] {
            let begun = begun(&world, CampaignSpec::seed_of(of));
            let spec = CampaignSpec::begun_around(&controller, begun).unwrap();
            assert_eq!(spec.seed(), seed);
        }
    }

    fn sweep(robots: &str, genes: &[f64]) -> CampaignSpec {
        let (model, world) = CampaignSpec::robots_from_toml(robots).unwrap();
        let controller = Controller::new(&model, genes).unwrap();
        CampaignSpec::sweep_around(&controller, begun(&world, 5)).unwrap()
    }

    #[track_caller]
    fn check_sweep(robots: &str, genes: &[f64], number: usize) -> Vec<Vec<f64>> {
        let spec = sweep(robots, genes);
        let initial = spec.controllers().initial();
        let search = spec.search();
        assert_eq!((search.population() as usize, search.generations()), (number, 1));
        assert_eq!(initial.len(), number);
        assert!((1..number).all(|place| !initial[..place].contains(&initial[place])));
        assert_eq!(spec.sweep_centre(), Some(&initial[0]));
        assert_eq!(CampaignSpec::from_toml(&spec.to_toml()).unwrap(), spec);
        let genes_of = |controller: &Controller| controller.genes().to_vec();
        assert_eq!(genes_of(&initial[0]), genes);
        initial.iter().map(genes_of).collect()
    }

    #[test]
    fn a_sweep_has_all_controllers_within_a_step() {
        let all = check_sweep("model = \"single-sensor\"", &[-0.7, 0.3, 0.05, 0.0], 81);
        for genes in &all {
            let steps = genes.iter().zip([-0.7, 0.3, 0.05, 0.0]);
            assert!(
                steps.clone().all(|(gene, own)| (gene - own).abs() < 0.1 + 1e-9),
                "{genes:?}"
            );
        }
        assert!(all.contains(&vec![-0.6, 0.2, 0.15, -0.1]));
        // Two speeds are at their limits, so that they have one step less.
        check_sweep("model = \"single-sensor\"", &[-0.7, 0.3, 1.0, -1.0], 36);
        // Listed angles and ratios have neighbours. All speeds are at their limits.
        let species = "ratios = [[3, 4], [2, 5], [1, 6]]\n[[species]]\nname = \"a\"\nrobot.sensors = [{}]\n\
                       [[species]]\nname = \"b\"\nrobot.sensors = [{ angle = \"free\", angles = [1.0, 0.5, 2.0] }]\n";
        let genes = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.5, 1.0];
        let all = check_sweep(species, &genes, 1 + (9 + 2) + (36 + 9 * 2));
        let ends = |angle, ratio| [&[1.0; 8][..], &[angle, ratio]].concat();
        for (angle, ratio, is_in) in [
            (1.0, 2.0, true),
            (1.0, 0.0, true),
            (2.0, 1.0, false),
            (0.5, 3.0, false),
        ] {
            assert_eq!(all.contains(&ends(angle, ratio)), is_in, "{angle} {ratio}");
        }
    }

    #[test]
    fn a_sweep_of_many_genes_changes_at_most_two_of_them_or_one() {
        let nine = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.0];
        let all = check_sweep("model = \"two-sensor\"", &nine, 1 + 2 * 9 + 4 * 36);
        let changed = |genes: &Vec<f64>| {
            genes
                .iter()
                .zip(nine)
                .filter(|(gene, own)| **gene != *own)
                .count()
        };
        assert!(all.iter().all(|genes| changed(genes) <= 2));
        let five =
            "[robot]\nsensors = [{}, { angle = 1.0 }, { angle = 2.0 }, { angle = 3.0 }, { angle = 4.0 }]";
        check_sweep(five, &[0.0; 64], 129);
        let species: String = (0..5)
            .map(|i| {
                format!(
                    "[[species]]\nname = \"s{i}\"\nrobot.sensors = [{{}}, {{}}, {{}}, {{}}, {{}}, {{}}]\n"
                )
            })
            .collect();
        let text = format!("ratios = [[1, 1, 1, 1, 1]]\n{species}");
        let (model, world) = CampaignSpec::robots_from_toml(&text).unwrap();
        let controller = Controller::new(&model, &vec![0.0; model.genes()]).unwrap();
        let error = CampaignSpec::sweep_around(&controller, begun(&world, 5)).unwrap_err();
        assert_eq!(
            error.to_string(),
            "a sweep = 1,281 controllers: must be at most 1000 controllers"
        );
    }

    #[test]
    fn only_a_whole_sweep_has_a_centre() {
        let spec = sweep("model = \"single-sensor\"", &[-0.7, 0.3, 1.0, 1.0]);
        let text = spec.to_toml();
        // A sweep that goes on still begins with its centre.
        let further = spec.with_generations(3).unwrap();
        assert!(further.sweep_centre().is_some());
        let other = text.replace("population = 36", "population = 40");
        assert_eq!(CampaignSpec::from_toml(&other).unwrap().sweep_centre(), None);
        let plain = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"random\"").unwrap();
        assert_eq!(plain.sweep_centre(), None);
    }
}

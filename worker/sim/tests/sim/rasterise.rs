//! Pictures of swarms with different robots.

use murmuration_proto::v1;
use murmuration_sim::{
    rasterise::Rasteriser,
    simulate::{Start, Swarm},
};
use murmuration_swarm::{CampaignSpec, CapabilityModel, Controller, ImageFormat, World};

/// The picture of a swarm at these poses, before stretching.
fn drawn(robots: &str, poses: &[[f64; 3]]) -> Vec<u8> {
    let mut rasteriser = Rasteriser::new(&robots_of(robots).1, &ImageFormat::default()).unwrap();
    rasteriser.draw(&still(robots, poses.to_vec()));
    rasteriser.raw_image()
}

fn robots_of(robots: &str) -> (CapabilityModel, World) {
    CampaignSpec::robots_from_toml(robots).unwrap()
}

/// A swarm at these poses.
fn still(robots: &str, poses: Vec<[f64; 3]>) -> Swarm {
    let (model, world) = robots_of(robots);
    let controller = Controller::new(&model, &vec![0.0; model.genes()]).unwrap();
    Swarm::new(&controller, &world, &Start::at(poses).unwrap()).unwrap()
}

#[test]
fn every_body_has_its_own_size() {
    let species = |name: &str, radius: u32| {
        format!(
            "[[species]]\nname = \"{name}\"\ncount = 1\nrobot = {{ radius = {radius}, sensors = [{{}}] }}\n"
        )
    };
    let poses = [[100.0, 100.0, 0.0], [400.0, 300.0, 2.0]];
    let [small, large] = [species("a", 3), species("b", 12)];
    let both = drawn(&format!("{small}{large}"), &poses);
    let [small, large] = [drawn(&small, &poses[..1]), drawn(&large, &poses[1..])];
    assert!(small.iter().any(|&white| white > 0) && large != small);
    let sum: Vec<u8> = small.iter().zip(&large).map(|(a, b)| a + b).collect();
    assert_eq!(both, sum);
}

/// Three species, the first two of the same size, in a world so small that they meet and erase each other.
const SPECIES: [&str; 3] = [
    "[[species]]\nname = \"a\"\ncount = 5\nrobot.sensors = [{}, { angle = 1.0 }]\n",
    "[[species]]\nname = \"b\"\ncount = 4\nrobot.sensors = [{ angle = 0.5 }]\n",
    "[[species]]\nname = \"c\"\ncount = 1\nrobot = { radius = 9, sensors = [{}, { angle = 2 }, { angle = 4 }] }\n",
];
const WORLD: &str = "[world]\nwidth = 120\nheight = 120\n";

/// Pictures of the same motion: in one channel, in one channel per species, and of each species alone.
struct Drawn {
    together: Rasteriser,
    apart: Rasteriser,
    alone: Vec<Rasteriser>,
}

/// Draws one motion in all the ways of [`Drawn`].
fn motion() -> Drawn {
    let robots = format!("{}{WORLD}", SPECIES.concat());
    let (model, world) = robots_of(&robots);
    let genes: Vec<f64> = (0..model.genes())
        .map(|gene| 0.9 - 0.35 * (gene % 5) as f64)
        .collect();
    let controller = Controller::new(&model, &genes).unwrap();
    let mut swarm = Swarm::new(&controller, &world, &Start::seeded(3)).unwrap();
    let one = ImageFormat::default();
    let each = v1::ImageFormat {
        channels: Some("species".to_owned()),
        ..one.into()
    };
    let each = ImageFormat::for_swarm(each, &world, &model).unwrap();
    let of = |format| Rasteriser::new(&world, format).unwrap();
    let mut drawn = Drawn {
        together: of(&one),
        apart: of(&each),
        alone: vec![of(&one), of(&one), of(&one)],
    };
    let places = controller.species_of_robots(world.agents());
    for _ in 0..150 {
        swarm.step();
        drawn.together.draw(&swarm);
        drawn.apart.draw(&swarm);
        for (place, rasteriser) in drawn.alone.iter_mut().enumerate() {
            let own = swarm.agents().zip(&places).filter(|(_, of)| **of == place);
            let poses = own.map(|(agent, _)| [agent.position[0], agent.position[1], agent.theta]);
            rasteriser.draw(&still(&format!("{}{WORLD}", SPECIES[place]), poses.collect()));
        }
    }
    drawn
}

#[test]
fn a_channel_is_the_picture_of_its_species_alone() {
    let Drawn {
        together,
        mut apart,
        alone,
    } = motion();
    let images: Vec<Vec<u8>> = alone.iter().map(Rasteriser::image).collect();
    assert!(images.iter().all(|image| image.contains(&255)));
    assert_eq!(apart.image(), images.concat());
    let raw: Vec<Vec<u8>> = alone.iter().map(Rasteriser::raw_image).collect();
    assert_eq!(apart.raw_image(), raw.concat());
    // In a single channel, the rays of a species also erase other species. So the channel has at most as much white as all
    // separate channels together.
    let mut erased = 0;
    for (pixel, &white) in together.raw_image().iter().enumerate() {
        let sum: u16 = raw.iter().map(|image| u16::from(image[pixel])).sum();
        // Each share is rounded.
        assert!(u16::from(white) <= sum + 2, "{pixel}");
        erased += u32::from(sum > u16::from(white) + 2);
    }
    assert!(erased > 100, "{erased}");
    apart.clear();
    assert_eq!(apart.image(), vec![0; 3 * 2500]);
}

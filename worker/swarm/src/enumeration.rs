//! The controllers of a finite space in a fixed order, with one controller for two mirror images.

use crate::{Controller, ControllerSpace, DriveKind, GeneSpace, StartShape, World};
use std::f64::consts::PI;

/// All controllers of a finite space, in a fixed order: the order of genes, or the order of [`Enumeration::scattered`].
///
/// Two controllers are *mirror images* if the robots of one move like those of the other in a mirror. If two mirror images behave
/// alike, only the first in the order of genes is listed. Mirror images behave alike in a swarm of one species whose sensors all
/// look straight ahead or straight back, in a world without obstacles, given poses or jitter.
#[derive(Debug, Clone, Copy)]
pub struct Enumeration<'a> {
    space: &'a ControllerSpace,
    len: u64,
    mirror: Option<Mirror>,
    /// Distance in the order of genes between controllers that follow each other in this list; coprime to `len`.
    step: u64,
}

/// How to mirror a controller: every pair of speeds changes in the same way.
#[derive(Debug, Clone, Copy)]
struct Mirror {
    values: u64,
    /// Number of pairs of speeds, one for each sensor state.
    pairs: u32,
    kind: Swap,
}

/// How a mirror changes a pair of speeds.
#[derive(Debug, Clone, Copy)]
enum Swap {
    /// Left and right wheel change places.
    Wheels,
    /// The turning rate changes its sign.
    Turn,
}

impl<'a> Enumeration<'a> {
    /// Enumerates `space` for robots in `world`; `None` if a gene is continuous, or there are more than 2^64 - 1 controllers.
    #[must_use]
    pub fn of(space: &'a ControllerSpace, world: &World) -> Option<Self> {
        let all = space
            .genes()
            .iter()
            .try_fold(1_u64, |all, gene| all.checked_mul(gene.values()?))?;
        let mirror = Mirror::of(space, world);
        let len = mirror.map_or(all, |mirror| u64::midpoint(all, mirror.own_images(mirror.pairs)));
        Some(Self {
            space,
            len,
            mirror,
            step: 1,
        })
    }

    /// The same controllers in an order whose first controllers are spread evenly over the whole list: each step of the order is
    /// 0.618 times as long as the list (the golden ratio).
    #[must_use]
    pub fn scattered(self) -> Self {
        let golden = (self.len as f64 * 0.5 * (5_f64.sqrt() - 1.0)) as u64;
        let step = (golden.max(1)..).find(|&step| common_divisor(step, self.len) == 1);
        Self {
            step: step.unwrap_or(1),
            ..self
        }
    }

    /// Number of controllers, mirror images counted once; at least 1.
    #[must_use]
    #[expect(clippy::len_without_is_empty, reason = "a space is never empty")]
    pub const fn len(&self) -> u64 {
        self.len
    }

    /// The controller at `index`, which is under [`Enumeration::len`].
    #[must_use]
    pub fn controller(&self, index: u64) -> Controller {
        let index = (u128::from(index) * u128::from(self.step) % u128::from(self.len)) as u64;
        let places = match self.mirror {
            Some(mirror) => mirror.places(index),
            None => self.places(index),
        };
        let genes = self.space.genes().iter().zip(places);
        let genes: Vec<f64> = genes.map(|(gene, place)| gene.value(place)).collect();
        self.space.controller(&genes)
    }

    /// The place of each gene's value; the last gene changes fastest.
    fn places(&self, index: u64) -> Vec<u64> {
        let mut rest = index;
        let mut places: Vec<u64> = self
            .space
            .genes()
            .iter()
            .rev()
            .map(|gene| {
                let values = gene.values().unwrap_or(1);
                let place = rest % values;
                rest /= values;
                place
            })
            .collect();
        places.reverse();
        places
    }

    /// The mirror image of a controller of the space; `None` if the enumeration lists mirror images separately.
    #[must_use]
    pub fn mirrored(&self, controller: &Controller) -> Option<Controller> {
        let kind = self.mirror?.kind;
        let pairs = controller.genes().as_chunks().0.iter();
        let genes = pairs.flat_map(|&[a, b]: &[f64; 2]| match kind {
            Swap::Wheels => [b, a],
            // `0.0 - b` is never -0.0, whose bits differ from those of the space's zero.
            Swap::Turn => [a, 0.0 - b],
        });
        Some(self.space.controller(&genes.collect::<Vec<_>>()))
    }
}

/// Greatest common divisor (Euclid).
const fn common_divisor(mut one: u64, mut other: u64) -> u64 {
    while other != 0 {
        (one, other) = (other, one % other);
    }
    one
}

impl Mirror {
    fn of(space: &ControllerSpace, world: &World) -> Option<Self> {
        let is_even =
            world.obstacles().is_empty() && !matches!(world.start(), StartShape::Poses(_)) && !world.jitter();
        let ([alone], true) = (space.model().species(), is_even) else {
            return None;
        };
        let robot = alone.robot();
        let ahead_or_back = |angle: f64| angle == 0.0 || angle.abs() == PI;
        let mut angles = robot.sensors().iter().map(|sensor| sensor.angle().value());
        if !angles.all(|angle| angle.is_some_and(ahead_or_back)) {
            return None;
        }
        let kind = match robot.drive().kind() {
            DriveKind::Differential { .. } => Swap::Wheels,
            DriveKind::Unicycle => Swap::Turn,
        };
        let values = space.genes().first().and_then(GeneSpace::values)?;
        let pairs = robot.states() as u32;
        Some(Self { values, pairs, kind })
    }

    /// The places of the speeds of the controller at `index`, in a list of the controllers that do not come after their mirror
    /// image.
    fn places(self, index: u64) -> Vec<u64> {
        let mut places = Vec::with_capacity(2 * self.pairs as usize);
        let mut rest = index;
        // Whether an earlier pair decides which of the two images comes first.
        let mut decided = false;
        for after in (0..self.pairs).rev() {
            let pair = if decided {
                let pair = rest / self.all(after);
                rest %= self.all(after);
                pair
            } else {
                self.first_pair(&mut rest, after, &mut decided)
            };
            places.extend([pair / self.values, pair % self.values]);
        }
        places
    }

    /// The pair of speeds that `after` pairs follow, if all earlier pairs are their own mirror images. The function subtracts
    /// from `rest` the number of controllers with a lower pair in this place.
    fn first_pair(self, rest: &mut u64, after: u32, decided: &mut bool) -> u64 {
        let pairs = self.values * self.values;
        for pair in 0..pairs {
            let (a, b) = (pair / self.values, pair % self.values);
            let image = match self.kind {
                Swap::Wheels => b * self.values + a,
                Swap::Turn => a * self.values + (self.values - 1 - b),
            };
            let controllers = match pair.cmp(&image) {
                std::cmp::Ordering::Less => self.all(after),
                std::cmp::Ordering::Equal => u64::midpoint(self.all(after), self.own_images(after)),
                std::cmp::Ordering::Greater => 0,
            };
            if *rest < controllers {
                *decided = pair != image;
                return pair;
            }
            *rest -= controllers;
        }
        pairs - 1
    }

    /// Number of controllers with this many pairs.
    const fn all(self, pairs: u32) -> u64 {
        (self.values * self.values).pow(pairs)
    }

    /// Number of controllers with this many pairs that are their own mirror images.
    const fn own_images(self, pairs: u32) -> u64 {
        self.values.pow(pairs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CampaignSpec;
    use std::collections::BTreeSet;

    fn spec(robots: &str, rest: &str) -> CampaignSpec {
        CampaignSpec::from_toml(&format!("method = \"random\"\n{robots}\n{rest}")).unwrap()
    }

    fn len(robots: &str, rest: &str) -> Option<u64> {
        let spec = spec(robots, rest);
        Enumeration::of(spec.controllers(), spec.world()).map(|all| all.len())
    }

    const SINGLE: &str = "model = \"single-sensor\"";

    #[test]
    fn the_papers_robot_has_194_481_controllers_and_half_of_them_up_to_mirror_images() {
        let images = 21_u64.pow(2);
        assert_eq!(len(SINGLE, ""), Some(u64::midpoint(194_481, images)));
        assert_eq!(len(SINGLE, "[controllers]\nstep = 0.5"), Some((625 + 25) / 2));
        assert_eq!(len(SINGLE, "[controllers]\nstep = 0"), None);
        assert_eq!(len("model = \"two-sensor\"", ""), Some(21_u64.pow(8) * 10));
        let two = "[robot]\nsensors = [{}, { angle = 0.5 }]";
        assert_eq!(len(two, "[controllers]\nstep = 1"), Some(3_u64.pow(8)));
        let six = "[robot]\nsensors = [{}, {}, {}, {}, {}, {}]";
        assert_eq!(len(six, ""), None);
        // The mirror image of a world with jitter or an obstacle is another world.
        let uneven = "[world]\njitter = true\n[controllers]\nstep = 1";
        assert_eq!(len(SINGLE, uneven), Some(81));
        let obstacle = "[controllers]\nstep = 1\n[[world.obstacles]]\nx = 100\ny = 100\nradius = 20";
        assert_eq!(len(SINGLE, obstacle), Some(81));
    }

    #[test]
    fn every_controller_or_its_mirror_image_is_listed_once() {
        let unicycle = "[robot]\nsensors = [{}]\ndrive = \"unicycle\"\nmax_speed = 3\nmax_turn = 0.5";
        let back = "[robot]\nsensors = [{}, { angle = 3.141592653589793 }]";
        for (robots, step, all) in [(SINGLE, 0.25, 6561), (unicycle, 0.25, 6561), (back, 1.0, 6561)] {
            let spec = spec(robots, &format!("[controllers]\nstep = {step}"));
            let listed = Enumeration::of(spec.controllers(), spec.world()).unwrap();
            let mut seen = BTreeSet::new();
            let bits = |controller: &Controller| -> Vec<u64> {
                controller.genes().iter().map(|gene| gene.to_bits()).collect()
            };
            let mut before: Vec<f64> = Vec::new();
            for controller in (0..listed.len()).map(|index| listed.controller(index)) {
                assert!(before.as_slice() < controller.genes(), "{controller}");
                before = controller.genes().to_vec();
                let mirrored = listed.mirrored(&controller).unwrap();
                assert!(controller.genes() <= mirrored.genes());
                assert_eq!(listed.mirrored(&mirrored).unwrap(), controller);
                seen.insert(bits(&controller));
                seen.insert(bits(&mirrored));
            }
            assert_eq!(seen.len(), all, "{robots}");
        }
    }

    /// A campaign that evaluates all controllers of a space, and has a sample.
    fn sampled(step: f64) -> CampaignSpec {
        let text = format!(
            "{SINGLE}\nmethod = \"exhaustive\"\n[controllers]\nstep = {step}\n[taxonomy]\nsample = 1000"
        );
        CampaignSpec::from_toml(&text).unwrap()
    }

    #[test]
    fn the_order_of_a_campaign_with_a_sample_has_every_controller_once() {
        let spec = sampled(0.25);
        let bits = |controller: Controller| -> Vec<u64> {
            controller.genes().iter().map(|gene| gene.to_bits()).collect()
        };
        let all = |all: Enumeration<'_>| -> BTreeSet<_> {
            (0..all.len()).map(|index| bits(all.controller(index))).collect()
        };
        let listed = all(Enumeration::of(spec.controllers(), spec.world()).unwrap());
        assert_eq!(all(spec.enumeration().unwrap()), listed);
    }

    #[test]
    fn the_first_controllers_of_a_campaign_with_a_sample_are_like_all() {
        let spec = sampled(0.1);
        let all = spec.enumeration().unwrap();
        // The means of the products of all pairs of genes, with 1 as the fifth gene.
        let means = |count: u64| {
            let mut means = [[0.0; 5]; 5];
            for controller in (0..count).map(|index| all.controller(index)) {
                let genes: Vec<f64> = controller.genes().iter().copied().chain([1.0]).collect();
                for (one, other) in (0..5).flat_map(|one| (0..5).map(move |other| (one, other))) {
                    means[one][other] += genes[one] * genes[other] / count as f64;
                }
            }
            means
        };
        let (first, whole) = (means(1000), means(all.len()));
        for (first, whole) in first.as_flattened().iter().zip(whole.as_flattened()) {
            // The means of 1,000 random controllers would differ from those of all by 0.01 to 0.02 (one standard deviation).
            assert!((first - whole).abs() < 0.02, "{first} and {whole}");
        }
    }

    #[test]
    fn where_there_are_no_mirror_images_the_last_gene_changes_fastest() {
        let spec = spec(
            "model = \"two-sensor\"",
            "[controllers]\nstep = 1\nangles = [0.5, -0.5]",
        );
        let listed = Enumeration::of(spec.controllers(), spec.world()).unwrap();
        assert_eq!(listed.len(), 2 * 3_u64.pow(8));
        assert_eq!(
            listed.controller(0).genes(),
            [-1.0, -1.0, -1.0, -1.0, -1.0, -1.0, -1.0, -1.0, 0.5]
        );
        assert_eq!(listed.controller(3).genes()[6..], [-1.0, 0.0, -0.5]);
        assert!(listed.mirrored(&listed.controller(0)).is_none());
    }
}

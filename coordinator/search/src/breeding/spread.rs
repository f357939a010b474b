//! Evenly spread samples: the Halton sequence with one prime per gene. The campaign's seed determines a permutation of the
//! digits and a shift.
//!
//! Any prefix of the sequence covers the space far more evenly than as many uniform samples. Without permutations, two genes with
//! large primes would follow a diagonal for hundreds of points.

use murmuration_swarm::{Controller, ControllerSpace, Purpose, RandomStream};
use rand::RngExt as _;

/// An evenly spread sequence of the controllers of a space; controllers can repeat if genes have few values.
pub(super) struct Spread<'a> {
    space: &'a ControllerSpace,
    genes: Vec<Digits>,
}

/// The sequence of one gene, in the base of the gene's prime.
struct Digits {
    /// Maps each digit to another digit. The digit 0 maps to itself, because every number has infinitely many leading zeros.
    permuted: Vec<u64>,
    shift: f64,
}

impl<'a> Spread<'a> {
    /// The sequence over `space` for `seed`.
    pub(super) fn over(space: &'a ControllerSpace, seed: u64) -> Self {
        let digits = |(gene, base): (u64, u64)| {
            let mut stream = RandomStream::derive(seed, Purpose::Spread, gene);
            let shift = stream.random();
            let mut permuted: Vec<u64> = (0..base).collect();
            stream.shuffle(&mut permuted[1..]);
            Digits { permuted, shift }
        };
        let genes = (0..space.genes().len() as u64).zip(primes()).map(digits);
        Self {
            space,
            genes: genes.collect(),
        }
    }

    /// The controller at `index` of the sequence.
    pub(super) fn controller(&self, index: u64) -> Controller {
        let genes = self.space.genes().iter().zip(&self.genes);
        let genes: Vec<f64> = genes.map(|(gene, digits)| gene.at(digits.share(index))).collect();
        self.space.controller(&genes)
    }
}

impl Digits {
    /// The number at `index` of the sequence, 0 to under 1.
    fn share(&self, index: u64) -> f64 {
        let base = self.permuted.len() as u64;
        let (mut rest, mut weight, mut share) = (index, 1.0, self.shift);
        while rest > 0 {
            weight /= base as f64;
            share += weight * self.permuted[(rest % base) as usize] as f64;
            rest /= base;
        }
        share.fract()
    }
}

/// The primes, ascending.
fn primes() -> impl Iterator<Item = u64> {
    (2..).filter(|number| {
        (2..*number)
            .take_while(|factor| factor * factor <= *number)
            .all(|factor| number % factor != 0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_swarm::CampaignSpec;

    fn spec(model: &str, step: f64) -> CampaignSpec {
        let text = format!("model = \"{model}\"\nmethod = \"random\"\n[controllers]\nstep = {step}");
        CampaignSpec::from_toml(&text).unwrap()
    }

    #[test]
    fn every_part_of_every_gene_is_sampled_alike() {
        let spec = spec("two-sensor", 0.0);
        for seed in 0..4 {
            let spread = Spread::over(spec.controllers(), seed);
            for gene in 0..8 {
                let mut parts = [0_u32; 10];
                for index in 0..1000 {
                    let value = spread.controller(index).genes()[gene];
                    parts[(value * 5.0 + 5.0) as usize] += 1;
                }
                // Uniform samples would differ from 100 by 10 and more.
                assert!(
                    parts.iter().all(|count| count.abs_diff(100) <= 4),
                    "{gene}: {parts:?}"
                );
            }
        }
    }

    #[test]
    fn genes_do_not_go_together() {
        let spec = spec("two-sensor", 0.0);
        let spread = Spread::over(spec.controllers(), 1);
        let controllers: Vec<_> = (0..500).map(|index| spread.controller(index)).collect();
        for (one, other) in (0..8).flat_map(|one| (0..one).map(move |other| (one, other))) {
            let product = |controller: &Controller| controller.genes()[one] * controller.genes()[other];
            // The mean of 500 products of independent genes is 0, with a standard deviation of 0.015.
            let mean = controllers.iter().map(product).sum::<f64>() / 500.0;
            assert!(mean.abs() < 0.04, "{one}, {other}: {mean}");
        }
    }

    #[test]
    fn a_sample_of_a_grid_is_of_the_grid_and_of_its_seed() {
        let spec = spec("single-sensor", 0.5);
        let sample = |seed| -> Vec<Controller> {
            let spread = Spread::over(spec.controllers(), seed);
            (0..50).map(|index| spread.controller(index)).collect()
        };
        assert!(
            sample(1)
                .iter()
                .flat_map(|controller| controller.genes())
                .all(|gene| (gene * 2.0).fract() == 0.0)
        );
        assert_eq!(sample(1), sample(1));
        assert_ne!(sample(1), sample(2));
    }
}

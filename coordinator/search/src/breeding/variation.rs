//! How a child differs from its parents: crossover and mutation.

use murmuration_proto::{ControllerSpace, GeneSpace, RandomStream, Search};

/// One-point crossover: `genes` keeps its head and takes the tail of `other`, at least one gene each.
pub(super) fn cross_over(genes: &mut [f64], other: &[f64], stream: &mut RandomStream) {
    let cut = 1 + stream.below(genes.len() as u64 - 1) as usize;
    genes[cut..].copy_from_slice(&other[cut..]);
}

/// Mutates each gene with the search's probability.
///
/// A speed moves by a uniform amount within the mutation step (a share of its limit), may change its sign, and becomes the
/// nearest speed of the space. Every other gene is drawn anew.
pub(super) fn mutate(genes: &mut [f64], space: &ControllerSpace, search: &Search, stream: &mut RandomStream) {
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

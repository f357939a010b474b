//! How a child differs from its parents: crossover and mutation.

use murmuration_proto::{ControllerSpace, RandomStream, Search};

/// One-point crossover: `genes` keeps its head and takes the tail of `other`, at least one gene each.
pub(super) fn cross_over(genes: &mut [f64], other: &[f64], stream: &mut RandomStream) {
    let cut = 1 + stream.below(genes.len() as u64 - 1) as usize;
    genes[cut..].copy_from_slice(&other[cut..]);
}

/// Mutates each gene with the search's probability.
///
/// A wheel speed moves by a uniform amount within the mutation step, may change its sign, and becomes the
/// nearest speed of the space. An angle is drawn anew from the space's angles.
pub(super) fn mutate(genes: &mut [f64], space: &ControllerSpace, search: &Search, stream: &mut RandomStream) {
    let (speeds, angles) = genes.split_at_mut(space.model().speeds());
    for speed in speeds {
        if stream.chance(search.mutation()) {
            let step = search.mutation_step();
            let moved = *speed + stream.between(-step, step);
            let flipped = stream.chance(search.sign_flip());
            *speed = space.nearest_speed(if flipped { -moved } else { moved });
        }
    }
    for angle in angles {
        if stream.chance(search.mutation()) {
            *angle = space.sample_angle(stream);
        }
    }
}

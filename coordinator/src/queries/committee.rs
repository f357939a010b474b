//! Several embeddings of the same individuals, and where they judge triplets differently.

use crate::novelty::Behaviours;
use murmuration_proto::Stream;
use rayon::prelude::*;

/// Pairs that every behaviour is compared with.
const PAIRS: usize = 256;

/// Embeddings of the same individuals, in one order, by different embedders.
#[derive(Debug, Clone)]
pub struct Committee {
    members: Vec<Behaviours>,
    individuals: usize,
}

/// Embeddings that are no committee.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NoCommittee {
    /// One alone is always of one mind.
    #[error("{0} embedding(s) cannot differ: a committee has two or more")]
    TooFew(usize),
    /// They are not of the same individuals.
    #[error("embeddings of {0} and of {1} individuals cannot be compared")]
    OtherIndividuals(usize, usize),
}

/// What a committee makes of one individual.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Dispute {
    /// Votes for the less favoured answer, summed over the comparisons.
    pub(super) minority: u64,
    /// Comparisons about which the members are not of one mind.
    split: u64,
    comparisons: u64,
}

impl Dispute {
    /// Share of the comparisons about which the members are not of one mind.
    pub(super) fn share(self) -> f64 {
        self.split as f64 / self.comparisons.max(1) as f64
    }
}

impl Committee {
    /// A committee of these embeddings.
    ///
    /// # Errors
    /// [`NoCommittee`] where they are fewer than two, or of different numbers of individuals.
    pub fn new(members: Vec<Behaviours>) -> Result<Self, NoCommittee> {
        let (Some(first), 2..) = (members.first(), members.len()) else {
            return Err(NoCommittee::TooFew(members.len()));
        };
        let individuals = first.len();
        match members.iter().find(|member| member.len() != individuals) {
            Some(other) => Err(NoCommittee::OtherIndividuals(individuals, other.len())),
            None => Ok(Self { members, individuals }),
        }
    }

    /// Asks of every individual, and of each of the same pairs of others: to which of the two is it nearer? The members
    /// vote; distances are only compared within one embedding, so that their scales do not matter.
    pub(super) fn disputed(&self, stream: &mut Stream) -> Vec<Dispute> {
        let count = self.individuals as u64;
        let mut draw = || stream.below(count) as usize;
        let pairs: Vec<(usize, usize)> = match count {
            0 => Vec::new(),
            _ => (0..PAIRS).map(|_| (draw(), draw())).collect(),
        };
        (0..self.individuals)
            .into_par_iter()
            .map(|anchor| self.dispute(anchor, &pairs))
            .collect()
    }

    fn dispute(&self, anchor: usize, pairs: &[(usize, usize)]) -> Dispute {
        let mut dispute = Dispute {
            minority: 0,
            split: 0,
            comparisons: 0,
        };
        for &(one, other) in pairs {
            if one == other || one == anchor || other == anchor {
                continue;
            }
            let nearer_to_one = |member: &&Behaviours| {
                member.squared_distance(anchor, one) < member.squared_distance(anchor, other)
            };
            let votes = self.members.iter().filter(nearer_to_one).count();
            let minority = votes.min(self.members.len() - votes) as u64;
            dispute.minority += minority;
            dispute.split += u64::from(minority > 0);
            dispute.comparisons += 1;
        }
        dispute
    }
}

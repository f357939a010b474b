//! The curve of comparisons: the labelled set says which of two behaviours is more like a third.

use super::{CurveError, Curves, Point, Questions, points};
use murmuration_engine::queries::next_comparison;
use murmuration_model::labels::{ComparedTriplet, Preference, Triple};
use murmuration_proto::{Purpose, RandomStream};
use murmuration_trainer::{
    compared_pictures::{self, ComparedPictures},
    network::Network,
    training::Teaching,
};
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
    time::Instant,
};

/// What was asked, and what the set answered.
#[derive(Debug, Default)]
struct Answers {
    /// Each [in order](Triple::in_order).
    asked: BTreeSet<Triple>,
    told: Vec<ComparedTriplet>,
}

impl Curves<'_> {
    /// As [`Curves::curve`], with questions of comparison: the labelled set chooses the behaviour that alone has the class of the
    /// reference, or neither. Answers that say neither count as answers, too.
    ///
    /// # Errors
    /// See [`CurveError`].
    pub fn comparison_curve(
        &self,
        which: usize,
        counts: &[usize],
        mut told: impl FnMut(Point),
    ) -> Result<(), CurveError> {
        let pretrained = &self.pretrained[which];
        let mut embedder = pretrained.network.clone();
        let mut answers = Answers::default();
        for &count in counts {
            let begun = Instant::now();
            self.ask(&mut answers, count, &embedder, pretrained.seed)?;
            if !answers.told.is_empty() {
                let teaching = self.compared(&answers.told)?;
                embedder = self.fine_tuned(pretrained, teaching)?;
            }
            let took = begun.elapsed();
            let accuracy = self.accuracy(&embedder);
            told(Point {
                questions: Questions::Comparisons,
                answers: answers.asked.len(),
                told: answers.told.len(),
                seed: pretrained.seed,
                not_random: accuracy.anchor_not_random().percent(),
                every: accuracy.every_anchor().percent(),
                took,
            });
        }
        Ok(())
    }

    /// Asks until there are `count` answers, or there is no question left.
    fn ask(
        &self,
        answers: &mut Answers,
        count: usize,
        embedder: &Network,
        seed: u64,
    ) -> Result<(), CurveError> {
        let train = self.sets.train();
        let classes: Vec<&str> = train.classes().collect();
        let points = points(embedder, train)?;
        while answers.asked.len() < count {
            let mut stream = RandomStream::derive(seed, Purpose::Comparison, answers.asked.len() as u64);
            let Some(triple) = next_comparison(&points, &answers.asked, &mut stream) else {
                break;
            };
            let [reference, left, right] = triple.individuals().map(|index| classes[index as usize]);
            let preference = Preference::of_classes(reference, left, right);
            answers.told.extend(triple.triplet(preference));
            answers.asked.insert(triple.in_order());
        }
        Ok(())
    }

    /// Comparisons with the pictures of their behaviours, those from further starts included.
    fn compared(&self, told: &[ComparedTriplet]) -> Result<Teaching, CurveError> {
        let train = self.sets.train();
        let named = told
            .iter()
            .flat_map(|told| [told.anchor, told.nearer, told.farther]);
        let places: BTreeMap<u64, u32> = named.collect::<BTreeSet<u64>>().into_iter().zip(0..).collect();
        let triplets = told.iter().map(|told| {
            let [anchor, nearer, farther] =
                [told.anchor, told.nearer, told.farther].map(|index| places[&index]);
            compared_pictures::ComparedTriplet {
                anchor,
                nearer,
                farther,
            }
        });
        let behaviours: Vec<usize> = places.keys().map(|&index| index as usize).collect();
        let (pictures, views) = train.all_pictures(&behaviours);
        let compared = ComparedPictures::new(train.shape(), views, pictures, triplets.collect())?;
        Ok(Arc::new(compared).into())
    }
}

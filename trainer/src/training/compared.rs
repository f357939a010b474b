//! Compared triplets of a step: comparisons in turn, each behaviour by any of its views.

use crate::{
    augment::Augmentation,
    compared_pictures::{ComparedPictures, ComparedTriplet},
};
use murmuration_proto::{Purpose, RandomStream};
use rayon::prelude::*;

/// The comparisons in random order. Steps take them in turn: none repeats before all others were taken.
pub(super) struct ComparedDeck<'a> {
    compared: &'a ComparedPictures,
    triplets: Vec<ComparedTriplet>,
    next: usize,
}

impl<'a> ComparedDeck<'a> {
    pub(super) fn new(compared: &'a ComparedPictures, stream: &mut RandomStream) -> Self {
        let mut triplets = compared.triplets().to_vec();
        stream.shuffle(&mut triplets);
        Self {
            compared,
            triplets,
            next: 0,
        }
    }

    /// The pictures of the next triplets, `most` of them or all: of all anchors, then of all nearer ones, then of all farther ones.
    pub(super) fn deal(&mut self, most: usize, stream: &mut RandomStream) -> Vec<&'a [u8]> {
        let all = self.triplets.len();
        let taken = most.min(all);
        let dealt: Vec<ComparedTriplet> = (0..taken)
            .map(|place| self.triplets[(self.next + place) % all])
            .collect();
        self.next = (self.next + taken) % all;
        let (compared, views) = (self.compared, self.compared.views() as u64);
        let mut pictures = Vec::with_capacity(3 * taken);
        for part in 0..3 {
            for triplet in &dealt {
                let view = stream.below(views) as usize;
                pictures.push(compared.picture(triplet.behaviours()[part], view));
            }
        }
        pictures
    }

    /// The images of pictures that were dealt.
    pub(super) fn augmented(
        &self,
        dealt: &[&[u8]],
        augmentation: Augmentation,
        stream: &mut RandomStream,
    ) -> Vec<f32> {
        let shape = self.compared.shape();
        let key = stream.bits();
        let mut images = vec![0.0; dealt.len() * shape.bytes()];
        let places = images.par_chunks_mut(shape.bytes()).zip(dealt).enumerate();
        places.for_each(|(i, (image, picture))| {
            let mut stream = RandomStream::derive(key, Purpose::Augment, i as u64);
            augmentation.apply(picture, shape, &mut stream, image);
        });
        images
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pictures::tests::grey;

    #[test]
    fn comparisons_take_turns_and_every_view_comes() {
        // Behaviour i has the pictures 2 i and 2 i + 1.
        let triplets = (0..5).map(|anchor| ComparedTriplet {
            anchor,
            nearer: (anchor + 1) % 5,
            farther: (anchor + 2) % 5,
        });
        let compared = ComparedPictures::new(grey(1), 2, (0..10).collect(), triplets.collect()).unwrap();
        let mut stream = RandomStream::derive(1, Purpose::Train, 0);
        let mut deck = ComparedDeck::new(&compared, &mut stream);
        let (mut anchors, mut views) = ([0; 5], [0; 2]);
        for _ in 0..25 {
            let dealt = deck.deal(3, &mut stream);
            assert_eq!(dealt.len(), 9);
            for place in 0..3 {
                let [anchor, nearer, farther] = [0, 3, 6].map(|part| dealt[part + place][0] / 2);
                assert_eq!((nearer, farther), ((anchor + 1) % 5, (anchor + 2) % 5));
                anchors[anchor as usize] += 1;
                views[dealt[place][0] as usize % 2] += 1;
            }
        }
        assert_eq!(anchors, [15; 5]);
        assert!(views.iter().all(|&times| times > 20), "{views:?}");
        // There are no more than there are.
        assert_eq!(deck.deal(100, &mut stream).len(), 15);
    }
}

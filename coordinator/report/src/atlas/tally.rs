//! The most frequent class over the trials of a controller, and the colour of the controller's pixel.

use super::layout::Place;
use murmuration_model::colours::{self, Rgb, class_colour};
use murmuration_swarm::{Class, Verdict};

/// The judge's verdicts on the trials of a controller, summed up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tally {
    /// The most frequent class; if several are equally frequent, the class of the earliest trial.
    pub class: Class,
    /// The share of trials of the most frequent class, above 0 to 1.
    pub share: f64,
}

impl Tally {
    /// Sums up at least one verdict.
    pub fn of(verdicts: &[Verdict]) -> Self {
        let of = |class: Class| verdicts.iter().filter(|verdict| verdict.class() == class).count();
        let mut most = (Class::Random, 0);
        for class in verdicts.iter().map(|verdict| verdict.class()) {
            if of(class) > most.1 {
                most = (class, of(class));
            }
        }
        Self {
            class: most.0,
            share: most.1 as f64 / verdicts.len().max(1) as f64,
        }
    }

    /// Certainty of the class, above 0 to below 1: the share of trials of this class, times the probability that annotators agree
    /// with the judge about this class.
    pub(crate) fn sureness(&self) -> f64 {
        self.share * precision(self.class)
    }
}

/// Number of motions for which the annotators agree with the judge about `class`, and number of motions to which the judge gives
/// `class`, in the validation parts of all labelled sets (`docs/judge.md`).
pub const fn agreed(class: Class) -> [u32; 2] {
    match class {
        Class::CyclicPursuit => [43, 44],
        Class::Milling => [15, 21],
        Class::Aggregation => [17, 20],
        Class::Dispersal => [76, 80],
        Class::WallFollowing => [14, 18],
        Class::NestedCycle => [14, 17],
        Class::ConcavePath => [14, 18],
        Class::Random => [205, 223],
    }
}

/// Probability that annotators agree when the judge gives this class, above 0 to below 1. It follows the rule of succession,
/// because some classes are rare in the labelled sets.
pub fn precision(class: Class) -> f64 {
    let [agreed, all] = agreed(class);
    f64::from(agreed + 1) / f64::from(all + 2)
}

/// Background of all colours: uncertain controllers are dark.
const DARK: Rgb = [0; 3];
/// Colour of pixels without an evaluation.
const NOTHING: Rgb = [0xff; 3];

/// The colour of a controller: the colour of its class, which is brighter if the class is more certain.
fn shade(tally: &Tally) -> Rgb {
    let part = (tally.sureness() * 255.0).round() as u8;
    colours::over(class_colour(tally.class), part, DARK)
}

/// The pixels of the picture, row by row.
pub(super) fn pixels(places: &[Option<Place>], tallies: &[Tally]) -> Vec<Rgb> {
    let shade = |place: &Option<Place>| place.map_or(NOTHING, |place| shade(&tallies[place.entry as usize]));
    places.iter().map(shade).collect()
}

//! Labels, classes, and how far annotators agree.

use super::Time;
use murmuration_proto::v1;
use schemars::JsonSchema;
use serde::Serialize;

/// What `label` added.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct AddedLabels {
    /// Id of the campaign.
    pub(crate) campaign: String,
    /// Number of answers that were added.
    pub(crate) added: usize,
    /// Digest of the classes of all individuals afterwards.
    pub(crate) label_digest: String,
}

/// An answer that stands.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Label {
    /// Index of the individual.
    index: u64,
    /// The class, `not sure` or `skip`.
    class: String,
    annotator: String,
    /// When the answer was given.
    time: Time,
    /// Its number in the label log.
    entry: u64,
}

/// A class.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Class {
    /// Its name.
    class: String,
    /// `#rrggbb`.
    colour: String,
    /// Number of standing answers with this class.
    labels: u64,
    /// Other classes with nearly the same name.
    near: Vec<String>,
}

/// How far two annotators agree.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Agreement {
    /// The first annotator and the second.
    annotators: [String; 2],
    /// Individuals that have a class from both.
    both: u64,
    /// Individuals that have the same class from both.
    agreed: u64,
    /// Cohen's kappa, -1 to 1; null if agreement by chance is certain.
    kappa: Option<f64>,
    /// Pairs of classes, the most frequent pair first.
    confusions: Vec<Confusion>,
    /// Individuals that have different classes.
    disagreements: Vec<Disagreement>,
}

/// A pair of classes.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct Confusion {
    /// Class by the first annotator.
    first: String,
    /// Class by the second annotator.
    second: String,
    /// Number of individuals.
    individuals: u64,
}

/// An individual that has different classes.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct Disagreement {
    /// Index of the individual.
    index: u64,
    /// Class by the first annotator.
    first: String,
    /// Class by the second annotator.
    second: String,
}

impl From<&v1::Label> for Label {
    fn from(label: &v1::Label) -> Self {
        let answer = label.answer.clone().unwrap_or_default();
        Self {
            index: answer.index,
            class: answer.answer,
            annotator: answer.annotator,
            time: Time::of_ms(answer.time_ms),
            entry: label.entry,
        }
    }
}

impl From<&v1::LabelClass> for Class {
    fn from(class: &v1::LabelClass) -> Self {
        Self {
            class: class.name.clone(),
            colour: class.colour.clone(),
            labels: class.labels,
            near: class.near.clone(),
        }
    }
}

impl Agreement {
    pub(crate) fn new(first: &str, second: &str, agreement: v1::Agreement) -> Self {
        let confusion = |confusion: v1::Confusion| Confusion {
            first: confusion.first,
            second: confusion.second,
            individuals: confusion.individuals,
        };
        let disagreement = |difference: v1::Disagreement| Disagreement {
            index: difference.index,
            first: difference.first,
            second: difference.second,
        };
        Self {
            annotators: [first.to_owned(), second.to_owned()],
            both: agreement.both,
            agreed: agreement.agreed,
            kappa: agreement.kappa,
            confusions: agreement.confusions.into_iter().map(confusion).collect(),
            disagreements: agreement.disagreements.into_iter().map(disagreement).collect(),
        }
    }
}

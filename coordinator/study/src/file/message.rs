//! The fields of a study file, before they are checked.

use super::{
    lay_over,
    numbers::{NumberAxis, NumbersMessage},
};
use crate::study::Study;
use murmuration_swarm::{Invalid, text};
use serde::Deserialize;
use std::{collections::BTreeMap, path::PathBuf};
use toml::Table;

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StudyMessage {
    pub(super) name: String,
    /// The replicates. The default is one replicate, with the seed 1.
    pub(super) seeds: Option<Seeds>,
    /// Number of embedders that the replicates share.
    pub(super) embedders: Option<u32>,
    pub(super) measures: Option<Vec<String>>,
    /// Settings of the count of behaviours.
    #[serde(default)]
    pub(super) behaviours: BehavioursMessage,
    /// The label files of each robot.
    #[serde(default)]
    pub(super) accuracy: BTreeMap<String, Vec<PathBuf>>,
    pub(super) recall: Option<RecallMessage>,
    /// The fields that all campaigns share.
    #[serde(default)]
    pub(super) campaign: Table,
    /// The differences between the campaigns.
    #[serde(default)]
    pub(super) axes: Vec<AxisMessage>,
    /// The axes of the phase diagrams.
    pub(super) phase: Option<PhaseMessage>,
    /// Figures to compare with.
    #[serde(default)]
    pub(super) published: Vec<PublishedMessage>,
    /// The changes that `--quick` makes.
    pub(super) quick: Option<QuickMessage>,
}

/// The replicates, as `seeds = 10` or `seeds = [3, 5]`.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(untagged, expecting = "a number of replicates or a list of seeds")]
pub(super) enum Seeds {
    /// Number of replicates, with the seeds from 1.
    Replicates(u64),
    /// One replicate for each seed.
    List(Vec<u64>),
}

/// Settings of the count of behaviours.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BehavioursMessage {
    /// Number of generations at the end of the search whose taxonomies are judged.
    pub(super) generations: Option<u32>,
    /// Name of the batches that replace the taxonomies of a random search.
    pub(super) random: Option<String>,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RecallMessage {
    /// The fields of the campaign of the atlas.
    #[serde(default)]
    pub(super) atlas: Table,
    /// Numbers of evaluations after which recall is measured.
    pub(super) at: Option<Vec<u32>>,
    /// Number of niches of the behaviour space.
    pub(super) niches: Option<u32>,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct AxisMessage {
    pub(super) name: String,
    /// Values of the axis; empty for an axis of numbers.
    #[serde(default)]
    pub(super) values: Vec<ValueMessage>,
    /// The field that takes the numbers.
    pub(super) field: Option<String>,
    pub(super) numbers: Option<NumbersMessage>,
    /// The numbers with `--quick`, if they differ from `numbers`.
    pub(super) quick: Option<NumbersMessage>,
    /// The field and numbers of an axis of numbers; set once its values are generated.
    #[serde(skip)]
    pub(super) about: Option<NumberAxis>,
}

/// The axes of phase diagrams.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PhaseMessage {
    /// Name of the axis from left to right.
    pub(super) x: String,
    /// Name of the axis from bottom to top.
    pub(super) y: Option<String>,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ValueMessage {
    pub(super) name: String,
    /// Fields of the campaigns that have this value.
    #[serde(default)]
    pub(super) campaign: Table,
    /// The changes that `--quick` makes.
    #[serde(default)]
    pub(super) quick: Table,
}

/// Published figures.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PublishedMessage {
    /// The publication.
    #[serde(default)]
    pub(super) source: String,
    /// The rows that the figures belong to: the name of a value, by the name of its axis.
    #[serde(default, rename = "where")]
    pub(super) rows: BTreeMap<String, String>,
    pub(super) figures: BTreeMap<String, f64>,
}

/// The changes that `--quick` makes.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct QuickMessage {
    pub(super) seeds: Option<Seeds>,
    /// Number of embedders that the replicates share.
    pub(super) embedders: Option<u32>,
    /// Fields of all campaigns.
    #[serde(default)]
    pub(super) campaign: Table,
    /// The changes of `[recall]`.
    pub(super) recall: Option<RecallMessage>,
}

impl StudyMessage {
    /// The study; if `quick` is true, with the changes of `[quick]`.
    pub(super) fn made(mut self, quick: bool) -> Result<Self, Invalid> {
        for axis in &mut self.axes {
            (axis.values, axis.about) = axis.numbered(quick)?;
        }
        if self.name.ends_with(Study::QUICK) {
            let allowed = format!(
                "a name that does not end in {}: only names of quick studies do",
                Study::QUICK
            );
            return Err(Invalid::new("name", text::quoted(&self.name), allowed));
        }
        if !quick {
            self.quick = None;
            self.axes
                .iter_mut()
                .flat_map(|axis| &mut axis.values)
                .for_each(|value| value.quick.clear());
            return Ok(self);
        }
        let Some(changes) = &self.quick else {
            let allowed = "a table with the changes of a quick study: run the study without `--quick`, or add the table";
            return Err(Invalid::missing("[quick]", allowed));
        };
        self.name.push_str(Study::QUICK);
        self.seeds = changes.seeds.clone().or(self.seeds);
        self.embedders = changes.embedders.or(self.embedders);
        if let (Some(recall), Some(changes)) = (&mut self.recall, &changes.recall) {
            lay_over(&mut recall.atlas, &changes.atlas);
            recall.at = changes.at.clone().or(recall.at.take());
            recall.niches = changes.niches.or(recall.niches);
        }
        Ok(self)
    }

    /// The fields of the campaigns of a row: the shared fields, overridden by the fields of each value. With `--quick`, its
    /// changes to the shared fields, then its changes to each value, override these fields.
    pub(super) fn campaign_of(&self, row: &[usize]) -> Table {
        let mut table = self.campaign.clone();
        let values = || {
            let named = self.axes.iter().zip(row);
            named.filter_map(|(axis, &place)| axis.values.get(place))
        };
        values().for_each(|value| lay_over(&mut table, &value.campaign));
        if let Some(quick) = &self.quick {
            lay_over(&mut table, &quick.campaign);
            values().for_each(|value| lay_over(&mut table, &value.quick));
        }
        table
    }
}

impl AxisMessage {
    /// The values of an axis of numbers, one for each number, and the field and the numbers of the axis. With `quick`, the
    /// numbers for `--quick`. For an axis whose values are written one by one, returns these values and `None`.
    fn numbered(&self, quick: bool) -> Result<(Vec<ValueMessage>, Option<NumberAxis>), Invalid> {
        let path = |field| format!("axes.{field} of {}", self.name);
        let (field, numbers) = match (&self.field, &self.numbers) {
            (None, None) if self.quick.is_none() => return Ok((self.values.clone(), None)),
            (Some(field), Some(numbers)) if self.values.is_empty() => (field, numbers),
            (Some(_), Some(_)) => {
                let allowed = "absent: the axis has `numbers`";
                return Err(Invalid::new(path("values"), "given", allowed));
            }
            (_, None) => {
                let allowed = "numbers for `field`, or `values` without `field`";
                return Err(Invalid::missing(path("numbers"), allowed));
            }
            (None, Some(_)) => {
                let allowed = "the field that has the numbers, such as \"world.agents\"";
                return Err(Invalid::missing(path("field"), allowed));
            }
        };
        let numbers = self.quick.as_ref().filter(|_| quick).unwrap_or(numbers);
        let about = NumberAxis::new(&self.name, field, numbers)?;
        let value = |(name, campaign)| ValueMessage {
            name,
            campaign,
            quick: Table::new(),
        };
        Ok((about.values().map(value).collect(), Some(about)))
    }
}

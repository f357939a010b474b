//! The fields of a study file, before they are checked.

use super::lay_over;
use murmuration_proto::{Invalid, text};
use serde::Deserialize;
use std::{collections::BTreeMap, path::PathBuf};
use toml::Table;

/// A study file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StudyMessage {
    /// Name of the study.
    pub(super) name: String,
    /// The replicates. Default: one, of seed 1.
    pub(super) seeds: Option<Seeds>,
    /// How many embedders the replicates share.
    pub(super) embedders: Option<u32>,
    /// What is measured.
    pub(super) measures: Option<Vec<String>>,
    /// How behaviours are counted.
    #[serde(default)]
    pub(super) behaviours: BehavioursMessage,
    /// The label files of each robot.
    #[serde(default)]
    pub(super) accuracy: BTreeMap<String, Vec<PathBuf>>,
    /// The fields that all campaigns share.
    #[serde(default)]
    pub(super) campaign: Table,
    /// What differs between the campaigns.
    #[serde(default)]
    pub(super) axes: Vec<AxisMessage>,
    /// Figures to compare with.
    #[serde(default)]
    pub(super) published: Vec<PublishedMessage>,
    /// What `--quick` changes.
    pub(super) quick: Option<QuickMessage>,
}

/// `seeds = 10` or `seeds = [3, 5]`.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(untagged, expecting = "a number of replicates or a list of seeds")]
pub(super) enum Seeds {
    /// Replicates with the seeds from 1.
    Replicates(u64),
    /// A replicate each.
    List(Vec<u64>),
}

/// How behaviours are counted.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BehavioursMessage {
    /// Taxonomies at the end of the search.
    pub(super) generations: Option<u32>,
    /// What stands for the taxonomies of a random search.
    pub(super) random: Option<String>,
}

/// An axis.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct AxisMessage {
    /// Its name.
    pub(super) name: String,
    /// Its values.
    pub(super) values: Vec<ValueMessage>,
}

/// A value of an axis.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ValueMessage {
    /// Its name.
    pub(super) name: String,
    /// Fields of the campaigns that have it.
    #[serde(default)]
    pub(super) campaign: Table,
    /// What `--quick` changes of these.
    #[serde(default)]
    pub(super) quick: Table,
}

/// Figures that somebody published.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PublishedMessage {
    /// Where.
    #[serde(default)]
    pub(super) source: String,
    /// The rows: the name of a value by the name of its axis.
    #[serde(default, rename = "where")]
    pub(super) rows: BTreeMap<String, String>,
    /// The figures by name.
    pub(super) figures: BTreeMap<String, f64>,
}

/// What `--quick` changes.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct QuickMessage {
    /// The replicates.
    pub(super) seeds: Option<Seeds>,
    /// How many embedders the replicates share.
    pub(super) embedders: Option<u32>,
    /// Fields of all campaigns.
    #[serde(default)]
    pub(super) campaign: Table,
}

/// What the name of a quick study ends with.
const QUICK: &str = "-quick";

impl StudyMessage {
    /// The study as it is made: with the changes of `[quick]`, or without them.
    pub(super) fn made(mut self, quick: bool) -> Result<Self, Invalid> {
        if self.name.ends_with(QUICK) {
            let allowed = format!("a name that does not end in {QUICK}, as that of a quick study does");
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
            let allowed =
                "a table that says what `--quick` changes; this study has none, so run it without `--quick`";
            return Err(Invalid::new("quick", "nothing", allowed));
        };
        self.name.push_str(QUICK);
        self.seeds = changes.seeds.clone().or(self.seeds);
        self.embedders = changes.embedders.or(self.embedders);
        Ok(self)
    }

    /// The fields of the campaigns of a row: those that all share, then those of each value, then what `--quick` changes, in
    /// the same order.
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

//! Labelled swarms that can be simulated again.

use super::{Behaviour, LabelledSet, Row};
use murmuration_files::{InputKind, read_bytes};
use murmuration_model::csv_file::{CsvError, CsvFile};
use murmuration_model::labels::LabelFileError;
use murmuration_sim::simulate::Start;
use murmuration_swarm::{Controller, World};
use std::{collections::HashMap, path::Path};

/// Columns of a start: behaviour, agent and pose.
const START: [&str; 5] = ["id", "agent", "x", "y", "theta"];

/// A labelled swarm that can be simulated again.
#[derive(Debug, Clone)]
pub struct Swarm {
    pub controller: Controller,
    pub start: Start,
    pub world: World,
}

impl LabelledSet {
    /// The swarm of each behaviour, in the file's order.
    ///
    /// The label file has a column for each gene of a controller ([`Row::controller`]). A start follows from the column `seed`,
    /// unless `starts` names a CSV file with a row for each agent of each behaviour (`id`, `agent` from 0 in order, `x`, `y`,
    /// `theta`).
    ///
    /// # Errors
    /// Names the file, and the line and column if possible, of data that is missing or cannot be simulated.
    pub fn swarms(&self, starts: Option<&Path>) -> Result<Vec<Swarm>, LabelFileError> {
        let mut poses = starts.map(read_starts).transpose()?;
        let mut start = |behaviour: &Behaviour, row: Row<'_>| match &mut poses {
            None => Ok(Start::seeded(row.seed()?)),
            Some(poses) => {
                let poses = poses.remove(&behaviour.id).unwrap_or_default();
                if poses.is_empty() {
                    return Err(row.refuse_behaviour("the id of a behaviour with a start"));
                }
                Start::at(poses).map_err(|error| row.refused(error))
            }
        };
        let swarm = |(behaviour, row)| {
            Ok(Swarm {
                controller: Row::controller(&row)?,
                start: start(behaviour, row)?,
                world: row.world()?,
            })
        };
        self.rows().map(swarm).collect()
    }

    /// The controller of each behaviour, in the file's order, read from the columns that [`LabelledSet::swarms`] reads.
    pub fn controllers(&self) -> Result<Vec<Controller>, LabelFileError> {
        self.rows().map(|(_, row)| Ok(row.controller()?)).collect()
    }
}

/// The poses of each behaviour's agents, by id.
fn read_starts(path: &Path) -> Result<HashMap<String, Vec<[f64; 3]>>, CsvError> {
    let text = read_bytes(path, InputKind::Starts).map_err(|error| CsvError::Unreadable {
        path: path.to_owned(),
        error: error.to_string(),
    })?;
    let mut starts: HashMap<String, Vec<[f64; 3]>> = HashMap::new();
    for row in CsvFile::open(path, text.as_slice(), &START)? {
        let row = row?;
        let poses = starts.entry(row.cell("id").to_owned()).or_default();
        if row.cell("agent") != poses.len().to_string() {
            return Err(row.refuse("agent", "the number of the next agent"));
        }
        poses.push([row.finite("x")?, row.finite("y")?, row.finite("theta")?]);
    }
    Ok(starts)
}

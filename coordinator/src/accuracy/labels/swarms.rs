//! The swarms that were labelled, to be simulated again.

use super::{Behaviour, Labels, Row, World};
use crate::labels::LabelFileError;
use csv::{ReaderBuilder, StringRecord};
use murmuration_proto::{Controller, Invalid};
use murmuration_worker::simulate::Start;
use std::{collections::HashMap, path::Path};

/// Columns of a start: which agent of which behaviour, and its pose.
const START: [&str; 5] = ["id", "agent", "x", "y", "theta"];

/// A labelled swarm, to be simulated again.
#[derive(Debug, Clone)]
pub struct Swarm {
    /// Its controller.
    pub controller: Controller,
    /// Where it starts.
    pub start: Start,
    /// Where it lives.
    pub world: World,
}

impl Labels {
    /// The swarm of each behaviour, in the file's order.
    ///
    /// Controllers are columns (`v1` to `v4`, or `v1` to `v8` and `theta`), and so is the `seed` of the start; or `starts` is
    /// a CSV file with a row for each agent of each behaviour (`id`, `agent` from 0 in order, `x`, `y`, `theta`).
    ///
    /// # Errors
    /// Names the file, and the line and column where there is one, of what is missing or cannot be simulated.
    pub fn swarms(&self, starts: Option<&Path>) -> Result<Vec<Swarm>, LabelFileError> {
        let mut poses = starts.map(read_starts).transpose()?;
        let mut start = |behaviour: &Behaviour, row: Row<'_>| match &mut poses {
            None => Ok(Start::seeded(row.seed()?)),
            Some(poses) => {
                let poses = poses.remove(&behaviour.id).unwrap_or_default();
                if poses.is_empty() {
                    return Err(row.refuse("id", "the id of a behaviour with a start"));
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

    /// The controller of each behaviour, in the file's order; columns as for [`Labels::swarms`].
    ///
    /// # Errors
    /// As [`Labels::swarms`].
    pub fn controllers(&self) -> Result<Vec<Controller>, LabelFileError> {
        self.rows().map(|(_, row)| row.controller()).collect()
    }
}

/// The poses of each behaviour's agents, by id.
fn read_starts(file: &Path) -> Result<HashMap<String, Vec<[f64; 3]>>, LabelFileError> {
    let refused = |error: csv::Error| LabelFileError::Unreadable {
        path: file.to_owned(),
        error: error.to_string(),
    };
    let mut reader = ReaderBuilder::new().from_path(file).map_err(refused)?;
    let columns = reader.headers().map_err(refused)?.clone();
    let mut places = [0; START.len()];
    for (place, name) in places.iter_mut().zip(START) {
        *place = columns
            .iter()
            .position(|column| column == name)
            .ok_or_else(|| LabelFileError::Column {
                path: file.to_owned(),
                column: name.to_owned(),
                problem: "there is no",
                columns: columns.iter().collect::<Vec<_>>().join(", "),
            })?;
    }
    let mut starts: HashMap<String, Vec<[f64; 3]>> = HashMap::new();
    for record in reader.into_records() {
        let record = record.map_err(refused)?;
        let poses = starts.entry(record[places[0]].to_owned()).or_default();
        if record[places[1]] != poses.len().to_string() {
            return Err(wrong(
                file,
                &record,
                places[1],
                "agent",
                "the number of the next agent",
            ));
        }
        let mut pose = [0.0; 3];
        for ((value, place), name) in pose.iter_mut().zip(&places[2..]).zip(&START[2..]) {
            let parsed = record[*place]
                .parse()
                .ok()
                .filter(|value: &f64| value.is_finite());
            *value = parsed.ok_or_else(|| wrong(file, &record, *place, name, "a finite number"))?;
        }
        poses.push(pose);
    }
    Ok(starts)
}

fn wrong(file: &Path, record: &StringRecord, place: usize, column: &str, allowed: &str) -> LabelFileError {
    let value = format!("\"{}\"", record[place].escape_debug());
    LabelFileError::Cell {
        path: file.to_owned(),
        line: record.position().map_or(0, csv::Position::line) as usize,
        error: Invalid::new(column, value, allowed),
    }
}

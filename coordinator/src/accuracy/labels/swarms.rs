//! The swarms that were labelled, to be simulated again.

use super::{Labels, LabelsError, Row};
use csv::{ReaderBuilder, StringRecord};
use murmuration_proto::{CapabilityModel, Controller, Invalid};
use murmuration_worker::simulate::Start;
use std::{collections::HashMap, path::Path};

/// Columns of wheel speeds; those of one sensor are the first four.
const SPEEDS: [&str; 8] = ["v1", "v2", "v3", "v4", "v5", "v6", "v7", "v8"];
/// Column of the second sensor's angle; a set without it is of the single-sensor model.
const ANGLE: &str = "theta";
/// Columns of a start: which agent of which behaviour, and its pose.
const START: [&str; 5] = ["id", "agent", "x", "y", "theta"];

impl Labels {
    /// The controller and the start of each behaviour, in the file's order.
    ///
    /// Controllers are columns (`v1` to `v4`, or `v1` to `v8` and `theta`); `starts` is a CSV file with a row for each
    /// agent of each behaviour (`id`, `agent` from 0 in order, `x`, `y`, `theta`).
    ///
    /// # Errors
    /// Names the file, and the line and column where there is one, of what is missing or cannot be simulated.
    pub fn swarms(&self, starts: &Path) -> Result<Vec<(Controller, Start)>, LabelsError> {
        let mut poses = read_starts(starts)?;
        let swarm = |row: &Row| {
            let poses = poses.remove(&row.id).unwrap_or_default();
            if poses.is_empty() {
                return Err(self.value(row, "id", "has no start"));
            }
            let start =
                Start::at(poses).map_err(|_| self.value(row, "id", "has a start that is not finite"))?;
            Ok((self.controller(row)?, start))
        };
        self.rows.iter().map(swarm).collect()
    }

    /// The controller of each behaviour, in the file's order; columns as for [`Labels::swarms`].
    ///
    /// # Errors
    /// As [`Labels::swarms`].
    pub fn controllers(&self) -> Result<Vec<Controller>, LabelsError> {
        self.rows.iter().map(|row| self.controller(row)).collect()
    }

    fn controller(&self, row: &Row) -> Result<Controller, LabelsError> {
        let (model, names) = match self.column(ANGLE) {
            Ok(_) => (CapabilityModel::TwoSensor, [SPEEDS.as_slice(), &[ANGLE]].concat()),
            Err(_) => (CapabilityModel::SingleSensor, SPEEDS[..4].to_vec()),
        };
        let gene = |name: &&str| {
            let value = &row.values[self.column(name)?];
            value
                .parse()
                .map_err(|_| self.value(row, name, "is not a number"))
        };
        let genes = names.iter().map(gene).collect::<Result<Vec<f64>, _>>()?;
        Controller::new(model, &genes)
            .map_err(|_: Invalid| self.value(row, names[0], "begins a controller that is out of range"))
    }
}

/// The poses of each behaviour's agents, by id.
fn read_starts(file: &Path) -> Result<HashMap<String, Vec<[f64; 3]>>, LabelsError> {
    let refused = |error| LabelsError::Csv {
        file: file.to_owned(),
        error,
    };
    let mut reader = ReaderBuilder::new().from_path(file).map_err(refused)?;
    let columns = reader.headers().map_err(refused)?.clone();
    let mut places = [0; START.len()];
    for (place, name) in places.iter_mut().zip(START) {
        *place = columns
            .iter()
            .position(|column| column == name)
            .ok_or_else(|| LabelsError::Column {
                file: file.to_owned(),
                column: name.to_owned(),
            })?;
    }
    let mut starts: HashMap<String, Vec<[f64; 3]>> = HashMap::new();
    for record in reader.into_records() {
        let record = record.map_err(refused)?;
        let poses = starts.entry(record[places[0]].to_owned()).or_default();
        if record[places[1]] != poses.len().to_string() {
            return Err(wrong(file, &record, places[1], "agent", "is not the next agent"));
        }
        let mut pose = [0.0; 3];
        for ((value, place), name) in pose.iter_mut().zip(&places[2..]).zip(&START[2..]) {
            let parsed = record[*place]
                .parse()
                .ok()
                .filter(|value: &f64| value.is_finite());
            *value = parsed.ok_or_else(|| wrong(file, &record, *place, name, "is not a finite number"))?;
        }
        poses.push(pose);
    }
    Ok(starts)
}

fn wrong(
    file: &Path,
    record: &StringRecord,
    place: usize,
    column: &str,
    problem: &'static str,
) -> LabelsError {
    LabelsError::Value {
        file: file.to_owned(),
        line: record.position().map_or(0, csv::Position::line),
        column: column.to_owned(),
        value: record[place].to_owned(),
        problem,
    }
}

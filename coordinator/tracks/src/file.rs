//! Files of tracks: CSV files with the columns frame, robot, x, y and optionally heading and species, in any order. Other columns
//! are ignored.

use crate::{MAX_GAP_FRAMES, RobotName, Sighting, TracksError};
use murmuration_model::csv_file::{ColumnNames, CsvError, CsvFile, CsvRow, is_no_value, without_zeros};
use murmuration_swarm::{CapabilityModel, Species, text::quoted};
use std::{
    collections::{BTreeMap, BTreeSet},
    fmt::Write as _,
    io::Read,
    path::{Path, PathBuf},
};

/// The columns of a file of tracks.
pub const COLUMNS: [&str; 6] = ["frame", "robot", "x", "y", "heading", "species"];

/// Maximum number of lines of a header after the names of the columns.
const MAX_HEADER_LINES: usize = 3;

/// How a file of tracks is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reading {
    /// Number of frames at the end of the film that are kept in memory; the gaps before these frames can still be interpolated.
    pub frames: u32,
    /// Robots that are seen in fewer frames are left out. `None` refuses robots that are seen in less than half of the frames.
    pub min_frames: Option<u32>,
    /// Whether headings are in degrees.
    pub degrees: bool,
}

impl Default for Reading {
    fn default() -> Self {
        Self {
            frames: u32::MAX,
            min_frames: None,
            degrees: false,
        }
    }
}

/// A file of tracks whose header has been read.
pub struct TracksFile<R>(CsvFile<R>);

impl<R: Read> TracksFile<R> {
    /// Reads the header of the file at `path`, whose bytes `reader` has. `columns` has the names of the columns in the file.
    ///
    /// # Errors
    /// If a column is missing or repeated, or `columns` names other columns than [`COLUMNS`].
    pub fn open(path: &Path, reader: R, columns: ColumnNames) -> Result<Self, TracksError> {
        columns.expect(&COLUMNS)?;
        Ok(Self(CsvFile::open_named(path, reader, &COLUMNS[..4], columns)?))
    }
}

/// The tracks of a swarm: at least one robot with at least one sighting.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracks {
    pub(crate) path: PathBuf,
    /// The robots in the order in which swarms have them.
    pub(crate) robots: Vec<Robot>,
    /// First and last frame in which a robot is seen.
    frames: [u32; 2],
    /// The robots that were left out, with the number of frames in which each is seen.
    left_out: Vec<(RobotName, u64)>,
    /// Number of lines after the header that have units or other names of columns.
    header_lines: usize,
    /// Whether robots that are seldom seen are refused.
    pub(crate) refuses_ghosts: bool,
}

/// A robot of a film.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Robot {
    pub(crate) name: RobotName,
    /// The sightings by frame: those in the kept frames, and the last one before them. At least one.
    pub(crate) sightings: BTreeMap<u32, Sighting>,
    species: Option<String>,
    /// First and last frame in which the robot is seen.
    frames: [u32; 2],
    /// Number of frames in which the robot is seen.
    seen: u64,
    /// Number of sightings with a heading.
    with_heading: u64,
    last_heading: Option<f64>,
    /// The first heading that can be no angle in radians, and the line of its row.
    strange_heading: Option<(f64, u64)>,
}

impl Robot {
    fn new(name: RobotName, frame: u32) -> Self {
        Self {
            name,
            sightings: BTreeMap::new(),
            species: None,
            frames: [frame; 2],
            seen: 0,
            with_heading: 0,
            last_heading: None,
            strange_heading: None,
        }
    }

    /// Adds the sighting of a row; false if the robot is in this frame already.
    fn add(&mut self, frame: u32, sighting: Sighting, line: u64) -> bool {
        let [first, last] = self.frames;
        self.frames = [first.min(frame), last.max(frame)];
        self.seen += 1;
        if let Some(heading) = sighting.heading {
            self.with_heading += 1;
            // Headings may go on over a turn, as those of `murmuration simulate` do; but no robot begins there, or jumps that far.
            let before = self.last_heading.replace(heading).unwrap_or_default();
            if (heading - before).abs() > 1.0001 * std::f64::consts::TAU {
                self.strange_heading.get_or_insert((heading, line));
            }
        }
        self.sightings.insert(frame, sighting).is_none()
    }

    /// Forgets the sightings before `frame`, but for the last of them.
    fn forget(&mut self, frame: u32) {
        while self
            .sightings
            .keys()
            .nth(1)
            .is_some_and(|&second| second <= frame)
        {
            self.sightings.pop_first();
        }
    }
}

impl Tracks {
    /// Reads a file.
    ///
    /// # Errors
    /// Names line and column of the first invalid cell. It is also an error if no robot is seen, if a robot is in a frame twice, if a
    /// robot has two species, or if headings cannot be radians.
    pub fn read(TracksFile(mut file): TracksFile<impl Read>, reading: Reading) -> Result<Self, TracksError> {
        let header = file.header().clone();
        let path = header.path();
        let mut robots: BTreeMap<RobotName, Robot> = BTreeMap::new();
        let kept = reading.frames.saturating_add(MAX_GAP_FRAMES + 1);
        let (mut header_lines, mut last) = (0, 0);
        while let Some(row) = file.next().transpose()? {
            if robots.is_empty() && header_lines < MAX_HEADER_LINES && is_of_header(&row) {
                header_lines += 1;
                continue;
            }
            let Some((frame, sighting)) = sighting(&row, reading.degrees)? else {
                continue;
            };
            let name = RobotName::parse(without_zeros(row.cell("robot")))
                .filter(|_| !is_no_value(row.cell("robot")));
            let name = name.ok_or_else(|| row.refuse("robot", "a whole number or a name"))?;
            let robot = robots
                .entry(name)
                .or_insert_with_key(|name| Robot::new(name.clone(), frame));
            if !robot.add(frame, sighting, row.line()) {
                let allowed = format!("a frame that robot {} is in once", robot.name);
                return Err(row.refuse("frame", &allowed).into());
            }
            set_species(robot, &row)?;
            last = last.max(frame);
            robot.forget(last.saturating_sub(kept));
        }
        let min_frames = u64::from(reading.min_frames.unwrap_or_default());
        let (robots, left_out): (Vec<_>, Vec<_>) =
            robots.into_values().partition(|robot| robot.seen >= min_frames);
        let frames = |end: usize| robots.iter().map(move |robot| robot.frames[end]);
        let Some(frames) = frames(0).min().zip(frames(1).max()) else {
            return Err(TracksError::Empty(path.to_owned()));
        };
        let strange = robots.iter().find_map(|robot| robot.strange_heading);
        match strange.filter(|_| !reading.degrees) {
            Some((heading, line)) => Err(TracksError::Headings {
                path: path.to_owned(),
                line,
                heading,
            }),
            None => Ok(Self {
                path: path.to_owned(),
                robots,
                frames: frames.into(),
                left_out: left_out
                    .into_iter()
                    .map(|robot| (robot.name, robot.seen))
                    .collect(),
                header_lines,
                refuses_ghosts: reading.min_frames.is_none(),
            }),
        }
    }

    pub fn robots(&self) -> u32 {
        u32::try_from(self.robots.len()).unwrap_or(u32::MAX)
    }

    /// Puts the robots into the order in which swarms of `model` have them: by species, then by name. Returns the number of robots
    /// of each species; `None` if the file names no species.
    ///
    /// # Errors
    /// [`TracksError::Species`] if a robot has no species, or a species that is not in the model.
    pub fn order_by_species(&mut self, model: &CapabilityModel) -> Result<Option<Vec<u32>>, TracksError> {
        if !self.names_species() {
            return Ok(None);
        }
        let mut counts = vec![0; model.species().len()];
        let mut placed = Vec::with_capacity(self.robots.len());
        for robot in &self.robots {
            let place = self.place_of_species(robot, model)?;
            counts[place] += 1;
            placed.push((place, robot.clone()));
        }
        placed.sort_by_key(|(place, _)| *place);
        self.robots = placed.into_iter().map(|(_, robot)| robot).collect();
        Ok(Some(counts))
    }

    fn place_of_species(&self, robot: &Robot, model: &CapabilityModel) -> Result<usize, TracksError> {
        let refused = |what: String| TracksError::Species {
            path: self.path.clone(),
            robot: robot.name.clone(),
            what,
        };
        let Some(name) = &robot.species else {
            return Err(refused("has no species, and others have one".to_owned()));
        };
        let known = |species: &Species| species.name().as_str() == name;
        model.species().iter().position(known).ok_or_else(|| {
            let names = model.species().iter().map(|species| species.name().as_str());
            let known = names.collect::<Vec<_>>().join(", ");
            refused(format!("is of species {}: there are {known}", quoted(name)))
        })
    }

    /// Whether the file names the species of robots.
    pub fn names_species(&self) -> bool {
        self.robots.iter().any(|robot| robot.species.is_some())
    }

    /// The first and the last frame in which the file has a robot.
    pub const fn frames(&self) -> [u32; 2] {
        self.frames
    }

    /// The robots that are left out, with the number of frames in which each is seen.
    pub fn left_out(&self) -> &[(RobotName, u64)] {
        &self.left_out
    }

    /// Number of lines after the names of the columns that belong to the header too.
    pub const fn header_lines(&self) -> usize {
        self.header_lines
    }

    /// Share of the rows that have a heading, 0 to 1.
    pub fn share_of_headings(&self) -> f64 {
        let sum = |count: fn(&Robot) -> u64| self.robots.iter().map(count).sum::<u64>() as f64;
        sum(|robot| robot.with_heading) / sum(|robot| robot.seen)
    }

    /// Number of missing rows; a complete file has a row for each robot in each frame.
    pub fn missing(&self) -> u64 {
        let [first, last] = self.frames.map(u64::from);
        let all = (last - first + 1) * self.robots.len() as u64;
        all.saturating_sub(self.robots.iter().map(|robot| robot.seen).sum())
    }

    /// The kept frames from `first` on in which a robot is seen.
    pub(crate) fn seen_frames(&self, first: u32) -> BTreeSet<u32> {
        let frames = self.robots.iter().flat_map(|robot| robot.sightings.keys());
        frames.copied().filter(|&frame| frame >= first).collect()
    }
}

/// Whether a row is one of units or names of columns, which some tools write below the header.
fn is_of_header(row: &CsvRow) -> bool {
    let numbers = COLUMNS[..4].iter().map(|column| row.cell(column));
    let is_word = |cell: &str| !is_no_value(cell) && cell.parse::<f64>().is_err();
    row.cell("frame").parse::<f64>().is_err()
        && is_word(row.cell("x"))
        && is_word(row.cell("y"))
        && numbers.count() == 4
}

/// The frame and the sighting of a row; `None` if the robot is not seen in this frame.
fn sighting(row: &CsvRow, degrees: bool) -> Result<Option<(u32, Sighting)>, CsvError> {
    let frame = row.whole("frame")?;
    if ["x", "y"].iter().all(|axis| is_no_value(row.cell(axis))) {
        return Ok(None);
    }
    let heading = match is_no_value(row.cell("heading")) {
        true => None,
        false => Some(row.finite("heading")?),
    };
    let sighting = Sighting {
        at: [row.finite("x")?, row.finite("y")?],
        heading: heading.map(|heading| if degrees { heading.to_radians() } else { heading }),
    };
    Ok(Some((frame, sighting)))
}

fn set_species(robot: &mut Robot, row: &CsvRow) -> Result<(), CsvError> {
    let name = row.cell("species");
    if is_no_value(name) {
        return Ok(());
    }
    match robot.species.get_or_insert_with(|| name.to_owned()) == name {
        true => Ok(()),
        false => {
            let allowed = format!("the one that robot {} has in other rows", robot.name);
            Err(row.refuse("species", &allowed))
        }
    }
}

/// Writes the tracks of a swarm from the poses (x, y, heading) of its robots in each frame, from frame 0 on. [`Tracks::read`]
/// reads the same numbers. `species` has the name of each robot's species; if `species` is empty, the file has no column of
/// species.
pub fn to_csv(frames: &[Vec<[f64; 3]>], species: &[&str]) -> String {
    let header = "frame,robot,x,y,heading";
    let mut text = match species {
        [] => format!("{header}\n"),
        _ => format!("{header},species\n"),
    };
    for (frame, poses) in frames.iter().enumerate() {
        for (robot, [x, y, heading]) in poses.iter().enumerate() {
            // Writing to a string cannot fail.
            let _ = match species.get(robot) {
                None => writeln!(text, "{frame},{robot},{x},{y},{heading}"),
                Some(name) => writeln!(text, "{frame},{robot},{x},{y},{heading},{name}"),
            };
        }
    }
    text
}

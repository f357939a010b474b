//! Files of tracks: CSV files with the columns frame, robot, x, y and optionally heading and species, in any order. Other columns
//! are ignored.

use crate::Sighting;
use murmuration_model::csv_file::{CsvError, CsvFile};
use murmuration_swarm::{CapabilityModel, Invalid, Species, counted, text::quoted};
use std::{
    collections::BTreeMap,
    fmt::Write as _,
    path::{Path, PathBuf},
};

/// The tracks of a swarm: at least one robot with at least one sighting.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracks {
    pub(crate) path: PathBuf,
    /// The sightings by number of the robot, then by frame; every robot has at least one sighting.
    pub(crate) robots: BTreeMap<u32, BTreeMap<u32, Sighting>>,
    /// The species of robots by their number, if the file has them.
    species: BTreeMap<u32, String>,
    frames: [u32; 2],
}

/// Why tracks cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TracksError {
    #[error(transparent)]
    File(#[from] CsvError),
    #[error("{}: there are no rows below the names of the columns", .0.display())]
    Empty(PathBuf),
    #[error("{}: the frames last less than one step, and a motion has one at least", .0.display())]
    Short(PathBuf),
    #[error(
        "{}: robot {robot} is missing from {}; only gaps of up to {} are interpolated", path.display(), missing(*frames),
        counted(u64::from(crate::MAX_GAP_FRAMES), "frame")
    )]
    Gap {
        path: PathBuf,
        /// Number of the robot.
        robot: u32,
        /// First and last missing frame.
        frames: [u32; 2],
    },
    #[error("{}: robot {robot} {what}", path.display())]
    Species {
        path: PathBuf,
        /// Number of the robot.
        robot: u32,
        what: String,
    },
    #[error(transparent)]
    Invalid(#[from] Invalid),
}

fn missing([first, last]: [u32; 2]) -> String {
    match first == last {
        true => format!("frame {first}"),
        false => format!("frames {first} to {last}"),
    }
}

impl Tracks {
    /// Parses the text of the file at `path`.
    ///
    /// # Errors
    /// Names line and column of the first invalid cell. It is also an error if there is no row, if a robot is in a frame twice,
    /// or if a robot has two species.
    pub fn parse(path: &Path, text: Vec<u8>) -> Result<Self, TracksError> {
        let file = CsvFile::open(path, text.as_slice(), &["frame", "robot", "x", "y"])?;
        let mut robots: BTreeMap<u32, BTreeMap<u32, Sighting>> = BTreeMap::new();
        let mut species: BTreeMap<u32, String> = BTreeMap::new();
        let mut frames: Option<[u32; 2]> = None;
        for row in file {
            let row = row?;
            let (frame, robot) = (row.whole("frame")?, row.whole("robot")?);
            let sighting = Sighting {
                at: [row.finite("x")?, row.finite("y")?],
                heading: match row.cell("heading") {
                    "" => None,
                    _ => Some(row.finite("heading")?),
                },
            };
            let own = robots.entry(robot).or_default();
            if own.insert(frame, sighting).is_some() {
                let allowed = format!("a frame that robot {robot} is in once");
                return Err(row.refuse("frame", &allowed).into());
            }
            let name = row.cell("species");
            if !name.is_empty() && species.entry(robot).or_insert_with(|| name.to_owned()) != name {
                return Err(row
                    .refuse(
                        "species",
                        &format!("the one that robot {robot} has in other rows"),
                    )
                    .into());
            }
            let [first, last] = frames.unwrap_or([frame; 2]);
            frames = Some([first.min(frame), last.max(frame)]);
        }
        match frames {
            Some(frames) => Ok(Self {
                path: path.to_owned(),
                robots,
                species,
                frames,
            }),
            None => Err(TracksError::Empty(path.to_owned())),
        }
    }

    pub fn robots(&self) -> u32 {
        u32::try_from(self.robots.len()).unwrap_or(u32::MAX)
    }

    /// Number of robots of each species of `model`; `None` if the file names no species.
    ///
    /// # Errors
    /// [`TracksError::Species`] if a robot has no species or a species that is not in the model, or if its number is higher than
    /// that of a robot of a later species.
    pub fn counts(&self, model: &CapabilityModel) -> Result<Option<Vec<u32>>, TracksError> {
        if self.species.is_empty() {
            return Ok(None);
        }
        let mut counts = vec![0; model.species().len()];
        let mut last = 0;
        for &robot in self.robots.keys() {
            let refused = |what: String| TracksError::Species {
                path: self.path.clone(),
                robot,
                what,
            };
            let Some(name) = self.species.get(&robot) else {
                return Err(refused("has no species, and others have one".to_owned()));
            };
            let known = |species: &Species| species.name().as_str() == name;
            let Some(place) = model.species().iter().position(known) else {
                let names: Vec<_> = model
                    .species()
                    .iter()
                    .map(|species| species.name().as_str())
                    .collect();
                let known = names.join(", ");
                return Err(refused(format!(
                    "is of species {}: there are {known}",
                    quoted(name)
                )));
            };
            if place < last {
                let what = "comes after robots of a later species: those of the first species have the lowest numbers";
                return Err(refused(what.to_owned()));
            }
            last = place;
            counts[place] += 1;
        }
        Ok(Some(counts))
    }

    /// The first and the last frame in which the file has a robot.
    pub const fn frames(&self) -> [u32; 2] {
        self.frames
    }

    /// Share of the rows that have a heading, 0 to 1.
    pub fn share_of_headings(&self) -> f64 {
        let sightings = || self.robots.values().flat_map(BTreeMap::values);
        let known = sightings().filter(|sighting| sighting.heading.is_some());
        known.count() as f64 / sightings().count() as f64
    }

    /// Number of missing rows; a complete file has a row for each robot in each frame.
    pub fn missing(&self) -> u64 {
        let [first, last] = self.frames.map(u64::from);
        let all = (last - first + 1) * self.robots.len() as u64;
        all - self.robots.values().map(|own| own.len() as u64).sum::<u64>()
    }
}

/// Writes the tracks of a swarm from the poses (x, y, heading) of its robots in each frame, from frame 0 on. [`Tracks::parse`]
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

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_swarm::CampaignSpec;

    fn parsed(text: &str) -> Result<Tracks, TracksError> {
        Tracks::parse(Path::new("t.csv"), text.as_bytes().to_vec())
    }

    #[test]
    fn columns_are_found_by_name_and_headings_may_be_missing() {
        let tracks = parsed("time,robot,y,x,frame\n0.1,7,2,1,10\n0.2,7,4,3,12\n0.1,3,6,5,10\n").unwrap();
        assert_eq!((tracks.robots(), tracks.frames()), (2, [10, 12]));
        assert_eq!(tracks.robots[&7][&12].at, [3.0, 4.0]);
        assert_eq!(tracks.share_of_headings(), 0.0);
        // Both robots miss frame 11, and robot 3 misses frame 12.
        assert_eq!(tracks.missing(), 3);
        let some = parsed("frame,robot,x,y,heading\n0,0,1,1,0.5\n1,0,1,1,\n").unwrap();
        assert_eq!(some.share_of_headings(), 0.5);
    }

    #[test]
    fn what_is_wrong_is_named_by_line_and_column() {
        let check = |text: &str, message: &str| assert_eq!(parsed(text).unwrap_err().to_string(), message);
        check(
            "frame,x,y\n1,2,3\n",
            "t.csv, line 1: there is no column \"robot\"; its columns are frame, x, y",
        );
        check(
            "frame,robot,x,y\n1,2,3,4\n1.5,2,3,4\n",
            "t.csv, line 3: frame = \"1.5\": must be a whole number from 0 to 4294967295",
        );
        check(
            "frame,robot,x,y\n1,2,3,inf\n",
            "t.csv, line 2: y = \"inf\": must be a finite number",
        );
        check(
            "frame,robot,x,y,heading\n1,2,3,4,north\n",
            "t.csv, line 2: heading = \"north\": must be a finite number",
        );
        check(
            "frame,robot,x,y\n1,2,3,4\n1,2,3,5\n",
            "t.csv, line 3: frame = \"1\": must be a frame that robot 2 is in once",
        );
        check(
            "frame,robot,x,y\n",
            "t.csv: there are no rows below the names of the columns",
        );
    }

    #[test]
    fn robots_of_each_species_are_counted() {
        let text = "ratios = [[1, 2], [2, 1]]\n[[species]]\nname = \"a\"\nmodel = \"turbopi\"\n\
                    [[species]]\nname = \"b\"\nmodel = \"turbopi\"\n";
        let (model, _) = CampaignSpec::robots_from_toml(text).unwrap();
        let frames = [vec![[0.0; 3]; 3], vec![[1.0; 3]; 3]];
        let counts = |species: &[&str]| {
            let tracks = parsed(&to_csv(&frames, species)).unwrap();
            tracks.counts(&model).map_err(|error| error.to_string())
        };
        assert_eq!(counts(&["a", "a", "b"]), Ok(Some(vec![2, 1])));
        assert_eq!(counts(&[]), Ok(None));
        let refused = |species: &[&str]| counts(species).unwrap_err();
        assert_eq!(
            refused(&["a", "c", "b"]),
            "t.csv: robot 1 is of species \"c\": there are a, b"
        );
        assert_eq!(
            refused(&["a", "", "b"]),
            "t.csv: robot 1 has no species, and others have one"
        );
        assert!(
            refused(&["b", "a", "b"]).starts_with("t.csv: robot 1 comes after robots of a later species")
        );
        let two = parsed("frame,robot,x,y,species\n0,4,1,1,a\n1,4,1,1,b\n").unwrap_err();
        assert_eq!(
            two.to_string(),
            "t.csv, line 3: species = \"b\": must be the one that robot 4 has in other rows"
        );
    }

    #[test]
    fn what_is_written_is_read_again() {
        let frames = vec![vec![[0.1, 1.0 / 3.0, -4.0]; 2], vec![[1e-7, 250.0, 1e3]; 2]];
        let tracks = parsed(&to_csv(&frames, &[])).unwrap();
        let heading = |robot: u32, frame: u32| tracks.robots[&robot][&frame].heading;
        assert_eq!(tracks.robots[&1][&0].at, [0.1, 1.0 / 3.0]);
        assert_eq!((heading(0, 1), heading(1, 0)), (Some(1e3), Some(-4.0)));
        assert_eq!(tracks.missing(), 0);
    }
}

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
    /// Number of rows that name no robot.
    nameless: u64,
    /// Number of lines after the header that have units or other names of columns.
    header_lines: usize,
    /// Whether robots that are seldom seen are refused.
    pub(crate) refuses_ghosts: bool,
    /// Whether the headings of the file were read as degrees.
    pub(crate) in_degrees: bool,
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
        }
    }

    /// Adds the sighting of a row; false if the robot is in this frame already.
    fn add(&mut self, frame: u32, sighting: Sighting) -> bool {
        let [first, last] = self.frames;
        self.frames = [first.min(frame), last.max(frame)];
        self.seen += 1;
        self.with_heading += u64::from(sighting.heading.is_some());
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
    /// Names line and column of the first invalid cell. It is also an error if no robot is seen, if a robot is in a frame twice, or if
    /// a robot has two species.
    pub fn read(TracksFile(mut file): TracksFile<impl Read>, reading: Reading) -> Result<Self, TracksError> {
        let header = file.header().clone();
        let path = header.path();
        let mut robots: BTreeMap<RobotName, Robot> = BTreeMap::new();
        let kept = reading.frames.saturating_add(MAX_GAP_FRAMES + 1);
        let (mut header_lines, mut nameless) = (0, 0);
        while let Some(row) = file.next().transpose()? {
            if robots.is_empty() && header_lines < MAX_HEADER_LINES && is_of_header(&row) {
                header_lines += 1;
                continue;
            }
            let Some((frame, sighting)) = sighting(&row, reading.degrees)? else {
                continue;
            };
            // TrackMate has spots that belong to no track.
            if is_no_value(row.cell("robot")) {
                nameless += 1;
                continue;
            }
            let name = RobotName::parse(without_zeros(row.cell("robot")));
            let name = name.ok_or_else(|| row.refuse("robot", "a whole number or a name"))?;
            let robot = robots
                .entry(name)
                .or_insert_with_key(|name| Robot::new(name.clone(), frame));
            if !robot.add(frame, sighting) {
                let allowed = format!("a frame that robot {} is in once", robot.name);
                return Err(row.refuse("frame", &allowed).into());
            }
            set_species(robot, &row)?;
            // A file may have the rows of one robot after those of another, so only the robot's own frames count.
            robot.forget(robot.frames[1].saturating_sub(kept));
        }
        let min_frames = u64::from(reading.min_frames.unwrap_or_default());
        let (robots, left_out): (Vec<_>, Vec<_>) =
            robots.into_values().partition(|robot| robot.seen >= min_frames);
        let frames = |end: usize| robots.iter().map(move |robot| robot.frames[end]);
        let Some(frames) = frames(0).min().zip(frames(1).max()) else {
            return Err(TracksError::Empty(path.to_owned()));
        };
        Ok(Self {
            path: path.to_owned(),
            robots,
            frames: frames.into(),
            left_out: left_out
                .into_iter()
                .map(|robot| (robot.name, robot.seen))
                .collect(),
            nameless,
            header_lines,
            refuses_ghosts: reading.min_frames.is_none(),
            in_degrees: reading.degrees,
        })
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
        let places = self
            .robots
            .iter()
            .map(|robot| self.place_of_species(robot, model));
        let places = places.collect::<Result<Vec<usize>, _>>()?;
        places.iter().for_each(|&place| counts[place] += 1);
        let mut placed: Vec<_> = places.into_iter().zip(std::mem::take(&mut self.robots)).collect();
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

    /// Number of rows with a position that name no robot; they are left out.
    pub const fn nameless(&self) -> u64 {
        self.nameless
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
    let is_word = |cell: &str| !is_no_value(cell) && cell.parse::<f64>().is_err();
    row.cell("frame").parse::<f64>().is_err() && is_word(row.cell("x")) && is_word(row.cell("y"))
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

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_swarm::CampaignSpec;

    fn parsed(text: &str) -> Result<Tracks, TracksError> {
        read(text, Reading::default())
    }

    fn read(text: &str, reading: Reading) -> Result<Tracks, TracksError> {
        let file = TracksFile::open(Path::new("t.csv"), text.as_bytes(), ColumnNames::default())?;
        Tracks::read(file, reading)
    }

    fn named(text: &str, columns: &str) -> Result<Tracks, TracksError> {
        let file = TracksFile::open(Path::new("t.csv"), text.as_bytes(), columns.parse()?)?;
        Tracks::read(file, Reading::default())
    }

    /// The sightings of a robot.
    fn sightings<'a>(tracks: &'a Tracks, robot: &str) -> &'a BTreeMap<u32, Sighting> {
        let named = tracks.robots.iter().find(|own| own.name.to_string() == robot);
        &named.unwrap().sightings
    }

    #[test]
    fn columns_are_found_by_name_and_headings_may_be_missing() {
        let tracks = parsed("time,robot,y,x,frame\n0.1,7,2,1,10\n0.2,7,4,3,12\n0.1,3,6,5,10\n").unwrap();
        assert_eq!((tracks.robots(), tracks.frames()), (2, [10, 12]));
        assert_eq!(sightings(&tracks, "7")[&12].at, [3.0, 4.0]);
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
        check("frame,robot,x,y\n", "t.csv: no robot is seen in it");
    }

    #[test]
    fn robots_of_each_species_are_counted() {
        let text = "ratios = [[1, 2], [2, 1]]\n[[species]]\nname = \"a\"\nmodel = \"turbopi\"\n\
                    [[species]]\nname = \"b\"\nmodel = \"turbopi\"\n";
        let (model, _) = CampaignSpec::robots_from_toml(text).unwrap();
        let frames = [vec![[0.0; 3]; 3], vec![[1.0; 3]; 3]];
        let counts = |species: &[&str]| {
            let mut tracks = parsed(&to_csv(&frames, species)).unwrap();
            let counts = tracks.order_by_species(&model).map_err(|error| error.to_string());
            counts.map(|counts| {
                (
                    counts,
                    tracks
                        .robots
                        .iter()
                        .map(|robot| robot.name.to_string())
                        .collect::<String>(),
                )
            })
        };
        assert_eq!(counts(&["a", "a", "b"]), Ok((Some(vec![2, 1]), "012".to_owned())));
        assert_eq!(counts(&["b", "a", "b"]), Ok((Some(vec![1, 2]), "102".to_owned())));
        assert_eq!(counts(&[]), Ok((None, "012".to_owned())));
        let refused = |species: &[&str]| counts(species).unwrap_err();
        assert_eq!(
            refused(&["a", "c", "b"]),
            "t.csv: robot 1 is of species \"c\": there are a, b"
        );
        assert_eq!(
            refused(&["a", "", "b"]),
            "t.csv: robot 1 has no species, and others have one"
        );
        let two = parsed("frame,robot,x,y,species\n0,4,1,1,a\n1,4,1,1,b\n").unwrap_err();
        assert_eq!(
            two.to_string(),
            "t.csv, line 3: species = \"b\": must be the one that robot 4 has in other rows"
        );
    }

    #[test]
    fn what_is_written_is_read_again() {
        let frames = vec![vec![[0.1, 1.0 / 3.0, -4.0]; 2], vec![[1e-7, 250.0, -10.0]; 2]];
        let tracks = parsed(&to_csv(&frames, &[])).unwrap();
        let heading = |robot: &str, frame: u32| sightings(&tracks, robot)[&frame].heading;
        assert_eq!(sightings(&tracks, "1")[&0].at, [0.1, 1.0 / 3.0]);
        assert_eq!((heading("0", 1), heading("1", 0)), (Some(-10.0), Some(-4.0)));
        assert_eq!(tracks.missing(), 0);
    }

    #[test]
    fn files_of_other_tools_are_read() {
        // trackpy and pandas write whole numbers as 0.0, and NaN where they have no value.
        let tracks = parsed(
            "frame,robot,x,y,heading\n0.0,7.0,1,2,nan\n1.0,7.0,NaN,NA\n2.0,7.0,3,4,\n"
                .replace("NA\n", "NA,\n")
                .as_str(),
        )
        .unwrap();
        assert_eq!(
            (tracks.frames(), tracks.missing(), tracks.share_of_headings()),
            ([0, 2], 1, 0.0)
        );
        let one = parsed("frame,robot,x,y\n0,7,1,2\n1,7,NaN,3\n").unwrap_err();
        assert_eq!(
            one.to_string(),
            "t.csv, line 3: x = \"NaN\": must be a finite number"
        );
        // SLEAP names its tracks, and has other columns.
        let sleap = "robot=track,frame=frame_idx,x=body.x,y=body.y";
        let text = "track,frame_idx,body.x,body.y,x\ntrack_10,0,1,2,9\ntrack_2,0,3,4,9\n";
        let tracks = named(text, sleap).unwrap();
        let names: Vec<String> = tracks.robots.iter().map(|robot| robot.name.to_string()).collect();
        assert_eq!(names, ["\"track_2\"", "\"track_10\""]);
        let lacking = named("track,frame_idx,x,y\n", sleap).unwrap_err().to_string();
        assert!(lacking.contains("there is no column \"body.x\""), "{lacking}");
        let refused = |columns: &str| named("frame,robot,x,y\n", columns).unwrap_err().to_string();
        let optional = refused("heading=angle");
        assert!(optional.contains("there is no column \"angle\""), "{optional}");
        let twice = refused("x=x,y=x");
        assert!(twice.contains("must be pairs with \"x\" once"), "{twice}");
        // TrackMate has spots without a track, and three more lines of names and units.
        let spots = parsed("frame,robot,x,y\n0,,1,2\n0,4,1,2\n1,None,1,2\n").unwrap();
        assert_eq!((spots.robots(), spots.nameless()), (1, 2));
        let columns = "robot=TRACK_ID,frame=FRAME,x=POSITION_X,y=POSITION_Y";
        let text = "LABEL,TRACK_ID,POSITION_X,POSITION_Y,FRAME\nLabel,Track ID,X,Y,Frame\nLabel,Track ID,X,Y,Frame\n,,(micron),(micron),\nID0,0,1,2,0\n";
        let trackmate = named(text, columns).unwrap();
        assert_eq!((trackmate.header_lines(), trackmate.robots()), (3, 1));
        let unknown = named(text, "id=robot").unwrap_err();
        assert!(
            unknown
                .to_string()
                .contains("columns = \"id\": must be names for columns among")
        );
    }

    #[test]
    fn headings_may_be_in_degrees() {
        let degrees = Reading {
            degrees: true,
            ..Reading::default()
        };
        let tracks = read("frame,robot,x,y,heading\n0,0,1,1,0.1\n1,0,1,1,180\n", degrees).unwrap();
        assert_eq!(sightings(&tracks, "0")[&1].heading, Some(std::f64::consts::PI));
    }

    #[test]
    fn only_the_end_of_a_film_is_kept() {
        let rows: String = (0..1000)
            .map(|frame| format!("{frame},0,{frame},1\n{frame},1,{frame},2\n"))
            .collect();
        let text = format!("frame,robot,x,y\n{rows}2000,0,1,1\n");
        let tracks = read(
            &text,
            Reading {
                frames: 100,
                ..Reading::default()
            },
        )
        .unwrap();
        // The last sighting of each robot before the kept frames shows how long its gap is.
        assert_eq!(
            sightings(&tracks, "0").keys().copied().collect::<Vec<_>>(),
            [999, 2000]
        );
        assert_eq!(tracks.missing(), 2 * 2001 - 2001);
        let tracks = read(
            &format!("frame,robot,x,y\n{rows}"),
            Reading {
                frames: 100,
                ..Reading::default()
            },
        )
        .unwrap();
        assert_eq!(
            sightings(&tracks, "1").keys().copied().collect::<Vec<_>>(),
            (873..1000).collect::<Vec<_>>()
        );
    }

    #[test]
    fn robots_that_are_seldom_seen_can_be_left_out() {
        let rows: String = (0..50).map(|frame| format!("{frame},0,1,1\n")).collect();
        let text = format!("frame,robot,x,y\n{rows}20,1,2,2\n21,1,2,2\n");
        let tracks = read(
            &text,
            Reading {
                min_frames: Some(3),
                ..Reading::default()
            },
        )
        .unwrap();
        assert_eq!(
            (tracks.robots(), tracks.left_out().len(), tracks.left_out()[0].1),
            (1, 1, 2)
        );
        let none = read(
            &text,
            Reading {
                min_frames: Some(51),
                ..Reading::default()
            },
        )
        .unwrap_err();
        assert_eq!(none.to_string(), "t.csv: no robot is seen in it");
    }
}

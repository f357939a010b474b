//! Tests `murmuration recognise`: it recognises swarms that the simulator films, even with jitter and dropped frames.

use murmuration_swarm::{Purpose, RandomStream};
use murmuration_tests::{Murmuration, small_latent_spec, whole_number};
use rand::RngExt as _;
use serde_json::Value;
use std::{fs, path::PathBuf};
use tempfile::TempDir;

/// Largest error of the camera along each axis, world units; robots have a radius of 5.
const JITTER: f64 = 0.3;

/// A completed campaign, whose individuals the test films.
struct Studio {
    folder: TempDir,
    murmuration: Murmuration,
    spec: String,
}

impl Studio {
    fn open() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let spec = folder.path().join("small.toml").display().to_string();
        fs::write(&spec, small_latent_spec("").to_toml()).unwrap();
        let murmuration = Murmuration::over(&folder.path().join("data"));
        let run = murmuration.run(&["run", &spec]);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        Self {
            folder,
            murmuration,
            spec,
        }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// An individual, and its film.
    fn film(&self, index: u64) -> (Value, String) {
        let shown = self
            .murmuration
            .run(&["show", "small-1", "--index", &index.to_string(), "--json"]);
        let individual = shown.last_line();
        let controller = individual["controller"].to_string();
        let seed = whole_number(&individual["seed"]);
        let tracks = self.path("tracks.csv").display().to_string();
        let filmed = self.murmuration.run(&[
            "simulate",
            "--controller",
            &controller,
            "--seed",
            &seed,
            "--spec",
            &self.spec,
            "--force",
            "--tracks",
            &tracks,
        ]);
        assert_eq!(filmed.code, Some(0), "{}", filmed.stderr);
        (individual, fs::read_to_string(tracks).unwrap())
    }

    /// The result of recognising a film.
    fn recognise(&self, film: &str, more: &[&str]) -> Value {
        let path = self.path("film.csv");
        fs::write(&path, film).unwrap();
        let path = path.display().to_string();
        let arguments = [&["recognise", &path, "--json"], more].concat();
        self.murmuration.run(&arguments).last_line()
    }
}

/// The film as a worse camera records it: without headings, without a fifth of the rows and every ninth frame, and with an error
/// in each position.
fn worse(film: &str) -> String {
    let mut dice = RandomStream::derive(3, Purpose::Jitter, 0);
    let mut text = "frame,robot,x,y\n".to_owned();
    for row in film.lines().skip(1) {
        let cells: Vec<&str> = row.split(',').collect();
        let frame: u32 = cells[0].parse().unwrap();
        let mut off = |cell: &str| cell.parse::<f64>().unwrap() + dice.random_range(-JITTER..JITTER);
        let [x, y] = [cells[2], cells[3]].map(&mut off);
        if !frame.is_multiple_of(9) && !dice.random_bool(0.2) {
            text += &format!("{frame},{},{x:.2},{y:.2}\n", cells[1]);
        }
    }
    text
}

#[test]
fn a_filmed_individual_is_recognised_as_itself_and_through_a_bad_camera_as_one_like_it() {
    let studio = Studio::open();
    let mut found = 0;
    for index in (0..100).step_by(11) {
        let (individual, film) = studio.film(index);
        let exact = studio.recognise(&film, &[]);
        for field in ["features", "embedding", "image"] {
            assert_eq!(exact[field], individual[field], "{field} of individual {index}");
        }
        assert_eq!(exact["missing"], 0);
        assert_eq!(exact["neighbours"][0]["distance"], 0.0, "{}", exact["neighbours"]);
        let bad = studio.recognise(&worse(&film), &[]);
        assert_eq!(bad["share_of_headings"], 0.0);
        assert!(bad["missing"].as_u64().unwrap() > 1000, "{}", bad["missing"]);
        let nearest = bad["neighbours"].as_array().unwrap();
        found += u32::from(nearest.iter().any(|near| near["index"] == index));
    }
    assert!(found >= 8, "only {found} of 10 are among the 5 nearest");
}

#[test]
fn a_film_of_another_pace_in_other_units_shows_the_same() {
    let studio = Studio::open();
    let (individual, film) = studio.film(40);
    let rows = film.lines().skip(1).map(|row| {
        let cells: Vec<&str> = row.split(',').collect();
        let metres = |cell: &str| cell.parse::<f64>().unwrap() / 250.0;
        let frame = cells[0].parse::<u32>().unwrap();
        // The film has two frames for each step, and every second frame is missing.
        format!(
            "{},{},{},{},{}\n",
            2 * frame,
            cells[1],
            metres(cells[2]),
            metres(cells[3]),
            cells[4]
        )
    });
    let metres = format!("frame,robot,x,y,heading\n{}", rows.collect::<String>());
    let png = studio.path("row.png").display().to_string();
    let options = [
        "--frame-time",
        "0.5",
        "--arena",
        "2x2",
        "--count",
        "3",
        "--png",
        &png,
    ];
    let found = studio.recognise(&metres, &options);
    assert_eq!(
        (&found["scale"], &found["frame_time"]),
        (&250.0.into(), &0.5.into())
    );
    assert_eq!(found["image"], individual["image"]);
    assert_eq!(found["neighbours"][0]["index"], 40);
    assert_eq!(found["neighbours"].as_array().unwrap().len(), 3);
    let file = fs::File::open(&png).unwrap();
    let picture = png::Decoder::new(std::io::BufReader::new(file))
        .read_info()
        .unwrap();
    // The image has four pictures of 50 x 50 cells of 8 pixels, and three lines between them.
    assert_eq!(
        (picture.info().width, picture.info().height),
        (4 * 400 + 3 * 8, 400)
    );
}

/// A row of a film: frame, robot, x, y and heading.
type FilmRow<'a> = [&'a str; 5];

/// The film in another form: `head`, and each row as `written` writes it.
fn rewritten(film: &str, head: &str, written: impl Fn(FilmRow<'_>) -> String) -> String {
    let rows = film.lines().skip(1).map(|row| {
        let cells: Vec<&str> = row.split(',').collect();
        written([cells[0], cells[1], cells[2], cells[3], cells[4]])
    });
    format!("{head}\n{}\n", rows.collect::<Vec<_>>().join("\n"))
}

fn number(cell: &str) -> f64 {
    cell.parse().unwrap()
}

/// The film with the rows of each robot together, as a spreadsheet saves it.
fn by_robot(film: &str) -> String {
    let (head, rows) = film.split_once('\n').unwrap();
    let mut rows: Vec<&str> = rows.lines().collect();
    rows.sort_by_key(|row| row.split(',').nth(1).unwrap().to_owned());
    format!("\u{feff}{head}\r\n{}\r\n", rows.join("\r\n"))
}

/// The film with the names of robots 3 and 5 exchanged from frame 100 on.
fn exchanged(film: &str) -> String {
    let head = film.lines().next().unwrap();
    rewritten(film, head, |[frame, robot, x, y, heading]| {
        let robot = match robot {
            "3" if number(frame) >= 100.0 => "5",
            "5" if number(frame) >= 100.0 => "3",
            robot => robot,
        };
        format!("{frame},{robot},{x},{y},{heading}")
    })
}

/// The frames of the film from 30 on, the last first, with headings that went on over five turns.
fn ending(film: &str) -> String {
    let turns = 5.0 * std::f64::consts::TAU;
    let more = rewritten(film, "", |[frame, robot, x, y, heading]| {
        format!("{frame},{robot},{x},{y},{}", number(heading) + turns)
    });
    let rows = more.lines().filter(|row| !row.is_empty());
    let mut rows: Vec<&str> = rows
        .filter(|row| number(row.split(',').next().unwrap()) >= 30.0)
        .collect();
    rows.reverse();
    format!("frame,robot,x,y,heading\n{}\n", rows.join("\n"))
}

/// Each form of a film that a person must be able to use, with the options for it.
fn readable(film: &str) -> Vec<(&'static str, String, Vec<&'static str>)> {
    let plain = "frame,robot,x,y,heading";
    vec![
        (
            "SLEAP",
            rewritten(
                film,
                "track,frame_idx,body.x,body.y,body.score,angle",
                |[frame, robot, x, y, heading]| format!("track_{robot},{frame},{x},{y},0.9,{heading}"),
            ),
            vec![
                "--columns",
                "frame=frame_idx,robot=track,x=body.x,y=body.y,heading=angle",
            ],
        ),
        (
            "TrackMate",
            rewritten(
                film,
                "LABEL,TRACK_ID,POSITION_X,POSITION_Y,FRAME,A\nLabel,Track ID,X,Y,Frame,A\nLabel,Track ID,X,Y,Frame,A\n,,(micron),(micron),,(rad)",
                |[frame, robot, x, y, heading]| format!("ID{robot},{robot},{x},{y},{frame},{heading}"),
            ),
            vec![
                "--columns",
                "frame=FRAME,robot=TRACK_ID,x=POSITION_X,y=POSITION_Y,heading=A",
            ],
        ),
        (
            "trackpy, with CR as the end of lines",
            rewritten(film, plain, |[frame, robot, x, y, heading]| {
                format!("{frame}.0,{robot}.0,{x},{y},{heading}")
            })
            .replace('\n', "\r"),
            vec![],
        ),
        (
            "y up, with the origin in the middle",
            rewritten(film, plain, |[frame, robot, x, y, heading]| {
                format!(
                    "{frame},{robot},{},{},{}",
                    number(x) - 250.0,
                    250.0 - number(y),
                    -number(heading)
                )
            }),
            vec!["--origin", "centre", "--y", "up"],
        ),
        (
            "degrees, at 25 frames a second",
            rewritten(film, plain, |[frame, robot, x, y, heading]| {
                format!("{frame},{robot},{x},{y},{}", number(heading).to_degrees())
            }),
            vec!["--degrees", "--fps", "1"],
        ),
        (
            "ARGoS, in metres",
            rewritten(film, "tick,id,x,y,yaw", |[frame, robot, x, y, heading]| {
                let [x, y] = [number(x) / 250.0 - 1.0, 1.0 - number(y) / 250.0];
                format!("{frame},foot-bot{robot},{x},{y},{}", -number(heading))
            }),
            vec![
                "--columns",
                "frame=tick,robot=id,heading=yaw",
                "--arena",
                "2x2",
                "--origin",
                "centre",
                "--y",
                "up",
            ],
        ),
        ("robot by robot, saved by a spreadsheet", by_robot(film), vec![]),
        ("two names exchanged", exchanged(film), vec![]),
        ("its end, with headings of many turns", ending(film), vec![]),
        (
            "a ghost",
            format!("{film}150,ghost,1,1,0\n151,ghost,1,1,0\n"),
            vec!["--min-frames", "3"],
        ),
    ]
}

#[test]
fn films_of_other_tools_are_read_with_their_options() {
    let studio = Studio::open();
    let (_, film) = studio.film(40);
    for (tool, film, options) in readable(&film) {
        let found = studio.recognise(&film, &options);
        let nearest = &found["neighbours"][0];
        assert_eq!(nearest["index"], 40, "{tool}: {found}");
        let distance = nearest["distance"].as_f64().unwrap();
        assert!(distance < 1e-3, "{tool}: {distance}");
    }
}

#[test]
fn films_that_cannot_be_meant_are_refused_with_the_option_that_mends_them() {
    let studio = Studio::open();
    let (_, film) = studio.film(40);
    let plain = "frame,robot,x,y,heading";
    let moved = |by: f64| {
        rewritten(&film, plain, |[frame, robot, x, y, heading]| {
            format!("{frame},{robot},{},{y},{heading}", number(x) + by)
        })
    };
    let metres = rewritten(&film, plain, |[frame, robot, x, y, heading]| {
        format!(
            "{frame},{robot},{},{},{heading}",
            number(x) / 250.0,
            number(y) / 250.0
        )
    });
    let degrees = rewritten(&film, plain, |[frame, robot, x, y, heading]| {
        format!("{frame},{robot},{x},{y},{}", number(heading).to_degrees())
    });
    let one_missing = rewritten(&film, plain, |[frame, robot, x, y, heading]| {
        match [frame, robot] {
            ["100", "7"] => format!("100,7,NaN,{y},{heading}"),
            _ => format!("{frame},{robot},{x},{y},{heading}"),
        }
    });
    let zeros = rewritten(&film, plain, |[frame, robot, x, y, heading]| {
        match number(frame) as u64 % 30 {
            0 => format!("{frame},{robot},0,0,{heading}"),
            _ => format!("{frame},{robot},{x},{y},{heading}"),
        }
    });
    for (film, expected) in [
        (moved(600.0), "0 % of the positions are inside the walls"),
        (moved(-250.0), "--origin centre"),
        (metres, "--arena WIDTHxHEIGHT"),
        (degrees, "--degrees"),
        (
            format!("{film}150,ghost,1,1,0\n151,ghost,1,1,0\n"),
            "is seen in only 2 of",
        ),
        (
            film.replace("frame,robot", "frame_idx,track"),
            "--columns frame=NAME",
        ),
        (one_missing, "x = \"NaN\": must be a finite number"),
        (zeros, "farther than it can, as in "),
    ] {
        let path = studio.path("film.csv");
        fs::write(&path, film).unwrap();
        let refused = studio
            .murmuration
            .run(&["recognise", &path.display().to_string()]);
        assert!(
            refused.code == Some(2) && refused.stderr.contains(expected),
            "{expected}: {}",
            refused.stderr
        );
    }
}

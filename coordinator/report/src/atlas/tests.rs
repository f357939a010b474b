//! Tests that the files of an atlas agree with each other and with the judge's verdicts.

use super::*;
use crate::picture::sample::decode_png;
use murmuration_files::Replaces;
use murmuration_model::colours;
use murmuration_swarm::{Class, Enumeration, PictureShape};
use std::fs;

const SPEC: &str = "model = \"single-sensor\"\nmethod = \"exhaustive\"\n[controllers]\nstep = 0.5\n[evaluation]\nstarts = 3\n";

/// An atlas with controllers of all classes; some controllers have a more certain class than others.
fn atlas() -> Atlas {
    let spec = CampaignSpec::from_toml(SPEC).unwrap();
    let all = Enumeration::of(spec.controllers(), spec.world()).unwrap();
    let verdicts: Vec<Verdict> = Verdict::of_one_species().collect();
    let entry = |index: u64| {
        let place = index as usize;
        let message = [place, place, place + place % 4].map(|place| verdicts[place % verdicts.len()]);
        AtlasEntry {
            controller: all.controller(index),
            seed: index,
            verdicts: message.to_vec(),
            features: [0.5, -1.0, 0.0, index as f64, 1e-3],
            score: 4.5,
        }
    };
    Atlas {
        campaign: "single-sensor-1".to_owned(),
        digest: "d".repeat(64),
        entries: (0..all.len()).map(entry).collect(),
        spec: spec.clone(),
    }
}

fn written(atlas: &Atlas) -> (tempfile::TempDir, ReportFiles) {
    let place = tempfile::tempdir().unwrap();
    let files = write(
        atlas,
        folder(&place.path().join("atlas"), Replaces::Unchanged).unwrap(),
    )
    .unwrap();
    (place, files)
}

/// The rows of the table `atlas.csv`; each row has its cells by the name of their column.
fn rows(files: &ReportFiles) -> Vec<std::collections::BTreeMap<String, String>> {
    let path = files.page.with_file_name("atlas.csv");
    let mut table = csv::Reader::from_path(path).unwrap();
    let head = table.headers().unwrap().clone();
    let row = |row: csv::StringRecord| {
        let cells = head.iter().zip(row.iter());
        cells
            .map(|(name, cell)| (name.to_owned(), cell.to_owned()))
            .collect()
    };
    table.records().map(|record| row(record.unwrap())).collect()
}

#[test]
fn the_pixel_of_a_controller_and_of_its_mirror_image_is_of_the_class_in_its_row() {
    let atlas = atlas();
    let (_place, files) = written(&atlas);
    let layout = Layout::of(&atlas.spec).unwrap();
    let png = fs::read(files.page.with_file_name("atlas.png")).unwrap();
    let (width, height, pixels) = decode_png(&png);
    assert_eq!((width, height), (25, 25));
    let rows = rows(&files);
    assert_eq!(rows.len(), 325);
    let mut painted = 0;
    for row in rows {
        let genes: Vec<f64> = ["left_0", "right_0", "left_1", "right_1"]
            .iter()
            .map(|gene| row[*gene].parse().unwrap())
            .collect();
        let class = Class::ALL
            .into_iter()
            .find(|class| class.name() == row["class"])
            .unwrap();
        let sureness: f64 = row["sureness"].parse().unwrap();
        let expected = colours::over(
            colours::class_colour(class),
            (sureness * 255.0).round() as u8,
            [0; 3],
        );
        let mirrored = [genes[1], genes[0], genes[3], genes[2]];
        for genes in [genes.as_slice(), &mirrored] {
            let controller = atlas.spec.controllers().controller(genes);
            let [x, y] = layout.pixel(&controller).unwrap();
            assert_eq!(pixels[3 * (25 * y + x)..][..3], expected, "{genes:?}");
            painted += 1;
        }
    }
    // `painted` counts the 25 controllers that are their own mirror images twice.
    assert_eq!(painted, 625 + 25);
}

#[test]
fn the_first_speed_of_a_pair_goes_right_and_the_second_up() {
    let atlas = atlas();
    let layout = Layout::of(&atlas.spec).unwrap();
    let pixel = |genes: [f64; 4]| {
        layout
            .pixel(&atlas.spec.controllers().controller(&genes))
            .unwrap()
    };
    assert_eq!((layout.values(), layout.side()), (5, 25));
    assert_eq!(pixel([-1.0, -1.0, -1.0, -1.0]), [0, 24]);
    assert_eq!(pixel([1.0, -1.0, -1.0, -1.0]), [20, 24]);
    assert_eq!(pixel([-1.0, 1.0, -1.0, -1.0]), [0, 4]);
    assert_eq!(pixel([-1.0, -1.0, 1.0, 0.5]), [4, 21]);
    assert_eq!(
        layout.pixel(&atlas.spec.controllers().controller(&[0.1, 0.0, 0.0, 0.0])),
        None
    );
}

#[test]
fn shares_come_to_one_and_every_column_is_explained() {
    let (_place, files) = written(&atlas());
    let readme = fs::read_to_string(files.page.with_file_name("README.md")).unwrap();
    for row in rows(&files) {
        let shares = row.iter().filter(|(column, _)| column.starts_with("share_"));
        let sum: f64 = shares.map(|(_, share)| share.parse::<f64>().unwrap()).sum();
        assert!((sum - 1.0).abs() < 1e-12);
        for column in row.keys() {
            let is_class = Class::ALL.iter().any(|class| *column == format!("share_{class}"));
            assert!(is_class || readme.contains(&format!("`{column}`")), "{column}");
        }
    }
}

#[test]
fn a_tally_is_the_most_frequent_class_and_of_several_that_of_the_earliest_trial() {
    let of = |verdicts: &[i32]| {
        let verdicts: Vec<_> = verdicts
            .iter()
            .map(|&verdict| Verdict::try_from(verdict).unwrap())
            .collect();
        Tally::of(&verdicts)
    };
    assert_eq!(
        (of(&[1, 2, 2]).class, of(&[1, 2, 2]).share),
        (Class::Milling, 2.0 / 3.0)
    );
    assert_eq!(of(&[2, 1, 1, 2]).class, Class::Milling);
    // A behaviour of the class `random` with a pattern still counts as random.
    assert_eq!(
        (of(&[9, 2, 10]).class, of(&[9, 2, 10]).share),
        (Class::Random, 2.0 / 3.0)
    );
    let sureness = of(&[2, 2]).sureness();
    assert_eq!(sureness, precision(Class::Milling));
}

#[test]
fn what_has_no_picture_has_a_table() {
    let text = "model = \"two-sensor\"\nmethod = \"exhaustive\"\n[search]\npopulation = 4\ngenerations = 3\n[taxonomy]\nmedoids = 3";
    let spec = CampaignSpec::from_toml(text).unwrap();
    let controller = spec.controllers().controller(&[
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        std::f64::consts::FRAC_PI_2,
    ]);
    let entry = AtlasEntry {
        controller,
        verdicts: vec![Verdict::Class(Class::Dispersal)],
        ..atlas().entries.swap_remove(0)
    };
    let (_place, files) = written(&Atlas {
        spec,
        entries: vec![entry],
        ..atlas()
    });
    assert!(files.page.ends_with("atlas.csv"));
    assert_eq!(rows(&files).len(), 1);
    assert!(!files.page.with_file_name("atlas.png").exists());
}

#[test]
fn a_tile_has_the_pictures_of_its_controllers_where_the_map_has_their_pixels() {
    let atlas = atlas();
    let layout = Layout::of(&atlas.spec).unwrap();
    let place = tempfile::tempdir().unwrap();
    let mut files = folder(place.path(), Replaces::Unchanged).unwrap();
    let mut tiles = Tiles::new(layout.clone(), PictureShape::new(1, 2).unwrap());
    for (index, entry) in atlas.entries.iter().enumerate() {
        // The four pixels of the picture: the index above 1 in the left column, and 2 above 3 in the right column.
        tiles
            .add(&mut files, &entry.controller, &[index as u8, 1, 2, 3])
            .unwrap();
    }
    assert!(
        tiles
            .add(&mut files, &atlas.entries[0].controller, &[0; 5])
            .is_err()
    );
    tiles.finish(&mut files).unwrap();
    write(&atlas, files).unwrap();
    let entry = &atlas.entries[200];
    let [x, y] = layout.pixel(&entry.controller).unwrap();
    let tile = format!("pictures/tile-{}-{}.png", x / 5, y / 5);
    let (width, _, pixels) = decode_png(&fs::read(place.path().join(tile)).unwrap());
    assert_eq!(width, 10);
    let corner = y % 5 * 2 * 10 + x % 5 * 2;
    assert_eq!(
        [
            pixels[corner],
            pixels[corner + 1],
            pixels[corner + 10],
            pixels[corner + 11]
        ],
        [200, 2, 1, 3]
    );
}

#[test]
fn the_page_holds_the_map_and_loads_nothing_from_elsewhere() {
    let atlas = atlas();
    let (_place, files) = written(&atlas);
    let page = fs::read_to_string(&files.page).unwrap();
    assert!(
        page.contains("data:image/png;base64,") && !page.contains("http://") && !page.contains("https://")
    );
    let poster = fs::read_to_string(files.page.with_file_name("atlas-poster.svg")).unwrap();
    assert!(poster.contains("cyclic pursuit") && poster.contains("625 controllers, 325 of them simulated"));
    assert_eq!(
        CampaignSpec::from_toml(&fs::read_to_string(files.page.with_file_name("spec.toml")).unwrap())
            .unwrap(),
        atlas.spec
    );
}

#[test]
fn the_poster_as_png_has_the_map_and_the_legend() {
    let (_place, files) = written(&atlas());
    let read = |name: &str| decode_png(&fs::read(files.page.with_file_name(name)).unwrap());
    let (width, height, pixels) = read("atlas-poster.png");
    assert_eq!((width, height), (3726, 3066));
    let at = |x: usize, y: usize| &pixels[3 * (2 * y * 3726 + 2 * x)..][..3];
    let (_, _, map) = read("atlas.png");
    assert_eq!(at(110 + 10, 120 + 10), &map[..3]);
    let first_of_legend = at(110 + 1323 + 34 + 15, 120 + 20 + 15);
    let is_class = Class::ALL
        .map(colours::class_colour)
        .iter()
        .any(|colour| colour == first_of_legend);
    assert!(is_class, "{first_of_legend:?}");
    // The name of the class stands to the right of the dot in the legend.
    let words = (0..300).map(|x| at(110 + 1323 + 78 + x, 120 + 28));
    assert!(
        words
            .filter(|pixel| pixel.iter().all(|&value| value < 90))
            .count()
            > 10
    );
}

#[test]
fn an_atlas_replaces_the_former_one_and_no_file_of_its_owner() {
    let (place, _) = written(&atlas());
    let path = place.path().join("atlas");
    let few = Atlas {
        spec: CampaignSpec::from_toml(
            "model = \"single-sensor\"\nmethod = \"random\"\n[evaluation]\njudge = true",
        )
        .unwrap(),
        entries: atlas().entries[..10].to_vec(),
        ..atlas()
    };
    write(&few, folder(&path, Replaces::Unchanged).unwrap()).unwrap();
    assert!(path.join("atlas.csv").is_file() && !path.join("atlas.html").exists());
    // In a folder without an atlas, a file with the name of an atlas's file belongs to the user.
    fs::write(place.path().join("README.md"), "mine").unwrap();
    let refused = folder(place.path(), Replaces::Changed).unwrap_err().to_string();
    assert!(refused.contains("did not write README.md"), "{refused}");
}

//! What a written report holds, read back from the files.

use super::{
    sample::{SMALL, Sample},
    *,
};
use crate::picture::sample::decode_png;
use murmuration_proto::CapabilityModel;
use std::fs;

fn written(report: &Report) -> (tempfile::TempDir, ReportFiles) {
    let place = tempfile::tempdir().unwrap();
    let files = write(report, &place.path().join("new/report")).unwrap();
    (place, files)
}

fn page(report: &Report) -> String {
    let (_place, files) = written(report);
    fs::read_to_string(files.page).unwrap()
}

#[test]
fn every_file_is_there_and_can_be_read() {
    let report = sample::report(&SMALL);
    let (_place, files) = written(&report);
    let folder = files.page.parent().unwrap();
    let names: Vec<_> = files
        .others
        .iter()
        .map(|path| path.strip_prefix(folder).unwrap().to_str().unwrap())
        .collect();
    assert_eq!(
        names,
        [
            "spec.toml",
            "archive.csv",
            "taxonomy.csv",
            "classes.csv",
            "generations.csv",
            "novelty.svg",
            "map.svg",
            "medoids/01-image.png",
            "medoids/01-trajectory.png",
            "medoids/02-image.png",
            "medoids/02-trajectory.png",
            "medoids/03-image.png",
            "medoids/03-trajectory.png",
        ]
    );
    let read = |name: &str| fs::read(folder.join(name)).unwrap();
    assert_eq!(decode_png(&read("medoids/03-image.png")).0, 400);
    assert_eq!(decode_png(&read("medoids/03-trajectory.png")).0, 1000);
    let spec = String::from_utf8(read("spec.toml")).unwrap();
    assert_eq!(CampaignSpec::from_toml(&spec).unwrap(), report.spec);
    assert_eq!(fs::read_dir(folder).unwrap().count(), 9, "nothing else is left");
    write(&report, folder).unwrap();
}

#[test]
fn the_page_needs_nothing_from_anywhere() {
    let page = page(&sample::report(&SMALL));
    let own_words = page.replace("http://www.w3.org/2000/svg", "");
    for foreign in ["http://", "https://", "src=\"/", "@import", "url("] {
        assert!(!own_words.contains(foreign), "{foreign}");
    }
    assert!(page.contains("default-src 'none'"));
}

#[test]
fn a_page_speaks_of_the_files_beside_it_where_there_are_any() {
    let report = sample::report(&SMALL);
    let (_place, files) = written(&report);
    let beside = fs::read_to_string(&files.page).unwrap();
    let words = beside.split(|c: char| !(c.is_alphanumeric() || "._-".contains(c)));
    let named: std::collections::BTreeSet<_> = words
        .filter(|word| [".csv", ".svg", ".toml"].iter().any(|kind| word.ends_with(kind)))
        .collect();
    assert_eq!(named.len(), 4, "{named:?}");
    for name in named {
        assert!(files.page.with_file_name(name).exists(), "{name}");
    }
    assert_eq!(beside.matches("beside this page").count(), 3);

    let alone = super::page(&report).unwrap();
    assert!(!alone.contains("beside this page"));
    assert!(alone.contains("<code>murmuration report sample-1</code> writes"));
    assert!(alone.contains("Saved as spec.toml, the text below"));
}

#[test]
fn what_comes_from_data_is_escaped() {
    let hostile = "</script><script>alert(1)</script>\"'&<img src=x>";
    let mut report = sample::report(&SMALL);
    report.campaign = hostile.into();
    let name: crate::labels::ClassName = hostile.parse().unwrap();
    report.names.classes[0].name = name.clone();
    report.names.by_individual.insert(1, name);
    report.digest = hostile.into();
    report.simulator_version = hostile.into();
    report.map.axis_titles = [hostile.into(), hostile.into()];
    let (place, files) = written(&report);
    let svg = fs::read_to_string(files.page.with_file_name("map.svg")).unwrap();
    let page = fs::read_to_string(files.page).unwrap();
    drop(place);
    assert!(!page.contains("alert(1)</script>") && !page.contains("<img src=x"));
    assert!(page.contains("&lt;/script&gt;&lt;script&gt;alert(1)"));
    assert!(!svg.contains("<script") && svg.contains("alert(1)"));
    let data = page
        .split("type=\"application/json\">")
        .nth(1)
        .unwrap()
        .split("</script>")
        .next()
        .unwrap();
    assert!(serde_json::from_str::<serde_json::Value>(data).is_ok());
}

#[test]
fn the_page_bears_the_names_that_people_gave_and_their_colours() {
    let mut report = sample::report(&SMALL);
    let named = page(&report);
    assert!(
        named.contains("<span class=\"class\" style=\"--class:#1d96e6\">ring, or &quot;mill&quot;</span>")
    );
    assert!(named.contains("wall · 0") && named.contains("Behaviour 2") && !named.contains(">Behaviour 1<"));
    report.names = Names::default();
    let nameless = page(&report);
    assert!(nameless.contains("Behaviour 1") && !nameless.contains("What people called them"));
}

#[test]
fn tables_hold_every_number_exactly() {
    let report = sample::report(&SMALL);
    let (_place, files) = written(&report);
    let table = |name: &str| -> Vec<Vec<String>> {
        let text = fs::read_to_string(files.page.with_file_name(name)).unwrap();
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .from_reader(text.as_bytes());
        reader
            .records()
            .map(|record| record.unwrap().iter().map(str::to_owned).collect())
            .collect()
    };
    let archive = table("archive.csv");
    assert_eq!(archive.len(), 1 + report.individuals.len());
    assert_eq!(archive[0][12..].join(","), "vl0,vr0,vl1,vr1,class");
    for (index, (row, entry)) in archive[1..].iter().zip(&report.individuals).enumerate() {
        let expected = [index as f64, f64::from(report.clusters[index] + 1)]
            .into_iter()
            .chain(report.map.points[index])
            .chain([
                f64::from(entry.generation),
                entry.seed as f64,
                entry.novelty_when_evaluated,
            ])
            .chain(entry.features)
            .chain(entry.controller.genes().iter().copied());
        assert_eq!(
            row[..row.len() - 1]
                .iter()
                .map(|cell| cell.parse().unwrap())
                .collect::<Vec<f64>>(),
            expected.collect::<Vec<_>>()
        );
        let named = [0, 5, 7].contains(&index);
        assert_eq!(row.last().unwrap(), if named { "ring, or \"mill\"" } else { "" });
    }
    let taxonomy = table("taxonomy.csv");
    assert_eq!(taxonomy.len(), 4);
    assert_eq!(
        taxonomy[2][3].parse::<f64>().unwrap(),
        report.medoids[1].mean_distance
    );
    assert_eq!(taxonomy[2][4].parse::<f64>().unwrap(), report.medoids[1].novelty);
    assert_eq!(taxonomy[2][6].parse::<u64>().unwrap(), report.individuals[1].seed);
    assert_eq!(taxonomy[1].last().unwrap(), "ring, or \"mill\"");
    assert_eq!(
        table("classes.csv")[1..],
        [
            ["ring, or \"mill\"", "#1d96e6", "3", "4"],
            ["wall", "#e6861d", "0", "0"]
        ]
    );
    let generations = table("generations.csv");
    assert_eq!(generations.len(), 21);
    assert_eq!(
        generations[7][1].parse::<f64>().unwrap(),
        report.generations[6].best_novelty
    );
}

#[test]
fn no_name_in_a_table_is_a_formula() {
    let mut report = sample::report(&SMALL);
    let name: crate::labels::ClassName = "=HYPERLINK(1)".parse().unwrap();
    report.names.classes[0].name = name.clone();
    report.names.by_individual = [0, 5].map(|index| (index, name.clone())).into();
    let (_place, files) = written(&report);
    for name in ["archive.csv", "taxonomy.csv", "classes.csv"] {
        let text = fs::read_to_string(files.page.with_file_name(name)).unwrap();
        assert!(
            text.contains("'=HYPERLINK(1)") && !text.contains(",=") && !text.contains("\n="),
            "{text}"
        );
    }
}

#[test]
fn commands_repeat_what_the_card_shows() {
    let two_sensors = Sample {
        spec: "model = \"two-sensor\"\nmethod = \"random\"\n[taxonomy]\nmedoids = 2\n[world]\nagents = 3\nhorizon = 50",
        ..SMALL
    };
    let report = sample::report(&two_sensors);
    for medoid in &report.medoids {
        let entry = &report.individuals[medoid.index as usize];
        let command = commands::simulate(&report.spec, entry, "a.gif");
        assert!(
            command.contains("--model two-sensor") && command.contains(&format!("--seed {} ", entry.seed))
        );
        assert!(
            command.contains("--spec spec.toml"),
            "the world is not the default: {command}"
        );
        let genes = command.split(['[', ']']).nth(1).unwrap().split(", ");
        let genes: Vec<f64> = genes.map(|gene| gene.parse().unwrap()).collect();
        assert_eq!(
            Controller::new(CapabilityModel::TwoSensor, &genes).unwrap(),
            entry.controller
        );
    }
    assert!(page(&report).contains("the heuristic filter was off"));
    assert!(page(&sample::report(&SMALL)).contains("proposals"));
}

#[test]
fn a_place_that_cannot_be_written_is_named() {
    let report = sample::report(&SMALL);
    let place = tempfile::tempdir().unwrap();
    let check = |in_the_way: &str, folder: &str| {
        let path = place.path().join(in_the_way);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, "").unwrap();
        let error = write(&report, &place.path().join(folder)).unwrap_err();
        assert!(matches!(error, ReportError::Write { .. }));
        assert!(error.to_string().contains(path.to_str().unwrap()), "{error}");
    };
    check("file", "file");
    check("one/medoids", "one");
    let taken = place.path().join("two/report.html");
    fs::create_dir_all(&taken).unwrap();
    let error = write(&report, &place.path().join("two")).unwrap_err();
    assert!(error.to_string().contains(taken.to_str().unwrap()), "{error}");
}

#[test]
fn what_does_not_fit_together_is_refused_before_anything_is_written() {
    let check = |damage: fn(&mut Report), said: &str| {
        let mut report = sample::report(&SMALL);
        damage(&mut report);
        let place = tempfile::tempdir().unwrap();
        let error = write(&report, &place.path().join("report"))
            .unwrap_err()
            .to_string();
        assert!(error.contains(said), "{error:?} does not say {said:?}");
        assert_eq!(fs::read_dir(place.path()).unwrap().count(), 0);
    };
    check(|report| report.medoids.clear(), "no medoid");
    check(|report| report.clusters.truncate(39), "39 of them in clusters");
    check(|report| report.map.points.truncate(39), "39 on the map");
    check(|report| report.clusters[0] = 3, "cluster 3 of 3");
    check(|report| report.medoids[0].index = 40, "medoid 40 among 40");
    check(|report| report.map.points[5][1] = f64::NAN, "not finite");
    check(
        |report| report.medoids[1].image.truncate(9),
        "cannot draw individual 1",
    );
}

#[test]
fn a_full_page_stays_small() {
    let full = Sample {
        spec: "model = \"single-sensor\"\nmethod = \"hand-crafted\"\n[taxonomy]\nmedoids = 16",
        individuals: 10_000,
        frames: 400,
    };
    let bytes = page(&sample::report(&full)).len();
    assert!(bytes < 6_000_000, "{bytes} bytes");
}

/// Writes samples into the folder that `SAMPLE_REPORT` names, to be looked at:
/// `SAMPLE_REPORT=samples cargo test --release -p murmuration-coordinator a_sample_to_look_at -- --ignored`
#[test]
#[ignore = "for people to look at"]
fn a_sample_to_look_at() {
    let folder = PathBuf::from(std::env::var_os("SAMPLE_REPORT").unwrap());
    let sample = |spec, individuals| {
        sample::report(&Sample {
            spec,
            individuals,
            frames: 400,
        })
    };
    let filtered = "model = \"single-sensor\"\nmethod = \"hand-crafted\"\nfilter = true";
    let two = "model = \"two-sensor\"\nmethod = \"random\"\n[world]\nwidth = 800.0\nheight = 500.0";
    let crowd = "model = \"single-sensor\"\nmethod = \"random\"\n[taxonomy]\nmedoids = 3\n[world]\nagents = 1000\nwidth = 2000.0\nheight = 2000.0\nhorizon = 200";
    for (name, spec, individuals) in [
        ("single", filtered, 10_000),
        ("two", two, 100_000),
        ("crowd", crowd, 500),
    ] {
        let report = sample(spec, individuals);
        write(&report, &folder.join(name)).unwrap();
        for (place, medoid) in report.medoids.iter().take(3).enumerate() {
            let gif = picture::animation_gif(
                &medoid.replay,
                report.spec.world(),
                &picture::Animation::default(),
            )
            .unwrap();
            fs::write(folder.join(name).join(format!("{}.gif", place + 1)), gif).unwrap();
        }
    }
}

//! Tests that write a report and read its files.

mod channels;
mod learned;
mod tables;

use super::{
    sample::{SMALL, Sample},
    *,
};
use crate::picture::sample::decode_png;
use learned::LATENT;
use murmuration_model::labels::GivenClass;
use murmuration_swarm::{Class, Preset, Verdict};
use std::fs;

fn folder_of(path: &std::path::Path) -> Folder {
    Folder::create(path, murmuration_files::Replaces::Unchanged).unwrap()
}

fn written(report: &Report) -> (tempfile::TempDir, ReportFiles) {
    let place = tempfile::tempdir().unwrap();
    let files = write(report, folder_of(&place.path().join("new/report"))).unwrap();
    (place, files)
}

fn given(class: &murmuration_model::labels::ClassName) -> GivenClass {
    GivenClass {
        class: class.clone(),
        by_machine: false,
    }
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
            "contact-sheet.svg",
            "medoids/01-image.png",
            "medoids/01-trajectory.png",
            "medoids/01-trajectory.svg",
            "medoids/02-image.png",
            "medoids/02-trajectory.png",
            "medoids/02-trajectory.svg",
            "medoids/03-image.png",
            "medoids/03-trajectory.png",
            "medoids/03-trajectory.svg",
        ]
    );
    let read = |name: &str| fs::read(folder.join(name)).unwrap();
    assert_eq!(decode_png(&read("medoids/03-image.png")).0, 400);
    assert_eq!(decode_png(&read("medoids/03-trajectory.png")).0, 1000);
    let spec = String::from_utf8(read("spec.toml")).unwrap();
    assert_eq!(CampaignSpec::from_toml(&spec).unwrap(), report.spec);
    assert_eq!(
        fs::read_dir(folder).unwrap().count(),
        11,
        "nothing else is left but the list of files"
    );
    write(&report, folder_of(folder)).unwrap();
}

#[test]
fn a_card_shows_how_far_its_cluster_reaches() {
    let mut report = sample::report(&SMALL);
    let members = report.medoids[1].spread.as_ref().map(Spread::members).unwrap();
    let captions = members.map(|(which, member)| {
        format!(
            "is {which}: individual {}, at a distance of {}",
            numbers::grouped(member.index),
            numbers::short(member.distance)
        )
    });
    let before = page(&report);
    for caption in &captions {
        assert!(before.contains(caption), "{caption}");
    }
    report.medoids[1].spread = None;
    let after = page(&report);
    assert!(captions.iter().all(|caption| !after.contains(caption)));
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
    assert_eq!(named.len(), 5, "{named:?}");
    for name in named {
        assert!(files.page.with_file_name(name).exists(), "{name}");
    }
    assert_eq!(beside.matches("beside this page").count(), 3);

    let alone = super::page(&report).unwrap();
    assert!(!alone.contains("beside this page"));
    assert!(alone.contains("<code>murmuration report sample-1</code> writes"));
    assert!(alone.contains("The text below, saved as spec.toml,"));
}

#[test]
fn what_comes_from_data_is_escaped() {
    let hostile = "</script><script>alert(1)</script>\"'&<img src=x>";
    let mut report = sample::report(&SMALL);
    report.campaign = hostile.into();
    let name: murmuration_model::labels::ClassName = hostile.parse().unwrap();
    report.names.classes[0].name = name.clone();
    report.names.by_individual.insert(1, given(&name));
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
    assert!(named.contains("wall · 0") && !named.contains("Behaviour 1<"));
    report.names = Names::default();
    let suggested = page(&report);
    let judged = format!("{}?</span><small>judge</small>", report.judged.medoids[0].words());
    assert!(suggested.contains(&judged) && !suggested.contains("Behaviour 1<"));
    report.judged.medoids.clear();
    let nameless = page(&report);
    assert!(nameless.contains("Behaviour 1<") && !nameless.contains("id=\"names\""));
}

#[test]
fn what_people_named_and_what_the_machine_named_are_told_apart() {
    const MARK: &str = "Named by the rule-based judge, not by a person.";
    let mut report = sample::report(&SMALL);
    let named = page(&report);
    assert!(
        named.contains("annotators have named 2 and the rule-based judge, a program, has named another 1.")
    );
    assert!(named.contains("ring, or &quot;mill&quot; · 3, 1 of them only by the rule-based judge"));
    assert_eq!(
        named.matches(MARK).count(),
        2,
        "a person named the first behaviour"
    );
    report.names.by_individual.get_mut(&0).unwrap().by_machine = true;
    let named = page(&report);
    // The card of the other behaviour has the judge's verdict.
    assert_eq!(named.matches(MARK).count(), 3);
    assert!(named.contains("ring, or &quot;mill&quot; (by the rule-based judge) · "));
}

#[test]
fn a_name_from_an_earlier_version_is_on_the_card_the_legend_and_the_table() {
    let mut report = sample::report(&SMALL);
    report.medoids[1].carried = Some(CarriedName {
        class: "wall".parse().unwrap(),
        version: 1,
        place: 4,
        shared: 7,
        of: 9,
    });
    let (_place, files) = written(&report);
    let page = fs::read_to_string(&files.page).unwrap();
    for expected in [
        "style=\"--class:#e6861d\" title=\"Carried over from an earlier version",
        ">wall?</span><small>carried over</small>",
        "Name carried over from behaviour 5 of version 1 of the taxonomy: 7 of its 9 individuals are here.",
        "wall (carried over) · ",
    ] {
        assert!(page.contains(expected), "{expected}");
    }
    assert!(!page.contains("Behaviour 2<"));
    let mut table = csv::Reader::from_path(files.page.with_file_name("taxonomy.csv")).unwrap();
    let rows: Vec<csv::StringRecord> = table.records().map(Result::unwrap).collect();
    let names: Vec<_> = rows.iter().map(|row| (&row[6], &row[7])).collect();
    assert_eq!(names, [("ring, or \"mill\"", ""), ("wall", "1"), ("", "")]);
}

#[test]
fn a_page_names_what_behaviours_are_compared_by() {
    let features = page(&sample::report(&SMALL));
    for expected in [
        "(Table 1 of Mattson and Brown), each its mean over the last 100 steps: average speed, angular momentum, radial variance \
         (times 20, as in the authors' simulator), scatter, group rotation. The distance between two behaviours is Euclidean.",
        "The behaviour space has 5 dimensions",
        "This campaign measures nothing on it.",
    ] {
        assert!(
            features.contains(&expected.replace('\'', "&#39;")) || features.contains(expected),
            "{expected}"
        );
    }
    let report = sample::report(&LATENT);
    let embedding = page(&report);
    let compared = format!(
        "Behaviours are compared by the 5 numbers that checkpoint <code>{}</code> computes from a grey image.",
        report.checkpoint
    );
    assert!(embedding.contains(&compared) && embedding.contains("The behaviour space has 5 dimensions"));
    assert!(!embedding.contains("average speed"));

    let both = page(&sample::report(&Sample {
        spec: "model = \"single-sensor\"\nmethod = \"latent\"\n[taxonomy]\nmedoids = 3\n[world]\nagents = 6\nhorizon = 200",
        ..LATENT
    }));
    assert!(both.contains("group rotation. Each of the two parts is scaled to a total variance of 1"));
    assert!(both.contains("The behaviour space has 10 dimensions"));
}

#[test]
fn a_page_begins_with_what_was_found_and_folds_what_is_random_or_shown_already() {
    let mut report = sample::report(&SMALL);
    // The first medoid has a label, which takes precedence over the judge's verdict.
    report.judged.medoids = [Class::Random, Class::Milling, Class::Random]
        .map(Verdict::Class)
        .into();
    report.judged.sample = vec![
        (0, Verdict::Class(Class::Random)),
        (1, Verdict::Class(Class::Milling)),
    ];
    let found = page(&report);
    let expected = "<strong>At least 1 distinct behaviour</strong>: ring, or &quot;mill&quot;. \
                <strong>The rule-based judge names 1 more kind of behaviour</strong>: milling (50\u{a0}%). \
                The judge knows no kind for about 50 % of the archive (a sample of 2).";
    assert!(
        found.contains(expected),
        "{}",
        &found[found.find("class=\"findings\"").unwrap()..][..300]
    );
    assert!(found.contains("not by a person.\">milling?</span><small>judge</small>"));
    let folded = &found[found.find("<summary>1 more: 1 random</summary>").unwrap()..];
    assert!(folded.contains("id=\"behaviour-3\"") && !folded.contains("id=\"behaviour-2\""));

    report.names = Names::default();
    report.judged.medoids = vec![Verdict::Class(Class::Random); 3];
    let nothing = page(&report);
    assert!(!nothing.contains("class=\"findings\"") && !nothing.contains(" more: "));
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
        let command = again::simulate(&report.spec, entry, "a.gif");
        assert!(command.contains(&format!("--seed {} ", entry.seed)), "{command}");
        assert!(
            command.contains("--spec spec.toml"),
            "the world is not the default: {command}"
        );
        let genes = command.split(['[', ']']).nth(1).unwrap().split(", ");
        let genes: Vec<f64> = genes.map(|gene| gene.parse().unwrap()).collect();
        assert_eq!(
            Controller::new(Preset::TwoSensor, &genes).unwrap(),
            entry.controller
        );
    }
    assert!(page(&report).contains("The heuristic filter was off"));
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
        let folder = place.path().join(folder);
        let error = write(&report, folder_of(&folder)).unwrap_err().to_string();
        let named = path.strip_prefix(&folder).unwrap().to_str().unwrap();
        assert!(
            error.contains(&format!("did not write {named}, which is in the way")),
            "{error}"
        );
    };
    check("one/medoids", "one");
    check("two/report.html", "two");
}

#[test]
fn what_does_not_fit_together_is_refused_before_anything_is_written() {
    let check = |damage: fn(&mut Report), expected: &str| {
        let mut report = sample::report(&SMALL);
        damage(&mut report);
        let place = tempfile::tempdir().unwrap();
        let error = write(&report, folder_of(place.path())).unwrap_err().to_string();
        assert!(error.contains(expected), "{error:?} does not say {expected:?}");
        assert_eq!(fs::read_dir(place.path()).unwrap().count(), 0);
    };
    check(|report| report.medoids.clear(), "no medoid");
    check(|report| report.clusters.truncate(39), "39 of them in clusters");
    check(|report| report.map.points.truncate(39), "39 on the map");
    check(|report| report.clusters[0] = 3, "cluster 3 of 3");
    check(|report| report.medoids[0].index = 40, "individual 40 among 40");
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

/// Writes sample reports for inspection into the folder that `SAMPLE_REPORT` names:
///
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
        write(&report, folder_of(&folder.join(name))).unwrap();
        for (place, medoid) in report.medoids.iter().take(3).enumerate() {
            let gif = picture::animation_gif(
                &medoid.replay,
                report.spec.world(),
                picture::Colouring::Agents,
                &picture::Animation::default(),
            )
            .unwrap();
            fs::write(folder.join(name).join(format!("{}.gif", place + 1)), gif).unwrap();
        }
    }
}

#[test]
fn the_example_report_has_the_style_and_the_scripts_of_today() {
    let example = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../docs/example-report/report.html"
    );
    let example = fs::read_to_string(example).unwrap();
    let today = page(&sample::report(&SMALL));
    let parts = |name: &str| {
        let [begin, end] = [format!("<{name}>"), format!("</{name}>")];
        let after = today.split(&begin).skip(1);
        after
            .map(|part| part.split_once(&end).unwrap().0.to_owned())
            .collect::<Vec<_>>()
    };
    let parts = [parts("style"), parts("script")].concat();
    assert!(parts.len() > 4);
    for part in parts {
        assert!(
            example.contains(&part),
            "docs/example-report/report.html is of another day: make it anew, as campaign.toml beside it says"
        );
    }
}

use super::*;
use crate::{
    picture::sample::decode_png,
    sample::{self, SMALL, Sample},
};
use murmuration_swarm::{Class, Verdict};

/// A report of six behaviours: the first has a person's name, the judge names the others.
fn report() -> Report {
    let mut report = sample::report(&Sample {
        spec: "name = \"sample\"\nmodel = \"single-sensor\"\nmethod = \"hand-crafted\"\n\
               [taxonomy]\nmedoids = 6\n[world]\nagents = 6\nhorizon = 200",
        ..SMALL
    });
    report.judged.medoids = [
        Class::Milling,
        Class::Dispersal,
        Class::Random,
        Class::Dispersal,
        Class::Aggregation,
        Class::Random,
    ]
    .map(Verdict::Class)
    .to_vec();
    report
}

fn options(change: impl FnOnce(&mut Options)) -> Options {
    let mut options = Options::default();
    change(&mut options);
    options
}

fn drawn(options: &Options) -> PaperFigure {
    PaperFigure::draw(&report(), options).unwrap()
}

fn svg(options: &Options) -> String {
    String::from_utf8(drawn(options).file(Format::Svg).unwrap()).unwrap()
}

#[track_caller]
fn check_refused(options: &Options, expected: &str) {
    match PaperFigure::draw(&report(), options) {
        Ok(_) => panic!("{options:?} is accepted"),
        Err(error) => assert_eq!(error.to_string(), expected),
    }
}

#[test]
fn distinct_behaviours_are_shown_and_names_without_a_person_have_a_question_mark() {
    let panels = drawn(&Options::default()).panels;
    let shown: Vec<_> = panels
        .iter()
        .map(|panel| (panel.behaviour, panel.label.as_deref().unwrap()))
        .collect();
    assert_eq!(
        shown,
        [(1, "ring, or \"mill\""), (2, "dispersal?"), (5, "aggregation?")]
    );
}

#[test]
fn chosen_behaviours_keep_their_order_and_have_letters_in_it() {
    let chosen = options(|options| {
        options.behaviours = Some("6,2".parse().unwrap());
        options.labels = Labels::Letters;
    });
    let panels = drawn(&chosen).panels;
    let shown = panels
        .iter()
        .map(|panel| (panel.behaviour, panel.label.as_deref()));
    assert_eq!(shown.collect::<Vec<_>>(), [(6, Some("a")), (2, Some("b"))]);
    assert_eq!([0, 25, 26, 52, 701].map(letters), ["a", "z", "aa", "ba", "zz"]);
}

#[test]
fn the_size_on_paper_is_in_every_format() {
    let page = options(|options| options.width = Width::PAGE);
    for (options, width) in [(Options::default(), 85.0), (page, 178.0)] {
        let figure = drawn(&options);
        let [across, height] = figure.size_mm();
        assert_eq!(across, width);
        let svg = String::from_utf8(figure.file(Format::Svg).unwrap()).unwrap();
        assert!(
            svg.contains(&format!("width=\"{width}mm\" height=\"{height:.1}")),
            "{}",
            &svg[..300]
        );
        let pdf = String::from_utf8_lossy(&figure.file(Format::Pdf).unwrap()).into_owned();
        let (_, found) = pdf.split_once("/MediaBox [0 0 ").unwrap();
        let points: f64 = found.split(' ').next().unwrap().parse().unwrap();
        assert!((points * MM_PER_POINT - width).abs() < 0.01, "{points}");
        let (pixels, _, _) = decode_png(&figure.file(Format::Png).unwrap());
        assert_eq!(f64::from(pixels), (width / 25.4 * 300.0).round());
    }
}

#[test]
fn text_is_drawn_as_outlines_with_its_words_in_a_title() {
    let svg = svg(&options(|options| options.shares = true));
    assert!(!svg.contains("<text") && !svg.contains("font-"), "{svg}");
    assert!(svg.contains("<title>dispersal?</title>"), "{svg}");
    assert!(svg.contains(" %</title>"), "{svg}");
    let plain = options(|options| options.labels = Labels::None);
    assert_eq!(self::svg(&plain).matches("<title>").count(), 1);
}

#[test]
fn files_are_the_same_every_time_and_small() {
    for format in Format::ALL {
        let [first, second] = [0; 2].map(|_| drawn(&Options::default()).file(format).unwrap());
        assert_eq!(first, second);
        assert!(first.len() < 200_000, "{format:?}: {}", first.len());
    }
}

#[test]
fn behaviours_are_side_by_side_and_rows_are_full() {
    let size = |columns: Option<&str>| {
        let wanted = options(|options| {
            options.behaviours = Some("1,2,3,4".parse().unwrap());
            options.columns = columns.map(|columns| columns.parse().unwrap());
        });
        drawn(&wanted).size_mm()
    };
    let [default, one, two, four] = [None, Some("1"), Some("2"), Some("4")].map(size);
    // Three would fit, but leave a last row of one.
    assert_eq!(default, two);
    assert!(one[1] > 2.0 * two[1] && two[1] > 1.5 * four[1]);
}

#[test]
fn what_does_not_fit_is_refused() {
    let chosen = |text: &str| options(|options| options.behaviours = Some(text.parse().unwrap()));
    check_refused(
        &chosen("2,7"),
        "behaviours = 7: must be numbers from 1 to 6, as the report shows them",
    );
    let narrow = Options {
        width: "20mm".parse().unwrap(),
        columns: Some("6".parse().unwrap()),
        ..chosen("1,2,3,4,5,6")
    };
    check_refused(
        &narrow,
        "columns = 6: must be fewer, because behaviours would be narrower than 5 mm in a figure 20 mm wide",
    );
    let high = Options {
        width: "500mm".parse().unwrap(),
        columns: Some("1".parse().unwrap()),
        ..chosen("1,2,3")
    };
    assert!(
        PaperFigure::draw(&report(), &high)
            .err()
            .unwrap()
            .to_string()
            .contains("mm high; 1000 mm are possible")
    );
}

#[test]
fn long_names_have_two_lines_and_then_an_end() {
    let wrap = |text: &str| wrapped(text, [60.0; 2], false);
    assert_eq!(wrap("milling"), ["milling"]);
    assert_eq!(wrap(""), [""; 0]);
    assert_eq!(wrap("two clusters that rotate"), ["two clusters that", "rotate"]);
    let long = wrap("a very long name that nobody can read in a figure of a paper");
    assert!(long.len() == 2 && long[1].ends_with('…'), "{long:?}");
    let word = wrap(&"w".repeat(64));
    assert!(word.len() == 1 && word[0].ends_with('…'), "{word:?}");
    for line in long.iter().chain(&word) {
        assert!(width_of(line, TEXT, false) <= 60.0);
    }
}

//! Study files with the table `[recall]`, and with maps.

use super::*;

const RECALL: &str = r#"
name = "r"
measures = ["recall", "richness"]
recall = { atlas = { model = "single-sensor", method = "exhaustive" }, at = [10, 40], niches = 30 }
campaign = { model = "single-sensor", method = "random", evaluation.judge = true }

[quick]
recall = { atlas.controllers.step = 0.5, at = [5] }
"#;

#[test]
fn an_atlas_is_a_campaign_and_quick_changes_it() {
    let plan = |quick| read(RECALL, quick).unwrap().measures.recall.clone().unwrap();
    let (long, quick) = (plan(false), plan(true));
    let at: Vec<u32> = long.at.iter().map(|at| at.get()).collect();
    assert_eq!((at, long.niches.get()), (vec![10, 40], 30));
    assert_eq!(long.atlas.evaluations(), 97_461);
    assert_eq!(
        (quick.at[0].get(), quick.niches.get(), quick.atlas.evaluations()),
        (5, 30, 325)
    );
    let defaults = RECALL.replace(", at = [10, 40], niches = 30", "");
    let plan = read(&defaults, false).unwrap().measures.recall.clone().unwrap();
    let at: Vec<u32> = plan.at.iter().map(|at| at.get()).collect();
    assert_eq!((at, plan.niches.get()), (vec![1000, 3000, 10_000], 500));
}

#[test]
fn recall_that_cannot_be_measured_is_refused() {
    let check = |part: &str, by: &str, expected: &str| {
        assert!(RECALL.contains(part), "{part}");
        let error = read(&RECALL.replace(part, by), false).unwrap_err();
        assert!(error.contains(expected), "{error:?} does not say {expected:?}");
    };
    check(
        ", evaluation.judge = true",
        "",
        "seed = 1: evaluation.judge = false: must be true",
    );
    check(
        ", evaluation.judge = true",
        ", evaluation = { judge = true, starts = 4 }",
        "seed = 1: evaluation.starts = 4: must be 1",
    );
    check(
        "method = \"exhaustive\"",
        "method = \"random\"",
        "the atlas of [recall]: evaluation.judge",
    );
    check(
        "method = \"exhaustive\"",
        "method = \"exhaustve\"",
        "the atlas of [recall]: unknown value `exhaustve` of method",
    );
    check(
        "method = \"exhaustive\"",
        "method = \"exhaustive\", name = \"x\"",
        "recall.atlas.name = given",
    );
    check(
        "method = \"random\"",
        "method = \"random\", world.agents = 6",
        "the model and world of [recall]'s atlas",
    );
    check(
        "[10, 40]",
        "[10, 10001]",
        "recall.at = 10001: must be at most 10000",
    );
    check("[10, 40]", "[40, 10]", "recall.at = [40, 10]");
    check("[10, 40]", "[]", "recall.at = []");
    check("[10, 40]", "[0]", "recall.at = [0]");
    check(
        "niches = 30",
        "niches = 1",
        "recall.niches = 1: must be 2 to 5000",
    );
    check("niches = 30", "niche = 30", "unknown field `niche`");
    check(
        "measures = [\"recall\", \"richness\"]",
        "",
        "recall = given: must be absent",
    );
    let without: Vec<&str> = RECALL
        .lines()
        .filter(|line| !line.starts_with("recall"))
        .collect();
    let error = read(&without.join("\n"), false).unwrap_err();
    assert!(error.contains("the measure \"recall\" needs one"), "{error}");
}

#[test]
fn estimates_of_richness_alone_need_single_starts() {
    // Recall counts whether a niche was found, not how often. A search that is not random has no estimates of richness that
    // several starts could bias.
    let starts = RECALL.replace(
        ", evaluation.judge = true",
        ", evaluation = { judge = true, starts = 4 }",
    );
    read(&starts.replace("\"recall\", \"richness\"", "\"recall\""), false).unwrap();
    read(
        &starts.replace("method = \"random\"", "method = \"hand-crafted\""),
        false,
    )
    .unwrap();
}

#[test]
fn maps_need_verdicts_and_a_sample() {
    let text = |judge: bool| {
        format!(
            "name = \"m\"\nmeasures = [\"maps\"]\n\
             campaign = {{ model = \"single-sensor\", method = \"random\", evaluation.judge = {judge} }}"
        )
    };
    assert_eq!(read(&text(true), false).unwrap().measures.which, [Measure::Maps]);
    let error = read(&text(false), false).unwrap_err();
    assert!(error.contains("seed = 1: evaluation.judge = false"), "{error}");
    let listed = text(true).replace("method = \"random\"", "method = \"exhaustive\"");
    let error = read(&listed, false).unwrap_err();
    assert!(error.contains("seed = 1: method = exhaustive"), "{error}");
}

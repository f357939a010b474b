use crate::CampaignSpec;

const BEGINNING: &str = "model = \"single-sensor\"\nmethod = \"latent\"\n";

#[track_caller]
fn check(rest: &str, words: &str) {
    let text = format!("{BEGINNING}{rest}");
    let error = CampaignSpec::from_toml(&text).unwrap_err().to_string();
    assert!(error.contains(words), "{error:?} does not say {words:?}");
    assert!(
        !error.contains("expected u") && !error.ends_with('\n'),
        "{error:?}"
    );
    // The byte order mark and the line ends of some editors must not change the message.
    let edited = format!("\u{feff}{}", text.replace('\n', "\r\n"));
    assert_eq!(CampaignSpec::from_toml(&edited).unwrap_err().to_string(), error);
}

#[test]
fn a_value_of_the_wrong_kind_is_told_what_is_allowed() {
    check(
        "[search]\npopulation = 99999999999",
        "search.population must be a smaller whole number, not 99999999999",
    );
    let whole = "search.population must be a whole number, 0 or more, not";
    for value in ["-1", "1.5", "\"many\"", "true"] {
        check(
            &format!("[search]\npopulation = {value}"),
            &format!("{whole} {value}"),
        );
    }
    check(
        "[search]\npopulation = -1",
        "line 4, column 14\n  |\n4 | population = -1\n",
    );
    check("seed = -1", "seed must be a whole number, 0 or more, not -1");
    check("filter = 1", "filter must be true or false, not 1");
    check("search = 1", "search must be a table, not 1");
    check("name = 3", "name must be a text in quotes, not 3");
    check(
        "[world]\nwidth = \"x\"",
        "world.width must be a number, not \"x\"",
    );
    check(
        "controllers = { angles = 3 }",
        "controllers.angles must be a list",
    );
    check(
        "[controllers]\nangles = [\"x\"]",
        "controllers.angles[0] must be a number",
    );
    check(
        "[training]\nheld_out = true",
        "line 4, column 12\n  |\n4 | held_out = true\n  |            ^^^^\ntraining.held_out must be a number, not true",
    );
    check(
        "[training.recipe.in-batch]\nepochs = -3",
        "4 | epochs = -3\n  |          ^^\ntraining.recipe.in-batch.epochs must be a whole number, 0 or more",
    );
    check(
        "[feedback.recipe.labelled]\nepochs = -3",
        "4 | epochs = -3\n  |          ^^\nfeedback.recipe.labelled.epochs must be a whole number, 0 or more",
    );
    check(
        "[training.recipe.in-batch]\ncrop = [1.0]",
        "training.recipe.in-batch.crop must be a list of 2, not of 1",
    );
    check(
        "[training]\nrecipe = \"paper\"",
        "training.recipe must be a table such as { paper = {} }, not \"paper\"",
    );
    check(
        "[training]\nrecipe = { paper = {}, in-batch = {} }",
        "training.recipe must be a name, or a table of one name, not a table",
    );
    check(
        "[training]\nrecipe = { untrained = 3 }",
        "4 | recipe = { untrained = 3 }\n  |                        ^\ntraining.recipe.untrained must be a table, not 3",
    );
    check(
        "[training]\nnetwork.layers = []",
        "training.network.layers must be a list of 1 to 100 layers, not an empty list",
    );
    check(
        "[feedback]\nrecipe = \"untrained\"",
        "4 | recipe = \"untrained\"\n  |          ^^^^^^^^^^^\nfeedback.recipe must be a table, not \"untrained\"",
    );
    check(
        "seed = 2024-01-01",
        "seed must be a whole number, 0 or more, not 2024-01-01",
    );
    check(
        "[robot]\nsensors = [{ angle = \"left\" }]",
        "robot.sensors[0].angle must be a number of radians, or \"free\", not \"left\"",
    );
}

#[test]
fn what_is_no_toml_is_told_what_is_missing() {
    check("name = \"ring", "this text has no \" at its end");
    check("name = 'ring", "this text has no ' at its end");
    check("name = ring", "a text in quotes");
    check("seed =", "a value must be a number");
    check(
        "seed = 1\nseed = 2",
        "4 | seed = 2\n  | ^^^^\nthis field, or its section, occurs twice",
    );
    check("[search\npopulation = 5", "unclosed table, expected `]`");
}

#[test]
fn a_line_that_nobody_reads_is_not_repeated() {
    let long = "x".repeat(60_000);
    for text in [format!("seed = \"{long}\""), format!("{long} = 1"), long] {
        let error = CampaignSpec::from_toml(&text).unwrap_err().to_string();
        let at = error.lines().next().unwrap_or_default();
        assert!(at.starts_with("TOML parse error at line 1, column "), "{at}");
        assert!(error.len() < 5_000, "{} bytes", error.len());
    }
    check("[search]\npopulation = -1", "4 | population = -1\n");
}

#[test]
fn an_unknown_field_is_told_what_may_have_been_meant() {
    check("sed = 1", "unknown field `sed`: did you mean `seed`?");
    check(
        "[robot]\nsensors = [{ fov = 0.4 }]",
        "in [robot.sensors]: here it is `half_angle`, half of the field of view, in radians.",
    );
    check(
        "[robot]\nsensors = [{ detects = [\"robots\"] }]",
        "in [robot.sensors]: here it is `sees`.",
    );
    check(
        "[search]\npopluation = 5",
        "in [search]: did you mean `population`? [search] has",
    );
    check(
        "[serch]\npopulation = 5",
        "unknown field `serch`: did you mean `search`?",
    );
    check(
        "[training.network]\nnmae = 1",
        "in [training.network]: did you mean `name`?",
    );
    check(
        "[training.recipe.in-batch]\nepoch = 3",
        "unknown field `epoch` in [training.recipe.in-batch]: did you mean `epochs`?",
    );
    check(
        "[training.recipe.inbatch]\nepochs = 3",
        "unknown value `inbatch` of training.recipe: did you mean `in-batch`?",
    );
    check(
        "[training]\nnetwork.layers = [{ dens = { units = 3 } }]",
        "unknown value `dens` of training.network.layers[0]: did you mean `dense`? It may be",
    );
    check(
        "[training]\nnetwork.layers = [{ dense = {} }]",
        "training.network.layers[0].dense: the field `units` is missing",
    );
    let error = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"latnt\"").unwrap_err();
    let words = "unknown value `latnt` of method: did you mean `latent`? It may be `random`,";
    assert!(error.to_string().contains(words), "{error}");
    check(
        "xyzzy = 1",
        "unknown field `xyzzy`. The top of the file has `name`",
    );
}

#[test]
fn a_list_that_is_none_is_told_what_a_list_is() {
    check(
        "[species]\nname = \"a\"",
        "species must be a list of tables: [{ ... }], or tables with two brackets around the name, not a table",
    );
    check(
        "[robot]\nsensors = { range = 120 }",
        "robot.sensors must be a list of tables: [{ ... }], or tables with two brackets around the name, not a table",
    );
    check(
        "[search]\npopulation = [1]",
        "search.population must be a whole number, 0 or more, not a list",
    );
    check(
        "[controllers]\nangles = \"1\"",
        "controllers.angles must be a list such as [\"1\"], not \"1\"",
    );
    check(
        "ratios = [[-1, 4]]",
        "ratios[0][0] must be a whole number, 0 or more, not -1",
    );
}

#[test]
fn a_field_of_another_section_is_told_where_it_belongs() {
    check(
        "population = 5",
        "unknown field `population`: it belongs in [search]",
    );
    check(
        "[image]\npopulation = 5",
        "unknown field `population` in [image]: it belongs in [search]. [image] has `resolution`, `window` and `channels`",
    );
    check(
        "[label]\npopulation = 5",
        "unknown field `label`: its `population` belongs in [search]",
    );
    check(
        "[image]\nstarts = 5",
        "it belongs in [dataset] or in [feedback] or in [evaluation]",
    );
    check(
        "[image]\nmethod = 5",
        "it belongs at the top of the file, before every [section]",
    );
    check(
        "[image]\npopluation = 5",
        "did you mean `population`, which belongs in [search]?",
    );
    check(
        "[[species]]\nname = \"a\"\nrobot.sensors = [{}, { agnle = 1.0 }]",
        "unknown field `agnle` in [robot.sensors]: did you mean `angle`?",
    );
    check(
        "[[species]]\nname = \"a\"\nradius = 3",
        "unknown field `radius` in [species]: it belongs in [world] or in [robot] or in",
    );
    check("[feedback]\nlabelled = {}", "it belongs in [feedback.recipe]");
    check(
        "[training.network]\nlayers = [{ dense = { kernel = 5, units = 5 } }]",
        "in [training.network.layers.dense]: it belongs in [training.network.layers.convolution]",
    );
    check(
        "[training.recipe.untrained]\nepochs = 5",
        "unknown field `epochs` in [training.recipe.untrained]: it belongs in [training.recipe.in-batch] or in",
    );
    check(
        "[training]\nmargin = 5",
        "it belongs in [training.recipe.in-batch] or in",
    );
}

//! Texts of trainings as checkpoints and stored specifications contain them. These texts must not change: digests cover them.

use super::Configuration;
use crate::CampaignSpec;

const LAYERS: &str = "layers = [{ convolution = { channels = 16, kernel = 3, stride = 2, padding = 1 } }, \
                      { group-normalisation = { groups = 4 } }, { leaky-relu = { slope = 0.01 } }, \
                      { convolution = { channels = 8, kernel = 3 } }, { average-pooling = { grid = 2 } }, \
                      { dense = { units = 64 } }, \"relu\", { dense = { units = 5 } }]";

#[track_caller]
fn check(given: &str, text: &str) {
    let configuration = Configuration::from_toml(given).unwrap();
    assert_eq!(configuration.to_toml(), text);
    assert_eq!(Configuration::from_toml(text).unwrap(), configuration);
}

#[test]
fn the_text_of_a_configuration_does_not_change() {
    check("", include_str!("texts/default.toml"));
    check(
        "[network]\nname = \"paper\"\n[recipe.paper]",
        include_str!("texts/paper.toml"),
    );
    let untrained = include_str!("texts/untrained.toml");
    check("recipe = \"untrained\"\n[network]\ndimensions = 3", untrained);
    check("network.dimensions = 3\n[recipe.untrained]", untrained);
    check("[recipe.labelled]", include_str!("texts/labelled.toml"));
    check(
        "[recipe.paper-labelled]",
        include_str!("texts/paper-labelled.toml"),
    );
    check(&format!("[network]\n{LAYERS}"), include_str!("texts/layers.toml"));
    check(
        "seed = 9223372036854775807\nheld_out = 0.25\n[network]\nlayers = [{ dense = { units = 3 } }]\n\
         [recipe.in-batch]\nmargin = 2\ncrop = [1, 2]\nlearning_rate = 1e-9",
        include_str!("texts/numbers.toml"),
    );
}

#[track_caller]
fn check_campaign(given: &str, text: &str) {
    let spec = CampaignSpec::from_toml(&format!("model = \"single-sensor\"\n{given}")).unwrap();
    assert_eq!(spec.to_toml(), text);
    assert_eq!(CampaignSpec::from_toml(text).unwrap(), spec);
}

#[test]
fn the_text_of_a_campaign_with_a_training_does_not_change() {
    check_campaign(
        "method = \"latent\"\n[training.recipe.paper]\n[feedback.recipe.paper-labelled]",
        include_str!("texts/campaign-paper.toml"),
    );
    check_campaign(
        &format!("method = \"latent\"\n[training.network]\n{LAYERS}"),
        include_str!("texts/campaign-layers.toml"),
    );
    check_campaign(
        "method = \"untrained\"\n[training.network]\nname = \"paper\"",
        include_str!("texts/campaign-untrained.toml"),
    );
}

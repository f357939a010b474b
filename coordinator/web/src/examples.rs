//! Campaigns that can be started with one click.

/// Name, description, and campaign file of each.
pub(super) const EXAMPLES: [(&str, &str, &str); 6] = [
    (
        "quick-latent",
        "A small campaign on a learned embedding",
        include_str!("../../../examples/quick-latent.toml"),
    ),
    (
        "quick-hil",
        "A small campaign that learns from a rule-based judge, twice",
        include_str!("../../../examples/quick-hil.toml"),
    ),
    (
        "single-sensor-latent",
        "One sensor, a learned embedding, as many evaluations as the paper",
        include_str!("../../../examples/single-sensor-latent.toml"),
    ),
    (
        "two-sensor-latent",
        "Two sensors, a learned embedding",
        include_str!("../../../examples/two-sensor-latent.toml"),
    ),
    (
        "single-sensor",
        "One sensor, hand-crafted features",
        include_str!("../../../examples/single-sensor.toml"),
    ),
    (
        "two-sensor",
        "Two sensors, hand-crafted features",
        include_str!("../../../examples/two-sensor.toml"),
    ),
];

//! The campaigns that faults disturb, and their digests without faults.

use super::Scale;
use murmuration_swarm::CampaignSpec;
use murmuration_tests::Murmuration;
use std::{collections::BTreeMap, fs, sync::Mutex};

/// The arguments of a coordinator with a worker and a free port.
pub const SERVE: [&str; 7] = [
    "serve",
    "--listen",
    "127.0.0.1:0",
    "--workers",
    "1",
    "--trainers",
    "0",
];

/// A campaign of the method `hand-crafted`, with `generations` generations of ten controllers.
pub fn campaign(scale: &Scale, generations: u32, horizon: u32) -> CampaignSpec {
    let generations = scale.stretch * generations;
    let text = format!(
        "name = \"disturbed\"\nmodel = \"single-sensor\"\nmethod = \"hand-crafted\"\nseed = 7\n\
         [world]\nhorizon = {horizon}\n[search]\npopulation = 10\ngenerations = {generations}\n[taxonomy]\nmedoids = 4\n"
    );
    CampaignSpec::from_toml(&text).unwrap()
}

/// A campaign on a learned embedding, trained for exactly `epochs` epochs.
pub fn latent(scale: &Scale, epochs: u32) -> CampaignSpec {
    let epochs = scale.stretch * epochs;
    let text = format!(
        "name = \"disturbed\"\nmodel = \"single-sensor\"\nmethod = \"latent\"\nseed = 7\n\
         [dataset]\ncontrollers = 200\n[training.recipe.in-batch]\nbatch = 50\nepochs = {epochs}\npatience = {epochs}\n\
         [world]\nhorizon = 200\n[search]\npopulation = 10\ngenerations = 3\n[taxonomy]\nmedoids = 4\n"
    );
    CampaignSpec::from_toml(&text).unwrap()
}

/// Digests of undisturbed runs, made by `murmuration run` on the first request.
pub struct Undisturbed(Mutex<BTreeMap<String, String>>);

impl Undisturbed {
    pub fn new() -> Self {
        Self(Mutex::default())
    }

    pub fn digest(&self, spec: &CampaignSpec) -> String {
        let text = spec.to_toml();
        let mut known = self.0.lock().unwrap();
        let digest = known.entry(text.clone()).or_insert_with(|| {
            let folder = tempfile::tempdir().unwrap();
            let file = folder.path().join("spec.toml");
            fs::write(&file, text).unwrap();
            let murmuration = Murmuration::over(&folder.path().join("data"));
            let run = murmuration.run(&["run", &file.display().to_string()]);
            assert_eq!(run.code, Some(0), "{}", run.stderr);
            let digest = murmuration.run(&["digest", "latest", "--json"]).last_line();
            digest["digest"].as_str().unwrap().to_owned()
        });
        digest.clone()
    }

    /// Checks the only acceptable outcome of a scenario: the digest of the undisturbed run.
    pub fn check(&self, spec: &CampaignSpec, digest: &str) -> String {
        assert_eq!(
            digest,
            self.digest(spec),
            "the digest differs from the undisturbed run"
        );
        format!("digest {} as undisturbed", &digest[..8])
    }
}

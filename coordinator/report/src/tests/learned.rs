//! The report of a campaign whose embedder learned from people.

use super::*;
use murmuration_model::Round;
use murmuration_swarm::CheckpointDigest;

pub(super) const LATENT: Sample = Sample {
    spec: "name = \"sample\"\nmodel = \"single-sensor\"\nmethod = \"latent\"\nspace = \"embedding\"\n[taxonomy]\nmedoids = 3\n[search]\ngenerations = 15\n\
           [feedback]\ngenerations = 5\n[world]\nagents = 6\nhorizon = 200",
    ..SMALL
};

/// The report of a campaign with one round of labels from people.
fn taught() -> Report {
    let mut report = sample::report(&LATENT);
    let checkpoint = CheckpointDigest::of(b"taught");
    report.checkpoint = checkpoint.to_string();
    report.repetition = Repetition {
        rounds: vec![Round {
            parent: CheckpointDigest::of(b"pretrained"),
            checkpoint,
            labels: 206,
            label_digest: "0a1b".to_owned(),
        }],
        attended: true,
        adopted: false,
    };
    report
}

#[test]
fn a_specification_promises_its_archive_only_where_it_leads_there() {
    const PROMISE: &str = "reproduces the archive, bit for bit";
    for sample in [SMALL, LATENT] {
        let alone = sample::report(&sample);
        assert!(page(&alone).contains(PROMISE));
        assert_eq!(again::specification(&alone), alone.spec.to_toml());
    }
    let taught = taught();
    let (_place, files) = written(&taught);
    let page = fs::read_to_string(&files.page).unwrap();
    assert!(!page.contains(PROMISE));
    let spec = fs::read_to_string(files.page.with_file_name("spec.toml")).unwrap();
    let round = &taught.repetition.rounds[0];
    let (parent, checkpoint) = (round.parent, round.checkpoint);
    for expected in [
        "This specification alone does not reproduce the archive of campaign sample-1.".to_owned(),
        "The labels that campaign sample-1 learned from are needed".to_owned(),
        format!("Round 1 fine-tuned checkpoint {parent} on the classes of 206 individuals"),
        format!("into checkpoint {checkpoint}"),
    ] {
        assert!(page.contains(&expected) && spec.contains(&expected), "{expected}");
    }
    assert!(page.contains("murmuration labels sample-1 --csv labels.csv"));
    assert_eq!(CampaignSpec::from_toml(&spec).unwrap(), taught.spec);

    // No label file can repeat the answers of the synthetic annotator.
    let mut named = self::taught();
    assert!(!again::is_by_commands(&named));
    named.names.by_individual.retain(|_, given| !given.by_machine);
    assert!(again::is_by_commands(&named));

    let mut adopted = taught;
    adopted.repetition.adopted = true;
    let page = crate::page(&adopted).unwrap();
    assert!(page.contains("which the campaign adopted"));
    let digest = CheckpointDigest::of(b"elsewhere");
    let mut published = sample::report(&LATENT);
    let text = format!("model = \"single-sensor\"\nmethod = \"latent\"\ncheckpoint = \"{digest}\"");
    published.spec = CampaignSpec::from_toml(&text).unwrap();
    assert!(again::specification(&published).contains(&format!("# Checkpoint {digest} is needed")));
}

#[test]
fn a_space_that_changed_is_said_to_have() {
    let alone = page(&sample::report(&LATENT));
    assert!(alone.contains("Each generation was bred by the values of the generation before it."));
    assert!(!alone.contains("The embedding changed") && alone.contains("was defined beforehand"));
    let taught = page(&taught());
    assert!(taught.contains("during this campaign: it was fine-tuned on labels in 1 round."));
    assert!(!taught.contains("Each generation was bred by") && !taught.contains("was defined beforehand"));
    assert!(taught.contains("20 (15 of the search, 5 for 1 round of feedback)"));
    let drawn = page(&sample::report(&Sample {
        spec: "model = \"single-sensor\"\nmethod = \"random\"\n[taxonomy]\nmedoids = 3\n[world]\nagents = 6\nhorizon = 200",
        ..SMALL
    }));
    assert!(drawn.contains("every controller was drawn at random"));
}

//! Commands that go wrong.

use super::{Transcript, done, fails};

/// What people meet most when something is wrong, first without a data directory, then about a campaign.
pub const ERRORS: [Transcript; 49] = [
    fails("robot-sensors", 2, &["robot", "FOLDER/seven.toml"])
        .with_files(&[("seven.toml", "robot.sensors = [{}, {}, {}, {}, {}, {}, {}]")]),
    fails("robot-cone", 2, &["robot", "FOLDER/cone.toml"])
        .with_files(&[("cone.toml", "robot.sensors = [{ half_angle = 3.2 }]")]),
    fails(
        "error-evaluate",
        2,
        &["evaluate", "FOLDER/small.toml", "FOLDER/genes.csv"],
    )
    .with_files(&[("genes.csv", "left_1,right_1\n0.1,0.2\n")]),
    fails("error-study-field", 2, &["study", "run", "FOLDER/bad.toml"])
        .with_files(&[("bad.toml", "name = \"bad\"\nseed = 2\n")]),
    fails("error-study-cell", 2, &["study", "run", "FOLDER/bad.toml"]).with_files(&[(
        "bad.toml",
        "name = \"bad\"\ncampaign.model = \"single-sensor\"\n\
         axes = [{ name = \"method\", values = [{ name = \"wrong\", campaign.method = \"wrong\" }] }]\n",
    )]),
    fails("error-no-study", 2, &["study", "show", "other"]),
    fails("error-no-data-directory", 2, &["list"]),
    fails("error-unknown-command", 2, &["nonsense"]),
    fails("error-mistyped-command", 2, &["rn", "small.toml"]),
    fails("error-unknown-option", 2, &["list", "--jsn"]),
    fails(
        "error-no-coordinator",
        1,
        &["list", "--coordinator", "http://127.0.0.1:9"],
    ),
    fails("error-missing-file", 2, &["run", "missing.toml"]),
    fails("error-syntax", 2, &["run", "FOLDER/bad.toml"]).with_files(&[("bad.toml", "model = [")]),
    fails("error-unknown-field", 2, &["run", "FOLDER/bad.toml"]).with_files(&[(
        "bad.toml",
        "model = \"single-sensor\"\nmethod = \"random\"\n[search]\npopluation = 20\n",
    )]),
    fails("error-wrong-type", 2, &["run", "FOLDER/bad.toml"]).with_files(&[(
        "bad.toml",
        "model = \"single-sensor\"\nmethod = \"latent\"\n[training]\nheld_out = true\n",
    )]),
    fails("error-out-of-range", 2, &["run", "FOLDER/bad.toml"]).with_files(&[(
        "bad.toml",
        "model = \"single-sensor\"\nmethod = \"random\"\n[search]\npopulation = 0\n",
    )]),
    fails(
        "error-no-workers",
        2,
        &["run", "FOLDER/small.toml", "--workers", "0"],
    ),
    fails(
        "error-controller",
        2,
        &["simulate", "--controller", "0.1,0.2,0.3"],
    ),
    fails("error-gene", 2, &["simulate", "--controller", "0.1,0.2,0.3,1.5"]),
    fails(
        "error-picture-name",
        2,
        &["simulate", "--controller", "0,0,0,0", "--gif", "FOLDER/a.png"],
    ),
    fails("error-tracks-column", 2, &["recognise", "FOLDER/bad.csv"])
        .with_files(&[("bad.csv", "frame,x,y\n0,1,2\n")]),
    fails("error-tracks-cell", 2, &["recognise", "FOLDER/bad.csv"])
        .with_files(&[("bad.csv", "frame,robot,x,y\n0,0,1,2\n1,0,1,up\n")]),
    fails("error-no-answers", 2, &["label", "latest"]),
    fails("error-token-role", 2, &["token", "ana", "--role", "king"]),
    fails("error-insecure-listen", 2, &["serve", "--listen", "0.0.0.0:0"]),
    fails("error-restore", 2, &["restore", "FOLDER/nothing"]),
    fails("error-doctor-no-data-directory", 2, &["doctor"]),
    done("campaign-for-errors", &["run", "FOLDER/small.toml"]),
    fails("error-no-campaign", 2, &["show", "other-1"]),
    fails("error-tracks-gap", 2, &["recognise", "FOLDER/gap.csv"]).with_files(&[(
        "gap.csv",
        "frame,robot,x,y\n0,0,1,2\n0,1,1,2\n90,0,1,2\n90,1,1,2\n60,0,1,2\n",
    )]),
    fails("error-no-individual", 2, &["show", "small-1", "--index", "100"]),
    fails("error-submit-alone", 1, &["submit", "FOLDER/small.toml"]),
    fails("error-resume-completed", 1, &["resume", "small-1"]),
    fails("error-pause-completed", 1, &["pause", "small-1"]),
    fails("error-cancel-completed", 1, &["cancel", "small-1"]),
    fails("error-refine-hand-crafted", 1, &["refine", "small-1"]),
    fails("error-adopt-unknown", 2, &["adopt", "small-1", "0000"]),
    fails("error-no-checkpoint", 2, &["checkpoints", "show", "0000"]),
    fails(
        "error-export",
        2,
        &["checkpoints", "export", "0000", "FOLDER/out.onnx"],
    ),
    fails(
        "error-label-column",
        2,
        &["label", "small-1", "--csv", "FOLDER/bad.csv"],
    )
    .with_files(&[("bad.csv", "id,klass\n1,ring\n")]),
    fails(
        "error-label-row",
        2,
        &["label", "small-1", "--csv", "FOLDER/bad.csv"],
    )
    .with_files(&[("bad.csv", "id,class,annotator,time\n1,ring,ana,1763700000000\n")]),
    fails(
        "error-labels-csv-exists",
        2,
        &["labels", "small-1", "--csv", "FOLDER/bad.csv"],
    ),
    fails(
        "error-class",
        2,
        &["classes", "small-1", "--rename", "ring", "mill"],
    ),
    fails(
        "error-agreement",
        2,
        &["agreement", "small-1", "--annotators", "ana", "ben"],
    ),
    fails(
        "error-quarantine-lift",
        2,
        &["quarantine", "--lift", "5f0c3a9e12d4b687"],
    ),
    fails("error-atlas", 2, &["atlas", "small-1"]),
    fails("error-exhaustive", 2, &["run", "FOLDER/bad.toml"]).with_files(&[(
        "bad.toml",
        "model = \"single-sensor\"\nmethod = \"exhaustive\"\n[search]\npopulation = 100\n",
    )]),
    fails("error-backup-within", 2, &["backup", "FOLDER/data/backup"]),
    fails("error-health", 1, &["health"]),
];

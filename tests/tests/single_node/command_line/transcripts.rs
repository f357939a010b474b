//! The commands whose output is kept in `snapshots`, in the order in which they run.

mod errors;

pub use errors::ERRORS;

/// A command line, and what is known of it beforehand.
pub struct Transcript {
    /// The name of its snapshot.
    pub name: &'static str,
    /// Its arguments; `FOLDER` is the folder of its files, `MODELS` that of the models for tests.
    pub arguments: &'static [&'static str],
    /// Its exit code.
    pub code: i32,
    /// The kind of the documents that it prints, with --json.
    pub kind: Option<&'static str>,
    /// Whether it prints figures of this machine.
    pub figures: bool,
    /// Files that it finds in the folder.
    pub files: &'static [(&'static str, &'static str)],
}

/// A command that succeeds.
const fn done(name: &'static str, arguments: &'static [&'static str]) -> Transcript {
    Transcript {
        name,
        arguments,
        code: 0,
        kind: None,
        figures: false,
        files: &[],
    }
}

/// A command that prints documents of a kind.
const fn json(name: &'static str, kind: &'static str, arguments: &'static [&'static str]) -> Transcript {
    Transcript {
        kind: Some(kind),
        ..done(name, arguments)
    }
}

/// A command that fails.
const fn fails(name: &'static str, code: i32, arguments: &'static [&'static str]) -> Transcript {
    Transcript {
        code,
        ..done(name, arguments)
    }
}

impl Transcript {
    const fn with_figures(self) -> Self {
        Self {
            figures: true,
            ..self
        }
    }

    const fn with_files(self, files: &'static [(&'static str, &'static str)]) -> Self {
        Self { files, ..self }
    }
}

const GENES: &str = "left_0,right_0,left_1,right_1,seed\n-0.7,0.3,1,1,7\n1,1,1,1,8\n";

const LABELS: &str = "id,class,annotator,time\n\
    0,ring,ana,2026-11-21T12:00:00Z\n1,ring,ana,2026-11-21T12:00:01Z\n\
    2,clump,ana,2026-11-21T12:00:02Z\n3,clump,ana,2026-11-21T12:00:03Z\n\
    4,not sure,ana,2026-11-21T12:00:04Z\n\
    0,ring,ben,2026-11-21T12:00:05Z\n1,clump,ben,2026-11-21T12:00:06Z\n";

/// Tracks of two robots, one of which a frame lacks.
const FEW: &str = "frame,robot,x,y\n0,1,100,100\n0,2,200,200\n1,1,101,100\n2,1,102,100\n2,2,200,202\n";

const ROBOTS: &str = "ratios = [[3, 1], [2, 2]]\n[[species]]\nname = \"a\"\nmodel = \"two-sensor\"\n\
    [[species]]\nname = \"b\"\nrobot.sensors = [{ half_angle = 0.2, range = 120, sees = [\"a\", \"walls\"] }]\n";

/// Its first cell is the campaign of `small.toml`.
const STUDY: &str = "name = \"two\"\nseeds = 2\nbehaviours.generations = 2\n\
    [campaign]\nmodel = \"single-sensor\"\nmethod = \"hand-crafted\"\nworld.horizon = 200\n\
    search = { population = 20, generations = 5 }\ntaxonomy.medoids = 4\n";
/// A world of two species as the authors' simulator saves it.
const SAVED_WORLD: &str = r#"{"behavior": [], "w": 500, "h": 500, "population_size": 30, "seed": null, "padding": 15,
"agent_config": {"type": "HeterogeneousSwarmConfig", "sub_population_configs": [
{"type": "DiffDriveAgentConfig", "dt": 1.0, "agent_radius": 5, "wheel_radius": 2.0, "controller": [-0.7, 0.3, 1.0, 1.0],
"sensors": {"sensors": [{"type": "BinaryLOSSensor", "angle": 0, "history_length": 50}]}},
{"type": "UnicycleAgentConfig", "dt": 1.0, "agent_radius": 5, "controller": [5.0, 0.3, 12.0, 0.0],
"sensors": {"sensors": [{"type": "BinaryFOVSensor", "theta": 0.12, "bias": -0.07, "fp": 0.1, "fn": 0.05,
"agent_sensing_range": 181.2}]}}], "counts": [18, 12]},
"show_walls": true, "collide_walls": false, "stop_at": null, "objects": [], "goals": [], "agent_init": null}"#;
/// All controllers of a grid of three values of each speed.
const COARSE: &str = "name = \"coarse\"\nmodel = \"single-sensor\"\nmethod = \"exhaustive\"\n\
    [controllers]\nstep = 1\n[world]\nhorizon = 100\n";

const BENCH_CLUSTER: [&str; 8] = [
    "bench",
    "cluster",
    "--generations",
    "1",
    "--null-generations",
    "1",
    "--rounds",
    "1",
];

/// Of one campaign, from its run to its backup.
pub const OUTPUTS: [Transcript; 83] = [
    json("run-json", "run", &["run", "FOLDER/small.toml", "--json"]),
    done("run", &["run", "FOLDER/small.toml", "--seed", "7"]),
    done("list", &["list"]),
    json("list-json", "campaign", &["list", "--json"]),
    done("show", &["show", "small-1"]),
    json("show-json", "campaign", &["show", "small-1", "--json"]),
    done("show-index", &["show", "small-1", "--index", "42"]),
    json(
        "show-index-json",
        "individual",
        &["show", "small-1", "--index", "42", "--json"],
    ),
    done("show-taxonomy", &["show", "small-1", "--taxonomy"]),
    json(
        "show-taxonomy-json",
        "taxonomy",
        &["show", "small-1", "--taxonomy", "--json"],
    ),
    done("watch", &["watch", "small-1"]),
    json("watch-json", "campaign", &["watch", "small-1", "--json"]),
    done("digest", &["digest", "small-1"]),
    json("digest-json", "digest", &["digest", "small-1", "--json"]),
    done("report", &["report", "small-1", "--out", "FOLDER/report"]),
    json(
        "report-json",
        "report",
        &["report", "small-1", "--out", "FOLDER/report", "--json"],
    ),
    done("label", &["label", "small-1", "--csv", "FOLDER/mine.csv"]).with_files(&[("mine.csv", LABELS)]),
    json(
        "label-json",
        "added-labels",
        &["label", "small-1", "--synthetic", "2", "--json"],
    ),
    done("labels", &["labels", "small-1"]),
    json("labels-json", "label", &["labels", "small-1", "--json"]),
    done("labels-csv", &["labels", "small-1", "--csv", "FOLDER/out.csv"]),
    done(
        "labels-csv-force",
        &["labels", "small-1", "--csv", "FOLDER/out.csv", "--force"],
    ),
    done("classes", &["classes", "small-1"]),
    done("classes-create", &["classes", "small-1", "--create", "rings"]),
    json("classes-json", "class", &["classes", "small-1", "--json"]),
    done(
        "agreement",
        &["agreement", "small-1", "--annotators", "ana", "ben"],
    ),
    json(
        "agreement-json",
        "agreement",
        &["agreement", "small-1", "--annotators", "ana", "ben", "--json"],
    ),
    done(
        "accuracy",
        &["accuracy", "--features", "--labels", "FOLDER/out.csv"],
    ),
    json(
        "accuracy-json",
        "accuracy",
        &["accuracy", "--features", "--labels", "FOLDER/out.csv", "--json"],
    ),
    done(
        "accuracy-untrained",
        &["accuracy", "--untrained", "2", "--labels", "FOLDER/out.csv"],
    )
    .with_figures(),
    json(
        "accuracy-untrained-json",
        "untrained-accuracy",
        &[
            "accuracy",
            "--untrained",
            "2",
            "--labels",
            "FOLDER/out.csv",
            "--json",
        ],
    )
    .with_figures(),
    done("judge", &["judge", "--labels", "FOLDER/out.csv"]),
    json(
        "judge-json",
        "judge",
        &["judge", "--labels", "FOLDER/out.csv", "--json"],
    ),
    done("simulate", &["simulate", "--controller", "-0.7,0.3,1,1"]),
    json(
        "simulate-json",
        "individual",
        &["simulate", "--controller", "-0.7,0.3,1,1", "--json"],
    ),
    done("evaluate", &["evaluate", "FOLDER/small.toml", "FOLDER/genes.csv"])
        .with_files(&[("genes.csv", GENES)]),
    json(
        "evaluate-json",
        "evaluated",
        &["evaluate", "FOLDER/small.toml", "FOLDER/genes.csv", "--json"],
    ),
    done(
        "simulate-tracks",
        &[
            "simulate",
            "--controller",
            "-0.7,0.3,1,1",
            "--tracks",
            "FOLDER/tracks.csv",
        ],
    ),
    done("recognise", &["recognise", "FOLDER/tracks.csv"]),
    json(
        "recognise-json",
        "recognised",
        &["recognise", "FOLDER/few.csv", "--count", "2", "--json"],
    )
    .with_files(&[("few.csv", FEW)]),
    done("robot", &["robot", "FOLDER/robots.toml"]).with_files(&[("robots.toml", ROBOTS)]),
    json("robot-json", "robots", &["robot", "--model", "turbopi", "--json"]),
    done("controller-export", &["controller", "export", "small-1", "3"]),
    json(
        "controller-export-json",
        "exported-controller",
        &["controller", "export", "--controller", "0.1,-0.2,0.3,1", "--json"],
    ),
    done("filter", &["filter", "-0.7,0.3,1,1", "0,0,0,0"]),
    json(
        "filter-json",
        "filter-score",
        &["filter", "-0.7,0.3,1,1", "0,0,0,0", "--json"],
    ),
    done(
        "checkpoints-import",
        &["checkpoints", "import", "MODELS/small.onnx"],
    ),
    done("checkpoints-list", &["checkpoints", "list"]),
    json(
        "checkpoints-list-json",
        "checkpoint",
        &["checkpoints", "list", "--json"],
    ),
    done("token", &["token", "ana", "--role", "annotator"]),
    json(
        "token-json",
        "token",
        &["token", "ana", "--role", "annotator", "--json"],
    ),
    done("certs", &["certs", "FOLDER/certs", "--host", "swarm.example"]),
    json(
        "certs-json",
        "certificates",
        &["certs", "FOLDER/certs", "--worker", "alpha", "--json"],
    ),
    done("quarantine", &["quarantine"]),
    json("quarantine-json", "quarantine", &["quarantine", "--json"]),
    done("doctor", &["doctor"]),
    json(
        "doctor-json",
        "doctor",
        &["doctor", "--salvage", "FOLDER/saved", "--json"],
    ),
    done("backup", &["backup", "FOLDER/backup"]),
    json(
        "restore-json",
        "backup",
        &["restore", "FOLDER/backup", "--data", "FOLDER/restored", "--json"],
    ),
    done("export", &["export", "small-1", "FOLDER/exported"]),
    json(
        "export-json",
        "export",
        &[
            "export",
            "small-1",
            "FOLDER/exported",
            "--csv",
            "--force",
            "--json",
        ],
    ),
    done(
        "import",
        &["import", "FOLDER/exported", "--data", "FOLDER/imported"],
    ),
    json(
        "import-json",
        "campaign",
        &[
            "import",
            "FOLDER/exported",
            "--data",
            "FOLDER/imported-again",
            "--json",
        ],
    ),
    fails("error-import-there", 2, &["import", "FOLDER/exported"]),
    fails("error-export-there", 2, &["export", "small-1", "FOLDER/exported"]),
    fails("error-import-other", 2, &["import", "FOLDER/backup"]),
    done("world", &["world", "FOLDER/cyclone.json"]).with_files(&[("cyclone.json", SAVED_WORLD)]),
    done("study-run", &["study", "run", "FOLDER/two.toml"]).with_files(&[("two.toml", STUDY)]),
    json(
        "study-run-json",
        "study",
        &["study", "run", "FOLDER/two.toml", "--json"],
    ),
    done("study-list", &["study", "list"]),
    json("study-list-json", "listed-study", &["study", "list", "--json"]),
    done("study-show", &["study", "show", "two"]),
    done(
        "study-report",
        &["study", "report", "two", "--out", "FOLDER/report"],
    ),
    done("bench-simulate", &["bench", "simulate", "--seconds", "0.02"]).with_figures(),
    json(
        "bench-simulate-json",
        "bench-simulate",
        &["bench", "simulate", "--seconds", "0.02", "--json"],
    )
    .with_figures(),
    done(
        "bench-pipeline",
        &["bench", "pipeline", "--controllers", "100", "--generations", "1"],
    )
    .with_figures(),
    json(
        "bench-pipeline-json",
        "bench-pipeline",
        &[
            "bench",
            "pipeline",
            "--controllers",
            "100",
            "--generations",
            "1",
            "--json",
        ],
    )
    .with_figures(),
    done("bench-cluster", &BENCH_CLUSTER).with_figures(),
    json(
        "bench-cluster-json",
        "bench-cluster",
        &[
            "bench",
            "cluster",
            "--generations",
            "1",
            "--null-generations",
            "1",
            "--rounds",
            "1",
            "--json",
        ],
    )
    .with_figures(),
    done("atlas", &["atlas", "FOLDER/coarse.toml", "--out", "FOLDER/atlas"])
        .with_files(&[("coarse.toml", COARSE)]),
    json(
        "atlas-json",
        "atlas",
        &["atlas", "FOLDER/coarse.toml", "--out", "FOLDER/atlas", "--json"],
    ),
    done("delete", &["delete", "small-2"]),
    json(
        "delete-json",
        "deletion",
        &["delete", "small-2", "--yes", "--json"],
    ),
];

/// To a coordinator that stays, without workers.
pub const SERVED: [Transcript; 9] = [
    done("health", &["health"]),
    done("submit", &["submit", "FOLDER/small.toml"]),
    json(
        "submit-json",
        "campaign",
        &["submit", "FOLDER/small.toml", "--json"],
    ),
    done("pause", &["pause", "small-1"]),
    done("resume-served", &["resume", "small-1"]),
    done("cancel", &["cancel", "small-1"]),
    fails("error-report-unfinished", 1, &["report", "small-2"]),
    fails("error-data-directory-held", 1, &["run", "FOLDER/small.toml"]),
    fails("error-doctor-held", 1, &["doctor"]),
];

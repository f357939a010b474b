//! Names of the files of studies in a data directory, for the code that runs, shows and backs up studies.

/// The folder of all studies in a data directory; each study is a folder in it.
pub const STUDIES: &str = "studies";
/// The study file, as of the study's last run.
pub const STUDY_FILE: &str = "study.toml";
/// How the study was run.
pub const STUDY_ORIGIN: &str = "origin.json";
/// The checkpoints that cells of the study share.
pub const STUDY_EMBEDDERS: &str = "embedders.json";
/// The classes that people gave on the page of the study.
pub const STUDY_CLASSES: &str = "classes.csv";
/// The files of a study that cannot be made again from its campaigns.
pub const STUDY_ORIGINALS: [&str; 4] = [STUDY_FILE, STUDY_ORIGIN, STUDY_EMBEDDERS, STUDY_CLASSES];

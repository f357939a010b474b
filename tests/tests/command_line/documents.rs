//! Runs the commands of each page of the documents. Each command that is not run has a reason.

use crate::script::{
    Rule::{Before, NotRun, Stays},
    Script, free_port,
};
use murmuration_tests::{
    Test,
    pages::{blocks, pages},
};

const PAGES: [&str; 11] = [
    "README.md",
    "docs/first-campaign.md",
    "docs/labelling.md",
    "docs/clusters.md",
    "docs/commands.md",
    "docs/performance.md",
    "docs/operations.md",
    "docs/security.md",
    "docs/data-directory.md",
    "docs/export.md",
    "docs/results.md",
];

const LONG: &str = "it takes half an hour and more";
const NO_TRAINING_LABELS: &str = "the labels for training are not in the repository";

/// A shell command that writes a table of labels.
const ANSWERS: &str = "printf 'index,class\\n0,ring\\n1,ring\\n2,clump\\n3,clump\\n' >my.csv";

/// A shell command that writes a table of controllers.
pub const CONTROLLERS: &str =
    "printf 'left_0,right_0,left_1,right_1\\n-0.7,0.3,1,1\\n1,1,1,1\\n' >controllers.csv";

/// The beginning of a command that renders a film.
pub const FILM: &str = "murmuration simulate --controller=-0.7,0.3,1,1 --mp4";
pub const NO_ENCODER: &str = "ffmpeg need not be there";

pub fn of_the_readme() {
    let port = free_port();
    Script::of("README.md")
        // This command would create a folder in the home directory.
        .replace("python3 -m venv ~/swarms && . ~/swarms/bin/activate", "true")
        .replace(
            "murmuration serve --workers 0",
            format!("murmuration serve --workers 0 --listen 127.0.0.1:{port}"),
        )
        .replace("127.0.0.1:7700", format!("127.0.0.1:{port}"))
        .replace("my-robot.toml", "small.toml")
        .rule(
            "make ",
            NotRun("it builds and tests everything, which this test is a part of"),
        )
        .rule("murmuration serve", Stays("pages:"))
        .rule("murmuration-worker", Stays("connected"))
        .rule("murmuration-trainer", Stays("connected"))
        .run();
}

pub fn of_the_page_on_a_first_campaign() {
    Script::of("docs/first-campaign.md")
        .rule(
            "murmuration run mine.toml",
            Before("cp docs/example-report/campaign.toml mine.toml"),
        )
        .run();
}

pub fn of_the_page_on_labelling() {
    let port = free_port();
    Script::of("docs/labelling.md")
        .replace(
            "murmuration serve",
            format!("murmuration serve --listen 127.0.0.1:{port}"),
        )
        .replace("examples/quick-latent.toml", "small.toml")
        .rule("murmuration serve", Stays("pages:"))
        .rule("murmuration label latest", Before(ANSWERS))
        .run();
}

pub fn of_the_page_on_clusters() {
    let port = free_port();
    Script::of("docs/clusters.md")
        .replace(
            "murmuration serve --workers 0",
            format!("murmuration serve --workers 0 --listen 127.0.0.1:{port}"),
        )
        .replace("127.0.0.1:7700", format!("127.0.0.1:{port}"))
        .replace("examples/quick.toml", "small.toml")
        .rule("murmuration serve", Stays("pages:"))
        .rule("murmuration-worker", Stays("connected"))
        .rule("murmuration-trainer", Stays("connected"))
        .run();
}

pub fn of_the_page_on_commands() {
    Script::of("docs/commands.md")
        .replace("latest CHECKPOINT", "latest $OTHER")
        .replace("--generations 200", "--generations 6")
        .rule("murmuration run examples/two-sensor-latent.toml", NotRun(LONG))
        .rule("murmuration resume latest", Before("interrupted small.toml"))
        .rule(
            "murmuration adopt",
            Before(
                "OTHER=\"$(murmuration checkpoints list --json | sed -n 's/.*\"digest\":\"\\([0-9a-f]\\{8\\}\\).*/\\1/p' | head -n 1)\"",
            ),
        )
        .rule(
            "murmuration evaluate",
            Before(CONTROLLERS),
        )
        .rule(
            "murmuration delete",
            NotRun("the campaign of that number is another one here"),
        )
        .rule(FILM, NotRun(NO_ENCODER))
        .rule(
            "murmuration label latest --csv",
            Before(ANSWERS),
        )
        // An earlier command must not have changed the person's own file.
        .rule(
            "murmuration lab judge",
            Before("test \"$(sed -n 2p my.csv)\" = 0,ring"),
        )
        .run();
}

pub fn of_the_page_on_operations() {
    let [coordinator, worker] = [free_port(), free_port()];
    Script::of("docs/operations.md")
        .replace("127.0.0.1:7700", format!("127.0.0.1:{coordinator}"))
        .replace("127.0.0.1:7701", format!("127.0.0.1:{worker}"))
        .rule(
            "docker compose",
            NotRun("tests/tests/containers starts this cluster"),
        )
        .rule(
            "export MURMURATION_COORDINATOR",
            NotRun("there are no containers here"),
        )
        .rule("murmuration submit", NotRun("there are no containers here"))
        .rule("murmuration watch", NotRun("there are no containers here"))
        .rule("kubectl", NotRun("there is no Kubernetes here"))
        .rule("for who in", NotRun("there is no Kubernetes here"))
        .rule(
            "murmuration health --coordinator http://127.0.0.1:7701 --alive",
            Before("kill -0 \"${stays[1]}\""),
        )
        .rule(
            "murmuration health --coordinator http://127.0.0.1:7701",
            Before(
                "if [ ${#stays[@]} = 0 ]; then\n\
                 murmuration serve --workers 0 --listen 127.0.0.1:7700 >\"$DESK/serve.log\" 2>&1 &\n\
                 stay serve.log pages:\n\
                 MURMURATION_HEALTH=127.0.0.1:7701 murmuration-worker >\"$DESK/worker.log\" 2>&1 &\n\
                 stay worker.log connected\n\
                 fi",
            ),
        )
        .run();
}

pub fn of_the_page_on_security() {
    let port = free_port();
    Script::of("docs/security.md")
        .replace("0.0.0.0:7700", format!("127.0.0.1:{port}"))
        .replace("swarm.example:7700", format!("localhost:{port}"))
        .rule("murmuration serve", Stays("pages:"))
        .rule(
            "murmuration-worker",
            // The files that people copy to the other machines, according to the page.
            Before(
                "mkdir other && cp certs/ca.pem certs/alpha*.pem certs/beta*.pem certs/trainer*.pem other && cp small.toml other/spec.toml && cd other\n\
                 grep -o 'mur_[A-Za-z0-9_-]*' \"$DESK/output\" | head -n 1 >my-token",
            ),
        )
        .rule("murmuration-worker", Stays("connected"))
        .rule("murmuration-trainer", Stays("connected"))
        .run();
}

pub fn of_the_page_on_the_data_directory() {
    Script::of("docs/data-directory.md")
        .replace("CAMPAIGN", "small-1")
        .replace("/backups/", "backups/")
        .rule(
            "murmuration doctor",
            Before("test -e murmuration-data || interrupted small.toml"),
        )
        .rule(
            "murmuration restore /backups/monday --data restored-data",
            Before("murmuration backup backups/monday"),
        )
        .rule("murmuration backup", Before("rm -r backups"))
        .rule(
            "murmuration restore /backups/monday --data murmuration-data",
            Before("mv murmuration-data before"),
        )
        .run();
}

pub fn of_the_page_on_exports() {
    Script::of("docs/export.md")
        .rule("murmuration export latest", Before("murmuration run small.toml"))
        .run();
}

pub fn of_the_page_on_results() {
    Script::of("docs/results.md")
        .rule(
            "murmuration lab accuracy --labels $L/single_sensor/validation.csv --checkpoint",
            NotRun(LONG),
        )
        .rule(
            "murmuration lab accuracy --labels $L/two_sensor/validation.csv --labels $L/rare/validation.csv --checkpoint",
            NotRun(LONG),
        )
        .rule("murmuration run", NotRun(LONG))
        .rule(
            "murmuration lab study run",
            NotRun("tests/tests/single_node/studies.rs runs smaller ones"),
        )
        .rule("murmuration lab study report recall", NotRun("the study before it was not run"))
        .rule("murmuration checkpoints list", NotRun("it lists what the campaign before it trained"))
        .rule("murmuration lab bench labels", NotRun(NO_TRAINING_LABELS))
        .run();
}

/// The `make` commands of the page take minutes; the test would run any other command of the page.
pub fn of_the_page_on_performance() {
    let measures = "it measures for minutes, in the release profile";
    Script::of("docs/performance.md")
        .rule("make ", NotRun(measures))
        .run();
}

/// A test for each other page with commands.
pub fn of_other_pages() -> Vec<Test> {
    let pages = pages().into_iter();
    let others = pages.filter(|(name, text)| {
        !PAGES.contains(&name.as_str()) && blocks(text).iter().any(|(language, _)| language == "sh")
    });
    let test = |(name, text): (String, String)| {
        Test::new(&format!("documents::of_{name}"), move || {
            let script = Script::of(&name);
            let script = match text.contains("murmuration serve --data atlas-data") {
                true => script.rule("murmuration serve", Stays("pages:")).replace(
                    "serve --data atlas-data",
                    "serve --data atlas-data --listen 127.0.0.1:0",
                ),
                false => script,
            };
            script.run();
        })
    };
    others.map(test).collect()
}

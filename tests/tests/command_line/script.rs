//! Runs commands as one script, in a folder with the repository's files. A command that is not run has a rule with the reason.

use murmuration_tests::{
    binary,
    pages::{blocks, page, root},
    small_latent_spec,
};
use std::{
    fmt::Write as _,
    fs,
    net::TcpListener,
    os::unix::fs::symlink,
    path::Path,
    process::{Command, Stdio},
};
use tempfile::TempDir;

/// Rules for lines that begin in a certain way. Lines without a rule are run as they are.
#[derive(Debug, Clone, Copy)]
pub enum Rule {
    /// The command keeps running in the background. The script waits until the command has printed this text, and stops the
    /// command after the script's last line.
    Stays(&'static str),
    /// A piece of script that runs before the line.
    Before(&'static str),
    /// The command is not run, for this reason. The test still checks its arguments: the options of `murmuration`, make's
    /// targets, files for `kubectl`.
    NotRun(&'static str),
}

/// Commands that run one after the other.
pub struct Script {
    name: String,
    commands: Vec<String>,
    rules: Vec<(&'static str, Rule)>,
    replaced: Vec<(&'static str, String)>,
    small_campaign: String,
    captures: bool,
}

/// The output of a command.
pub struct Captured {
    pub stdout: String,
    pub stderr: String,
    /// `None` for a command that keeps running.
    pub code: Option<i32>,
}

/// Shell code that defines substitutes for programs that are not run, and functions that wait for background commands and stop
/// them.
const PRELUDE: &str = r#"
set -euo pipefail
stays=()
understood() { printf '%s\0' "$@" >>"$DESK/understood"; printf '\036\0' >>"$DESK/understood"; }
stay() { # the log's name, and the sign
    until grep -qF "$2" "$DESK/$1"; do
        kill -0 "$!" || { cat "$DESK/$1" >&2; exit 1; }
        sleep 0.05
    done
    stays+=("$!")
}
leave() {
    # One may have ended because another did.
    for process in "${stays[@]}"; do kill "$process" 2>&- || true; wait "$process"; done
    stays=()
}
not_run() { # the line
    (
        murmuration() { understood murmuration "$@"; }
        make() { command make --dry-run "$@" >/dev/null; }
        docker() { :; }
        pip() { :; }
        kubectl() {
            for word in "$@"; do
                case "$word" in
                --from-file=*) test -f "${word##*=}" ;;
                --kustomize) test -f deploy/kubernetes/kustomization.yaml ;;
                esac || { echo "no such file: $word" >&2; exit 1; }
            done
        }
        eval "$1"
    )
}
# A campaign that its coordinator has left: $1 is its file.
interrupted() {
    murmuration serve --workers 0 --listen 127.0.0.1:0 >"$DESK/interrupted.log" 2>&1 &
    local coordinator=$!
    until grep -qF pages: "$DESK/interrupted.log"; do kill -0 "$coordinator"; sleep 0.05; done
    murmuration submit "$1"
    kill "$coordinator"
    wait "$coordinator"
}
"#;

impl Script {
    /// A script of the shell blocks of a page.
    pub fn of(name: &str) -> Self {
        let text = page(name);
        let blocks = blocks(&text).into_iter();
        let shell = blocks.filter(|(language, _)| language == "sh");
        Self::new(name, shell.flat_map(|(_, lines)| commands(&lines)).collect())
    }

    /// A script of `commands`, with this name.
    pub fn new(name: &str, commands: Vec<String>) -> Self {
        Self {
            name: name.to_owned(),
            commands,
            rules: Vec::new(),
            replaced: Vec::new(),
            small_campaign: small_latent_spec("").to_toml(),
            captures: false,
        }
    }

    /// Uses `toml` as the campaign file `small.toml`.
    pub fn small_campaign(mut self, toml: String) -> Self {
        self.small_campaign = toml;
        self
    }

    /// Adds a rule for lines that begin with `beginning`.
    pub fn rule(mut self, beginning: &'static str, rule: Rule) -> Self {
        self.rules.push((beginning, rule));
        self
    }

    /// Replaces a name that only an example has.
    pub fn replace(mut self, example: &'static str, by: impl Into<String>) -> Self {
        self.replaced.push((example, by.into()));
        self
    }

    /// Runs the script. Panics with its whole output if a command fails.
    pub fn run(self) {
        let (desk, succeeds) = self.run_at_a_desk();
        let output = fs::read_to_string(desk.path().join("output")).unwrap();
        assert!(succeeds, "{}:\n{output}", self.name);
        check_understood(desk.path());
    }

    /// Runs the script, and returns the output of each command, whether or not it fails.
    pub fn capture(mut self) -> Vec<Captured> {
        self.captures = true;
        let (desk, succeeds) = self.run_at_a_desk();
        let output = fs::read_to_string(desk.path().join("output")).unwrap();
        assert!(succeeds, "{}:\n{output}", self.name);
        let captured = |number: usize| {
            let read = |what: &str| fs::read_to_string(desk.path().join(format!("{number}.{what}")));
            Captured {
                stdout: read("log").unwrap(),
                stderr: read("stderr").unwrap_or_default(),
                code: read("code").ok().map(|code| code.trim().parse().unwrap()),
            }
        };
        (0..self.commands.len()).map(captured).collect()
    }

    /// Runs the script in a folder of its own, with the repository's files. Returns the folder, and whether the script succeeded.
    fn run_at_a_desk(&self) -> (TempDir, bool) {
        let desk = tempfile::tempdir().unwrap();
        let work = desk.path().join("work");
        fs::create_dir(&work).unwrap();
        for name in [
            "Makefile", "deploy", "docs", "examples", "scripts", "studies", "tests",
        ] {
            symlink(root().join(name), work.join(name)).unwrap();
        }
        fs::write(work.join("small.toml"), &self.small_campaign).unwrap();
        fs::write(desk.path().join("understood"), "").unwrap();
        fs::write(desk.path().join("script"), self.text()).unwrap();
        let output = fs::File::create(desk.path().join("output")).unwrap();
        let folder = binary("murmuration").parent().unwrap().to_owned();
        let path = format!("{}:{}", folder.display(), std::env::var("PATH").unwrap());
        let mut bash = Command::new("bash");
        bash.arg(desk.path().join("script"))
            .current_dir(&work)
            .env("PATH", path)
            .env("DESK", desk.path());
        for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("MURMURATION_")) {
            bash.env_remove(name);
        }
        // A document's `make` must not use the job server of the `make` that runs this test: the two would wait for each other.
        for name in ["MAKEFLAGS", "MFLAGS", "MAKELEVEL"] {
            bash.env_remove(name);
        }
        let status = bash
            .stdin(Stdio::null())
            .stdout(output.try_clone().unwrap())
            .stderr(output)
            .status()
            .unwrap();
        (desk, status.success())
    }

    fn text(&self) -> String {
        let mut script = PRELUDE.to_owned();
        let mut used = vec![false; self.rules.len()];
        for (number, command) in self.commands.iter().enumerate() {
            let rules = self
                .rules
                .iter()
                .zip(&mut used)
                .filter(|((beginning, _), _)| command.starts_with(beginning));
            let rules: Vec<Rule> = rules
                .map(|((_, rule), used)| {
                    *used = true;
                    *rule
                })
                .collect();
            let line = self.filled_in(command);
            // The output shows the seconds since the start of the script.
            writeln!(
                script,
                "echo \"[$SECONDS s]\" {} >&2",
                quoted(&format!("$ {line}"))
            )
            .unwrap();
            let mut run = true;
            for rule in rules {
                match rule {
                    Rule::Before(piece) => writeln!(script, "{}", self.filled_in(piece)).unwrap(),
                    Rule::Stays(sign) => {
                        run = false;
                        // A comment would hide the redirection that follows.
                        let line = line.split("  # ").next().unwrap_or_default();
                        writeln!(
                            script,
                            "{line} >\"$DESK/{number}.log\" 2>&1 &\nstay {number}.log {}",
                            quoted(sign)
                        )
                        .unwrap();
                    }
                    Rule::NotRun(reason) => {
                        run = false;
                        writeln!(script, "# {reason}\nnot_run {}", quoted(&line)).unwrap();
                    }
                }
            }
            if run && self.captures {
                writeln!(
                    script,
                    "code=0\n{{\n{line}\n}} >\"$DESK/{number}.log\" 2>\"$DESK/{number}.stderr\" || code=$?\n\
                     echo $code >\"$DESK/{number}.code\""
                )
                .unwrap();
            } else if run {
                writeln!(script, "{line}").unwrap();
            }
        }
        script += "leave\n";
        let stale: Vec<_> = self.rules.iter().zip(used).filter(|(_, used)| !used).collect();
        assert!(
            stale.is_empty(),
            "{} has no such lines any more: {stale:?}",
            self.name
        );
        script
    }
}

impl Script {
    fn filled_in(&self, line: &str) -> String {
        let replaced = self.replaced.iter();
        replaced.fold(line.to_owned(), |line, (example, by)| line.replace(example, by))
    }
}

/// The commands of a block, without comments and with continuation lines joined.
pub fn commands(lines: &[String]) -> Vec<String> {
    let mut commands: Vec<String> = Vec::new();
    let mut goes_on = false;
    for line in lines {
        let line = line.split(" #").next().unwrap().trim_end();
        let line = if line.starts_with('#') { "" } else { line };
        match commands.last_mut().filter(|_| goes_on) {
            Some(command) => *command += &format!("\n{line}"),
            None if line.is_empty() => continue,
            None => commands.push(line.to_owned()),
        }
        let whole = commands.last().unwrap();
        let in_loop = whole.starts_with("for ") && !whole.ends_with("\ndone");
        goes_on = in_loop || whole.ends_with('\\');
    }
    commands
}

fn quoted(text: &str) -> String {
    format!("'{}'", text.replace('\'', r"'\''"))
}

/// Checks that the program accepts the commands that were not run.
fn check_understood(desk: &Path) {
    let recorded = fs::read_to_string(desk.join("understood")).unwrap();
    let commands = recorded.split_terminator("\u{1e}\0");
    for command in commands {
        let words: Vec<&str> = command.split_terminator('\0').collect();
        if let Err(error) = murmuration_program::command().try_get_matches_from(&words) {
            panic!("{words:?}: {error}");
        }
    }
}

/// An address of this machine that was free a moment ago.
pub fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .port()
}

//! A Slurm cluster of containers, and the scripts of deploy/slurm on it.

use murmuration_tests::{Murmuration, binary, requirements::slurm_image};
use std::{
    fs,
    path::Path,
    process::{Command, Output},
    thread,
    time::{Duration, Instant},
};
use tempfile::TempDir;

/// Time limit of every wait: far longer than anything takes, also beside other tests on a busy machine.
const LIMIT: Duration = Duration::from_secs(900);

/// Time of the campaign that faults disturb, if the machine stays as fast as it was. The faults take about a minute.
const SECONDS_OF_FAULTS: f64 = 120.0;

/// Share of a core that a container may use: other tests run at the same time.
const CPUS: &str = "0.4";

/// A head and two nodes with a common home folder. Dropping a `SlurmCluster` removes the containers.
struct SlurmCluster {
    image: String,
    /// Prefix of the containers' names, and name of their network.
    name: String,
    home: TempDir,
}

impl SlurmCluster {
    fn up() -> Self {
        let cluster = Self {
            image: slurm_image().expect("the harness asks first whether there are images"),
            name: format!("murmuration-slurm-{}", std::process::id()),
            home: tempfile::tempdir().unwrap(),
        };
        let programs = cluster.home.path().join("bin");
        fs::create_dir(&programs).unwrap();
        for program in ["murmuration", "murmuration-worker", "murmuration-trainer"] {
            fs::copy(binary(program), programs.join(program)).unwrap();
        }
        for script in ["campaign", "coordinator", "workers"] {
            let name = format!("{script}.sbatch");
            let source = Path::new(env!("CARGO_MANIFEST_DIR"))
                .join("../deploy/slurm")
                .join(&name);
            fs::copy(source, cluster.home.path().join(name)).unwrap();
        }
        let owned = Command::new("chown")
            .args(["-R", "1000:1000"])
            .arg(cluster.home.path())
            .status();
        assert!(owned.unwrap().success());
        run(Command::new("docker").args(["network", "create", &cluster.name]));
        cluster.start("head", "head");
        for node in ["node1", "node2"] {
            cluster.start(node, "node");
        }
        cluster.until("two idle nodes", || {
            cluster
                .head("sinfo --noheader --partition=low --states=idle --format=%D")
                .trim()
                == "2"
        });
        cluster
    }

    fn start(&self, host: &str, role: &str) {
        let home = format!("{}:/home/user", self.home.path().display());
        let name = format!("{}-{host}", self.name);
        run(Command::new("docker")
            .args([
                "run",
                "--detach",
                "--init",
                "--cpus",
                CPUS,
                "--name",
                &name,
                "--hostname",
                host,
            ])
            .args([
                "--network",
                &self.name,
                "--network-alias",
                host,
                "--volume",
                &home,
                &self.image,
                "start-slurm",
                role,
            ]));
    }

    /// Kills a node, as its machine would fail.
    fn kill(&self, host: &str) {
        run(Command::new("docker").args(["rm", "--force", &format!("{}-{host}", self.name)]));
    }

    /// The output of a shell command of the user on the head.
    fn head(&self, command: &str) -> String {
        let output = self.on_head(command);
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        assert!(
            output.status.success(),
            "{command}: {}{}",
            text(&output.stdout),
            text(&output.stderr)
        );
        text(&output.stdout)
    }

    /// Runs a shell command of the administrator on the head.
    fn as_root(&self, command: &str) {
        let container = format!("{}-head", self.name);
        run(Command::new("docker").args(["exec", &container, "sh", "-c", command]));
    }

    fn on_head(&self, command: &str) -> Output {
        let container = format!("{}-head", self.name);
        let in_path = format!("export PATH=/home/user/bin:$PATH; {command}");
        let mut docker = Command::new("docker");
        docker.args([
            "exec",
            "--user",
            "user",
            "--workdir",
            "/home/user",
            &container,
            "bash",
            "-c",
            &in_path,
        ]);
        docker.output().unwrap()
    }

    /// Submits a job, and returns its id.
    fn sbatch(&self, arguments: &str) -> String {
        self.head(&format!("sbatch --parsable {arguments}"))
            .trim()
            .to_owned()
    }

    /// A field of a job, such as `JobState`.
    fn job(&self, id: &str, field: &str) -> String {
        let shown = self.head(&format!("scontrol show job {id}"));
        let mut fields = shown.split_whitespace();
        let value = fields.find_map(|one| one.strip_prefix(&format!("{field}=")));
        value.unwrap_or_default().to_owned()
    }

    fn until(&self, what: &str, holds: impl Fn() -> bool) {
        let begun = Instant::now();
        while !holds() {
            assert!(
                begun.elapsed() < LIMIT,
                "no {what}:\n{}",
                self.head("squeue --long; sinfo; tail -n 30 *.out")
            );
            thread::sleep(Duration::from_millis(500));
        }
    }

    fn write_spec(&self, name: &str, generations: u32) -> String {
        let spec = spec(name, generations);
        fs::write(self.home.path().join(format!("{name}.toml")), &spec).unwrap();
        spec
    }

    /// Generations of the newest campaign; 0 if nobody answers.
    fn generations(&self) -> u64 {
        let shown = self.on_head("murmuration show latest --json");
        let shown: serde_json::Value = serde_json::from_slice(&shown.stdout).unwrap_or_default();
        shown["generations_done"].as_u64().unwrap_or(0)
    }

    /// Pace of the newest campaign, which has ended.
    fn generations_per_second(&self) -> f64 {
        let shown = self.head("murmuration show latest --json");
        let shown: serde_json::Value = serde_json::from_str(&shown).unwrap();
        let time = |field: &str| shown[field].as_f64().unwrap();
        1000.0 * time("generations_done") / (time("ended_ms") - time("created_ms"))
    }

    /// Digest of the newest campaign.
    fn digest(&self) -> String {
        let printed = self.head("murmuration digest latest --json");
        let printed: serde_json::Value = serde_json::from_str(&printed).unwrap();
        printed["digest"].as_str().unwrap().to_owned()
    }
}

impl Drop for SlurmCluster {
    fn drop(&mut self) {
        // Containers that stay after a failed test do no harm: the next test uses other names.
        for host in ["head", "node1", "node2"] {
            let name = format!("{}-{host}", self.name);
            let _ = Command::new("docker").args(["rm", "--force", &name]).output();
        }
        let _ = Command::new("docker")
            .args(["network", "rm", &self.name])
            .output();
    }
}

fn run(command: &mut Command) {
    let output = command.output().unwrap();
    assert!(
        output.status.success(),
        "{command:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
}

fn spec(name: &str, generations: u32) -> String {
    format!(
        "name = \"{name}\"\nmodel = \"single-sensor\"\nmethod = \"hand-crafted\"\nseed = 7\n[world]\nhorizon = 1000\n\
         [search]\npopulation = 20\ngenerations = {generations}\n[taxonomy]\nmedoids = 4\n"
    )
}

/// The digest of the campaign on this machine, undisturbed.
fn undisturbed(spec: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("spec.toml");
    fs::write(&file, spec).unwrap();
    let alone = Murmuration::over(&folder.path().join("data"));
    let ended = alone.run(&["run", file.to_str().unwrap(), "--json"]).last_line();
    ended["digest"].as_str().unwrap().to_owned()
}

/// A campaign by one command; a campaign whose job is preempted, loses a node, and reaches its time limit; workers of an array job
/// that leave without work.
pub fn campaigns_on_slurm_end_as_on_one_machine() {
    let slurm = SlurmCluster::up();

    let spec = slurm.write_spec("together", 100);
    slurm.head("srun --nodes=2 --ntasks-per-node=1 murmuration run together.toml >srun.out 2>&1");
    assert_eq!(slurm.digest(), undisturbed(&spec));
    // Long enough for all faults, however fast the machine is.
    let generations = (slurm.generations_per_second() * SECONDS_OF_FAULTS) as u32;

    let spec = slurm.write_spec("disturbed", generations.clamp(300, 50_000));
    let job = slurm.sbatch(
        "--nodes=2 --cpus-per-task=2 --time=60 --signal=B:USR1@30 --output=campaign.out campaign.sbatch disturbed.toml",
    );
    let restarts = || slurm.job(&job, "Restarts").parse::<u32>().unwrap();
    // The number of restarts, once the job has got on.
    let gets_on = || {
        let begun = slurm.generations();
        slurm.until("further generations", || {
            slurm.job(&job, "JobState") == "RUNNING" && slurm.generations() > begun + 5
        });
        restarts()
    };
    let starts_again = |after: &str, before: u32| {
        slurm.until(&format!("start after {after}"), || {
            assert_ne!(
                slurm.job(&job, "JobState"),
                "COMPLETED",
                "over too early for {after}"
            );
            restarts() > before
        });
    };
    let before = gets_on();
    // The other job gets both nodes at once.
    let other = slurm.sbatch("--partition=high --nodes=2 --exclusive --output=other.out --wrap='sleep 5'");
    slurm.until("preemption", || slurm.job(&other, "JobState") == "COMPLETED");
    starts_again("preemption", before);
    let before = gets_on();
    slurm.kill("node2");
    // Slurm would notice the loss after half a minute.
    slurm.as_root("scontrol update NodeName=node2 State=DOWN Reason=killed");
    starts_again("the loss of a node", before);
    slurm.start("node2", "node");
    slurm.as_root("scontrol update NodeName=node2 State=RESUME || true");
    let before = gets_on();
    slurm.head(&format!("scontrol update JobId={job} TimeLimit=1"));
    starts_again("the time limit", before);
    slurm.as_root(&format!("scontrol update JobId={job} TimeLimit=60"));
    slurm.until("an end", || slurm.job(&job, "JobState") == "COMPLETED");
    assert_eq!(slurm.digest(), undisturbed(&spec));

    let spec = slurm.write_spec("queued", 60);
    let coordinator = slurm.sbatch("--output=coordinator.out coordinator.sbatch");
    slurm.until("a coordinator", || {
        slurm.on_head("murmuration health").status.success()
    });
    let workers = slurm.sbatch("--array=1-2 --output=worker-%a.out workers.sbatch --idle-timeout 5s");
    slurm.head("murmuration submit queued.toml");
    slurm.until("an end of the campaign", || slurm.generations() == 60);
    slurm.until("workers that left", || {
        slurm
            .head(&format!("squeue --noheader --jobs={workers}"))
            .trim()
            .is_empty()
    });
    for worker in [1, 2] {
        let log = fs::read_to_string(slurm.home.path().join(format!("worker-{worker}.out"))).unwrap();
        assert!(log.contains("no work for 5s"), "{log}");
    }
    assert_eq!(slurm.digest(), undisturbed(&spec));
    slurm.head(&format!("scancel {coordinator}"));
}

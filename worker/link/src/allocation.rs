//! The part of a cluster that this process may use: processor cores, and the name of its machine and job.

use std::{env, num::NonZeroUsize, thread};

/// Variables that hold the number of cores that a scheduler gives to a process.
const CORES: [&str; 3] = ["SLURM_CPUS_PER_TASK", "OMP_NUM_THREADS", "PBS_NUM_PPN"];

/// Variables that hold the id of a scheduler's job, each with the variable of the process's number in the job.
const JOBS: [(&str, &str); 6] = [
    ("SLURM_ARRAY_JOB_ID", "SLURM_ARRAY_TASK_ID"),
    ("SLURM_JOB_ID", "SLURM_PROCID"),
    ("PBS_JOBID", "PBS_ARRAY_INDEX"),
    ("LSB_JOBID", "LSB_JOBINDEX"),
    ("AWS_BATCH_JOB_ID", "AWS_BATCH_JOB_ARRAY_INDEX"),
    ("BATCH_JOB_UID", "BATCH_TASK_INDEX"),
];

/// How a launcher numbers the processes that it starts.
struct Launcher {
    /// Variable of the number of this process.
    number: &'static str,
    /// Variable of the number of the first process, which is 0 for launchers without such a variable.
    first: Option<&'static str>,
    /// Variable of the number of processes, if the launcher has one.
    count: Option<&'static str>,
    /// Variables that together tell this launch from every other one.
    launch: &'static [&'static str],
}

const fn launcher(
    number: &'static str,
    count: Option<&'static str>,
    launch: &'static [&'static str],
) -> Launcher {
    Launcher {
        number,
        first: None,
        count,
        launch,
    }
}

/// Launchers whose processes belong together: MPI, and tasks of `srun`. MPI comes first, because it may start its processes by
/// `srun`, whose variables they then have too.
const PARALLEL: [Launcher; 3] = [
    launcher(
        "OMPI_COMM_WORLD_RANK",
        Some("OMPI_COMM_WORLD_SIZE"),
        &["PMIX_NAMESPACE"],
    ),
    launcher("PMI_RANK", Some("PMI_SIZE"), &["PMI_JOBID"]),
    // `srun` sets the number of tasks, and a batch script does not have it.
    launcher(
        "SLURM_PROCID",
        Some("SLURM_STEP_NUM_TASKS"),
        &["SLURM_JOB_ID", "SLURM_STEP_ID"],
    ),
];

const ARRAY_TASK: &str = "SLURM_ARRAY_TASK_ID";

/// Launchers whose processes may have nothing to do with each other: nodes of PBS, and indices of array jobs.
const SEPARATE: [Launcher; 6] = [
    launcher("PBS_NODENUM", None, &["PBS_JOBID"]),
    Launcher {
        number: ARRAY_TASK,
        first: Some("SLURM_ARRAY_TASK_MIN"),
        count: Some("SLURM_ARRAY_TASK_COUNT"),
        launch: &["SLURM_ARRAY_JOB_ID"],
    },
    launcher(
        "AWS_BATCH_JOB_NODE_INDEX",
        Some("AWS_BATCH_JOB_NUM_NODES"),
        &["AWS_BATCH_JOB_ID"],
    ),
    launcher(
        "AWS_BATCH_JOB_ARRAY_INDEX",
        Some("AWS_BATCH_JOB_ARRAY_SIZE"),
        &["AWS_BATCH_JOB_ID"],
    ),
    launcher("BATCH_TASK_INDEX", Some("BATCH_TASK_COUNT"), &["BATCH_JOB_UID"]),
    launcher("JOB_COMPLETION_INDEX", None, &[]),
];

/// Variables of the job that a launch belongs to. A job that is queued again keeps its id.
const LAUNCHING_JOBS: [&[&str]; 6] = [
    &["SLURM_CLUSTER_NAME", "SLURM_ARRAY_JOB_ID"],
    &["SLURM_CLUSTER_NAME", "SLURM_JOB_ID"],
    &["PBS_JOBID"],
    &["LSB_JOBID"],
    &["AWS_BATCH_JOB_ID"],
    &["BATCH_JOB_UID"],
];

/// Variable that counts how often a job was queued again.
const RESTARTS: &str = "SLURM_RESTART_COUNT";
/// The name of a launch that the user gives where the launcher gives none.
const LAUNCH: &str = "MURMURATION_LAUNCH";

/// The place of this process among processes that were launched together.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Rank {
    /// 0 for the first process.
    pub number: u64,
    /// The name of the launch, the same for all its processes and another one for each launch; `None` if the launcher gives none.
    pub launch: Option<String>,
    /// The name of the job of the launch. A launch in the same job, or in the job when it is queued again, has the same name.
    pub job: Option<String>,
    /// Whether the launcher says that there are several processes, and that they belong together.
    pub is_parallel: bool,
}

/// The rank of this process; `None` if no launcher numbers its processes.
#[must_use]
pub fn rank() -> Option<Rank> {
    rank_among(|name| env::var(name).ok())
}

fn rank_among(variable: impl Fn(&str) -> Option<String>) -> Option<Rank> {
    let number = |name: &str| variable(name)?.trim().parse::<u64>().ok();
    // AWS adds the index to the id of the array.
    let word = |name: &&str| Some(variable(name)?.split([':', '#']).next()?.to_owned());
    let words = |names: &[&str]| {
        let words: Option<Vec<String>> = names.iter().map(word).collect();
        words
            .filter(|words| !words.is_empty())
            .map(|words| words.join("."))
    };
    let of_user = variable(LAUNCH).filter(|name| !name.is_empty());
    let of = |launcher: &Launcher, is_parallel: bool| {
        let own = number(launcher.number)?;
        let count = match launcher.count {
            Some(count) => number(count)?,
            None => 1,
        };
        let first = launcher.first.and_then(&number).unwrap_or_default();
        // Each task of an array has a count of its own.
        let restarts = variable(RESTARTS).filter(|_| launcher.number != ARRAY_TASK);
        let launch = words(launcher.launch).map(|launch| match restarts {
            Some(restarts) => format!("{launch}-{restarts}"),
            None => launch,
        });
        Some(Rank {
            number: own.checked_sub(first)?,
            job: of_user
                .clone()
                .or_else(|| LAUNCHING_JOBS.iter().find_map(|names| words(names)))
                .or_else(|| words(launcher.launch)),
            launch: of_user.clone().or(launch),
            is_parallel: is_parallel && count > 1,
        })
    };
    let parallel = PARALLEL.iter().filter_map(|launcher| of(launcher, true));
    let separate = SEPARATE.iter().filter_map(|launcher| of(launcher, false));
    let all: Vec<Rank> = parallel.chain(separate).collect();
    let several = all.iter().find(|rank| rank.is_parallel).cloned();
    several.or_else(|| all.into_iter().next())
}

/// Number of threads for computations: the least of the cores that the system allows this process (affinity and cgroups) and of
/// the cores that a scheduler gives it.
#[must_use]
pub fn cores() -> NonZeroUsize {
    let allowed = thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    fewest(allowed, |name| env::var(name).ok())
}

fn fewest(allowed: NonZeroUsize, variable: impl Fn(&str) -> Option<String>) -> NonZeroUsize {
    let given = CORES
        .iter()
        .filter_map(|name| variable(name)?.trim().parse().ok());
    given.fold(allowed, NonZeroUsize::min)
}

/// Name for people of a process of this `kind` (such as "worker"): that of the machine, with the scheduler's job if there is one.
#[must_use]
pub fn process_name(kind: &str) -> String {
    let machine = machine_name().unwrap_or_else(|| kind.to_owned());
    match job(|name| env::var(name).ok()) {
        Some(job) => format!("{machine} (job {job})"),
        None => machine,
    }
}

/// The scheduler's job of this process, such as `123.4`.
fn job(variable: impl Fn(&str) -> Option<String>) -> Option<String> {
    let is_short = |text: &String| {
        !text.is_empty() && text.len() <= 48 && text.bytes().all(|byte| byte.is_ascii_graphic())
    };
    let of = |name: &str| variable(name).filter(is_short);
    JOBS.iter().find_map(|(job, process)| {
        let job = of(job)?;
        Some(match of(process) {
            Some(process) => format!("{job}.{process}"),
            None => job,
        })
    })
}

/// The name of this machine for people: its host name up to the first dot.
#[must_use]
pub fn machine_name() -> Option<String> {
    host_name()?.split('.').next().map(str::to_owned)
}

/// The host name of this machine; `None` if the system has no name, or one that is not a host name.
#[must_use]
pub fn host_name() -> Option<String> {
    let system = rustix::system::uname();
    let name = system.nodename().to_str().ok()?;
    let is_in_one = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte);
    let is_one = name.len() <= 253
        && name
            .bytes()
            .next()
            .is_some_and(|first| first.is_ascii_alphanumeric());
    (is_one && name.bytes().all(is_in_one)).then(|| name.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The variables of a process, by name.
    fn among(variables: &[(&str, &str)]) -> impl Fn(&str) -> Option<String> {
        |name| {
            let found = variables.iter().find(|(known, _)| *known == name);
            found.map(|(_, value)| (*value).to_owned())
        }
    }

    #[test]
    fn a_scheduler_can_give_fewer_cores_but_not_more() {
        let four = NonZeroUsize::new(4).unwrap();
        let of = |variables: &[(&str, &str)]| fewest(four, among(variables)).get();
        assert_eq!(of(&[]), 4);
        assert_eq!(of(&[("SLURM_CPUS_PER_TASK", "2")]), 2);
        assert_eq!(of(&[("SLURM_CPUS_PER_TASK", "16"), ("OMP_NUM_THREADS", "3")]), 3);
        assert_eq!(of(&[("OMP_NUM_THREADS", "0"), ("SLURM_CPUS_PER_TASK", "x")]), 4);
    }

    #[test]
    fn the_rank_of_a_process_follows_from_its_launcher() {
        let of = |variables: &[(&str, &str)]| {
            let rank = rank_among(among(variables))?;
            Some((rank.number, rank.launch.unwrap_or_default(), rank.is_parallel))
        };
        let step = [
            ("SLURM_JOB_ID", "12"),
            ("SLURM_STEP_ID", "0"),
            ("SLURM_PROCID", "3"),
        ];
        let with = |more: &[(&'static str, &'static str)]| [&step[..], more].concat();
        assert_eq!(of(&[]), None);
        // A batch script is no task of `srun`.
        assert_eq!(of(&step), None);
        let slurm = |number| (number, "12.0".to_owned(), true);
        assert_eq!(of(&with(&[("SLURM_STEP_NUM_TASKS", "4")])), Some(slurm(3)));
        assert_eq!(
            of(&with(&[
                ("SLURM_STEP_NUM_TASKS", "1"),
                ("MURMURATION_LAUNCH", "mine")
            ])),
            Some((3, "mine".to_owned(), false))
        );
        let mpi = [
            ("OMPI_COMM_WORLD_RANK", "1"),
            ("OMPI_COMM_WORLD_SIZE", "2"),
            ("PMIX_NAMESPACE", "prterun-1@1"),
        ];
        let of_mpi = (1, "prterun-1@1".to_owned(), true);
        assert_eq!(of(&mpi), Some(of_mpi.clone()));
        // `mpirun` in a task of `srun`, or with processes that `srun` started.
        for tasks in ["1", "4"] {
            let both = [&with(&[("SLURM_STEP_NUM_TASKS", tasks)]), &mpi[..]].concat();
            assert_eq!(of(&both), Some(of_mpi.clone()));
        }
        let array = [
            ("SLURM_ARRAY_JOB_ID", "7"),
            ("SLURM_ARRAY_TASK_ID", "11"),
            ("SLURM_ARRAY_TASK_MIN", "10"),
            ("SLURM_ARRAY_TASK_COUNT", "5"),
            ("SLURM_RESTART_COUNT", "1"),
        ];
        assert_eq!(of(&array), Some((1, "7".to_owned(), false)));
        let aws = [
            ("AWS_BATCH_JOB_ID", "a-b:2"),
            ("AWS_BATCH_JOB_ARRAY_INDEX", "2"),
            ("AWS_BATCH_JOB_ARRAY_SIZE", "3"),
        ];
        assert_eq!(of(&aws), Some((2, "a-b".to_owned(), false)));
        assert_eq!(
            of(&[("JOB_COMPLETION_INDEX", "0")]),
            Some((0, String::new(), false))
        );
        assert_eq!(of(&[("PMI_RANK", "x"), ("PMI_SIZE", "2")]), None);
    }

    #[test]
    fn a_job_that_is_queued_again_has_another_launch() {
        let of = |step: &str, restarts: &str| {
            let variables = [
                ("SLURM_CLUSTER_NAME", "main"),
                ("SLURM_JOB_ID", "12"),
                ("SLURM_STEP_ID", step),
                ("SLURM_PROCID", "0"),
                ("SLURM_STEP_NUM_TASKS", "2"),
                ("SLURM_RESTART_COUNT", restarts),
            ];
            let rank = rank_among(among(&variables)).unwrap();
            (rank.job.unwrap(), rank.launch.unwrap())
        };
        let first = of("0", "0");
        for (step, restarts) in [("1", "0"), ("0", "1")] {
            let (job, launch) = of(step, restarts);
            assert!(job == first.0 && launch != first.1, "{job} {launch}");
        }
    }

    #[test]
    fn the_job_of_a_process_is_named() {
        let of = |variables: &[(&str, &str)]| job(among(variables));
        assert_eq!(of(&[]), None);
        assert_eq!(
            of(&[("SLURM_JOB_ID", "12"), ("SLURM_PROCID", "3")]).as_deref(),
            Some("12.3")
        );
        let array = [
            ("SLURM_ARRAY_JOB_ID", "7"),
            ("SLURM_ARRAY_TASK_ID", "9"),
            ("SLURM_JOB_ID", "12"),
        ];
        assert_eq!(of(&array).as_deref(), Some("7.9"));
        assert_eq!(of(&[("PBS_JOBID", "5.server")]).as_deref(), Some("5.server"));
        assert_eq!(of(&[("PBS_JOBID", "\u{1b}[m")]), None);
    }
}

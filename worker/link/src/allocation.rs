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

/// The name of this machine, up to the first dot; `None` if the system has no name, or one that cannot be shown.
#[cfg(unix)]
#[must_use]
pub fn machine_name() -> Option<String> {
    let system = rustix::system::uname();
    let name = system.nodename().to_str().ok()?.split('.').next()?;
    let is_shown = !name.is_empty() && name.len() <= 63 && name.bytes().all(|byte| byte.is_ascii_graphic());
    is_shown.then(|| name.to_owned())
}

#[cfg(not(unix))]
pub fn machine_name() -> Option<String> {
    env::var("COMPUTERNAME").ok()
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

//! The machine that measures.

use super::Machine;
use murmuration_worker::simulate::Arch;
use std::{fs, thread};

/// This machine.
pub(super) fn this() -> Machine {
    Machine {
        cpu: fs::read_to_string("/proc/cpuinfo")
            .ok()
            .and_then(|text| cpu(&text)),
        cores: thread::available_parallelism().map_or(1, usize::from),
        vector_bits: vector_bits(Arch::new()),
    }
}

/// In words, for people.
pub(super) fn words(machine: &Machine) -> String {
    let cpu = machine.cpu.as_deref().unwrap_or("unknown CPU");
    format!(
        "{cpu}, cores: {}, vectors of {} bits",
        machine.cores, machine.vector_bits
    )
}

/// The name in the text of /proc/cpuinfo; aarch64 has none there.
pub(super) fn cpu(text: &str) -> Option<String> {
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

const fn vector_bits(arch: Arch) -> u32 {
    match arch {
        Arch::Scalar => 64,
        #[cfg(target_arch = "x86_64")]
        Arch::V3(_) => 256,
        #[cfg(target_arch = "x86_64")]
        Arch::V4(_) => 512,
        // NEON.
        _ => 128,
    }
}

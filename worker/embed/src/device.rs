//! The devices that can embed, and sessions of ONNX Runtime on them.

use ort::{
    environment::Environment,
    ep::{CUDA, ExecutionProvider as _, cuda::ConvAlgorithmSearch},
    logging::LogLevel,
    session::{Session, builder::GraphOptimizationLevel},
};
use std::fmt;

/// A device that embeds pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, clap::ValueEnum)]
pub enum Device {
    /// The processor.
    #[default]
    Cpu,
    /// The first card that CUDA shows to this process.
    Cuda,
}

/// A model that returns its input: one node, `Identity`.
pub(super) const IDENTITY: &[u8] = b"\x08\x08\x3a7\x0a\x10\x0a\x01x\x12\x01y\x22\x08Identity\x12\x01gZ\x0f\x0a\x01x\x12\x0a\x0a\x08\x08\x01\x12\x04\
    \x0a\x02\x08\x01b\x0f\x0a\x01y\x12\x0a\x0a\x08\x08\x01\x12\x04\x0a\x02\x08\x01B\x02\x10\x11";

impl Device {
    /// Whether the loaded ONNX Runtime is built for this device.
    pub(super) fn is_built_in(self) -> bool {
        match self {
            Self::Cpu => true,
            Self::Cuda => CUDA::is_available().unwrap_or(false),
        }
    }
}

impl fmt::Display for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Cpu => "the CPU",
            Self::Cuda => "CUDA",
        })
    }
}

/// A single-threaded session of `model` on `device`.
pub(super) fn open_session(environment: &Environment, device: Device, model: &[u8]) -> ort::Result<Session> {
    let builder = Session::builder(environment)?
        .with_intra_threads(1)?
        .with_inter_threads(1)?
        .with_parallel_execution(false)?
        .with_optimization_level(GraphOptimizationLevel::All)?
        .with_deterministic_compute(true)?
        // `ort` returns failures as errors, so ONNX Runtime need not write failures to stderr.
        .with_log_level(LogLevel::Fatal)?
        // With memory patterns, ONNX Runtime would keep one pattern for each batch size.
        .with_memory_pattern(false)?;
    let mut builder = match device {
        Device::Cpu => builder,
        Device::Cuda => builder.with_execution_providers([CUDA::default()
            // With TF32, products keep 10 bits of a number: a CPU's embedding would differ by more than machines may.
            .with_tf32(false)
            // The default measures all algorithms, and may choose another one in each process.
            .with_conv_algorithm_search(ConvAlgorithmSearch::Default)
            .build()
            .error_on_failure()])?,
    };
    builder.commit_from_memory(model)
}

//! The embedding kind of this machine.

use crate::Runtime;
use murmuration_proto::EmbeddingKind;
use std::env::consts::ARCH;

impl Runtime {
    /// The embedding kind of this machine. ONNX Runtime chooses kernels by the processor's features, and its builds differ.
    /// If both are the same, embeddings have the same bits.
    #[must_use]
    pub fn kind(&self) -> EmbeddingKind {
        EmbeddingKind::of(&format!("{ARCH} {} {}", instructions().join(" "), self.build()))
    }
}

/// Instruction sets for which ONNX Runtime has kernels.
#[cfg(target_arch = "x86_64")]
fn instructions() -> Vec<&'static str> {
    macro_rules! detected {
        ($($name:tt)*) => {
            [$(($name, std::arch::is_x86_feature_detected!($name))),*]
        };
    }
    let all = detected!(
        "sse4.1" "avx" "fma" "f16c" "avx2" "avxvnni" "avx512f" "avx512bw" "avx512dq" "avx512vl" "avx512vnni"
        "avx512bf16" "avx512fp16"
    );
    let detected = all.into_iter().filter(|(_, detected)| *detected);
    detected.map(|(name, _)| name).collect()
}

#[cfg(target_arch = "aarch64")]
fn instructions() -> Vec<&'static str> {
    macro_rules! detected {
        ($($name:tt)*) => {
            [$(($name, std::arch::is_aarch64_feature_detected!($name))),*]
        };
    }
    let all = detected!("neon" "fp16" "dotprod" "i8mm" "bf16" "sve" "sve2");
    let detected = all.into_iter().filter(|(_, detected)| *detected);
    detected.map(|(name, _)| name).collect()
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
fn instructions() -> Vec<&'static str> {
    Vec::new()
}

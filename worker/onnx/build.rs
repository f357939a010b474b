//! Compiles `onnx.proto` with protox, so that no `protoc` binary is needed.

use prost::Message as _;
use std::{error::Error, fs, path::PathBuf};

fn main() -> Result<(), Box<dyn Error>> {
    let files = protox::compile(["onnx.proto"], ["."])?;
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    fs::write(out.join("descriptors.bin"), files.encode_to_vec())?;
    let mut config = prost_build::Config::new();
    config.enable_type_names();
    config.compile_fds(files)?;
    println!("cargo:rerun-if-changed=onnx.proto");
    Ok(())
}

//! What a process prints: data on standard output, words for people on standard error.
//!
//! The standard library's macros panic where the stream cannot be written: a pipe whose reader left, a full disk. Here
//! standard output returns the error, and what cannot be said on standard error is dropped, since there is nowhere left to
//! say it.

use clap::Parser;
use std::{
    ffi::OsString,
    fmt,
    io::{self, Write as _},
    process::ExitCode,
};

/// Why data did not reach standard output.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// Nobody reads it any more, as in `murmuration list | head -1`.
    #[error("nobody reads standard output any more")]
    Closed,
    /// It cannot be written, for want of space say.
    #[error("cannot write to standard output: {0}")]
    Write(io::Error),
}

impl From<io::Error> for OutputError {
    fn from(error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::BrokenPipe => Self::Closed,
            _ => Self::Write(error),
        }
    }
}

impl OutputError {
    /// The exit code of a process that ends with this error: 0 where the reader left, which had what it wanted; else 1.
    #[must_use]
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Closed => ExitCode::SUCCESS,
            Self::Write(_) => ExitCode::FAILURE,
        }
    }
}

/// Prints text on standard output, all of it before this returns; see [`outln!`](crate::outln).
///
/// # Errors
/// [`OutputError`].
pub fn print(text: impl fmt::Display) -> Result<(), OutputError> {
    let mut stdout = io::stdout().lock();
    write!(stdout, "{text}")?;
    Ok(stdout.flush()?)
}

/// Says a line on standard error; one that cannot be written is dropped. See [`errln!`](crate::errln).
pub fn say(line: impl fmt::Display) {
    // One write a line, so that lines of several processes do not mix.
    let _ = io::stderr().lock().write_all(format!("{line}\n").as_bytes());
}

/// Prints a line of data on standard output: like `println!`, but a `Result` ([`OutputError`]) instead of a panic.
#[macro_export]
macro_rules! outln {
    ($($text:tt)*) => { $crate::print(format_args!("{}\n", format_args!($($text)*))) };
}

/// Says a line to people on standard error: like `eprintln!`, but never panics.
#[macro_export]
macro_rules! errln {
    ($($text:tt)*) => { $crate::say(format_args!($($text)*)) };
}

/// Reads the `words` of a command line, of which the first is the program. Help and version are data and go to standard output, what is wrong with the command line to
/// standard error; then there is an exit code to end with.
///
/// # Errors
/// The exit code: 0 after help and version, 1 where these cannot be written, 2 for bad usage.
pub fn parse_arguments<A: Parser>(words: impl IntoIterator<Item = OsString>) -> Result<A, ExitCode> {
    A::try_parse_from(words).map_err(|error| {
        let printed = error.print().and_then(|()| io::stdout().flush());
        match printed.map_err(OutputError::from) {
            Err(failed @ OutputError::Write(_)) if !error.use_stderr() => {
                say(format_args!("error: {failed}"));
                failed.exit_code()
            }
            _ => ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2)),
        }
    })
}

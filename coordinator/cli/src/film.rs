//! Films of swarms, encoded by ffmpeg.

use super::{
    CliError,
    files::{Overwrite, finish},
};
use murmuration_report::picture::Film;
use std::{
    ffi::OsString,
    fs,
    io::{self, Read as _, Write as _},
    path::Path,
    process::{Child, Command, Stdio},
    thread,
};

/// The program that encodes films; it must be in the PATH.
const ENCODER: &str = "ffmpeg";
/// Largest part of the encoder's error message that this process keeps, in bytes.
const MAX_ERROR_BYTES: u64 = 64 << 10;

/// Encodes a film at `fps` pictures per second to `path`.
pub(super) fn encode(
    film: Film<impl Iterator<Item = Vec<u8>>>,
    fps: u32,
    path: &Path,
    overwrite: Overwrite,
) -> Result<(), CliError> {
    encode_by(ENCODER.as_ref(), film, fps, (path, overwrite))
}

fn encode_by(
    encoder: &Path,
    film: Film<impl Iterator<Item = Vec<u8>>>,
    fps: u32,
    (path, overwrite): (&Path, Overwrite),
) -> Result<(), CliError> {
    let file = overwrite.begin(path)?;
    run(encoder, film, fps, file.path(), path)?;
    if fs::metadata(file.path()).is_ok_and(|film| film.is_file() && film.len() == 0) {
        let reason = format!("{ENCODER} succeeded, but wrote nothing to {}", path.display());
        return Err(CliError::Failed(reason));
    }
    finish(file, path)
}

/// Runs the encoder, which writes the film to `file`. The caller moves `file` to `path`.
fn run(
    encoder: &Path,
    film: Film<impl Iterator<Item = Vec<u8>>>,
    fps: u32,
    file: &Path,
    path: &Path,
) -> Result<(), CliError> {
    let mut running = start(encoder, (film.width, film.height), fps, file)?;
    let errors = running.stderr.take();
    // A thread reads the errors. Without this thread, an encoder with a long message would wait for this process, which would
    // wait for the encoder.
    let errors = thread::spawn(move || {
        let (mut message, mut rest) = (Vec::new(), errors);
        if let Some(errors) = &mut rest {
            let _ = errors.take(MAX_ERROR_BYTES).read_to_end(&mut message);
            let _ = io::copy(errors, &mut io::sink());
        }
        message
    });
    let mut pictures = running.stdin.take();
    let fed = film
        .pictures
        .into_iter()
        .try_for_each(|picture| match &mut pictures {
            Some(pipe) => pipe.write_all(&picture),
            None => Ok(()),
        });
    drop(pictures);
    let ended = running.wait();
    let message = errors.join().unwrap_or_default();
    let ended =
        ended.map_err(|error| CliError::Failed(format!("{ENCODER} cannot be waited for: {error}")))?;
    // The encoder's message explains more than the error of the broken pipe.
    if !ended.success() {
        let message = String::from_utf8_lossy(&message);
        let message = murmuration_swarm::Text::line(message.trim());
        return Err(CliError::Failed(format!(
            "{ENCODER} could not write {}: {message}",
            path.display()
        )));
    }
    fed.map_err(|error| CliError::Failed(format!("{ENCODER} does not take the pictures: {error}")))
}

fn start(encoder: &Path, (width, height): (u32, u32), fps: u32, file: &Path) -> Result<Child, CliError> {
    let size = format!("{width}x{height}");
    Command::new(encoder)
        .args(["-hide_banner", "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24"])
        .args(["-s", &size, "-r", &fps.to_string(), "-i", "-"])
        // Players need pictures with even sides, and this pixel format.
        .args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p", "-movflags", "+faststart"])
        .args(["-f", "mp4"])
        // With the protocol in front, ffmpeg takes no file name for an option or a URL.
        .arg(named(file))
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => CliError::Failed(format!(
                "--mp4 needs the program {ENCODER}, which is not in the PATH: install it, or write an animated GIF with --gif"
            )),
            _ => CliError::Failed(format!("{ENCODER} cannot be started: {error}")),
        })
}

/// A file's name in the form for ffmpeg.
fn named(path: &Path) -> OsString {
    let mut name = OsString::from("file:");
    name.push(path);
    name
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{os::unix::fs::PermissionsExt as _, path::PathBuf};

    /// A script with this text in place of ffmpeg.
    fn encoder(folder: &Path, text: &str) -> PathBuf {
        let path = folder.join("encoder");
        fs::write(&path, format!("#!/bin/sh\n{text}\n")).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
        path
    }

    fn film() -> Film<impl Iterator<Item = Vec<u8>>> {
        Film {
            width: 2,
            height: 1,
            pictures: (0..3).map(|number| vec![number; 6]),
        }
    }

    #[test]
    fn all_pictures_go_to_the_encoder_with_their_size() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("film.mp4");
        let text = format!(
            "echo \"$@\" >'{0}'; for last; do :; done; cat >\"${{last#file:}}\"",
            folder.path().join("message").display(),
        );
        encode_by(
            &encoder(folder.path(), &text),
            film(),
            25,
            (&out, Overwrite::ALLOWED),
        )
        .unwrap();
        assert_eq!(fs::read(&out).unwrap(), [[0; 6], [1; 6], [2; 6]].concat());
        let message = fs::read_to_string(folder.path().join("message")).unwrap();
        assert!(
            message.contains("-s 2x1 -r 25 -i -") && message.contains("-f mp4 file:"),
            "{message}"
        );
    }

    #[test]
    fn a_film_is_there_once_it_is_whole_in_a_folder_that_is_made() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("new/film.mp4");
        let whole = encoder(folder.path(), "for last; do :; done; cat >\"${last#file:}\"");
        encode_by(&whole, film(), 25, (&out, Overwrite::ALLOWED)).unwrap();
        let first = fs::read(&out).unwrap();
        let half = "for last; do :; done; echo half >\"${last#file:}\"; exit 1";
        encode_by(
            &encoder(folder.path(), half),
            film(),
            25,
            (&out, Overwrite::ALLOWED),
        )
        .unwrap_err();
        assert_eq!(fs::read(&out).unwrap(), first);
        let nothing = encoder(folder.path(), "cat >/dev/null; exit 0");
        let message = encode_by(&nothing, film(), 25, (&out, Overwrite::ALLOWED))
            .unwrap_err()
            .to_string();
        assert!(message.contains("wrote nothing to"), "{message}");
        assert_eq!(fs::read_dir(folder.path().join("new")).unwrap().count(), 1);
    }

    #[test]
    fn an_encoder_that_says_much_is_not_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let text = "head -c 300000 /dev/zero | tr '\\0' x >&2; cat >/dev/null; exit 1";
        let much = Film {
            width: 2,
            height: 1,
            pictures: (0..40).map(|_| vec![0; 10_000]),
        };
        let loud = encoder(folder.path(), text);
        let message = encode_by(
            &loud,
            much,
            25,
            (&folder.path().join("film.mp4"), Overwrite::ALLOWED),
        )
        .unwrap_err();
        assert!(message.to_string().contains("xxxx"), "{message}");
    }

    #[test]
    fn an_encoder_that_is_not_there_or_fails_is_named_with_why() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("film.mp4");
        let message = encode_by(
            &folder.path().join("none"),
            film(),
            25,
            (&out, Overwrite::ALLOWED),
        )
        .unwrap_err()
        .to_string();
        assert!(
            message.contains("needs the program ffmpeg") && message.contains("--gif"),
            "{message}"
        );
        let failing = encoder(folder.path(), "cat >/dev/null; echo no such codec >&2; exit 1");
        let message = encode_by(&failing, film(), 25, (&out, Overwrite::ALLOWED))
            .unwrap_err()
            .to_string();
        assert!(message.contains("film.mp4: no such codec"), "{message}");
    }
}

//! Controllers as people type them.

use super::CliError;
use murmuration_swarm::{CapabilityModel, Controller, Invalid, Preset, counted, text::quoted};
use std::{f64::consts::PI, ffi::OsString};

/// Reads a controller such as `0.6,1,0.4,0.5`, also in the brackets with which controllers are printed: `[0.6, 1, 0.4, 0.5]`.
/// Angles can have the form `-pi/3` or `2pi/3`. Without a `model`, the number of genes chooses one of the paper's models.
pub(super) fn parse(text: &str, model: Option<&CapabilityModel>) -> Result<Controller, CliError> {
    let text = text.trim();
    let in_brackets = text.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
    let genes = in_brackets
        .unwrap_or(text)
        .split(',')
        .map(|gene| number(gene.trim()).ok_or_else(|| Invalid::new("controller", quoted(text), FORM)))
        .collect::<Result<Vec<_>, _>>()?;
    if let Some(model) = model {
        return Ok(Controller::new(model, &genes)?);
    }
    let models = Preset::PAPER.map(CapabilityModel::from);
    let found = models.into_iter().find(|model| model.genes() == genes.len());
    let model =
        found.ok_or_else(|| Invalid::new("controller", counted(genes.len() as u64, "value"), FORM))?;
    Ok(Controller::new(model, &genes)?)
}

/// Puts a space before a word of the command line if the word is a list of numbers that begins with a minus sign. Clap then reads
/// the list as a value, not as an option. `parse` removes the space.
pub fn marked(word: OsString) -> OsString {
    let is_list = |text: &str| {
        let number = text.strip_prefix('-').unwrap_or_default();
        number.starts_with(|c: char| c.is_ascii_digit() || c == '.') && number.contains([',', ' '])
    };
    match word.to_str().filter(|text| is_list(text)) {
        Some(text) => format!(" {text}").into(),
        None => word,
    }
}

const FORM: &str = "4 wheel speeds such as 0.6,1,0.4,0.5 (single-sensor), or 8 and an angle such as \
                    0.8,0.5,0.6,-0.5,-0.5,0,-0.2,0.5,-pi/3 (two-sensor), separated by commas, with or without square \
                    brackets around the list";

/// A number, or a multiple of pi such as `pi`, `-pi/3`, `2pi/3`.
fn number(text: &str) -> Option<f64> {
    if let Ok(number) = text.parse() {
        return Some(number);
    }
    let (sign, unsigned) = text.strip_prefix('-').map_or((1.0, text), |rest| (-1.0, rest));
    let (factor, rest) = unsigned.split_once("pi")?;
    let factor: f64 = if factor.is_empty() {
        1.0
    } else {
        factor.trim_end_matches('*').parse().ok()?
    };
    let divisor: f64 = if rest.is_empty() {
        1.0
    } else {
        rest.strip_prefix('/')?.parse().ok()?
    };
    Some(sign * factor * PI / divisor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(text: &str, genes: &[f64]) {
        assert_eq!(parse(text, None).unwrap().genes(), genes);
    }

    #[test]
    fn controllers_are_read_as_papers_print_them() {
        check("0.6,1,0.4,0.5", &[0.6, 1.0, 0.4, 0.5]);
        check("[-0.7, -1.0, 1.0, -1.0]", &[-0.7, -1.0, 1.0, -1.0]);
        check(
            " [0, 0, 0, 0, 0, 0, 0, 0, -pi/3] ",
            &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -PI / 3.0],
        );
        check(
            "0,0,0,0,0,0,0,0,2pi/3",
            &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0 * PI / 3.0],
        );
    }

    #[test]
    fn options_and_single_numbers_are_no_controllers() {
        let check = |word: &str, marked_as: &str| assert_eq!(marked(word.into()), marked_as);
        for controller in ["-0.7,0.3,1,1", "-.7, 0.3, 1, 1", "-1 0 0 0", "-0.7,0.3"] {
            check(controller, &format!(" {controller}"));
        }
        for other in [
            "-0.7",
            "--json",
            "-h",
            "-",
            "--",
            "0.6,1,0.4,0.5",
            "--seed=1,2",
            "-x,1",
        ] {
            check(other, other);
        }
    }

    #[test]
    fn what_is_no_controller_is_named() {
        for bad in [
            "",
            "1,2,3",
            "0.1,0.2,x,0.4",
            "0,0,0,2",
            "0,0,0,nan",
            "pie,0,0,0",
            "[0,0,0,0",
            "0,0,0,0]",
            "[[0,0,0,0]]",
            "0 0 0 0",
            "0,0,,0,0",
        ] {
            let error = parse(bad, None).unwrap_err().to_string();
            assert!(error.starts_with("controller"), "{error}");
        }
    }
}

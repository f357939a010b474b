//! All errors of a draft at once.
//!
//! A campaign file is read until its first error. To find the others, the wrong field is left out, so that it has its default, and
//! the file is read again.

use super::fields::{OWN_ROBOTS, USUAL_ROBOTS};
use murmuration_swarm::{CampaignSpec, Invalid, Method, SpecFileError, line_of_field};
use toml::{Table, Value};

/// Maximum number of errors that a page shows.
const MOST: usize = 30;

/// An error in a draft.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Problem {
    /// The path of the wrong field in a campaign file; empty if unknown.
    pub(super) field: String,
    /// The number of the wrong line of the text, from 1.
    pub(super) line: Option<usize>,
    /// The whole error, with the field's path.
    pub(super) text: String,
    /// The allowed values and the value; `None` if the error says more than that.
    pub(super) must: Option<Must>,
}

/// The allowed values of a field, and its value; `None` if it has no value.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Must {
    pub(super) allowed: String,
    pub(super) value: Option<String>,
    /// Whether the error only says of which type the value must be.
    is_of_type: bool,
}

impl Problem {
    /// Describes an error, with the number of its line if `text` is the campaign file.
    pub(super) fn of(error: &SpecFileError, text: &str) -> Self {
        match error {
            SpecFileError::Value(invalid) => Self {
                line: line_of_field(text, &invalid.field),
                ..Self::from(invalid)
            },
            SpecFileError::Syntax(error) => Self {
                field: error.field().to_owned(),
                line: error.line(),
                text: error.to_string(),
                must: error.allowed().map(|allowed| Must {
                    allowed: allowed.to_owned(),
                    value: error.value().map(str::to_owned),
                    is_of_type: true,
                }),
            },
        }
    }

    /// Whether the error is about a field of the form.
    pub(super) fn is_about(&self, path: &str) -> bool {
        let last = |path: &str| path.rsplit('.').next().map(str::to_owned);
        self.field == path || (!self.field.contains('.') && Some(&self.field) == last(path).as_ref())
    }

    /// The error without the field's path: `must be a whole number from 1 to 100000, not -4`.
    pub(super) fn brief(&self) -> String {
        match &self.must {
            Some(Must {
                allowed,
                value: Some(value),
                ..
            }) => format!("must be {allowed}, not {value}"),
            Some(Must {
                allowed, value: None, ..
            }) => format!("is missing: must be {allowed}"),
            None => self.text.clone(),
        }
    }
}

impl From<&Invalid> for Problem {
    fn from(invalid: &Invalid) -> Self {
        Self {
            field: invalid.field.clone(),
            line: None,
            text: invalid.to_string(),
            must: Some(Must {
                allowed: invalid.allowed.clone(),
                value: invalid.value.clone(),
                is_of_type: false,
            }),
        }
    }
}

/// The campaign of a table, or all errors in the table and what remains without the wrong fields.
pub(super) fn read(table: &Table) -> Result<CampaignSpec, (Vec<Problem>, Table)> {
    let mut rest = table.clone();
    let mut problems: Vec<Problem> = Vec::new();
    loop {
        let error = match CampaignSpec::from_table(without_empty(rest.clone())) {
            Ok(spec) if problems.is_empty() => return Ok(spec),
            Ok(_) => break,
            Err(error) => Problem::of(&error, ""),
        };
        let goes_on = problems.len() < MOST && repair(&mut rest, &error.field);
        if problems.iter().all(|known| known.field != error.field) {
            problems.push(error);
        }
        if !goes_on {
            break;
        }
    }
    for problem in &mut problems {
        say_limits(problem, &rest);
    }
    Err((problems, rest))
}

/// All errors in the text of a file, in the order of their lines. `first` is the error with which a reader stopped, and `others`
/// are the errors in the same file as a table.
pub(super) fn in_text(text: &str, first: &SpecFileError, others: Vec<Problem>) -> Vec<Problem> {
    let first = Problem::of(first, text);
    let others = others.into_iter().filter(|other| other.field != first.field);
    let others: Vec<_> = others
        .map(|other| Problem {
            line: line_of_field(text, &other.field),
            ..other
        })
        .collect();
    let mut problems = vec![first];
    problems.extend(others);
    problems.sort_by_key(|problem| problem.line);
    problems
}

/// Removes empty tables.
pub(super) fn without_empty(mut table: Table) -> Table {
    table.retain(|_, value| value.as_table().is_none_or(|inner| !inner.is_empty()));
    table
}

/// Names the limits of a number, because a reader stops at a value of a wrong type before it checks the limits. The limits are
/// those that refuse a huge number in the field, where all other fields are right.
fn say_limits(problem: &mut Problem, right: &Table) {
    let Some(must) = problem.must.as_mut().filter(|must| must.is_of_type) else {
        return;
    };
    let mut huge = right.clone();
    let is_there = set(&mut huge, &problem.field, Value::Integer(u32::MAX.into()));
    if let Some(Err(SpecFileError::Value(refused))) =
        is_there.map(|()| CampaignSpec::from_table(without_empty(huge)))
        && refused.field == problem.field
        && !refused.allowed.contains(" where ")
    {
        must.allowed = refused.allowed;
    }
}

/// Sets the field of a section; `None` if the path is not that of such a field.
fn set(table: &mut Table, path: &str, value: Value) -> Option<()> {
    let (section, name) = path.split_once('.').unwrap_or(("", path));
    let table = match section {
        "" => table,
        section => {
            let section = table.entry(section).or_insert_with(|| Table::new().into());
            section.as_table_mut()?
        }
    };
    if !name.contains(['.', '[']) {
        table.insert(name.to_owned(), value);
    }
    Some(())
}

/// Makes the field right, so that the next error can be found: leaves it out, or gives a missing field a value. Returns false if
/// it can do neither.
fn repair(table: &mut Table, field: &str) -> bool {
    if take(table, field) {
        return true;
    }
    let section = field.split(['.', '[']).next().unwrap_or_default();
    match section {
        "method" if !table.contains_key("method") => {
            table.insert("method".to_owned(), Method::Latent.name().into());
            true
        }
        // Without its wrong part, a robot can be incomplete. The presets are complete.
        "model" | "robot" | "species" | "ratios"
            if table.get("model").is_none_or(|model| !is_usual(model)) =>
        {
            for own in OWN_ROBOTS {
                table.remove(own);
            }
            table.insert("model".to_owned(), USUAL_ROBOTS.into());
            true
        }
        _ => false,
    }
}

fn is_usual(model: &Value) -> bool {
    model.as_str() == Some(USUAL_ROBOTS)
}

/// Removes the value at a path such as `robot.sensors[1].angle`; false if the table has no such value.
fn take(table: &mut Table, path: &str) -> bool {
    let steps = path.split(['.', '[']).map(|step| step.trim_end_matches(']'));
    let steps: Vec<&str> = steps.collect();
    let Some((last, outer)) = steps.split_last() else {
        return false;
    };
    let Some((first, inner)) = outer.split_first() else {
        return table.remove(*last).is_some();
    };
    let mut value = table.get_mut(*first);
    for step in inner {
        value = value.and_then(|value| match value {
            Value::Array(items) => items.get_mut(step.parse::<usize>().ok()?),
            value => value.get_mut(*step),
        });
    }
    match value {
        Some(Value::Table(table)) => table.remove(*last).is_some(),
        Some(Value::Array(items)) => match last.parse::<usize>() {
            Ok(place) if place < items.len() => {
                items.remove(place);
                true
            }
            _ => false,
        },
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problems(text: &str) -> Vec<String> {
        let (problems, _) = read(&text.parse().unwrap()).unwrap_err();
        let said = |problem: &Problem| format!("{} {}", problem.field, problem.brief());
        problems.iter().map(said).collect()
    }

    #[test]
    fn all_wrong_fields_are_named_with_their_limits() {
        let mut said = problems(
            "model = \"single-sensor\"\nmethod = \"latent\"\nname = \"a b\"\n[search]\npopulation = -4\ngenerations = 0\n\
             [world]\nagents = \"abc\"\nhorizon = 1.5\n[dataset]\ncontrollers = \"x\"\n[serch]\na = 1\n",
        );
        said.sort();
        let starts = [
            "dataset.controllers must be a whole number from ",
            "name must be 1 to 64 letters",
            "search.generations must be a whole number from 1 to ",
            "search.population must be a whole number from 1 to 100000, not -4",
            "serch unknown field `serch`: did you mean `search`?",
            "world.agents must be a whole number from 1 to 10000, not \"abc\"",
            "world.horizon must be a whole number from 1 to 10000000, not 1.5",
        ];
        assert_eq!(said.len(), starts.len(), "{said:#?}");
        for (said, start) in said.iter().zip(starts) {
            assert!(said.starts_with(start), "{said:?} is not {start:?}");
        }
    }

    #[test]
    fn what_is_missing_hides_no_other_error() {
        let said = problems("seed = \"x\"\n");
        assert_eq!(said.len(), 3, "{said:#?}");
        let said = problems(
            "method = \"random\"\nseed = \"x\"\nrobot.sensors = [{ angle = 45 }, { fov = 1 }, { range = -1 }]\n",
        );
        for part in [
            "sensors[0].angle must be",
            "sensors[1].fov unknown",
            "sensors[2].range must be",
            "seed must be",
        ] {
            assert!(said.iter().any(|said| said.contains(part)), "{part}: {said:#?}");
        }
    }
}

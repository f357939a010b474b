//! Tables of genomes in the format of RobotSwarmSimulator, by the paper's authors: CSV without a header. Each row has the genes
//! of one controller, in the order of `murmuration robot`.

use super::CliError;
use csv::{ReaderBuilder, StringRecord, Trim};
use murmuration_swarm::text;
use std::path::Path;

/// Reads the rows of a table without a header: its first row has a number, and no name of a gene. Returns `None` for a table with
/// a header.
///
/// # Errors
/// The error names the row that does not have one finite number per gene, and the fault of that row.
pub(super) fn read(path: &Path, text: &[u8], genes: &[&str]) -> Result<Option<Vec<Vec<f64>>>, CliError> {
    let reader = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(Trim::All)
        .from_reader(text);
    let mut rows = Vec::new();
    for (place, record) in reader.into_records().enumerate() {
        let Ok(record) = record else {
            // The reader of files with a header reports files that are not CSV.
            return Ok(None);
        };
        if place == 0 && is_header(&record, genes) {
            return Ok(None);
        }
        rows.push(numbers(&record, genes).map_err(|reason| {
            CliError::Input(format!(
                "{}: row {}: {reason}; a table without a header has the {} genes of the robots in each row, as finite numbers \
                 (`murmuration robot` names them)",
                path.display(),
                place + 1,
                genes.len()
            ))
        })?);
    }
    Ok(Some(rows).filter(|rows| !rows.is_empty()))
}

fn is_header(record: &StringRecord, genes: &[&str]) -> bool {
    let is_number = |cell: &str| cell.parse::<f64>().is_ok();
    record.iter().any(|cell| genes.contains(&cell)) || !record.iter().any(is_number)
}

/// The numbers of a row, or an error message about it.
fn numbers(record: &StringRecord, genes: &[&str]) -> Result<Vec<f64>, String> {
    let columns = record.len();
    if columns == genes.len() + 1 && record.iter().next_back() == Some("") {
        return Err("it ends with a comma".to_owned());
    }
    if columns != genes.len() {
        return Err(format!("it has {columns} columns"));
    }
    let number = |(cell, gene): (&str, &&str)| match cell.parse() {
        Ok(number) if f64::is_finite(number) => Ok(number),
        _ => Err(format!(
            "{gene} = {}: must be a finite number",
            text::quoted(cell)
        )),
    };
    record.iter().zip(genes).map(number).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Result<Option<Vec<Vec<f64>>>, String> {
        let genes = ["left_0", "right_0", "left_1", "right_1"];
        read(Path::new("genomes.csv"), text.as_bytes(), &genes).map_err(|error| error.to_string())
    }

    #[test]
    fn a_table_without_a_header_has_a_controller_in_each_row() {
        let rows = read_text("-0.68018, 0.36262, 0.9391, 0.91109\n-0.0, 1, 1.0, -1e-3\n");
        let expected = vec![
            vec![-0.68018, 0.36262, 0.9391, 0.91109],
            vec![-0.0, 1.0, 1.0, -1e-3],
        ];
        assert_eq!(rows, Ok(Some(expected)));
    }

    #[test]
    fn a_table_with_a_header_is_left_to_others() {
        for text in [
            "left_0,right_0,left_1,right_1\n1,1,1,1\n",
            "left_0,right_0,left_1,right_1,2024\n1,1,1,1,1\n",
            "",
            "index\n",
        ] {
            assert_eq!(read_text(text), Ok(None), "{text}");
        }
    }

    #[test]
    fn rows_of_another_length_or_without_numbers_are_named() {
        for (text, said_of) in [
            ("1,2,3\n", "row 1: it has 3 columns"),
            ("1,2,3,4\n1,2,3,4,5\n", "row 2: it has 5 columns"),
            (
                "1,2,3,4\n1,2,3,x\n",
                "row 2: right_1 = \"x\": must be a finite number",
            ),
            ("nan,1,1,1\n", "row 1: left_0 = \"nan\""),
            ("1,inf,1,1\n", "row 1: right_0 = \"inf\""),
            ("1,2,3,4,\n", "row 1: it ends with a comma"),
        ] {
            let message = read_text(text).unwrap_err();
            assert!(
                message.contains(&format!("genomes.csv: {said_of}")) && message.contains("4 genes"),
                "{message}"
            );
        }
    }
}

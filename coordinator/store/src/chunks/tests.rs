//! Tests that chunks give back what was written, and that damaged chunks are named.

use super::*;

/// Changes the value of one individual in a column of a database's only campaign.
pub(crate) fn edit(connection: &Connection, column: &str, place: i64, change: impl FnOnce(&mut Vec<u8>)) {
    let (table, ends) = match column {
        "images" => ("image_chunks", "ends"),
        "embeddings" => ("embedding_chunks", "x''"),
        _ => ("individual_chunks", "x''"),
    };
    let select = format!(
        "SELECT rowid, first, individuals, {ends}, {column} FROM {table} WHERE ?1 BETWEEN first AND first + individuals - 1"
    );
    let (row, first, individuals, ends, column_value): (i64, i64, u32, Vec<u8>, Vec<u8>) = connection
        .query_row(&select, [place], |row| row.try_into())
        .unwrap();
    let mut ends = ends_in(&ends);
    if ends.is_empty() {
        ends = (1..=individuals as usize)
            .map(|end| end * column_value.len() / individuals as usize)
            .collect();
    }
    let starts = std::iter::once(0).chain(ends.iter().copied());
    let mut values: Vec<_> = starts
        .zip(&ends)
        .map(|(start, &end)| column_value[start..end].to_vec())
        .collect();
    change(&mut values[(place - first) as usize]);
    let update = format!("UPDATE {table} SET {column} = ?2 WHERE rowid = ?1");
    connection
        .execute(&update, params![row, values.concat()])
        .unwrap();
    if table == "image_chunks" {
        let ends = values.iter().scan(0, |end, value| {
            *end += value.len() as u32;
            Some(end.to_le_bytes())
        });
        let update = "UPDATE image_chunks SET ends = ?2 WHERE rowid = ?1";
        connection
            .execute(update, params![row, ends.collect::<Vec<_>>().concat()])
            .unwrap();
    }
}

//! Small files that would come to much in memory.

use super::*;
use arrow_array::types::{Float32Type, Float64Type};
use parquet::basic::Encoding;
use std::fs;

/// The path of a table with this column, written by the library as anybody can.
fn written(folder: &Path, values: ArrayRef, properties: WriterProperties) -> (std::path::PathBuf, Schema) {
    let path = folder.join("table.parquet");
    let schema = Schema::new(vec![column("x", values.data_type().clone())]);
    let rows = RecordBatch::try_new(Arc::new(schema.clone()), vec![values]).unwrap();
    let file = File::create(&path).unwrap();
    let mut writer = ArrowWriter::try_new(file, rows.schema(), Some(properties)).unwrap();
    writer.write(&rows).unwrap();
    writer.close().unwrap();
    (path, schema)
}

/// Why a table of so many rows is refused.
fn refused((path, schema): &(std::path::PathBuf, Schema), rows: u64) -> String {
    let error = open(path, File::open(path).unwrap(), schema, rows)
        .map(drop)
        .unwrap_err();
    error.to_string()
}

fn zstd() -> parquet::file::properties::WriterPropertiesBuilder {
    WriterProperties::builder().set_compression(Compression::ZSTD(parquet::basic::ZstdLevel::default()))
}

#[test]
fn what_the_writer_writes_is_read_in_batches() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("table.parquet");
    let schema = || {
        Schema::new(vec![
            column("x", list_of(DataType::Float64)),
            column("y", DataType::Utf8),
        ])
    };
    let mut table = TableWriter::create(&path, schema()).unwrap();
    let (rows, width) = (40_000, 300);
    for _ in 0..rows / 1000 {
        let numbers = number_column::<Float64Type>((0..1000 * width).map(f64::from));
        let texts = text_column((0..1000).map(|_| Some("a text that is in every row")));
        table
            .add(vec![Arc::new(lists(numbers, 1000, width as usize)), texts])
            .unwrap();
    }
    table.finish().unwrap();
    let batches = open(&path, File::open(&path).unwrap(), &schema(), rows as u64).unwrap();
    let lengths: Vec<usize> = batches.map(|rows| rows.unwrap().num_rows()).collect();
    assert_eq!(lengths.iter().sum::<usize>(), rows as usize);
    let longest = lengths.iter().max().unwrap() * width as usize * 8;
    assert!(longest <= BYTES, "{longest} bytes at once");
    let said = refused(&(path, schema()), rows as u64 + 1);
    assert!(said.contains("it has 40000 rows, and not 40001"), "{said}");
}

#[test]
fn row_groups_of_wide_rows_that_are_full_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("table.parquet");
    let schema = || {
        Schema::new(vec![
            column("mean", list_of(DataType::Float32)),
            column("trial", list_of(DataType::Float32)),
        ])
    };
    // As the embeddings of 256 dimensions of an individual with one start; numbers that hardly compress.
    let (rows, width, at_once) = (17_000_usize, 256, 500);
    let mut table = TableWriter::create(&path, schema()).unwrap();
    for part in 0..rows / at_once {
        let first = part * at_once * width;
        let numbers = || {
            let numbers = (first..first + at_once * width).map(|place| (place as f32).sin());
            number_column::<Float32Type>(numbers)
        };
        let columns = [numbers(), numbers()];
        table
            .add(
                columns
                    .map(|of| Arc::new(lists(of, at_once, width)) as ArrayRef)
                    .into(),
            )
            .unwrap();
    }
    table.finish().unwrap();
    let file = File::open(&path).unwrap();
    let metadata = ParquetRecordBatchReaderBuilder::try_new(file.try_clone().unwrap()).unwrap();
    let fullest = metadata
        .metadata()
        .row_groups()
        .iter()
        .map(|group| group.num_rows());
    let fullest = fullest.max().unwrap() as usize * width * 2 * 4;
    assert!((GROUP_BYTES / 4..=GROUP_BYTES).contains(&fullest), "{fullest}");
    let batches = open(&path, file, &schema(), rows as u64).unwrap();
    assert_eq!(batches.map(|rows| rows.unwrap().num_rows()).sum::<usize>(), rows);
}

#[test]
fn a_list_of_ten_million_numbers_in_few_bytes_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let numbers: ArrayRef = Arc::new(PrimitiveArray::<Float64Type>::from_value(1.0, 10_000_000));
    let table = written(
        folder.path(),
        Arc::new(lists(numbers, 1, 10_000_000)),
        zstd().build(),
    );
    assert!(fs::metadata(&table.0).unwrap().len() < 100_000);
    let said = refused(&table, 1);
    assert!(
        said.contains("row group 0 comes to") && said.contains("bytes in memory"),
        "{said}"
    );
}

#[test]
fn a_long_text_that_is_written_once_and_is_in_every_row_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let text = "long ".repeat(100_000);
    let texts = text_column((0..4096).map(|_| Some(text.as_str())));
    let table = written(folder.path(), texts, zstd().build());
    assert!(fs::metadata(&table.0).unwrap().len() < 100_000);
    let said = refused(&table, 4096);
    assert!(said.contains("bytes in memory"), "{said}");
    // The same with texts that are told by what they have in common with the one before.
    let delta = zstd()
        .set_dictionary_enabled(false)
        .set_encoding(Encoding::DELTA_BYTE_ARRAY);
    let texts = text_column((0..4096).map(|_| Some(text.as_str())));
    let said = refused(&written(folder.path(), texts, delta.build()), 4096);
    assert!(said.contains("an encoding that no export has"), "{said}");
}

#[test]
fn a_page_that_is_long_when_it_is_decompressed_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let text = "x".repeat(40 << 20);
    let plain = zstd().set_dictionary_enabled(false);
    let table = written(
        folder.path(),
        text_column([Some(text.as_str())].into_iter()),
        plain.build(),
    );
    assert!(fs::metadata(&table.0).unwrap().len() < 100_000);
    let said = refused(&table, 1);
    assert!(said.contains("a page has"), "{said}");
}

#[test]
fn a_file_that_was_cut_off_is_said_to_be() {
    let folder = tempfile::tempdir().unwrap();
    let numbers = number_column::<Float64Type>((0..1000).map(f64::from));
    let (path, schema) = written(folder.path(), numbers, zstd().build());
    let bytes = fs::read(&path).unwrap();
    let table = (path, schema);
    for (kept, named) in [
        (bytes.len() - 1, "it was cut off"),
        (bytes.len() / 2, "it was cut off"),
        (4, "shorter than a footer"),
        (0, "shorter than a footer"),
    ] {
        fs::write(&table.0, &bytes[..kept]).unwrap();
        let said = refused(&table, 1000);
        assert!(said.contains(named), "{said}");
    }
    // A footer that says it is a list of very many columns.
    let mut long = b"PAR1\x19\xfc\xff\xff\xff\x7f".to_vec();
    long.extend(6_u32.to_le_bytes());
    long.extend(b"PAR1");
    fs::write(&table.0, long).unwrap();
    let said = refused(&table, 1000);
    assert!(said.contains("its footer is damaged"), "{said}");
}

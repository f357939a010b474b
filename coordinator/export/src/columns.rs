//! Columns of Arrow: how they are described, made and checked.

use crate::{ExportError, sizes};
use arrow_array::{
    Array, ArrayRef, ArrowPrimitiveType, ListArray, PrimitiveArray, RecordBatch, StringArray, cast::AsArray,
};
use arrow_buffer::OffsetBuffer;
use arrow_schema::{DataType, Field, Schema};
use parquet::{
    arrow::{
        ArrowWriter,
        arrow_reader::{ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder},
    },
    basic::Compression,
    file::properties::WriterProperties,
    schema::types::ColumnPath,
};
use std::{collections::HashMap, fmt::Display, fs::File, path::Path, sync::Arc};

/// Most rows of a row group, and most rows that are read at a time.
const ROWS: usize = 16_384;
/// Bytes of rows that are read at a time, about: fewer rows where they are long.
const BYTES: usize = 32 << 20;
/// Most bytes of a row group as arrays, neither encoded nor compressed: [`sizes::check`] counts up to four times as many for
/// numbers of four bytes, the most of an export, and must come to less than it allows.
const GROUP_BYTES: usize = 16 << 20;

/// A column without nulls.
pub(crate) fn column(name: &str, kind: DataType) -> Field {
    Field::new(name, kind, false)
}

/// A list of numbers in each row.
pub(crate) fn list_of(kind: DataType) -> DataType {
    DataType::List(Arc::new(Field::new_list_field(kind, false)))
}

/// What a column is about, for people, and the unit of its numbers.
pub(crate) trait Described {
    /// The same column, described.
    fn about(self, about: &str) -> Self;
    /// The same column, with the unit of its numbers.
    fn unit(self, unit: &str) -> Self;
    /// The same column, with the names of the numbers in its lists.
    fn names(self, names: &[impl AsRef<str>]) -> Self;
}

impl Described for Field {
    fn about(self, about: &str) -> Self {
        with(self, "about", about)
    }

    fn unit(self, unit: &str) -> Self {
        with(self, "unit", unit)
    }

    fn names(self, names: &[impl AsRef<str>]) -> Self {
        let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
        with(self, "names", &names.join(", "))
    }
}

fn with(field: Field, key: &str, value: &str) -> Field {
    let known = field.metadata().iter();
    let mut metadata: HashMap<String, String> = known
        .map(|(key, value)| (key.to_string(), value.to_string()))
        .collect();
    metadata.insert(key.to_owned(), value.to_owned());
    field.with_metadata(metadata)
}

/// The metadata of a column under `key`; empty if there are none.
pub(crate) fn metadata(field: &Field, key: &str) -> String {
    field
        .metadata()
        .get(key)
        .map(ToString::to_string)
        .unwrap_or_default()
}

/// Lists of one length, behind each other in `values`.
pub(crate) fn lists(values: ArrayRef, rows: usize, width: usize) -> ListArray {
    let field = Arc::new(Field::new_list_field(values.data_type().clone(), false));
    let offsets = OffsetBuffer::from_lengths(std::iter::repeat_n(width, rows));
    ListArray::new(field, offsets, values, None)
}

/// A column of nulls, or of lists of one length where they have one.
pub(crate) fn lists_or_nulls<T: ArrowPrimitiveType>(
    values: Vec<T::Native>,
    rows: usize,
    width: usize,
) -> ArrayRef {
    let values: ArrayRef = Arc::new(PrimitiveArray::<T>::from_iter_values(values));
    match width {
        0 => Arc::new(ListArray::new_null(
            Arc::new(Field::new_list_field(values.data_type().clone(), false)),
            rows,
        )),
        width => Arc::new(lists(values, rows, width)),
    }
}

/// A table that is being written.
pub(crate) struct TableWriter {
    path: std::path::PathBuf,
    schema: Arc<Schema>,
    writer: ArrowWriter<File>,
}

impl TableWriter {
    /// A new table with these columns.
    pub(crate) fn create(path: &Path, schema: Schema) -> Result<Self, ExportError> {
        let file = File::create_new(path).map_err(ExportError::file("write", path))?;
        let mut properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(parquet::basic::ZstdLevel::default()))
            // How many bytes a row group has is bounded in `add`: the library would count them compressed.
            .set_max_row_group_row_count(Some(ROWS));
        let texts = schema.fields().iter();
        for text in texts.filter(|field| *field.data_type() == DataType::Utf8) {
            // Then a reader knows from the sizes of pages how long all texts together are.
            let column = ColumnPath::from(text.name().as_str());
            properties = properties.set_column_dictionary_enabled(column, false);
        }
        let properties = properties.build();
        let schema = Arc::new(schema);
        let writer = ArrowWriter::try_new(file, Arc::clone(&schema), Some(properties))
            .map_err(ExportError::unwritten(path))?;
        Ok(Self {
            path: path.to_path_buf(),
            schema,
            writer,
        })
    }

    /// Adds rows, column by column. Rows of a table are about equally long.
    pub(crate) fn add(&mut self, columns: Vec<ArrayRef>) -> Result<(), ExportError> {
        let rows = RecordBatch::try_new(Arc::clone(&self.schema), columns)
            .map_err(ExportError::uneven(&self.path))?;
        let row_bytes = rows.get_array_memory_size() / rows.num_rows().max(1);
        let most = (GROUP_BYTES / row_bytes.max(1)).clamp(1, ROWS);
        let mut start = 0;
        while start < rows.num_rows() {
            let room = most.saturating_sub(self.writer.in_progress_rows());
            let taken = room.min(rows.num_rows() - start);
            let written = match taken {
                0 => self.writer.flush(),
                _ => self.writer.write(&rows.slice(start, taken)),
            };
            written.map_err(ExportError::unwritten(&self.path))?;
            start += taken;
        }
        Ok(())
    }

    /// Writes the end of the table; it is on disk then.
    pub(crate) fn finish(self) -> Result<(), ExportError> {
        let path = self.path;
        let file = self.writer.into_inner().map_err(ExportError::unwritten(&path))?;
        file.sync_all().map_err(ExportError::file("write", &path))
    }
}

/// Opens a table, which must have these columns and so many rows; its rows come in batches. Nothing is decoded before it is known
/// what it comes to.
pub(crate) fn open(
    path: &Path,
    file: File,
    schema: &Schema,
    rows: u64,
) -> Result<ParquetRecordBatchReader, ExportError> {
    let damaged = |reason: &dyn Display| {
        let reason = format!("it is no table that `murmuration export` writes: {reason}");
        ExportError::damaged(path, reason)
    };
    sizes::check_footer(&file).map_err(|reason| damaged(&reason))?;
    let checked = file.try_clone().map_err(ExportError::file("read", path))?;
    let builder = ParquetRecordBatchReaderBuilder::try_new(file).map_err(|error| damaged(&error))?;
    if shape(builder.schema()) != shape(schema) {
        let names = schema.fields().iter().map(|field| field.name().as_str());
        let names = names.collect::<Vec<_>>().join(", ");
        return Err(damaged(&format!("its columns are others than {names}")));
    }
    let row_bytes = sizes::check(&checked, builder.metadata(), rows).map_err(|reason| damaged(&reason))?;
    let batch = BYTES / usize::try_from(row_bytes).unwrap_or(usize::MAX).max(1);
    let reader = builder.with_batch_size(batch.clamp(1, ROWS)).build();
    reader.map_err(|error| damaged(&error))
}

/// What tells whether two tables have the same columns.
fn shape(schema: &Schema) -> Vec<(&str, &DataType, bool)> {
    let columns = schema.fields().iter();
    columns
        .map(|field| (field.name().as_str(), field.data_type(), field.is_nullable()))
        .collect()
}

/// The numbers of a column without nulls.
pub(crate) fn numbers<T: ArrowPrimitiveType>(rows: &RecordBatch, column: usize) -> &[T::Native] {
    rows.column(column).as_primitive::<T>().values()
}

/// The numbers of a column, where they are there.
pub(crate) fn optional<T: ArrowPrimitiveType>(
    rows: &RecordBatch,
    column: usize,
) -> impl Iterator<Item = Option<T::Native>> + '_ {
    rows.column(column).as_primitive::<T>().iter()
}

/// The texts of a column, where they are there.
pub(crate) fn texts(rows: &RecordBatch, column: usize) -> impl Iterator<Item = Option<&str>> {
    rows.column(column).as_string::<i32>().iter()
}

/// A column of texts.
pub(crate) fn text_column<'a>(texts: impl Iterator<Item = Option<&'a str>>) -> ArrayRef {
    Arc::new(texts.collect::<StringArray>())
}

/// A column of numbers.
pub(crate) fn number_column<T: ArrowPrimitiveType>(numbers: impl Iterator<Item = T::Native>) -> ArrayRef {
    Arc::new(PrimitiveArray::<T>::from_iter_values(numbers))
}

/// A column of numbers, some of which are not there.
pub(crate) fn optional_column<T: ArrowPrimitiveType>(
    numbers: impl Iterator<Item = Option<T::Native>>,
) -> ArrayRef
where
    PrimitiveArray<T>: FromIterator<Option<T::Native>>,
{
    Arc::new(numbers.collect::<PrimitiveArray<T>>())
}

/// The numbers of the list in a row; nothing for a null.
pub(crate) fn list<T: ArrowPrimitiveType>(lists: &ListArray, row: usize) -> Vec<T::Native> {
    match lists.is_null(row) {
        true => Vec::new(),
        false => lists.value(row).as_primitive::<T>().values().to_vec(),
    }
}

#[cfg(test)]
mod tests;

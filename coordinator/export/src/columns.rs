//! Describes and makes Arrow columns.

use crate::ExportError;
use arrow_array::{Array, ArrayRef, ArrowPrimitiveType, ListArray, PrimitiveArray, RecordBatch, StringArray};
use arrow_buffer::OffsetBuffer;
use arrow_schema::{DataType, Field, Schema};
use parquet::{arrow::ArrowWriter, basic::Compression, file::properties::WriterProperties};
use std::{collections::HashMap, fs::File, path::Path, sync::Arc};

/// Maximum number of rows of a row group.
const ROWS: usize = 16_384;
/// Maximum size of a row group in memory, in bytes, neither encoded nor compressed. The writer holds one row group in memory.
const GROUP_BYTES: usize = 16 << 20;

/// A column without nulls.
pub(crate) fn column(name: &str, kind: DataType) -> Field {
    Field::new(name, kind, false)
}

/// A list of numbers in each row.
pub(crate) fn list_of(kind: DataType) -> DataType {
    DataType::List(Arc::new(Field::new_list_field(kind, false)))
}

/// Description of a column, and the unit of its numbers.
pub(crate) trait Described {
    /// This column, with `about` as its description.
    fn about(self, about: &str) -> Self;
    /// This column, with the unit of its numbers.
    fn unit(self, unit: &str) -> Self;
    /// This column, with the names of the numbers in its lists.
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

/// The metadata of a column under `key`; empty if the column has none under this key.
pub(crate) fn metadata(field: &Field, key: &str) -> String {
    field
        .metadata()
        .get(key)
        .map(ToString::to_string)
        .unwrap_or_default()
}

/// Lists of `width` numbers each; `values` has the numbers of the lists, one list after the other.
pub(crate) fn lists(values: ArrayRef, rows: usize, width: usize) -> ListArray {
    let field = Arc::new(Field::new_list_field(values.data_type().clone(), false));
    let offsets = OffsetBuffer::from_lengths(std::iter::repeat_n(width, rows));
    ListArray::new(field, offsets, values, None)
}

/// A column of lists of `width` numbers each; if `width` is 0, a column of nulls.
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
        let properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(parquet::basic::ZstdLevel::default()))
            // `add` bounds the bytes of a row group, because the library's limit would count compressed bytes.
            .set_max_row_group_row_count(Some(ROWS))
            .build();
        let schema = Arc::new(schema);
        let writer = ArrowWriter::try_new(file, Arc::clone(&schema), Some(properties))
            .map_err(ExportError::unwritten(path))?;
        Ok(Self {
            path: path.to_path_buf(),
            schema,
            writer,
        })
    }

    /// Adds rows, given as columns. Assumes that all rows of a table are about equally long.
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

    /// Writes the end of the table. The table is on disk when this function returns.
    pub(crate) fn finish(self) -> Result<(), ExportError> {
        let path = self.path;
        let file = self.writer.into_inner().map_err(ExportError::unwritten(&path))?;
        file.sync_all().map_err(ExportError::file("write", &path))
    }
}

pub(crate) fn text_column<'a>(texts: impl Iterator<Item = Option<&'a str>>) -> ArrayRef {
    Arc::new(texts.collect::<StringArray>())
}

pub(crate) fn number_column<T: ArrowPrimitiveType>(numbers: impl Iterator<Item = T::Native>) -> ArrayRef {
    Arc::new(PrimitiveArray::<T>::from_iter_values(numbers))
}

/// A column of numbers and nulls.
pub(crate) fn optional_column<T: ArrowPrimitiveType>(
    numbers: impl Iterator<Item = Option<T::Native>>,
) -> ArrayRef
where
    PrimitiveArray<T>: FromIterator<Option<T::Native>>,
{
    Arc::new(numbers.collect::<PrimitiveArray<T>>())
}

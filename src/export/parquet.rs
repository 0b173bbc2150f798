//! A table as Apache Parquet (Zstandard), with the tool frame and the provenance among the file's
//! key-value pairs.

use std::io::Write;

use serde_json::Value;

use super::Table;

#[cfg(feature = "parquet")]
pub(super) fn write(
    table: &Table,
    notes: &Value,
    writer: &mut (impl Write + Send),
) -> std::io::Result<()> {
    use std::collections::HashMap;
    use std::sync::Arc;

    use arrow_array::{ArrayRef, Float64Array, RecordBatch, StringArray, UInt64Array};
    use arrow_schema::{DataType, Field, Schema};
    use parquet::arrow::ArrowWriter;
    use parquet::basic::{Compression, ZstdLevel};
    use parquet::file::properties::WriterProperties;

    use super::Values;

    let mut fields = Vec::new();
    let mut arrays: Vec<ArrayRef> = Vec::new();
    for column in &table.columns {
        let (kind, nullable, array): (_, _, ArrayRef) = match &column.values {
            Values::Integer(values) => {
                (DataType::UInt64, false, Arc::new(UInt64Array::from(values.clone())))
            }
            Values::Number(values) => {
                (DataType::Float64, true, Arc::new(Float64Array::from(values.clone())))
            }
            Values::Text(values) => {
                (DataType::Utf8, false, Arc::new(StringArray::from(values.clone())))
            }
        };
        fields.push(Field::new(column.name, kind, nullable));
        arrays.push(array);
    }
    // In the schema's metadata, where readers by way of Arrow see it; the writer repeats it as a
    // key-value pair of the file. One key: the order of several would change from run to run.
    let notes = HashMap::from([("gripfast".to_owned(), notes.to_string())]);
    let schema = Arc::new(Schema::new_with_metadata(fields, notes));
    let batch = RecordBatch::try_new(Arc::clone(&schema), arrays).map_err(std::io::Error::other)?;
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .build();
    let mut parquet =
        ArrowWriter::try_new(writer, schema, Some(properties)).map_err(std::io::Error::other)?;
    parquet.write(&batch).map_err(std::io::Error::other)?;
    parquet.close().map_err(std::io::Error::other)?;
    Ok(())
}

#[cfg(not(feature = "parquet"))]
pub(super) fn write(
    _table: &Table,
    _notes: &Value,
    _writer: &mut impl Write,
) -> std::io::Result<()> {
    Err(std::io::ErrorKind::Unsupported.into())
}

//! Formats JSON values as tables for the terminal.

use serde_json::Value as Json;

/// Fields that can label an array's element in a table. The label is the first of these fields that
/// the element has.
const LABELS: [&str; 2] = ["name", "machine"];

/// Returns rows of cells as text under a title. The first column is aligned left, all others right.
pub(crate) fn table(title: &str, rows: &[Vec<String>]) -> String {
    let mut text = format!("{title}\n");
    for row in rows.iter().filter(|row| row.iter().any(|cell| !cell.is_empty())) {
        let cells = row.iter().enumerate().map(|(column, cell)| {
            let lengths = rows.iter().filter_map(|row| Some(row.get(column)?.chars().count()));
            let width = lengths.max().unwrap_or(0);
            match column {
                0 => format!("  {cell:<width$}"),
                _ => format!("    {cell:>width$}"),
            }
        });
        text += cells.collect::<String>().trim_end();
        text += "\n";
    }
    text
}

/// Returns the text of a number, flag, string or flat array. Numbers have at most three decimals;
/// those below 0.01 are in scientific notation.
pub(crate) fn cell(value: &Json) -> String {
    match value {
        Json::Null => "not measured".to_owned(),
        Json::String(text) => text.clone(),
        Json::Array(values) => values.iter().map(cell).collect::<Vec<_>>().join(", "),
        Json::Number(number) if number.is_f64() => match number.as_f64().unwrap_or(f64::NAN) {
            small if small != 0.0 && small.abs() < 0.01 => format!("{small:.1e}"),
            number => ((number * 1000.0).round() / 1000.0).to_string(),
        },
        other => other.to_string(),
    }
}

/// Returns a nested JSON value as tables: first the flat fields of its elements, then a table for
/// each nested field. The elements of an array must have the same fields.
pub(crate) fn tables(title: &str, value: &Json) -> String {
    let elements: Vec<(String, &Json)> = match value {
        Json::Array(elements) if elements.iter().any(is_nested) => {
            let label =
                |element: &Json| LABELS.iter().find_map(|label| element.get(label)).map(cell);
            let elements = (1..).zip(elements);
            let labelled =
                elements.map(|(number, each)| (label(each).unwrap_or(format!("{number}")), each));
            labelled.collect()
        }
        Json::Object(elements) => {
            elements.iter().map(|(key, value)| (key.clone(), value)).collect()
        }
        Json::Array(elements) if elements.is_empty() => return String::new(),
        flat => return format!("\n{title}: {}\n", cell(flat)),
    };
    let mut rows = vec![vec![String::new()]];
    let mut nested = String::new();
    for (label, element) in &elements {
        let mut row = vec![label.clone()];
        row.extend(element.as_array().into_iter().flatten().map(cell));
        for (key, field) in element.as_object().into_iter().flatten() {
            if field.as_array().is_some_and(|fields| fields.iter().any(is_nested)) {
                nested += &tables(&format!("{title}, {label}: {key}"), field);
            } else if !LABELS.contains(&key.as_str()) {
                row.push(cell(field));
                if !rows[0].contains(key) {
                    rows[0].push(key.clone());
                }
            }
        }
        rows.push(row);
    }
    // If an element has more fields than there are elements, elements become columns.
    if rows[0].len() > rows.len() {
        let columns = 0..rows[0].len();
        let column =
            |column| rows.iter().map(move |row| row.get(column).cloned().unwrap_or_default());
        rows = columns.map(|index| column(index).collect()).collect();
    }
    format!("\n{}{nested}", table(title, &rows))
}

pub(crate) fn is_nested(value: &Json) -> bool {
    value.is_object() || value.is_array()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn objects_are_rows_or_columns_and_their_nested_arrays_tables_of_their_own() {
        let rows = json!([
            {"name": "b", "n": 1, "x": 0.123_456, "range": [3, 4], "inner": [{"machine": "p", "y": null}]},
            {"name": "long", "n": 12, "x": 1e-7, "range": []},
            {"name": "c", "n": 3, "x": true, "range": [5]},
        ]);
        let expected = "
t
           n    range         x
  b        1     3, 4     0.123
  long    12             1.0e-7
  c        3        5      true

t, b: inner
                  y
  p    not measured
";
        let columns = json!({"a": {"x": 1, "y": 2}, "b": {"x": 3, "y": 4}});
        for (value, expected) in [
            (rows, expected),
            (columns, "\nt\n       x    y\n  a    1    2\n  b    3    4\n"),
            (json!({"a": {"x": 1, "y": 2}}), "\nt\n       a\n  x    1\n  y    2\n"),
            (json!([[1, 2], [34, 5]]), "\nt\n  1     1    2\n  2    34    5\n"),
            (json!(["a", "b"]), "\nt: a, b\n"),
            (json!([]), ""),
        ] {
            assert_eq!(tables("t", &value), expected);
        }
    }
}

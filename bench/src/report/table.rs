//! JSON as tables on the terminal.

use serde_json::Value as Json;

/// Fields that name an element of an array.
const LABELS: [&str; 3] = ["name", "machine", "part"];

/// Lays out rows of cells under a title: the first column to the left, all others to the right.
pub(crate) fn table(title: &str, rows: &[Vec<String>]) -> String {
    let mut lines = vec![title.to_owned()];
    for row in rows {
        let cells = row.iter().enumerate().map(|(column, cell)| {
            let cells = rows.iter().filter_map(|row| row.get(column));
            let width = cells.map(|cell| cell.chars().count()).max().unwrap_or(0);
            match column {
                0 => format!("  {cell:<width$}"),
                _ => format!("    {cell:>width$}"),
            }
        });
        lines.push(cells.collect::<String>().trim_end().to_owned());
    }
    lines.retain(|line| !line.is_empty());
    lines.join("\n") + "\n"
}

/// Returns the text of a number, flag, string or flat array; numbers have at most three decimals.
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

/// Returns the tables of a nested JSON value: one of its elements' flat fields, then those of their
/// nested fields.
pub(crate) fn tables(title: &str, value: &Json) -> String {
    let elements: Vec<(String, &Json)> = match value {
        Json::Array(elements) if elements.iter().any(is_nested) => {
            let label = |(index, element): (usize, &Json)| {
                let name = LABELS.iter().find_map(|label| element.get(label));
                name.map_or((index + 1).to_string(), cell)
            };
            let labels = elements.iter().enumerate().map(label);
            labels.zip(elements).collect()
        }
        Json::Object(elements) => elements
            .iter()
            .map(|(key, value)| (key.clone(), value))
            .collect(),
        flat => match cell(flat).as_str() {
            "" => return String::new(),
            text => return format!("\n{title}: {text}\n"),
        },
    };
    let mut rows = vec![vec![String::new()]];
    let mut nested = String::new();
    for (label, element) in &elements {
        let mut row = vec![label.clone()];
        row.extend(element.as_array().into_iter().flatten().map(cell));
        for (key, field) in element.as_object().into_iter().flatten() {
            let fields = field.as_array();
            if fields.is_some_and(|fields| fields.iter().any(is_nested)) {
                nested += &tables(&format!("{title}, {label}: {key}"), field);
            } else if !LABELS.contains(&key.as_str())
                && fields.is_none_or(|fields| !fields.is_empty())
            {
                let column = rows[0].iter().position(|heading| heading == key);
                let column = column.unwrap_or_else(|| {
                    rows[0].push(key.clone());
                    rows[0].len() - 1
                });
                row.resize(row.len().max(column + 1), String::new());
                row[column] = cell(field);
            }
        }
        rows.push(row);
    }
    if rows[0].len() > rows.len() {
        let columns = 0..rows[0].len();
        let column = |column| {
            rows.iter()
                .map(move |row| row.get(column).cloned().unwrap_or_default())
        };
        rows = columns.map(|index| column(index).collect()).collect();
    }
    format!("\n{}{nested}", table(title, &rows))
}

fn is_nested(value: &Json) -> bool {
    value.is_object() || value.is_array()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn objects_are_rows_and_their_nested_arrays_tables_of_their_own() {
        let value = json!([
            {"name": "b", "n": 1, "x": 0.123_456, "inner": [{"part": "p", "y": null}]},
            {"name": "long", "n": 12, "x": 1e-7, "range": [3, 4]},
            {"name": "c", "n": 3, "x": true, "range": []},
        ]);
        let expected = "
outer
           n         x    range
  b        1     0.123
  long    12    1.0e-7     3, 4
  c        3      true

outer, b: inner
                  y
  p    not measured
";
        assert_eq!(tables("outer", &value), expected);
    }

    #[test]
    fn few_elements_with_many_fields_are_columns() {
        let value = json!({"a": {"x": 1, "y": 2}, "b": {"x": 3, "y": 4}});
        assert_eq!(
            tables("t", &value),
            "\nt\n       x    y\n  a    1    2\n  b    3    4\n"
        );
        let value = json!({"a": {"x": 1, "y": 2, "z": 5}});
        assert_eq!(
            tables("t", &value),
            "\nt\n       a\n  x    1\n  y    2\n  z    5\n"
        );
        assert_eq!(
            tables("t", &json!([[1, 2], [34, 5]])),
            "\nt\n  1     1    2\n  2    34    5\n"
        );
        assert_eq!(tables("t", &json!(["a", "b"])), "\nt: a, b\n");
    }
}

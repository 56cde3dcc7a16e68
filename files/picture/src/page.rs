//! The HTML page of a report: text, tables and links to pictures. Also quotes fields of CSV files.

use std::fmt::Write as _;

const STYLE: &str = "body{font:16px/1.5 Helvetica,Arial,sans-serif;color:#1f2933;max-width:1240px;margin:2em auto;\
padding:0 1em}table{border-collapse:collapse;margin:1em 0}th,td{padding:.25em .8em;text-align:right;border-bottom:\
1px solid #e4e9ee}th:first-child,td:first-child{text-align:left}img{max-width:100%;border:1px solid #e4e9ee;\
margin:.5em 0}figure{margin:1.5em 0}caption,figcaption,p.note{color:#627080;text-align:left}";

/// An HTML page, to which a report is appended piece by piece.
#[derive(Debug, Clone)]
pub struct Page {
    title: String,
    body: String,
}

impl Page {
    /// Creates a page with `title`, in plain text, as title and heading.
    pub fn new(title: &str) -> Self {
        let title = escaped(title);
        Self { body: format!("<h1>{title}</h1>\n"), title }
    }

    /// Appends HTML. The caller must have [`escaped`] any text in it that is not trusted HTML.
    pub fn push_html(&mut self, html: &str) {
        self.body.push_str(html);
    }

    /// Appends a paragraph of plain text.
    pub fn push_text(&mut self, text: &str) {
        // Writing to a string never fails.
        let _ = writeln!(self.body, "<p>{}</p>", escaped(text));
    }

    /// Appends the picture `path` with a caption in plain text, and links to `values`, the files
    /// that hold the numbers shown. All paths are relative to the page.
    pub fn push_picture(&mut self, path: &str, caption: &str, values: &[&str]) {
        // Writing to a string never fails.
        let _ =
            write!(self.body, "<figure>{}<figcaption>{}", image(path, caption), escaped(caption));
        for path in values {
            let _ = write!(self.body, " <a href=\"{}\">{}</a>", href(path), escaped(path));
        }
        self.body.push_str("</figcaption></figure>\n");
    }

    /// Appends a table of plain text; the first row is its head.
    pub fn push_table(&mut self, rows: &[Vec<String>]) {
        self.body.push_str("<table>\n");
        for (at, row) in rows.iter().enumerate() {
            let tag = if at == 0 { "th" } else { "td" };
            self.body.push_str("<tr>");
            for cell in row {
                let _ = write!(self.body, "<{tag}>{}</{tag}>", escaped(cell));
            }
            self.body.push_str("</tr>\n");
        }
        self.body.push_str("</table>\n");
    }

    /// Returns the complete page as HTML, with its style sheet.
    pub fn to_html(&self) -> String {
        let Self { title, body } = self;
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title>\
             <style>{STYLE}</style></head><body>\n{body}</body></html>\n"
        )
    }
}

/// Returns HTML that shows a picture, which browsers load only when it scrolls into view. `path` is
/// relative to the page.
pub fn image(path: &str, description: &str) -> String {
    format!("<img loading=\"lazy\" src=\"{}\" alt=\"{}\">", href(path), escaped(description))
}

/// Encodes a relative path for use as the value of an HTML attribute such as `href`.
pub fn href(path: &str) -> String {
    let codes = [("%", "%25"), ("#", "%23"), ("?", "%3F"), (" ", "%20")];
    escaped(&replaced(path, &codes))
}

/// Replaces the characters of a text that have a meaning in HTML by entities.
pub fn escaped(text: &str) -> String {
    let entities = [("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ("\"", "&quot;")];
    replaced(text, &entities)
}

fn replaced(text: &str, pairs: &[(&str, &str)]) -> String {
    pairs.iter().fold(text.to_owned(), |text, (from, to)| text.replace(from, to))
}

/// Quotes a text for use as a field of a CSV file (RFC 4180): only if it contains a quotation mark,
/// a comma, a semicolon or a line break.
pub fn csv_field(text: &str) -> String {
    if text.contains(['"', ',', ';', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn foreign_text_is_text_and_not_markup() {
        let mut page = Page::new("a <b>");
        page.push_text("\"1 < 2\" & more");
        page.push_picture("run 1#/map.svg", "error > 0", &["values?.csv"]);
        page.push_table(&[vec!["<x>".to_owned()], vec!["1".to_owned()]]);
        let html = page.to_html();
        for part in [
            "<title>a &lt;b&gt;</title>",
            "<h1>a &lt;b&gt;</h1>",
            "<p>&quot;1 &lt; 2&quot; &amp; more</p>",
            "src=\"run%201%23/map.svg\" alt=\"error &gt; 0\"",
            "<a href=\"values%3F.csv\">values?.csv</a>",
            "<tr><th>&lt;x&gt;</th></tr>\n<tr><td>1</td></tr>",
        ] {
            assert!(html.contains(part), "{part} is not in {html}");
        }
    }

    #[test]
    fn texts_with_separators_are_quoted() {
        for (text, written) in
            [("T1", "T1"), ("a,b", "\"a,b\""), ("say \"go\"", "\"say \"\"go\"\"\"")]
        {
            assert_eq!(csv_field(text), written);
        }
    }
}

//! A page to read: headings, sentences, tables, figures. One self-contained HTML file without a script.

use crate::error::Error;
use crate::report::table::Table;
use crate::report::template::{fill, plain};
use crate::tone::Picture;
use base64::Engine;
use rayon::prelude::*;
use std::fmt::Write;
use std::path::Path;

/// Everything that the page shows.
#[derive(Clone, Debug, Default)]
pub struct Document {
    /// First heading.
    pub title: String,
    /// One line under it.
    pub subtitle: String,
    /// In order.
    pub sections: Vec<Section>,
    /// The command line that made the page.
    pub command: String,
}

/// A heading and what stands under it: sentences, then tables, then figures.
#[derive(Clone, Debug, Default)]
pub struct Section {
    /// The heading.
    pub heading: String,
    /// Paragraphs.
    pub text: Vec<String>,
    /// Tables with their captions.
    pub tables: Vec<(String, Table)>,
    /// Pictures that stand side by side as far as there is room.
    pub figures: Vec<Figure>,
    /// Footnotes: what is missing, and why.
    pub notes: Vec<String>,
}

/// A picture with its caption.
#[derive(Clone, Debug)]
pub struct Figure {
    /// First words, set bold.
    pub title: String,
    /// A sentence or figures.
    pub caption: String,
    /// The picture; shown at least at its own size, with hard pixels.
    pub picture: Picture,
}

/// Writes the page, whole or not at all; its length in bytes.
///
/// # Errors
/// [`Error::Encode`], I/O errors.
pub fn write(path: &Path, document: &Document) -> Result<usize, Error> {
    let page = html(document)?;
    quell_frames::files::write_bytes(path, page.as_bytes())?;
    Ok(page.len())
}

fn html(document: &Document) -> Result<String, Error> {
    let mut body = String::new();
    let out = &mut body;
    for (i, section) in document.sections.iter().enumerate() {
        // Writing to a string never fails.
        let _ = write!(out, "<section id=\"s{i}\"><h2>{}</h2>", plain(&section.heading));
        for paragraph in &section.text {
            let _ = write!(out, "<p>{}</p>", plain(paragraph));
        }
        for (caption, table) in &section.tables {
            write_table(out, caption, table);
        }
        let encoded = section.figures.par_iter().map(|f| f.picture.png()).collect::<Result<Vec<_>, Error>>()?;
        if !encoded.is_empty() {
            out.push_str("<div class=\"figures\">");
            for (figure, png) in section.figures.iter().zip(encoded) {
                let _ = write!(
                    out,
                    "<figure><img width=\"{}\" height=\"{}\" alt=\"{}\" src=\"data:image/png;base64,{}\"><figcaption><b>{}</b> \
                     {}</figcaption></figure>",
                    figure.picture.size.width,
                    figure.picture.size.height,
                    plain(&figure.title),
                    base64::engine::general_purpose::STANDARD.encode(&png),
                    plain(&figure.title),
                    plain(&figure.caption)
                );
            }
            out.push_str("</div>");
        }
        for note in &section.notes {
            let _ = write!(out, "<p class=\"note\">{}</p>", plain(note));
        }
        out.push_str("</section>");
    }
    let mut contents = String::new();
    for (i, section) in document.sections.iter().enumerate() {
        let _ = write!(contents, "<a href=\"#s{i}\">{}</a>", plain(&section.heading));
    }
    let (title, subtitle, command) = (plain(&document.title), plain(&document.subtitle), plain(&document.command));
    Ok(fill(include_str!("assets/document.html"), |name| match name {
        "title" => vec![title.as_str()],
        "subtitle" => vec![subtitle.as_str()],
        "style" => vec![include_str!("assets/document.css")],
        "contents" => vec![contents.as_str()],
        "body" => vec![body.as_str()],
        "command" => vec![command.as_str()],
        "version" => vec![env!("CARGO_PKG_VERSION")],
        _ => vec![],
    }))
}

fn write_table(out: &mut String, caption: &str, table: &Table) {
    let _ = write!(out, "<div class=\"scroll\"><table><caption>{}</caption><thead><tr>", plain(caption));
    for head in &table.head {
        let _ = write!(out, "<th scope=\"col\">{}</th>", plain(head));
    }
    out.push_str("</tr></thead><tbody>");
    for row in &table.rows {
        out.push_str("<tr>");
        for (i, cell) in row.iter().enumerate() {
            let (open, close) = if i == 0 { ("<th scope=\"row\">", "</th>") } else { ("<td>", "</td>") };
            let _ = write!(out, "{open}{}{close}", plain(cell));
        }
        out.push_str("</tr>");
    }
    out.push_str("</tbody></table></div>");
}

#[cfg(test)]
mod tests {
    use super::*;
    use quell::Size;

    #[test]
    fn text_stays_text_and_pictures_are_inside() {
        let mut table = Table::new(["method", "ms"]);
        table.push(["<script>".to_owned(), "1 & 2".to_owned()]);
        let picture = Picture { size: Size::new(2, 1), rgb: vec![0, 128, 255, 255, 0, 0] };
        let document = Document {
            title: "a < b".to_owned(),
            sections: vec![Section {
                heading: "one".to_owned(),
                tables: vec![("cap".to_owned(), table)],
                figures: vec![Figure { title: "f\"g".to_owned(), caption: String::new(), picture }],
                ..Section::default()
            }],
            ..Document::default()
        };
        let page = html(&document).unwrap();
        assert!(page.contains("a &lt; b") && page.contains("&lt;script&gt;") && page.contains("1 &amp; 2"));
        assert!(page.contains("data:image/png;base64,iVBORw0KGgo") && page.contains("alt=\"f&quot;g\""));
        assert!(!page.contains("{{") && !page.contains("http://") && !page.contains("https://"));
        let broken = Figure {
            picture: Picture { size: Size::new(2, 1), rgb: vec![] },
            ..document.sections[0].figures[0].clone()
        };
        let document = Document { sections: vec![Section { figures: vec![broken], ..Section::default() }], ..document };
        assert!(html(&document).is_err());
    }
}

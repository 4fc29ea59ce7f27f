//! Pages are made from a file with places `{{name}}`.

/// Text as HTML, in elements and in quoted attributes.
pub fn plain(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// The template with what `of` gives for the name of each place.
pub fn fill<'t>(template: &str, of: impl Fn(&str) -> Vec<&'t str>) -> String {
    let mut page = String::with_capacity(template.len() + 65_536);
    for (i, part) in template.split("{{").enumerate() {
        let (name, rest) = if i == 0 { ("", part) } else { part.split_once("}}").unwrap_or(("", part)) };
        for text in of(name) {
            page.push_str(text);
        }
        page.push_str(rest);
    }
    page
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_filled_once_and_text_stays_text() {
        let of = |name: &str| match name {
            "a" => vec!["1", "{{b}}"],
            "b" => vec!["2"],
            _ => vec![],
        };
        assert_eq!(fill("<{{a}}|{{b}}|{{unknown}}>", of), "<1{{b}}|2|>");
        assert_eq!(plain("<a b=\"c\">&"), "&lt;a b=&quot;c&quot;&gt;&amp;");
    }
}

//! Where controls are, for tests that aim at them.

use eframe::egui::Rect;

/// Places of the controls in this frame, by name.
#[derive(Default)]
pub(super) struct Marks {
    places: Vec<(String, Rect)>,
    sought: Option<String>,
}

impl Marks {
    pub(super) fn begin(&mut self) {
        self.places.clear();
    }

    pub(super) fn add(&mut self, name: &str, rect: Rect) {
        self.places.push((name.to_owned(), rect));
    }

    /// Which control is to be scrolled into view, from now on.
    #[cfg(not(target_arch = "wasm32"))]
    pub(super) fn seek(&mut self, name: Option<String>) {
        self.sought = name;
    }

    /// Whether this control is to be scrolled into view.
    pub(super) fn seeks(&self, name: &str) -> bool {
        self.sought.as_deref() == Some(name)
    }

    #[cfg(not(target_arch = "wasm32"))]
    pub(super) fn place(&self, name: &str) -> Option<Rect> {
        self.places.iter().find(|(known, _)| known == name).map(|(_, rect)| *rect)
    }

    pub(super) fn report(&self) -> serde_json::Value {
        let place =
            |(name, r): &(String, Rect)| (name.clone(), serde_json::json!([r.min.x, r.min.y, r.max.x, r.max.y]));
        self.places.iter().map(place).collect::<serde_json::Map<_, _>>().into()
    }
}

//! Saved views that outlive the window: a small text of JSON, in a file or in what the browser keeps for a page.

use crate::pilot::{Mode, Pilot, View};
use quell_trace::Scene;
use serde_json::{Map, Value, json};

/// A view that was saved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Saved {
    pub(super) pilot: Pilot,
    pub(super) time: f64,
}

/// Views of a scene, at most.
pub(super) const MOST: usize = 32;

/// Name of the file, and of what the browser keeps.
pub(super) const NAME: &str = "quell-live-views.json";

/// All that is kept, by the scenes' names.
fn read(text: &str) -> Result<Map<String, Value>, String> {
    if text.is_empty() {
        return Ok(Map::new());
    }
    match serde_json::from_str(text) {
        Ok(Value::Object(all)) => Ok(all),
        Ok(_) => Err(format!("{NAME} holds no views: rename or remove it")),
        Err(error) => Err(format!("{NAME} cannot be read ({error}): rename or remove it")),
    }
}

/// The views of a scene called `name`. Entries that are no views of it are left out.
///
/// # Errors
/// A text that is not of this kind, in words.
pub(super) fn of(text: &str, name: &str, scene: &Scene) -> Result<Vec<Saved>, String> {
    let all = read(text)?;
    let views = all.get(name).and_then(Value::as_array).into_iter().flatten();
    let usable = |view: &Value| -> Option<Saved> {
        let place: View = view["view"].as_str()?.parse().ok()?;
        let camera = usize::try_from(view["camera"].as_u64()?).ok()?;
        let mode = Mode::ALL.into_iter().find(|mode| view["mode"] == mode.name())?;
        let mut pilot = Pilot::at(scene, camera, place.time, mode).ok()?;
        if mode != Mode::Path {
            pilot.place(&place).ok()?;
        }
        Some(Saved { pilot, time: place.time })
    };
    Ok(views.filter_map(usable).take(MOST).collect())
}

/// The text with the views of a scene in place of those that it had.
///
/// # Errors
/// A text that is not of this kind, in words: it is not written over.
pub(super) fn with(text: &str, name: &str, saved: &[Saved]) -> Result<String, String> {
    let mut all = read(text)?;
    let views = saved.iter().map(|Saved { pilot, time }| {
        json!({ "view": pilot.words(*time), "camera": pilot.camera, "mode": pilot.mode.name() })
    });
    if saved.is_empty() {
        all.remove(name);
    } else {
        all.insert(name.to_owned(), views.collect());
    }
    serde_json::to_string_pretty(&all).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use quell_trace::builtin;

    #[test]
    fn views_come_back_beside_those_of_other_scenes() {
        let scene = builtin("cornell-box").unwrap();
        let mut pilot = Pilot::at(&scene, 1, 3.0, Mode::Path).unwrap();
        let path = Saved { pilot, time: 3.0 };
        pilot.drag([0.2, 0.1]);
        let orbit = Saved { pilot, time: 4.5 };
        pilot.mode = Mode::Fly;
        pilot.fly([0.0, 0.0, 1.0], 0.1);
        let fly = Saved { pilot, time: 0.0 };
        let text = with("", "other", &[orbit]).unwrap();
        let text = with(&text, "cornell-box", &[path, orbit, fly]).unwrap();
        let back = of(&text, "cornell-box", &scene).unwrap();
        assert_eq!(back.len(), 3);
        for (a, b) in back.iter().zip([path, orbit, fly]) {
            assert_eq!((a.time, a.pilot.mode, a.pilot.camera), (b.time, b.pilot.mode, b.pilot.camera));
            let apart = (a.pilot.eye() - b.pilot.eye()).length() + (a.pilot.forward() - b.pilot.forward()).length();
            assert!(apart < 1e-4, "{apart}");
        }
        let text = with(&text, "cornell-box", &[]).unwrap();
        assert!(of(&text, "cornell-box", &scene).unwrap().is_empty());
        assert_eq!(of(&text, "other", &scene).unwrap().len(), 1);
    }

    #[test]
    fn what_is_no_list_of_views_is_refused_or_left_out() {
        let scene = builtin("cornell-box").unwrap();
        for text in ["[", "[]", "3", "{"] {
            assert!(of(text, "cornell-box", &scene).unwrap_err().contains(NAME), "{text}");
            assert!(with(text, "cornell-box", &[]).is_err(), "{text}");
        }
        for views in [
            json!(3),
            json!([3, null, {}]),
            json!([{ "view": "1,2", "camera": 1, "mode": "orbit" }]),
            json!([{ "view": "1,2,3,4,5,6", "camera": 99, "mode": "orbit" }]),
            json!([{ "view": "1,2,3,4,5,6", "camera": -1, "mode": "orbit" }]),
            json!([{ "view": "1,2,3,1,2,3", "camera": 1, "mode": "fly" }]),
            json!([{ "view": "1,2,3,4,5,6", "camera": 1, "mode": "walk" }]),
        ] {
            let text = json!({ "cornell-box": views }).to_string();
            assert_eq!(of(&text, "cornell-box", &scene).unwrap(), [], "{text}");
        }
    }
}

//! A browser to look at pages with: chromedriver, spoken to over plain HTTP.

use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// Set to 1, a missing browser fails the tests instead of skipping them.
pub const REQUIRE: &str = "QUELL_REQUIRE_CHROMIUM";

/// Where a browser is looked for, in this order.
const BROWSERS: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

/// A headless browser with a fresh profile; both processes end with it.
pub struct Browser {
    driver: Child,
    port: u16,
    session: String,
    profile: PathBuf,
}

fn found(name: &str) -> Option<PathBuf> {
    std::env::split_paths(&std::env::var_os("PATH")?).map(|folder| folder.join(name)).find(|path| path.is_file())
}

/// How long a script of a page may take (30 s by default: too short for all shaders where other programs run beside).
const SCRIPT_LIMIT: Duration = Duration::from_secs(150);

impl Browser {
    /// Starts a browser with a window of this size; `None`, said aloud, where there is none.
    pub fn start(width: u32, height: u32) -> Option<Self> {
        Self::start_with(width, height, &["--disable-gpu"])
    }

    /// The same with further arguments.
    pub fn start_with(width: u32, height: u32, further: &[&str]) -> Option<Self> {
        let browser = BROWSERS.iter().find_map(|name| found(name));
        let (Some(browser), Some(driver)) = (browser, found("chromedriver")) else {
            assert!(std::env::var_os(REQUIRE).is_none_or(|v| v != "1"), "{REQUIRE}=1, but there is no chromium");
            eprintln!("SKIPPED: no chromium with chromedriver on the PATH ({REQUIRE}=1 makes this an error)");
            return None;
        };
        // Browsers of tests that run side by side may not share a profile: the second would end at once.
        static STARTED: AtomicU32 = AtomicU32::new(0);
        let number = STARTED.fetch_add(1, Ordering::Relaxed);
        let profile = std::env::temp_dir().join(format!("quell-browser-{}-{number}", std::process::id()));
        let mut driver = Command::new(driver)
            .arg("--port=0")
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("chromedriver starts");
        let mut lines = BufReader::new(driver.stdout.take().unwrap()).lines();
        let port = loop {
            let line = lines.next().expect("chromedriver names its port").unwrap();
            let words = line.rsplit_once("successfully on port ").map(|(_, port)| port.trim_end_matches('.').parse());
            if let Some(Ok(port)) = words {
                break port;
            }
        };
        // Whatever else it prints is read away, lest it wait for a reader.
        std::thread::spawn(move || lines.for_each(drop));
        let mut started = Self { driver, port, session: String::new(), profile };
        let mut arguments = vec![
            "--headless".to_owned(),
            "--no-sandbox".to_owned(),
            "--disable-quic".to_owned(),
            "--no-first-run".to_owned(),
            "--disable-background-networking".to_owned(),
            "--disable-component-update".to_owned(),
            "--disable-sync".to_owned(),
            "--disable-dev-shm-usage".to_owned(),
            "--hide-scrollbars".to_owned(),
            format!("--window-size={width},{height}"),
            format!("--user-data-dir={}", started.profile.display()),
        ];
        arguments.extend(further.iter().map(|&argument| argument.to_owned()));
        let options = json!({ "binary": browser, "args": arguments });
        let capabilities = json!({ "capabilities": { "alwaysMatch": {
            "goog:chromeOptions": options, "goog:loggingPrefs": { "browser": "ALL" },
            "timeouts": { "script": SCRIPT_LIMIT.as_millis() as u64 },
        } } });
        let session = started.call("POST", "/session", &capabilities);
        started.session = session["sessionId"].as_str().expect("a session").to_owned();
        Some(started)
    }

    /// One call of the WebDriver protocol; its `value`.
    fn call(&self, method: &str, path: &str, body: &Value) -> Value {
        let body = if method == "GET" || method == "DELETE" { String::new() } else { body.to_string() };
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).expect("chromedriver listens");
        stream.set_read_timeout(Some(SCRIPT_LIMIT + Duration::from_secs(30))).unwrap();
        let request = format!(
            "{method} {path} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nConnection: close\r\n\
             Content-Type: application/json\r\nContent-Length: {}\r\n\r\n{body}",
            self.port,
            body.len()
        );
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = Vec::new();
        let mut reader = BufReader::new(stream);
        let mut length = 0;
        loop {
            let mut line = String::new();
            reader.read_line(&mut line).unwrap();
            if line.trim().is_empty() {
                break;
            }
            if let Some((name, value)) = line.split_once(':')
                && name.eq_ignore_ascii_case("content-length")
            {
                length = value.trim().parse().unwrap();
            }
        }
        reader.take(length).read_to_end(&mut answer).unwrap();
        let answer: Value = serde_json::from_slice(&answer).expect("chromedriver answers in JSON");
        let value = &answer["value"];
        assert!(value.get("error").is_none(), "{method} {path}: {value}");
        value.clone()
    }

    /// One command of the session (WebDriver).
    pub fn post(&self, path: &str, body: Value) -> Value {
        self.call("POST", &format!("/session/{}{path}", self.session), &body)
    }

    /// Opens a file.
    pub fn open(&self, path: &Path) {
        self.post("/url", json!({ "url": format!("file://{}", path.display()) }));
    }

    /// Goes to an address.
    pub fn visit(&self, url: &str) {
        self.post("/url", json!({ "url": url }));
    }

    /// What a promise comes to.
    pub fn awaited(&self, promise: &str) -> Value {
        let script = format!(
            "const done = arguments[0]; (async () => {promise})().then(done, (e) => done({{ rejected: String(e) }}));"
        );
        self.post("/execute/async", json!({ "script": script, "args": [] }))
    }

    /// The value of a JavaScript expression.
    pub fn value(&self, expression: &str) -> Value {
        self.post("/execute/sync", json!({ "script": format!("return {expression};"), "args": [] }))
    }

    /// Waits until a JavaScript expression is true.
    #[track_caller]
    pub fn wait_for(&self, expression: &str) {
        let start = Instant::now();
        while self.value(expression) != Value::Bool(true) {
            assert!(start.elapsed() < Duration::from_secs(20), "never true: {expression}");
            std::thread::sleep(Duration::from_millis(30));
        }
    }

    /// Presses and releases one key; the WebDriver code of special ones, such as `\u{e014}` for the right arrow.
    pub fn key(&self, key: &str) {
        let actions = json!([{ "type": "keyDown", "value": key }, { "type": "keyUp", "value": key }]);
        self.post("/actions", json!({ "actions": [{ "type": "key", "id": "keyboard", "actions": actions }] }));
    }

    /// Clicks the element of a CSS selector.
    pub fn click(&self, selector: &str) {
        let element = self.post("/element", json!({ "using": "css selector", "value": selector }));
        let id = element.as_object().and_then(|o| o.values().next()).and_then(Value::as_str).expect(selector);
        self.post(&format!("/element/{id}/click"), json!({}));
    }

    /// Drags with the mouse, window coordinates.
    pub fn drag(&self, from: (f64, f64), to: (f64, f64)) {
        let at = |(x, y): (f64, f64), ms: u32| json!({ "type": "pointerMove", "duration": ms, "x": x as i64, "y": y as i64 });
        let actions = json!([
            at(from, 0), { "type": "pointerDown", "button": 0 }, at(to, 120), { "type": "pointerUp", "button": 0 },
        ]);
        self.post("/actions", json!({ "actions": [{ "type": "pointer", "id": "mouse", "actions": actions }] }));
    }

    /// Turns the wheel, window coordinates; negative: away from the user.
    pub fn wheel(&self, at: (f64, f64), delta: i64) {
        let actions = json!([{
            "type": "scroll", "x": at.0 as i64, "y": at.1 as i64, "deltaX": 0, "deltaY": delta, "duration": 0,
        }]);
        self.post("/actions", json!({ "actions": [{ "type": "wheel", "id": "wheel", "actions": actions }] }));
    }

    /// Writes a PNG of the window.
    pub fn screenshot(&self, path: &Path) {
        use base64::Engine;
        let value = self.call("GET", &format!("/session/{}/screenshot", self.session), &Value::Null);
        let png = base64::engine::general_purpose::STANDARD.decode(value.as_str().unwrap()).unwrap();
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, png).unwrap();
    }

    /// Errors of the page: exceptions, files that could not be loaded.
    pub fn complaints(&self) -> Vec<String> {
        let log = self.post("/se/log", json!({ "type": "browser" }));
        let errors = log.as_array().unwrap().iter().filter(|entry| entry["level"] == "SEVERE");
        errors.map(|entry| entry["message"].to_string()).collect()
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        if !self.session.is_empty() && !std::thread::panicking() {
            self.call("DELETE", &format!("/session/{}", self.session), &Value::Null);
        }
        // chromedriver ends its browser when it is asked to shut down; then it is waited for.
        if let Ok(mut stream) = TcpStream::connect(("127.0.0.1", self.port)) {
            let _ = stream.write_all(b"GET /shutdown HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n");
            let _ = stream.read_to_end(&mut Vec::new());
        }
        let start = Instant::now();
        while matches!(self.driver.try_wait(), Ok(None)) && start.elapsed() < Duration::from_secs(5) {
            std::thread::sleep(Duration::from_millis(20));
        }
        let _ = self.driver.kill();
        let _ = self.driver.wait();
        let _ = std::fs::remove_dir_all(&self.profile);
    }
}

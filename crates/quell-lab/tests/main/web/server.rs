//! Files over HTTP on this machine: a browser gives WebGPU and modules to no page from a file.

use std::collections::HashMap;
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;

/// Serves until the process ends.
pub struct Server {
    port: u16,
}

impl Server {
    /// Serves files by their paths.
    pub fn start(files: Vec<(String, Vec<u8>)>) -> Self {
        let listener = TcpListener::bind(("127.0.0.1", 0)).expect("a port");
        let port = listener.local_addr().expect("an address").port();
        let files: Arc<HashMap<String, Vec<u8>>> = Arc::new(files.into_iter().collect());
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let files = Arc::clone(&files);
                // A browser opens connections beforehand: one that says nothing must not hold up the others.
                std::thread::spawn(move || answer(stream, &files));
            }
        });
        Self { port }
    }

    pub fn address(&self, path: &str) -> String {
        format!("http://localhost:{}/{path}", self.port)
    }
}

fn answer(mut stream: TcpStream, files: &HashMap<String, Vec<u8>>) -> Option<()> {
    let mut lines = BufReader::new(stream.try_clone().ok()?).lines();
    let request = lines.next()?.ok()?;
    lines.map_while(Result::ok).find(String::is_empty)?;
    let path = request.split(' ').nth(1)?.trim_start_matches('/');
    let path = path.split('?').next()?;
    let kind = match path.rsplit_once('.')?.1 {
        "html" => "text/html",
        "js" => "text/javascript",
        "json" => "application/json",
        "wasm" => "application/wasm",
        _ => "application/octet-stream",
    };
    let (status, body): (_, &[u8]) = match files.get(path) {
        Some(body) => ("200 OK", body),
        // Asked for by every browser.
        None if path == "favicon.ico" => ("204 No Content", &[]),
        None => ("404 Not Found", &[]),
    };
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nCache-Control: no-store\r\n\
         Connection: close\r\n\r\n",
        body.len()
    );
    stream.write_all(head.as_bytes()).and_then(|()| stream.write_all(body)).ok()
}

//! Standard output, folders that can be written, and the address of a page.

use crate::failure::Failure;
use std::io::Write;
use std::path::Path;

/// Prints a result and a line break on standard output.
pub fn print(text: &str) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{}", text.trim_end_matches('\n')).and_then(|()| out.flush()).map_err(|e| match e.kind() {
        std::io::ErrorKind::BrokenPipe => Failure::NobodyListens,
        _ => Failure::Failed(format!("cannot write to standard output: {e}")),
    })
}

/// Makes the folder where it is missing and tries that a file can be written there, before hours of work.
pub fn check_folder(folder: &Path) -> Result<(), Failure> {
    if folder.as_os_str().is_empty() {
        return Err(Failure::Usage("the output folder has no name".to_owned()));
    }
    let trial = folder.join(format!(".quell-trial-{}", std::process::id()));
    quell_frames::files::write_bytes(&trial, b"quell")?;
    std::fs::remove_file(&trial).map_err(|e| Failure::Failed(format!("cannot remove {}: {e}", trial.display())))
}

/// The same for the folder of a file that will be written.
pub fn check_file(file: &Path) -> Result<(), Failure> {
    if file.is_dir() {
        return Err(Failure::Failed(format!("{} is a folder; name a file", file.display())));
    }
    match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => check_folder(folder),
        _ => check_folder(Path::new(".")),
    }
}

/// A page that quell did not write is not replaced.
pub fn check_page(page: &Path) -> Result<(), Failure> {
    match std::fs::read(page) {
        Ok(bytes) if !bytes.windows(5).any(|w| w == b"quell") => Err(Failure::Failed(format!(
            "{} exists and was not written by quell; choose another folder with -o",
            page.display()
        ))),
        // What cannot be read will be reported when it is written.
        _ => Ok(()),
    }
}

/// `file://` address of a file that exists.
pub fn file_url(path: &Path) -> String {
    let absolute = path.canonicalize().or_else(|_| std::path::absolute(path)).unwrap_or_else(|_| path.to_owned());
    url_of(&absolute.to_string_lossy())
}

/// Every byte that an address may not hold is written as `%XX`. Windows: `\\?\C:\a b` becomes `file:///C:/a%20b`,
/// `\\?\UNC\server\share` becomes `file://server/share`.
fn url_of(absolute: &str) -> String {
    let (host_follows, plain) = match absolute.strip_prefix(r"\\?\") {
        Some(rest) => match rest.strip_prefix(r"UNC\") {
            Some(share) => (true, share.replace('\\', "/")),
            None => (false, rest.replace('\\', "/")),
        },
        None if cfg!(windows) => (false, absolute.replace('\\', "/")),
        None => (false, absolute.to_owned()),
    };
    let mut url = String::from("file://");
    if !host_follows && !plain.starts_with('/') {
        url.push('/');
    }
    for byte in plain.bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'/' | b'-' | b'.' | b'_' | b'~' | b':' => url.push(byte as char),
            _ => url.push_str(&format!("%{byte:02X}")),
        }
    }
    url
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_escaped() {
        assert_eq!(url_of("/home/a b/ä#1/index.html"), "file:///home/a%20b/%C3%A4%231/index.html");
        assert_eq!(url_of(r"\\?\C:\quell demo\index.html"), "file:///C:/quell%20demo/index.html");
        assert_eq!(url_of(r"\\?\UNC\server\out\index.html"), "file://server/out/index.html");
    }

    #[test]
    fn a_file_in_the_way_of_a_folder_is_named() {
        let file = std::env::temp_dir().join(format!("quell-in-the-way-{}", std::process::id()));
        std::fs::write(&file, "x").unwrap();
        let Err(Failure::Failed(message)) = check_folder(&file.join("below")) else { panic!("it was accepted") };
        assert!(message.contains(&*file.to_string_lossy()), "{message}");
        assert!(matches!(check_page(&file), Err(Failure::Failed(_))));
        std::fs::remove_file(&file).unwrap();
    }
}

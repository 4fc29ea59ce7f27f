//! Header attributes in one order, so that the same frame written twice is the same file.
//!
//! The crate `exr` keeps attributes in a hash map and writes them in its order, which changes from run to run. Their length
//! does not depend on their order, so they are sorted where they lie.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};

/// The flag of files with several parts, in the second byte of the version.
const MULTI_PART: u8 = 0x10;

/// Sorts the attributes of every header of an EXR file by name.
pub fn sort_attributes(file: &mut File) -> io::Result<()> {
    file.seek(SeekFrom::Start(0))?;
    let sorted = sorted_headers(&mut BufReader::new(&*file))?;
    file.seek(SeekFrom::Start(0))?;
    file.write_all(&sorted)?;
    file.seek(SeekFrom::End(0))?;
    Ok(())
}

fn sorted_headers(reader: &mut impl BufRead) -> io::Result<Vec<u8>> {
    let mut start = [0; 8];
    reader.read_exact(&mut start)?;
    let mut sorted = start.to_vec();
    let several = start[5] & MULTI_PART != 0;
    loop {
        let mut attributes = Vec::new();
        while let Some(attribute) = attribute(reader)? {
            attributes.push(attribute);
        }
        attributes.sort();
        sorted.extend(attributes.iter().flat_map(|(_, bytes)| bytes));
        sorted.push(0);
        // Several headers end with one that is empty.
        if !several || attributes.is_empty() {
            return Ok(sorted);
        }
    }
}

/// Name, and all bytes of the attribute; `None` at the end of a header.
fn attribute(reader: &mut impl BufRead) -> io::Result<Option<(Vec<u8>, Vec<u8>)>> {
    let mut name = Vec::new();
    reader.read_until(0, &mut name)?;
    if name.len() <= 1 {
        return Ok(None);
    }
    let mut bytes = name.clone();
    reader.read_until(0, &mut bytes)?;
    let mut length = [0; 4];
    reader.read_exact(&mut length)?;
    bytes.extend(length);
    let length = u64::from(u32::from_le_bytes(length));
    let read = reader.take(length).read_to_end(&mut bytes)?;
    if read as u64 != length {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    Ok(Some((name, bytes)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(names: &[&str]) -> Vec<u8> {
        let mut bytes = Vec::new();
        for name in names {
            bytes.extend(name.as_bytes());
            bytes.extend(b"\0string\0");
            bytes.extend((name.len() as u32).to_le_bytes());
            bytes.extend(name.bytes().rev());
        }
        bytes.push(0);
        bytes
    }

    fn file(flags: u8, headers: &[&[&str]]) -> Vec<u8> {
        let mut bytes = vec![0x76, 0x2f, 0x31, 0x01, 2, flags, 0, 0];
        bytes.extend(headers.iter().flat_map(|names| header(names)));
        bytes
    }

    #[test]
    fn attributes_are_sorted_header_by_header() {
        let mut mixed = file(0, &[&["b", "channels", "a"]]);
        mixed.extend(b"pixels");
        assert_eq!(sorted_headers(&mut &mixed[..]).unwrap(), file(0, &[&["a", "b", "channels"]]));
        let mut mixed = file(MULTI_PART, &[&["b", "a"], &["z", "y", "x"], &[]]);
        mixed.extend(b"pixels");
        assert_eq!(sorted_headers(&mut &mixed[..]).unwrap(), file(MULTI_PART, &[&["a", "b"], &["x", "y", "z"], &[]]));
        assert!(sorted_headers(&mut &mixed[..12]).is_err());
    }
}

//! Lines of numbers as exporters write them: any line end, byte order mark, trailing blanks, decimal commas.

use std::io::{BufRead, Read};

use super::error::{ReadError, Result};

/// Longest line that is read; scan files stay below 300 bytes.
const MAX_LINE: u64 = 4096;

/// Byte order mark of UTF-8, as written by editors on Windows.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Largest number of fields kept of a line.
pub(crate) const MAX_FIELDS: usize = 12;

/// Reader of lines into one buffer of bounded size.
pub(crate) struct Lines<R> {
    reader: R,
    line: Vec<u8>,
    /// Number of the line last read, from 1.
    pub(crate) number: u64,
    /// Number of bytes read.
    pub(crate) offset: u64,
    /// False when the line last read ended with the file and not with a line end.
    pub(crate) ended: bool,
}

impl<R: BufRead> Lines<R> {
    /// Starts at the beginning of a file, or of a line.
    pub(crate) fn new(reader: R) -> Self {
        Self { reader, line: Vec::new(), number: 0, offset: 0, ended: true }
    }

    /// Reads the next line without its end, `None` after the last.
    pub(crate) fn next(&mut self) -> Result<Option<&[u8]>> {
        self.line.clear();
        let mut bounded = self.reader.by_ref().take(MAX_LINE);
        let n = bounded.read_until(b'\n', &mut self.line).map_err(ReadError::io("reading a line"))?;
        if n == 0 {
            return Ok(None);
        }
        self.number += 1;
        self.offset += n as u64;
        self.ended = self.line.last() == Some(&b'\n');
        if !self.ended && n as u64 == MAX_LINE {
            let what = format!("line {} is longer than {MAX_LINE} bytes", self.number);
            return Err(ReadError::Unsound("text", what));
        }
        let behind_mark = (self.number == 1).then(|| self.line.strip_prefix(BYTE_ORDER_MARK)).flatten();
        Ok(Some(behind_mark.unwrap_or(&self.line)))
    }
}

/// Splits a line at blanks; returns the first [`MAX_FIELDS`] fields and the number of all.
pub(crate) fn fields(line: &[u8]) -> ([&[u8]; MAX_FIELDS], usize) {
    let mut fields: [&[u8]; MAX_FIELDS] = [&[]; MAX_FIELDS];
    let mut n = 0;
    for field in line.split(u8::is_ascii_whitespace).filter(|field| !field.is_empty()) {
        if let Some(slot) = fields.get_mut(n) {
            *slot = field;
        }
        n += 1;
    }
    (fields, n)
}

/// Parses a number with a decimal point or comma.
pub(crate) fn number(field: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(field).ok()?;
    if text.contains(',') { text.replacen(',', ".", 1).parse().ok() } else { text.parse().ok() }
}

/// Parses a line of exactly `N` numbers.
pub(crate) fn numbers<const N: usize>(line: &[u8]) -> Option<[f64; N]> {
    let (fields, n) = fields(line);
    if n != N {
        return None;
    }
    let mut out = [0.0; N];
    for (slot, field) in out.iter_mut().zip(fields) {
        *slot = number(field)?;
    }
    Some(out)
}

/// Parses a whole number without sign.
pub(crate) fn whole(field: &[u8]) -> Option<u32> {
    if field.iter().all(u8::is_ascii_digit) { std::str::from_utf8(field).ok()?.parse().ok() } else { None }
}

/// Parses a line of one whole number.
pub(crate) fn only_whole(line: &[u8]) -> Option<u32> {
    let (fields, n) = fields(line);
    if n == 1 { whole(fields[0]) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_end_mark_and_decimal_is_read() {
        let mut lines = Lines::new(&b"\xef\xbb\xbf12 \r\n1,5\t-2.25 \n3e-1"[..]);
        assert_eq!(only_whole(lines.next().unwrap().unwrap()), Some(12));
        assert_eq!(numbers(lines.next().unwrap().unwrap()), Some([1.5, -2.25]));
        assert!(lines.ended);
        assert_eq!(numbers(lines.next().unwrap().unwrap()), Some([0.3]));
        assert!(!lines.ended && lines.next().unwrap().is_none());
    }

    #[test]
    fn a_file_without_line_ends_takes_no_memory() {
        let mut lines = Lines::new(std::io::BufReader::new(std::io::repeat(b'1').take(1 << 20)));
        assert!(matches!(lines.next(), Err(ReadError::Unsound(..))));
        assert!(lines.line.capacity() <= 2 * MAX_LINE as usize);
    }
}

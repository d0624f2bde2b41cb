//! Frames on the wire and in recordings: section 1 of the protocol document, written from that document alone.

use std::io::{ErrorKind, Read};

/// Bytes before the payload.
pub(super) const HEADER: usize = 32;

/// Largest payload, bytes.
pub(super) const MAX_PAYLOAD: usize = 1 << 20;

/// Supported version.
pub(super) const VERSION: [u8; 2] = [1, 0];

pub(super) const HELLO: u16 = 0x8001;
pub(super) const CAPABILITIES: u16 = 0x8002;
pub(super) const CONFIGURE: u16 = 0x8003;
pub(super) const CONFIGURED: u16 = 0x8004;
pub(super) const START: u16 = 0x8005;
pub(super) const ABORT: u16 = 0x8006;
pub(super) const RESUME: u16 = 0x8007;
pub(super) const HEARTBEAT: u16 = 0x0008;
pub(super) const STATUS: u16 = 0x0009;
pub(super) const ERROR: u16 = 0x800A;
pub(super) const SCAN_BEGIN: u16 = 0x8010;
pub(super) const COLUMN: u16 = 0x8011;
pub(super) const SCAN_END: u16 = 0x8012;
/// Critical bit: a receiver that does not support the type must reject the frame.
pub(super) const CRITICAL: u16 = 0x8000;

/// Frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Frame {
    pub(super) kind: u16,
    pub(super) scan: u32,
    pub(super) payload: Vec<u8>,
}

/// Error after which no further frame can be read.
#[derive(Debug, thiserror::Error)]
pub(super) enum FrameError {
    /// End of the stream.
    #[error("the connection was closed")]
    Closed,
    /// Invalid frame; the rest of the stream cannot be trusted.
    #[error("{0}")]
    Invalid(&'static str),
    /// Error of the operating system.
    #[error("{0}")]
    Io(#[from] std::io::Error),
}

/// Encodes the 32 bytes before a payload, with their checksum.
pub(super) fn header(kind: u16, scan: u32, sequence: u64, length: u32, major: u8) -> [u8; HEADER] {
    let mut bytes = [0; HEADER];
    bytes[..4].copy_from_slice(b"PSB1");
    bytes[4..6].copy_from_slice(&[major, VERSION[1]]);
    bytes[6..8].copy_from_slice(&kind.to_le_bytes());
    bytes[8..12].copy_from_slice(&length.to_le_bytes());
    bytes[16..24].copy_from_slice(&sequence.to_le_bytes());
    bytes[24..28].copy_from_slice(&scan.to_le_bytes());
    let header_crc = header_crc(&bytes);
    bytes[12..16].copy_from_slice(&header_crc.to_le_bytes());
    bytes
}

fn header_crc(header: &[u8; HEADER]) -> u32 {
    crc32c::crc32c_append(crc32c::crc32c(&header[..12]), &header[16..])
}

/// Encodes a frame.
pub(super) fn bytes(frame: &Frame, sequence: u64) -> Vec<u8> {
    let head = header(frame.kind, frame.scan, sequence, frame.payload.len() as u32, VERSION[0]);
    [&head[..], &frame.payload, &crc32c::crc32c(&frame.payload).to_le_bytes()].concat()
}

/// Reads the frame with the expected sequence number; blocks until it is complete.
pub(super) fn read(from: &mut impl Read, due: u64) -> Result<Frame, FrameError> {
    let mut head = [0; HEADER];
    fill(from, &mut head)?;
    let word = |at: usize| u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
    let invalid = |what| Err(FrameError::Invalid(what));
    if head[..4] != *b"PSB1" {
        return invalid("wrong magic");
    }
    if word(12) != header_crc(&head) {
        return invalid("wrong checksum of a header");
    }
    if head[4] != VERSION[0] {
        return invalid("another major version");
    }
    let length = word(8) as usize;
    if length > MAX_PAYLOAD {
        return invalid("a payload beyond 1 MiB");
    }
    if u64::from(word(16)) | u64::from(word(20)) << 32 != due {
        return invalid("a frame out of sequence");
    }
    let mut payload = vec![0; length];
    fill(from, &mut payload)?;
    let mut sum = [0; 4];
    fill(from, &mut sum)?;
    if u32::from_le_bytes(sum) != crc32c::crc32c(&payload) {
        return invalid("wrong checksum of a payload");
    }
    Ok(Frame { kind: u16::from_le_bytes([head[6], head[7]]), scan: word(24), payload })
}

fn fill(from: &mut impl Read, bytes: &mut [u8]) -> Result<(), FrameError> {
    from.read_exact(bytes).map_err(|error| match error.kind() {
        ErrorKind::UnexpectedEof | ErrorKind::ConnectionReset | ErrorKind::BrokenPipe => FrameError::Closed,
        _ => error.into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_those_of_the_page() {
        assert_eq!(crc32c::crc32c(b"123456789"), 0xE306_9283);
        let frame = Frame { kind: STATUS, scan: 7, payload: b"{}".to_vec() };
        let written = bytes(&frame, 258);
        assert_eq!(written[..12], *b"PSB1\x01\x00\x09\x00\x02\x00\x00\x00");
        assert_eq!(written[16..34], *b"\x02\x01\0\0\0\0\0\0\x07\0\0\0\0\0\0\0{}");
        assert!(matches!(read(&mut &written[..], 258), Ok(again) if again == frame));
        assert!(matches!(read(&mut &written[..], 259), Err(FrameError::Invalid("a frame out of sequence"))));
        for bit in 0..8 * written.len() {
            let mut spoiled = written.clone();
            spoiled[bit / 8] ^= 1 << (bit % 8);
            assert!(read(&mut &spoiled[..], 258).is_err(), "bit {bit}");
        }
    }
}

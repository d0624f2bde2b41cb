//! Frame codec, sections 1 and 5 of `PROTOCOL.md`; pure functions.

use crate::error::{Error, Result};

const MAGIC: u32 = u32::from_le_bytes(*b"PSB1");
/// Supported version.
pub(crate) const VERSION: (u8, u8) = (1, 0);
const HEADER: usize = 32;
/// Largest payload, bytes.
pub(crate) const MAX_PAYLOAD: usize = 1 << 20;

/// Frame types.
pub(crate) mod kind {
    pub(crate) const HELLO: u16 = 0x8001;
    pub(crate) const CAPABILITIES: u16 = 0x8002;
    pub(crate) const CONFIGURE: u16 = 0x8003;
    pub(crate) const CONFIGURED: u16 = 0x8004;
    pub(crate) const START: u16 = 0x8005;
    pub(crate) const ABORT: u16 = 0x8006;
    pub(crate) const RESUME: u16 = 0x8007;
    pub(crate) const HEARTBEAT: u16 = 0x0008;
    pub(crate) const STATUS: u16 = 0x0009;
    pub(crate) const ERROR: u16 = 0x800A;
    pub(crate) const SCAN_BEGIN: u16 = 0x8010;
    pub(crate) const COLUMN: u16 = 0x8011;
    pub(crate) const SCAN_END: u16 = 0x8012;
    /// Critical bit: a receiver that does not support the type must reject the frame.
    pub(crate) const CRITICAL: u16 = 0x8000;
}

/// Received frame.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Frame {
    pub(crate) kind: u16,
    /// Number of its scan, 0 for none.
    pub(crate) scan: u32,
    pub(crate) payload: Vec<u8>,
    /// Checksum of the payload as sent.
    pub(crate) crc: u32,
}

impl Frame {
    /// Returns whether the payload agrees with its checksum.
    pub(crate) fn sound(&self) -> bool {
        crc32c::crc32c(&self.payload) == self.crc
    }
}

/// Encodes a frame.
pub(crate) fn encode(kind: u16, scan: u32, sequence: u64, payload: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEADER + payload.len() + 4);
    bytes.extend(MAGIC.to_le_bytes());
    bytes.extend([VERSION.0, VERSION.1]);
    bytes.extend(kind.to_le_bytes());
    bytes.extend((payload.len() as u32).to_le_bytes());
    bytes.extend([0; 4]);
    bytes.extend(sequence.to_le_bytes());
    bytes.extend(scan.to_le_bytes());
    bytes.extend(0_u32.to_le_bytes());
    let crc = header_crc(&bytes);
    bytes[12..16].copy_from_slice(&crc.to_le_bytes());
    bytes.extend(payload);
    bytes.extend(crc32c::crc32c(payload).to_le_bytes());
    bytes
}

fn header_crc(header: &[u8]) -> u32 {
    crc32c::crc32c_append(crc32c::crc32c(&header[..12]), &header[16..HEADER])
}

/// Decoder of the byte stream of a connection.
#[derive(Debug, Default)]
pub(crate) struct Decoder {
    held: Vec<u8>,
    given: usize,
    sequence: u64,
}

impl Decoder {
    /// Appends received bytes.
    pub(crate) fn push(&mut self, bytes: &[u8]) {
        if self.given > MAX_PAYLOAD {
            self.held.drain(..self.given);
            self.given = 0;
        }
        self.held.extend_from_slice(bytes);
    }

    /// Returns the next complete frame.
    ///
    /// # Errors
    /// [`Error::Broken`] when the rest of the stream cannot be trusted.
    pub(crate) fn next(&mut self) -> Result<Option<Frame>> {
        let rest = &self.held[self.given..];
        let Some(header) = rest.get(..HEADER) else { return Ok(None) };
        let length = self.check_header(header)?;
        let Some(frame) = rest.get(..HEADER + length + 4) else { return Ok(None) };
        let (payload, crc) = frame[HEADER..].split_at(length);
        let frame = Frame {
            kind: u16_at(header, 6),
            scan: u32_at(header, 24),
            payload: payload.to_vec(),
            crc: u32_at(crc, 0),
        };
        self.given += HEADER + length + 4;
        self.sequence += 1;
        Ok(Some(frame))
    }

    /// Checks a header; returns the length of the payload.
    fn check_header(&self, header: &[u8]) -> Result<usize> {
        let broken = |what: String| Err(Error::Broken(what));
        if u32_at(header, 0) != MAGIC {
            return broken("invalid frame (wrong magic)".to_owned());
        }
        if u32_at(header, 12) != header_crc(header) {
            return broken("wrong checksum of a frame header".to_owned());
        }
        if header[4] != VERSION.0 {
            return Err(Error::Version { bridge: (header[4], header[5]) });
        }
        let length = u32_at(header, 8) as usize;
        if length > MAX_PAYLOAD {
            return broken(format!("payload of {length} bytes, at most {MAX_PAYLOAD} are permitted"));
        }
        let sequence = u64::from(u32_at(header, 16)) | u64::from(u32_at(header, 20)) << 32;
        if sequence != self.sequence {
            return broken(format!("frame {sequence} received, frame {} expected", self.sequence));
        }
        Ok(length)
    }
}

pub(crate) fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

pub(crate) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from(u16_at(bytes, at)) | u32::from(u16_at(bytes, at + 2)) << 16
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn decode(bytes: &[u8], piece: usize) -> Result<Vec<Frame>> {
        let mut decoder = Decoder::default();
        let mut frames = Vec::new();
        for piece in bytes.chunks(piece.max(1)) {
            decoder.push(piece);
            while let Some(frame) = decoder.next()? {
                frames.push(frame);
            }
        }
        Ok(frames)
    }

    #[test]
    fn the_page_is_kept_to_the_byte() {
        assert_eq!(crc32c::crc32c(b"123456789"), 0xE306_9283);
        let bytes = encode(kind::STATUS, 7, 258, b"{}");
        assert_eq!(bytes[..12], *b"PSB1\x01\x00\x09\x00\x02\x00\x00\x00");
        assert_eq!(bytes[16..34], *b"\x02\x01\0\0\0\0\0\0\x07\0\0\0\0\0\0\0{}");
        assert_eq!(bytes.len(), 38);
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn frames_come_back_in_any_pieces(
            payloads in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..300), 0..6),
            piece in 1_usize..400,
        ) {
            let bytes: Vec<u8> = payloads.iter().enumerate()
                .flat_map(|(i, payload)| encode(kind::COLUMN, 3, i as u64, payload)).collect();
            let frames = decode(&bytes, piece).unwrap();
            prop_assert!(frames.iter().all(Frame::sound));
            prop_assert_eq!(frames.into_iter().map(|f| f.payload).collect::<Vec<_>>(), payloads);
        }

        #[test]
        fn no_flipped_bit_passes(payload in prop::collection::vec(any::<u8>(), 0..40), bit in any::<prop::sample::Index>()) {
            let whole = encode(kind::COLUMN, 3, 0, &payload);
            let mut bytes = whole.clone();
            let bit = bit.index(bytes.len() * 8);
            bytes[bit / 8] ^= 1 << (bit % 8);
            // The longer length would require bytes that never arrive; the checksum of the header is checked first.
            match decode(&bytes, 1000) {
                Ok(frames) => prop_assert!(bit / 8 >= HEADER && frames.iter().all(|frame| !frame.sound())),
                Err(_) => prop_assert!(bit / 8 < HEADER),
            }
        }

        #[test]
        fn any_bytes_are_borne(bytes in prop::collection::vec(any::<u8>(), 0..200), piece in 1_usize..50) {
            let _ = decode(&bytes, piece);
            let mut framed = encode(kind::STATUS, 0, 0, &bytes);
            framed.extend(&bytes);
            let _ = decode(&framed, piece);
        }
    }
}

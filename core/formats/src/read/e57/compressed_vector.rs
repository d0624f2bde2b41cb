//! Binary section of a point cloud (ASTM E2807, CompressedVector): packets of bytestreams, one per field of the
//! prototype.
//!
//! Whole packets are unpacked and converted field by field, array by array. The `e57` crate, which reads the rest of
//! the file, builds an enum for every value and a vector for every point, at five times the processor time
//! (`core/formats/src/tests/speed.rs`). The checksums of the pages are not checked here; they were checked when the
//! file was opened.

use std::io::{Read, Seek, SeekFrom};

use e57::{Record, RecordDataType};

use super::PAGE;

/// Number of content bytes of a page; the rest is its checksum.
const CONTENT: usize = PAGE as usize - 4;

/// Number of pages read at once.
const PAGES: usize = 64;

/// Number of bytes of the section's header.
const HEADER: usize = 32;

/// Kinds of packets.
const INDEX: u8 = 0;
const DATA: u8 = 1;
const IGNORED: u8 = 2;

/// Points of one section, packet by packet.
#[derive(Debug)]
pub(super) struct CompressedVector<R> {
    pages: Pages<R>,
    points: Points,
    /// Number of points that have not been read yet.
    left: u64,
    packet: Vec<u8>,
}

impl<R: Read + Seek> CompressedVector<R> {
    /// Opens the section at a physical offset of the file.
    ///
    /// # Errors
    /// The message for bytes that cannot be read or are not such a section.
    pub(super) fn open(file: R, offset: u64, prototype: &[Record], records: u64) -> Result<Self, String> {
        let mut pages = Pages { file, content: Vec::new(), at: 0 };
        pages.seek(offset)?;
        let mut header = [0; HEADER];
        pages.read(&mut header)?;
        if header[0] != 1 {
            return Err("its points do not begin with a header".to_owned());
        }
        pages.seek(header[16..24].iter().rev().fold(0, |offset, byte| offset << 8 | u64::from(*byte)))?;
        let stream = |record: &Record| Stream::new(&record.data_type);
        let points = Points { streams: prototype.iter().map(stream).collect(), n: 0 };
        Ok(Self { pages, points, left: records, packet: Vec::new() })
    }

    /// Returns the points of the next packet that completes any; `None` after the last.
    ///
    /// # Errors
    /// The message for a packet that cannot be read.
    pub(super) fn next(&mut self) -> Result<Option<&Points>, String> {
        if self.left == 0 {
            return Ok(None);
        }
        self.points.skip();
        while self.points.n == 0 {
            self.next_packet()?;
        }
        self.points.n = self.points.n.min(usize::try_from(self.left).unwrap_or(usize::MAX));
        self.left -= self.points.n as u64;
        Ok(Some(&self.points))
    }

    fn next_packet(&mut self) -> Result<(), String> {
        let mut head = [0; 4];
        self.pages.read(&mut head)?;
        let [kind, _, low, high] = head;
        let length = usize::from(u16::from_le_bytes([low, high])) + 1;
        if !matches!(kind, INDEX | DATA | IGNORED) || !length.is_multiple_of(4) {
            return Err(format!("a packet of kind {kind} and {length} bytes"));
        }
        self.packet.resize(length - head.len(), 0);
        self.pages.read(&mut self.packet)?;
        if kind == DATA { self.points.append(&self.packet) } else { Ok(()) }
    }
}

/// Points of one packet; a field is unpacked when it is read.
#[derive(Debug)]
pub(super) struct Points {
    streams: Vec<Stream>,
    n: usize,
}

impl Points {
    /// Returns the number of points.
    pub(super) fn len(&self) -> usize {
        self.n
    }

    /// Reads a field of all points as numbers.
    pub(super) fn numbers(&self, field: usize, into: &mut Vec<f64>) {
        let stream = &self.streams[field];
        stream.encoding.numbers(stream.values(self.n), into);
    }

    /// Reads a field of all points as whole numbers; PDAL writes states as floats.
    pub(super) fn wholes(&self, field: usize, into: &mut Vec<i64>) {
        let stream = &self.streams[field];
        stream.encoding.wholes(stream.values(self.n), into);
    }

    /// Builds one packet of bytestreams of these types.
    #[cfg(test)]
    pub(super) fn of(types: &[&RecordDataType], bytestreams: &[Vec<u8>]) -> Self {
        let streams = types.iter().map(|data_type| Stream::new(data_type)).collect();
        let mut points = Self { streams, n: 0 };
        let mut packet = (types.len() as u16).to_le_bytes().to_vec();
        packet.extend(bytestreams.iter().flat_map(|bytes| (bytes.len() as u16).to_le_bytes()));
        packet.extend(bytestreams.iter().flatten());
        points.append(&packet).unwrap();
        points
    }

    /// Advances past the points.
    fn skip(&mut self) {
        for stream in &mut self.streams {
            stream.bit += self.n * stream.width;
        }
        self.n = 0;
    }

    /// Appends the points that a data packet completes; `packet` begins after its first four bytes.
    fn append(&mut self, packet: &[u8]) -> Result<(), String> {
        let n = self.streams.len();
        let broken = || "a packet is shorter than its bytestreams".to_owned();
        let u16_at = |k: usize| Some(usize::from(u16::from_le_bytes([*packet.get(k)?, *packet.get(k + 1)?])));
        let count = u16_at(0).ok_or_else(broken)?;
        if count != n {
            return Err(format!("a packet of {count} bytestreams, {n} fields are declared"));
        }
        let mut from = 2 + 2 * n;
        for (k, stream) in self.streams.iter_mut().enumerate() {
            let to = from + u16_at(2 + 2 * k).ok_or_else(broken)?;
            stream.append(packet.get(from..to).ok_or_else(broken)?);
            from = to;
        }
        self.n = self.streams.iter().filter_map(Stream::complete).min().unwrap_or(0);
        Ok(())
    }
}

/// Values of one field: those of one packet, with the bits of an incomplete value left by the previous packet.
#[derive(Debug)]
struct Stream {
    encoding: Encoding,
    /// Number of bits of a value, up to 64; 0 where all values are equal.
    width: usize,
    bytes: Vec<u8>,
    /// First bit of the first value.
    bit: usize,
}

impl Stream {
    fn new(data_type: &RecordDataType) -> Self {
        let (encoding, width) = Encoding::new(data_type);
        Self { encoding, width, bytes: Vec::new(), bit: 0 }
    }

    fn append(&mut self, more: &[u8]) {
        self.bytes.drain(..self.bit / 8);
        self.bit %= 8;
        self.bytes.extend_from_slice(more);
    }

    /// Returns the number of complete values; `None` where values occupy no bits.
    fn complete(&self) -> Option<usize> {
        (8 * self.bytes.len() - self.bit).checked_div(self.width)
    }

    /// Returns the first `n` values, which must be complete.
    fn values(&self, n: usize) -> impl Iterator<Item = u64> {
        let Self { width, bit: start, ref bytes, .. } = *self;
        let mask = u64::MAX.checked_shr(64 - width as u32).unwrap_or(0);
        // Where eight bytes suffice, all but the last few values are read eight bytes at a time.
        let in_eight = width <= 57 || width.is_multiple_of(8) && start.is_multiple_of(8);
        let last = (8 * bytes.len()).saturating_sub(start + 64);
        let fast = if in_eight { n.min(last.checked_div(width).unwrap_or(0)) } else { 0 };
        let fast_values = (0..fast).map(move |k| {
            let bit = start + k * width;
            let eight = bytes[bit / 8..].first_chunk().map_or(0, |eight| u64::from_le_bytes(*eight));
            eight >> (bit % 8) & mask
        });
        let rest = (fast..n).map(move |k| {
            let bit = start + k * width;
            // A value of up to 64 bits lies in nine bytes.
            let mut nine = [0; 16];
            let from = &bytes[bit / 8..];
            let held = from.len().min(9);
            nine[..held].copy_from_slice(&from[..held]);
            (u128::from_le_bytes(nine) >> (bit % 8)) as u64 & mask
        });
        fast_values.chain(rest)
    }
}

/// Encoding of a field.
#[derive(Debug, Clone, Copy)]
enum Encoding {
    Single,
    Double,
    /// Whole numbers from `min` on.
    Integer {
        min: i64,
    },
    /// The same times `scale`, from `offset` on.
    Scaled {
        min: i64,
        scale: f64,
        offset: f64,
    },
}

impl Encoding {
    /// Returns the encoding and the bits of a value.
    fn new(data_type: &RecordDataType) -> (Self, usize) {
        let bits = |min: i64, max: i64| {
            let range = i128::from(max) - i128::from(min);
            if range > 0 { range.ilog2() as usize + 1 } else { 0 }
        };
        match *data_type {
            RecordDataType::Single { .. } => (Self::Single, 32),
            RecordDataType::Double { .. } => (Self::Double, 64),
            RecordDataType::Integer { min, max } => (Self::Integer { min }, bits(min, max)),
            RecordDataType::ScaledInteger { min, max, scale, offset } => {
                (Self::Scaled { min, scale, offset }, bits(min, max))
            }
        }
    }

    /// Replaces `numbers` by the decoded values.
    fn numbers(self, values: impl Iterator<Item = u64>, numbers: &mut Vec<f64>) {
        numbers.clear();
        // The encoding is distinguished once, not for every value; for speed only: `tests::speed`.
        match self {
            Self::Single => numbers.extend(values.map(|value| f64::from(f32::from_bits(value as u32)))),
            Self::Double => numbers.extend(values.map(f64::from_bits)),
            Self::Integer { min } => {
                numbers.extend(values.map(|value| min.wrapping_add_unsigned(value) as f64));
            }
            Self::Scaled { min, scale, offset } => {
                let whole = values.map(|value| min.wrapping_add_unsigned(value) as f64);
                numbers.extend(whole.map(|whole| whole * scale + offset));
            }
        }
    }

    /// Replaces `wholes` by the decoded values, with the fraction cut off.
    fn wholes(self, values: impl Iterator<Item = u64>, wholes: &mut Vec<i64>) {
        wholes.clear();
        if let Self::Integer { min } = self {
            wholes.extend(values.map(|value| min.wrapping_add_unsigned(value)));
        } else {
            let mut numbers = Vec::new();
            self.numbers(values, &mut numbers);
            wholes.extend(numbers.iter().map(|number| *number as i64));
        }
    }
}

/// Content of the file's pages.
#[derive(Debug)]
struct Pages<R> {
    file: R,
    content: Vec<u8>,
    at: usize,
}

impl<R: Read + Seek> Pages<R> {
    /// Goes to a physical offset.
    fn seek(&mut self, offset: u64) -> Result<(), String> {
        self.file.seek(SeekFrom::Start(offset / PAGE * PAGE)).map_err(|e| e.to_string())?;
        self.content.clear();
        self.at = (offset % PAGE) as usize;
        if self.at >= CONTENT { Err(format!("offset {offset} is that of a checksum")) } else { Ok(()) }
    }

    fn read(&mut self, out: &mut [u8]) -> Result<(), String> {
        let mut filled = 0;
        while filled < out.len() {
            if self.at >= self.content.len() {
                self.refill()?;
            }
            let from = &self.content[self.at..];
            let n = from.len().min(out.len() - filled);
            out[filled..filled + n].copy_from_slice(&from[..n]);
            (filled, self.at) = (filled + n, self.at + n);
        }
        Ok(())
    }

    /// Reads more pages; the offset within a page is kept.
    fn refill(&mut self) -> Result<(), String> {
        self.at -= self.content.len();
        let mut pages = Vec::with_capacity(PAGES * PAGE as usize);
        let read = self.file.by_ref().take(PAGES as u64 * PAGE).read_to_end(&mut pages);
        read.map_err(|e| e.to_string())?;
        self.content.clear();
        for page in pages.chunks_exact(PAGE as usize) {
            self.content.extend_from_slice(&page[..CONTENT]);
        }
        if self.content.is_empty() { Err("the file ends before its points".to_owned()) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use e57::RecordDataType as Type;

    /// Packs one value after the other, bit by bit.
    fn packed(values: &[u64], width: usize) -> Vec<u8> {
        let mut bytes = vec![0; (values.len() * width).div_ceil(8)];
        for (k, value) in values.iter().enumerate() {
            for bit in (0..width).filter(|bit| value >> bit & 1 == 1) {
                let at = k * width + bit;
                bytes[at / 8] |= 1 << (at % 8);
            }
        }
        bytes
    }

    #[test]
    fn values_of_every_width_are_unpacked_however_packets_cut_them() {
        let mut random = fastrand::Rng::with_seed(1);
        for width in 1..=64 {
            let max =
                if width == 64 { i64::MAX } else { i64::MIN.wrapping_add_unsigned(u64::MAX >> (64 - width)) };
            let values: Vec<u64> = (0..300).map(|_| random.u64(..) & u64::MAX >> (64 - width)).collect();
            let mut stream = Stream::new(&Type::Integer { min: i64::MIN, max });
            assert_eq!(stream.width, width);
            let (bytes, mut unpacked) = (packed(&values, width), Vec::new());
            let mut from = 0;
            while from < bytes.len() {
                let to = (from + random.usize(1..100)).min(bytes.len());
                stream.append(&bytes[from..to]);
                let complete = stream.complete().unwrap();
                unpacked.extend(stream.values(complete));
                stream.bit += complete * width;
                from = to;
            }
            assert_eq!(unpacked[..values.len()], values, "{width} bits");
        }
    }

    #[test]
    fn values_are_those_of_their_types() {
        let (mut numbers, mut wholes) = (Vec::new(), Vec::new());
        let mut of = |encoding: Encoding, value: u64| {
            encoding.numbers([value].into_iter(), &mut numbers);
            encoding.wholes([value].into_iter(), &mut wholes);
            (numbers[0], wholes[0])
        };
        assert_eq!(of(Encoding::Scaled { min: -3, scale: 0.5, offset: 10.2 }, 1), (9.2, 9));
        assert_eq!(of(Encoding::Integer { min: -3 }, 1), (-2.0, -2));
        assert_eq!(of(Encoding::Single, u64::from(2.5_f32.to_bits())), (2.5, 2));
        assert_eq!(of(Encoding::Double, (-1.1_f64).to_bits()), (-1.1, -1));
    }
}

//! Modbus frames on a byte stream, in TCP and in RTU framing.
//!
//! TCP: transaction id, protocol 0, length, unit, PDU (Modbus Messaging on TCP/IP, 3.1.3). RTU: unit, PDU, CRC-16
//! low byte first (Modbus over Serial Line, 2.5.1). An RTU frame has no length field: that of a request follows from
//! the function code and, for writes, the byte count.

/// Framing of messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Framing {
    /// MBAP header with transaction id and length.
    Tcp,
    /// Trailing CRC-16.
    Rtu,
}

/// Length of the MBAP header with the unit id.
const HEADER: usize = 7;
/// Longest PDU.
const PDU_MAX: usize = 253;

/// Message, independent of its framing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// Transaction id on TCP; 0 on RTU.
    pub transaction: u16,
    /// Unit id.
    pub unit: u8,
    /// Function code and data.
    pub pdu: Vec<u8>,
}

/// Content at the start of a buffer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Split {
    /// Message and its length in bytes.
    Message(Message, usize),
    /// Incomplete message.
    More,
    /// Invalid bytes, and the number of bytes to discard.
    Junk(usize),
}

impl Framing {
    /// Splits off the first request in `bytes`.
    #[must_use]
    pub fn split_request(self, bytes: &[u8]) -> Split {
        match self {
            Framing::Tcp => split_tcp(bytes),
            Framing::Rtu => split_rtu_request(bytes),
        }
    }

    /// Encodes `message`.
    #[must_use]
    pub fn encode(self, message: &Message) -> Vec<u8> {
        match self {
            Framing::Tcp => {
                let length = u16::try_from(message.pdu.len() + 1).unwrap_or(u16::MAX);
                let mut bytes = Vec::with_capacity(HEADER + message.pdu.len());
                bytes.extend(message.transaction.to_be_bytes());
                bytes.extend([0, 0]);
                bytes.extend(length.to_be_bytes());
                bytes.push(message.unit);
                bytes.extend(&message.pdu);
                bytes
            }
            Framing::Rtu => {
                let mut bytes = vec![message.unit];
                bytes.extend(&message.pdu);
                bytes.extend(crc16(&bytes).to_le_bytes());
                bytes
            }
        }
    }
}

/// Splits off the first message of a TCP stream, request or answer.
#[must_use]
pub fn split_tcp(bytes: &[u8]) -> Split {
    let Some(header) = bytes.first_chunk::<HEADER>() else { return Split::More };
    let length = usize::from(u16::from_be_bytes([header[4], header[5]]));
    if header[2..4] != [0, 0] || !(2..=PDU_MAX + 1).contains(&length) {
        return Split::Junk(bytes.len());
    }
    let end = HEADER - 1 + length;
    let Some(pdu) = bytes.get(HEADER..end) else { return Split::More };
    let transaction = u16::from_be_bytes([header[0], header[1]]);
    Split::Message(Message { transaction, unit: header[6], pdu: pdu.to_vec() }, end)
}

fn split_rtu_request(bytes: &[u8]) -> Split {
    let Some(&function) = bytes.get(1) else { return Split::More };
    let pdu_len = match function {
        1..=6 => 5,
        15 | 16 => match bytes.get(6) {
            Some(&count) => 6 + usize::from(count),
            None => return Split::More,
        },
        _ => return Split::Junk(1),
    };
    let end = 1 + pdu_len + 2;
    let Some(frame) = bytes.get(..end) else { return Split::More };
    let (body, sum) = frame.split_at(end - 2);
    if crc16(body).to_le_bytes() != sum {
        return Split::Junk(1);
    }
    Split::Message(Message { transaction: 0, unit: body[0], pdu: body[1..].to_vec() }, end)
}

/// Returns the CRC-16/MODBUS.
#[must_use]
pub fn crc16(bytes: &[u8]) -> u16 {
    crc::Crc::<u16>::new(&crc::CRC_16_MODBUS).checksum(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Read of 10 registers from 0 at unit 1: the standard example of a Modbus request.
    const RTU_READ: [u8; 8] = [0x01, 0x03, 0x00, 0x00, 0x00, 0x0A, 0xC5, 0xCD];

    #[test]
    fn rtu_frames_end_where_the_function_says() {
        let read = Message { transaction: 0, unit: 1, pdu: RTU_READ[1..6].to_vec() };
        assert_eq!(Framing::Rtu.encode(&read), RTU_READ);
        assert_eq!(Framing::Rtu.split_request(&RTU_READ), Split::Message(read.clone(), 8));
        for end in 0..8 {
            assert_eq!(Framing::Rtu.split_request(&RTU_READ[..end]), Split::More, "{end} bytes");
        }
        let mut noisy = vec![0x99];
        noisy.extend(RTU_READ);
        assert_eq!(Framing::Rtu.split_request(&noisy), Split::Junk(1));

        let write = Message { transaction: 0, unit: 1, pdu: vec![16, 0, 100, 0, 2, 4, 0, 1, 0, 2] };
        let bytes = Framing::Rtu.encode(&write);
        assert_eq!(Framing::Rtu.split_request(&bytes), Split::Message(write, bytes.len()));
    }

    #[test]
    fn tcp_frames_end_where_the_header_says() {
        let message = Message { transaction: 0x1234, unit: 1, pdu: vec![3, 0, 0, 0, 32] };
        let mut bytes = Framing::Tcp.encode(&message);
        assert_eq!(bytes, [0x12, 0x34, 0, 0, 0, 6, 1, 3, 0, 0, 0, 32]);
        bytes.push(0x55);
        assert_eq!(Framing::Tcp.split_request(&bytes), Split::Message(message, 12));
        assert_eq!(Framing::Tcp.split_request(&bytes[..11]), Split::More);
        assert_eq!(Framing::Tcp.split_request(b"GET / HTTP/1.1"), Split::Junk(14));
    }
}

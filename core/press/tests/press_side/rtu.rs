//! RTU frames: through a gateway that passes late answers to the next connection, and on a pseudo terminal.

use std::io::{Read, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use crate::simulated_plc::{Memory, Plc, SharedPlc};
use platen_model::StrokeKey;
use platen_plant::press::{Block, Link, Press, Quiet, RegisterTable, Serial, Transport};
use platen_press::{Answer, Client, ModbusLink, channels, run_press};
use serialport::{SerialPort, TTYPort};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpListener;
use tokio::net::tcp::OwnedWriteHalf;

/// Returns the CRC-16/MODBUS of a frame, computed bit by bit, low byte first.
fn crc(frame: &[u8]) -> [u8; 2] {
    let mut crc = 0xFFFFu16;
    for byte in frame {
        crc ^= u16::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { crc >> 1 ^ 0xA001 } else { crc >> 1 };
        }
    }
    crc.to_le_bytes()
}

/// Returns the answer of unit 1 to a complete frame; `None` for an incomplete frame.
fn answer(plc: &SharedPlc, frame: &[u8]) -> Option<Vec<u8>> {
    let word = |at: usize| Some(u16::from_be_bytes([*frame.get(at)?, *frame.get(at + 1)?]));
    let (start, count) = (word(2)?, word(4)?);
    let length = if frame[1] == 16 { 9 + usize::from(*frame.get(6)?) } else { 8 };
    let whole = frame.get(..length)?;
    let (body, sum) = whole.split_at(length - 2);
    assert_eq!(sum, crc(body), "the host sent a bad frame");
    let mut plc = plc.lock().unwrap();
    let mut reply = match frame[1] {
        3 => {
            let words = plc.read(start, count).unwrap();
            let mut reply = vec![1, 3, 2 * count as u8];
            reply.extend(words.iter().flat_map(|word| word.to_be_bytes()));
            reply
        }
        16 => {
            let words: Vec<u16> =
                body[7..].chunks(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect();
            assert!(plc.write(start, &words), "a write outside the allowed registers");
            body[..6].to_vec()
        }
        other => panic!("function {other}"),
    };
    reply.extend(crc(&reply.clone()));
    Some(reply)
}

fn random(state: &mut u64) -> u64 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    *state
}

/// Serves a gateway to one line: a late answer goes to the connection then open. `late` of 1000 answers come after
/// 200 ms.
async fn gateway(plc: SharedPlc, late: u64, seed: u64) -> u16 {
    let listener = TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
    let port = listener.local_addr().unwrap().port();
    tokio::spawn(async move {
        let current: Arc<tokio::sync::Mutex<Option<OwnedWriteHalf>>> = Arc::default();
        let mut state = seed;
        while let Ok((stream, _)) = listener.accept().await {
            let (mut requests, replies) = stream.into_split();
            *current.lock().await = Some(replies);
            let mut frame = Vec::new();
            let mut bytes = [0; 260];
            while let Ok(n @ 1..) = requests.read(&mut bytes).await {
                frame.extend(&bytes[..n]);
                let Some(reply) = answer(&plc, &frame) else { continue };
                frame.clear();
                let wait = if random(&mut state) % 1000 < late { 200 } else { 0 };
                let current = Arc::clone(&current);
                let send = async move {
                    tokio::time::sleep(Duration::from_millis(wait)).await;
                    if let Some(line) = current.lock().await.as_mut() {
                        let _ = line.write_all(&reply).await;
                    }
                };
                if wait == 0 { send.await } else { drop(tokio::spawn(send)) }
            }
        }
    });
    port
}

/// Answers on the PLC's side of a pseudo terminal until the test ends. On a thread: an event loop would report the
/// hang-up of a closed terminal without end.
fn slave(mut line: TTYPort, plc: &SharedPlc, ended: &AtomicBool) {
    let (mut frame, mut bytes) = (Vec::new(), [0; 260]);
    line.set_timeout(Duration::from_millis(10)).unwrap();
    while !ended.load(Ordering::Relaxed) {
        match line.read(&mut bytes) {
            Ok(n) => frame.extend(&bytes[..n]),
            Err(error) if error.kind() == std::io::ErrorKind::TimedOut => {}
            // The other side is closed.
            Err(_) => std::thread::sleep(Duration::from_millis(10)),
        }
        if let Some(reply) = answer(plc, &frame) {
            frame.clear();
            line.write_all(&reply).unwrap();
        }
    }
}

/// Runs strokes over a link and asserts that each has its own result; returns the number of poisoned connections.
async fn strokes(link: Link, plc: SharedPlc, strokes: usize) -> u64 {
    tokio::spawn(crate::simulated_plc::run_plc(plc.clone()));
    let press = Press::pph1("Press 3", 3, link);
    let (host, side) = channels();
    let scans: Arc<Mutex<Vec<StrokeKey>>> = Arc::default();
    let ms = Duration::from_millis;
    let scanner = crate::simulated_plc::host(
        host.orders,
        host.answers.clone(),
        ms(20),
        ms(5),
        Arc::clone(&scans),
        Arc::default(),
    );
    tokio::spawn(scanner);
    let link = ModbusLink::new(&press.link);
    let run = tokio::spawn(run_press(press, link, Memory::new(7), side));
    plc.lock().unwrap().to_do = strokes;
    crate::simulated_plc::until(Duration::from_secs(120), "the strokes", || plc.lock().unwrap().idle()).await;
    let poisoned = host.status.borrow().counts.poisoned;
    host.answers.send(Answer::Stop).unwrap();
    run.await.unwrap().unwrap();
    let plc = plc.lock().unwrap();
    assert_eq!((plc.results.len(), scans.lock().unwrap().len(), plc.outside), (strokes, strokes, 0));
    for result in &plc.results {
        assert_eq!(result.dev_max, result.stroke, "the result of another stroke");
    }
    poisoned
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn late_answers_through_a_gateway_are_never_taken_for_others() {
    let plc: SharedPlc = Arc::new(Mutex::new(Plc::new(3, 0)));
    let port = gateway(plc.clone(), 20, 0x5EED).await;
    let mut link = Link::rtu_over_tcp("127.0.0.1", port, 1);
    link.poll = Duration::from_millis(10);
    link.response_timeout = Duration::from_millis(60);
    (link.backoff_min, link.backoff_max) = (Duration::from_millis(5), Duration::from_millis(10));
    if let Transport::RtuOverTcp(_, quiet) = &mut link.transport {
        *quiet = Quiet(Duration::from_millis(300));
    }
    let poisoned = strokes(link, plc, 50).await;
    assert!(poisoned > 0, "no answer was late");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn strokes_over_a_pseudo_terminal() {
    let plc: SharedPlc = Arc::new(Mutex::new(Plc::new(3, 0)));
    let (master, port) = TTYPort::pair().unwrap();
    let device = port.name().unwrap();
    drop(port);
    let ended = Arc::new(AtomicBool::new(false));
    let (its_plc, its_end) = (plc.clone(), Arc::clone(&ended));
    let thread = std::thread::spawn(move || slave(master, &its_plc, &its_end));
    let mut link = Link::rtu(Serial::new(device, 115_200), 1);
    link.poll = Duration::from_millis(10);
    strokes(link, plc, 10).await;
    ended.store(true, Ordering::Relaxed);
    thread.join().unwrap();
}

/// Blocks of equal length, so that a late answer has the form of the next one.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn no_read_returns_what_another_asked_for() {
    let plc: SharedPlc = Arc::new(Mutex::new(Plc::new(3, 0)));
    plc.lock().unwrap().regs = std::array::from_fn(|i| i as u16);
    let port = gateway(plc, 100, 0x5EED).await;
    let mut link = Link::rtu_over_tcp("127.0.0.1", port, 1);
    link.response_timeout = Duration::from_millis(60);
    if let Transport::RtuOverTcp(_, quiet) = &mut link.transport {
        *quiet = Quiet(Duration::from_millis(300));
    }
    let press = Press::pph1("Press 3", 3, link);
    let mut client = Client::new(ModbusLink::new(&press.link), &press);
    let (mut right, mut wrong) = (0, 0);
    for i in 0..200 {
        if !client.connected() {
            client.connect().await.unwrap();
        }
        let block = Block { table: RegisterTable::Holding, start: i % 20 * 8, count: 8 };
        match client.read(&block, 8).await {
            Ok(words) if words[0] == block.start => right += 1,
            Ok(_) => wrong += 1,
            Err(_) => {}
        }
    }
    assert!(wrong == 0 && right > 100 && client.counts().timeouts > 5, "{right} right, {wrong} wrong");
}

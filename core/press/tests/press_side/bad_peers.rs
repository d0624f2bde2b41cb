//! Protocol faults of Modbus TCP peers: every wrong answer drops the connection, and none is accepted.

use std::time::Duration;

use platen_plant::press::{Link, Press, RegisterTable};
use platen_press::{Client, LinkError, ModbusLink};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};

const BLOCK: platen_plant::press::Block =
    platen_plant::press::Block { table: RegisterTable::Holding, start: 0, count: 3 };

/// Connects a client to a peer that answers each request frame by `answer(connection, frame)`.
async fn peer(
    answer: impl Fn(usize, &[u8]) -> Vec<u8> + Send + Sync + Clone + 'static,
) -> Client<ModbusLink> {
    let listener = TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
    let mut link = Link::tcp("127.0.0.1", listener.local_addr().unwrap().port(), 1);
    link.response_timeout = Duration::from_millis(300);
    tokio::spawn(async move {
        let mut connections = 0;
        while let Ok((stream, _)) = listener.accept().await {
            tokio::spawn(serve(stream, connections, answer.clone()));
            connections += 1;
        }
    });
    let press = Press::pph1("P", 3, link);
    Client::new(ModbusLink::new(&press.link), &press)
}

async fn serve(mut stream: TcpStream, connection: usize, answer: impl Fn(usize, &[u8]) -> Vec<u8>) {
    let mut frame = [0; 260];
    while let Ok(n @ 1..) = stream.read(&mut frame).await {
        let bytes = answer(connection, &frame[..n]);
        if bytes.is_empty() {
            return;
        }
        if stream.write_all(&bytes).await.is_err() {
            return;
        }
    }
}

/// Returns a correct answer to a read: `words` behind the request's own header.
fn words(request: &[u8], words: &[u16]) -> Vec<u8> {
    let mut frame = request[..4].to_vec();
    frame.extend((3 + 2 * words.len() as u16).to_be_bytes());
    frame.extend([request[6], request[7], 2 * words.len() as u8]);
    frame.extend(words.iter().flat_map(|word| word.to_be_bytes()));
    frame
}

/// Asserts that a wrong answer drops the first connection, and that the next connection works.
async fn poisons(bad: impl Fn(&[u8]) -> Vec<u8> + Send + Sync + Clone + 'static) {
    let answer = move |connection: usize, request: &[u8]| {
        if connection == 0 { bad(request) } else { words(request, &[7, 8, 9]) }
    };
    let mut client = peer(answer).await;
    client.connect().await.unwrap();
    assert!(client.read(&BLOCK, 3).await.is_err());
    assert!(!client.connected(), "the connection must be dropped");
    assert_eq!(client.counts().poisoned, 1);
    client.connect().await.unwrap();
    assert_eq!(client.read(&BLOCK, 3).await.unwrap(), [7, 8, 9]);
}

#[tokio::test]
async fn too_few_and_too_many_registers() {
    poisons(|request| words(request, &[1, 2])).await;
    poisons(|request| words(request, &[1, 2, 3, 4])).await;
}

#[tokio::test]
async fn another_transaction_unit_or_function() {
    for byte in [1, 6, 7] {
        poisons(move |request| {
            let mut frame = words(request, &[1, 2, 3]);
            frame[byte] ^= 1;
            frame
        })
        .await;
    }
}

#[tokio::test]
async fn half_a_frame_and_no_answer_at_all() {
    poisons(|request| words(request, &[1, 2, 3])[..8].to_vec()).await;
    poisons(|_| Vec::new()).await;
    poisons(|_| b"HTTP/1.1 400 Bad Request\r\n\r\n".to_vec()).await;
}

#[tokio::test]
async fn a_write_that_is_echoed_with_another_address_or_count() {
    for (byte, right) in [(9, false), (11, false), (0, true)] {
        let mut client = peer(move |_, request: &[u8]| {
            let mut frame = request[..12].to_vec();
            frame[5] = 6;
            if !right {
                frame[byte] ^= 1;
            }
            frame
        })
        .await;
        client.connect().await.unwrap();
        let written = client.guarded_write(104, &[1, 2, 3]).await;
        assert_eq!((written.is_ok(), client.connected()), (right, right), "byte {byte}");
    }
}

#[tokio::test]
async fn an_exception_keeps_the_connection() {
    let exception =
        |_, request: &[u8]| [&request[..4], &[0, 3, request[6], request[7] | 0x80, 0x06]].concat();
    let mut client = peer(exception).await;
    client.connect().await.unwrap();
    assert!(matches!(client.read(&BLOCK, 3).await, Err(LinkError::Exception { code: 6, .. })));
    assert!(client.connected());
}

/// Example of MODBUS Application Protocol V1.1b3, section 6.21: function 43, type 14, basic, three objects.
#[tokio::test]
async fn a_controller_is_identified() {
    let who = |_, request: &[u8]| {
        assert_eq!(request[7..], [0x2B, 0x0E, 1, 0]);
        let objects: [&[u8]; 3] = [b"ACME", b"PC-7", b"V2.1"];
        let mut pdu = vec![request[6], 0x2B, 0x0E, 1, 1, 0, 0, 3];
        for (id, text) in (0..).zip(objects) {
            pdu.extend([id, text.len() as u8]);
            pdu.extend(text);
        }
        [&request[..4], &(pdu.len() as u16).to_be_bytes(), &pdu].concat()
    };
    let mut client = peer(who).await;
    client.connect().await.unwrap();
    assert_eq!(client.identify().await.unwrap(), ["ACME", "PC-7", "V2.1"]);
}

#[tokio::test]
async fn a_write_outside_the_allow_list_is_never_sent() {
    let mut client = peer(|_, _| panic!("nothing may be sent")).await;
    client.connect().await.unwrap();
    for (start, count) in [(99, 1), (99, 64), (163, 2), (164, 1), (0, 1), (100, 65)] {
        let refused = client.guarded_write(start, &vec![0; count]).await;
        assert!(matches!(refused, Err(LinkError::Refused { .. })), "{start} {count}");
    }
    assert_eq!((client.counts().writes_refused, client.counts().requests), (6, 0));
}

/// Connection limit: a full backlog never answers another connection.
#[tokio::test]
async fn a_listener_that_does_not_accept() {
    let socket = tokio::net::TcpSocket::new_v4().unwrap();
    socket.bind("127.0.0.1:0".parse().unwrap()).unwrap();
    let listener = socket.listen(0).unwrap();
    let address = listener.local_addr().unwrap();
    let mut fill = Vec::new();
    while let Ok(Ok(stream)) =
        tokio::time::timeout(Duration::from_millis(200), TcpStream::connect(address)).await
    {
        fill.push(stream);
    }
    let mut link = Link::tcp("127.0.0.1", address.port(), 1);
    link.connect_timeout = Duration::from_millis(300);
    let press = Press::pph1("P", 3, link);
    let mut client = Client::new(ModbusLink::new(&press.link), &press);
    assert!(matches!(client.connect().await, Err(LinkError::ConnectTimeout { .. })));
}

//! TCP sockets with the options that a press needs.

use std::io;
use std::time::Duration;

use platen_plant::press::Socket;
use socket2::{SockRef, TcpKeepalive};
use tokio::net::TcpStream;

/// Connects, without a time limit of its own; TCP_NODELAY and keep-alive are set.
pub(super) async fn connect(socket: &Socket) -> io::Result<TcpStream> {
    let stream = TcpStream::connect((socket.host.as_str(), socket.port)).await?;
    stream.set_nodelay(true)?;
    let keepalive =
        TcpKeepalive::new().with_time(Duration::from_secs(5)).with_interval(Duration::from_secs(1));
    SockRef::from(&stream).set_tcp_keepalive(&keepalive)?;
    Ok(stream)
}

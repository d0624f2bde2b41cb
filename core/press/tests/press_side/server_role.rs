//! Server role: the press is the Modbus client.

use std::net::SocketAddr;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use crate::simulated_plc::plc::{H, P};
use crate::simulated_plc::{Memory, Plc, SharedPlc};
use platen_model::StrokeKey;
use platen_plant::press::{Link, Press, Role};
use platen_press::{Answer, PressLink, channels, run_press};
use tokio_modbus::client::{Context, tcp};
use tokio_modbus::prelude::*;

async fn ask(host: SocketAddr) -> Context {
    tcp::connect_slave(host, Slave(1)).await.unwrap()
}

/// Runs the client of the press: writes its own block and reads the host's every 10 ms.
async fn exchange(plc: SharedPlc, host_at: SocketAddr) {
    let mut context = ask(host_at).await;
    loop {
        let own = plc.lock().unwrap().regs[P..P + 32].to_vec();
        let written = context.write_multiple_registers(P as u16, &own).await;
        let read = context.read_holding_registers(H as u16, 64).await;
        let (Ok(Ok(())), Ok(Ok(words))) = (written, read) else {
            context = ask(host_at).await;
            continue;
        };
        plc.lock().unwrap().regs[H..H + 64].copy_from_slice(&words);
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn thirty_strokes_with_the_host_as_server() {
    let plc: SharedPlc = Arc::new(Mutex::new(Plc::new(3, 0)));
    let mut press = Press::pph1("Press 3", 3, Link::tcp("127.0.0.1", 0, 1));
    press.role = Role::Server;
    let mut link = PressLink::new(&press);
    let PressLink::Served(served) = &mut link else { unreachable!("the role is server") };
    let host_at = served.listen().await.unwrap();
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
    let run = tokio::spawn(run_press(press, link, Memory::new(7), side));
    tokio::spawn(crate::simulated_plc::run_plc(plc.clone()));
    tokio::spawn(exchange(plc.clone(), host_at));
    plc.lock().unwrap().to_do = 30;
    crate::simulated_plc::until(Duration::from_secs(60), "the strokes", || plc.lock().unwrap().idle()).await;

    // Refused: writes outside the press block, other functions, other units.
    let mut stranger = ask(host_at).await;
    let refused = stranger.write_multiple_registers(110, &[1, 2]).await.unwrap();
    assert_eq!(refused, Err(ExceptionCode::IllegalDataAddress));
    let refused = stranger.read_coils(0, 1).await.unwrap();
    assert_eq!(refused, Err(ExceptionCode::IllegalFunction));
    stranger.set_slave(Slave(9));
    let unheard = tokio::time::timeout(ms(200), stranger.read_holding_registers(100, 1)).await;
    assert!(unheard.is_err(), "another unit's request was answered");

    host.answers.send(Answer::Stop).unwrap();
    run.await.unwrap().unwrap();
    let plc = plc.lock().unwrap();
    assert_eq!((plc.results.len(), scans.lock().unwrap().len()), (30, 30));
    for result in &plc.results {
        assert_eq!(result.dev_max, result.stroke, "the result of another stroke");
    }
    assert_eq!(plc.regs[H + 2], 0, "the press has read the safe status");
}

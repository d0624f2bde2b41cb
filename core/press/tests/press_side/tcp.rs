//! Whole press side against the simulated PLC over Modbus TCP on loopback.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use crate::simulated_plc::{Memory, Plc, SharedPlc};
use platen_plant::press::{Link, Press};
use platen_press::{Answer, ModbusLink, channels, run_press};

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn fifty_strokes_each_with_its_own_result() {
    let plc: SharedPlc = Arc::new(Mutex::new(Plc::new(3, 0)));
    let port = crate::simulated_plc::server::serve(plc.clone()).await;
    tokio::spawn(crate::simulated_plc::run_plc(plc.clone()));
    let press = Press::pph1("Press 3", 3, Link::tcp("127.0.0.1", port, 1));
    let (host, side) = channels();
    let (scans, alarms) = (Arc::default(), Arc::default());
    let ms = Duration::from_millis;
    tokio::spawn(crate::simulated_plc::host(
        host.orders,
        host.answers.clone(),
        ms(20),
        ms(5),
        Arc::clone(&scans),
        Arc::clone(&alarms),
    ));
    let link = ModbusLink::new(&press.link);
    let journal = Memory::new(7);
    let run = tokio::spawn(run_press(press, link, journal.clone(), side));
    plc.lock().unwrap().to_do = 50;
    crate::simulated_plc::until(Duration::from_secs(60), "50 strokes", || plc.lock().unwrap().idle()).await;

    host.answers.send(Answer::Stop).unwrap();
    run.await.unwrap().unwrap();
    let plc = plc.lock().unwrap();
    assert_eq!(scans.lock().unwrap().len(), 50);
    assert_eq!(alarms.lock().unwrap().as_slice(), []);
    assert_eq!(plc.results.len(), 50);
    for result in &plc.results {
        assert_eq!(result.dev_max, result.stroke, "the result of another stroke");
    }
    assert_eq!((plc.outside, plc.gave_up.len()), (0, 0));
    assert_eq!(plc.regs[crate::simulated_plc::plc::H + 2], 0, "safe status after the stop");
    eprintln!("writes {}, accept ms {:?}", plc.writes, plc.accept_ms);
}

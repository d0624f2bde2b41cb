//! Transactional outbox: delivery of a host's record to databases and brokers, by `platen forward`.
//!
//! A separate process reads the record while the host writes it, and keeps a cursor for each sink. There is no second
//! queue: the record's table of changes is the outbox, and a cursor moves when its sink has acknowledged. A change that
//! is sent twice is identified by its key.
//!
//! | module | contents |
//! |---|---|
//! | [`message`] | a change of the record as `platen.stroke/1` |
//! | `feed` | the next messages after a cursor |
//! | `cursor` | last change that each sink has |
//! | `sink` | a destination |
//! | `postgresql`, `mqtt`, `sparkplug` | the destinations |
//! | `shared` | cursors and states that the tasks share |
//! | `pump` | task of one sink |
//! | `forwarder` | tasks of all sinks |
//! | [`schema`] | tables of the database |
//! | `status` | the state for `platen status` |

mod cursor;
mod feed;
mod forwarder;
pub mod message;
mod mqtt;
mod postgresql;
mod press_state;
mod pump;
pub mod schema;
mod shared;
mod sink;
mod sparkplug;
mod status;
mod tls;

pub use cursor::CursorError;
pub use forwarder::{ForwardError, Start, forward};
pub use status::{FILE, ForwardStatus, SinkStatus};

//! Transactional outbox: the record of a host to databases and brokers, by `platen forward`.
//!
//! A process of its own reads the record beside the host and keeps a cursor for each sink. Nothing is queued twice: the record's table of changes is
//! the outbox, and a cursor moves when its sink has acknowledged. A change that is sent twice is known by its key.
//!
//! | module | what it does |
//! |---|---|
//! | [`message`] | a change of the record as `platen.stroke/1` |
//! | `feed` | the next messages after a cursor |
//! | `cursor` | how far each sink has got |
//! | `sink` | a destination |
//! | `postgresql`, `mqtt`, `sparkplug` | the destinations |
//! | `shared` | cursors and states that the tasks share |
//! | `pump` | one sink's task |
//! | `forwarder` | all of them |
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

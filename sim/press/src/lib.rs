//! A Modbus server that behaves like a plate press.

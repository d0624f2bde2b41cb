//! Register map, Modbus link and handshake with the press.

//! Checked option values as a table of the boundary.
#![allow(unsafe_code, reason = "builds the table of values")]

use std::ffi::CString;
use std::os::unix::ffi::OsStrExt;

use platen_abi::{Value as Raw, option_type};
use platen_plant::{OptionValue, Value};

/// Values with the memory that they point to.
#[derive(Debug)]
pub(super) struct Values {
    raw: Vec<Raw>,
    _texts: Vec<CString>,
    _lists: Vec<Vec<f64>>,
}

// SAFETY: the pointers lead into the struct's own, unchanging memory.
unsafe impl Send for Values {}

impl Values {
    pub(super) fn new(values: &[OptionValue]) -> Self {
        let (mut texts, mut lists) = (Vec::new(), Vec::new());
        let mut text = |bytes: &[u8]| {
            let text = CString::new(bytes.to_vec()).unwrap_or_default();
            let pointer = text.as_ptr();
            texts.push(text);
            pointer
        };
        let mut raw = Vec::new();
        for OptionValue { name, value, given } in values {
            let mut row = Raw {
                name: text(name.as_bytes()),
                kind: 0,
                from_default: i32::from(!given),
                i: 0,
                f: 0.0,
                s: std::ptr::null(),
                list: std::ptr::null(),
                n: 0,
            };
            match value {
                Value::Bool(b) => (row.kind, row.i) = (option_type::BOOL, i64::from(*b)),
                Value::Int(i) => (row.kind, row.i) = (option_type::INT, *i),
                Value::Duration(d) => (row.kind, row.f) = (option_type::DURATION, *d),
                Value::Float(f) => (row.kind, row.f) = (option_type::FLOAT, *f),
                Value::String(s) => (row.kind, row.s) = (option_type::STRING, text(s.as_bytes())),
                Value::Path(p) => (row.kind, row.s) = (option_type::PATH, text(p.as_os_str().as_bytes())),
                Value::Floats(list) => {
                    let list = list.clone();
                    (row.kind, row.list, row.n) = (option_type::FLOAT_LIST, list.as_ptr(), list.len() as u64);
                    lists.push(list);
                }
            }
            raw.push(row);
        }
        Self { raw, _texts: texts, _lists: lists }
    }

    pub(super) fn as_slice(&self) -> &[Raw] {
        &self.raw
    }
}

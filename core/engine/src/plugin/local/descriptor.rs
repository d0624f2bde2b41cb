//! Reader of the static tables that describe a plugin.
#![allow(unsafe_code, reason = "reads the plugin's static tables")]

use std::ffi::{CStr, c_char};

use platen_abi::{Desc, OptionDecl as RawOption, Table as _, desc_flag, option_flag, option_type};
use platen_plant::{OptionDecl, OptionType};

use super::super::{Descriptor, Kind};

/// Copies a descriptor.
///
/// # Safety
/// `desc` is a plugin's descriptor: strings end in NUL, lists in null, and all of it is constant.
pub(super) unsafe fn read(desc: *const Desc) -> Result<Descriptor, String> {
    // SAFETY: as the caller promises.
    unsafe {
        let desc = Desc::read(desc).map_err(|size| format!("its {} has {size} bytes", Desc::NAME))?;
        let kind = match text(desc.kind).as_str() {
            "scanner" => Kind::Scanner,
            "flattening" => Kind::Flattening,
            "comparison" => Kind::Comparison,
            "advisor" => Kind::Advisor,
            other => {
                return Err(format!(
                    "its kind is `{other}`, known are scanner, flattening, comparison and advisor"
                ));
            }
        };
        let id = text(desc.id);
        if id.is_empty() {
            return Err("it has no id".into());
        }
        Ok(Descriptor {
            id,
            kind,
            name: text(desc.name),
            vendor: text(desc.vendor),
            version: text(desc.version),
            doc: text(desc.doc),
            license: text(desc.license),
            url: text(desc.url),
            hardware: desc.flags & desc_flag::HARDWARE != 0,
            inputs: texts(desc.inputs),
            outputs: texts(desc.outputs),
            options: options(&desc)?,
        })
    }
}

/// # Safety
/// `p` is null or a string with a NUL at its end.
pub(super) unsafe fn text(p: *const c_char) -> String {
    if p.is_null() {
        return String::new();
    }
    // SAFETY: as the caller promises.
    unsafe { CStr::from_ptr(p) }.to_string_lossy().into_owned()
}

/// # Safety
/// `p` is null or a list of strings with a null at its end.
unsafe fn texts(mut p: *const *const c_char) -> Vec<String> {
    let mut all = Vec::new();
    // SAFETY: as the caller promises.
    unsafe {
        while !p.is_null() && !(*p).is_null() {
            all.push(text(*p));
            p = p.add(1);
        }
    }
    all
}

/// # Safety
/// As [`read`].
unsafe fn options(desc: &Desc) -> Result<Vec<OptionDecl>, String> {
    let mut all = Vec::new();
    let mut place = desc.options.cast::<u8>();
    for index in 0..desc.n_options {
        if place.is_null() {
            return Err(format!("its {} options are nowhere", desc.n_options));
        }
        // SAFETY: the list has n_options elements, each as long as its struct_size.
        let raw = unsafe { RawOption::read(place.cast()) }
            .map_err(|size| format!("option {index} has {size} bytes, {} are needed", RawOption::LEAST))?;
        // SAFETY: as above.
        all.push(unsafe { option(&raw) }?);
        // SAFETY: the stride is the element's own size.
        place = unsafe { place.add(raw.struct_size as usize) };
    }
    Ok(all)
}

/// # Safety
/// As [`read`].
unsafe fn option(raw: &RawOption) -> Result<OptionDecl, String> {
    let flag = |bit| raw.flags & bit != 0;
    // SAFETY: as the caller promises.
    let (name, unit, doc, default, choices) = unsafe {
        (text(raw.name), text(raw.unit), text(raw.doc), text(raw.default_text), texts(raw.choices))
    };
    let kind = match raw.kind {
        option_type::BOOL => OptionType::Bool,
        option_type::INT => OptionType::Int,
        option_type::FLOAT => OptionType::Float,
        option_type::STRING => OptionType::String,
        option_type::CHOICE => OptionType::Choice,
        option_type::PATH => OptionType::Path,
        option_type::DURATION => OptionType::Duration,
        option_type::FLOAT_LIST => OptionType::Floats,
        other => return Err(format!("option `{name}` has the unknown type {other}")),
    };
    Ok(OptionDecl {
        kind,
        unit: (!unit.is_empty()).then_some(unit),
        min: flag(option_flag::HAS_MIN).then_some(raw.min),
        max: flag(option_flag::HAS_MAX).then_some(raw.max),
        choices,
        default: (!raw.default_text.is_null()).then_some(default),
        required: flag(option_flag::REQUIRED),
        doc: doc.lines().map(str::trim).collect::<Vec<_>>().join(" ").trim().to_owned(),
        secret: flag(option_flag::SECRET),
        name,
    })
}

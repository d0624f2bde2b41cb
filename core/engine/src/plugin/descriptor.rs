//! Description of a plugin: name, kind, options, formats; copied out of its static tables.
#![allow(unsafe_code, reason = "reads the plugin's static tables")]

use std::ffi::{CStr, c_char};

use platen_abi::{Desc, OptionDecl as RawOption, option_flag, option_type};
use platen_plant::{OptionDecl, OptionType};

/// Kind of a plugin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Scanner driver: from a trigger to a lattice.
    Scanner,
    /// Flattening: from the mid-surface mesh to a chart (u, v).
    Flattening,
    /// Comparison: from surfaces to findings.
    Comparison,
}

impl Kind {
    /// Returns the name in descriptors.
    pub fn name(self) -> &'static str {
        match self {
            Self::Scanner => "scanner",
            Self::Flattening => "flattening",
            Self::Comparison => "comparison",
        }
    }
}

/// Description of a plugin.
#[derive(Debug, Clone, PartialEq)]
pub struct Descriptor {
    /// Name in plant files.
    pub id: String,
    /// Kind.
    pub kind: Kind,
    /// Name for people.
    pub name: String,
    /// Maker.
    pub vendor: String,
    /// Version.
    pub version: String,
    /// Purpose, in sentences.
    pub doc: String,
    /// SPDX expression.
    pub license: String,
    /// Formats read.
    pub inputs: Vec<String>,
    /// Formats written.
    pub outputs: Vec<String>,
    /// Options.
    pub options: Vec<OptionDecl>,
}

impl Descriptor {
    /// Copies the descriptor.
    ///
    /// # Safety
    /// `desc` is a plugin's descriptor: strings end in NUL, lists in null, and all of it is constant.
    pub(super) unsafe fn read(desc: &Desc) -> Result<Self, String> {
        // SAFETY: as the caller promises.
        unsafe {
            let kind = text(desc.kind);
            Ok(Self {
                id: text(desc.id),
                kind: match kind.as_str() {
                    "scanner" => Kind::Scanner,
                    "flattening" => Kind::Flattening,
                    "comparison" => Kind::Comparison,
                    _ => {
                        return Err(format!(
                            "its kind is `{kind}`, known are scanner, flattening and comparison"
                        ));
                    }
                },
                name: text(desc.name),
                vendor: text(desc.vendor),
                version: text(desc.version),
                doc: text(desc.doc),
                license: text(desc.license),
                inputs: texts(desc.inputs),
                outputs: texts(desc.outputs),
                options: options(desc)?,
            })
        }
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
/// As [`Descriptor::read`].
unsafe fn options(desc: &Desc) -> Result<Vec<OptionDecl>, String> {
    let mut all = Vec::new();
    let mut place = desc.options.cast::<u8>();
    for index in 0..desc.n_options {
        // SAFETY: the list has n_options elements, each as long as it says.
        let raw = unsafe { &*place.cast::<RawOption>() };
        if (raw.struct_size as usize) < size_of::<RawOption>() {
            return Err(format!(
                "option {index} has {} bytes, {} are needed",
                raw.struct_size,
                size_of::<RawOption>()
            ));
        }
        // SAFETY: as above.
        all.push(unsafe { option(raw) }?);
        // SAFETY: the stride is the element's own size.
        place = unsafe { place.add(raw.struct_size as usize) };
    }
    Ok(all)
}

/// # Safety
/// As [`Descriptor::read`].
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

//! Options of a plugin: one declaration gives validation, `describe`, schema and typed values.

use std::ffi::{CStr, c_char};
use std::path::PathBuf;

use platen_abi::{OptionDecl, Value, option_flag, option_type};

/// Options struct, declared with [`options!`](crate::options).
pub trait Options: Sized {
    /// Table of declarations, read by the host.
    const TABLE: &'static [OptionDecl];
    /// Creates the struct from the values that the host checked.
    ///
    /// # Errors
    /// A value is missing, which is a fault of the host.
    fn from_values(values: &Values<'_>) -> crate::Result<Self>;
}

/// A plugin without options.
impl Options for () {
    const TABLE: &'static [OptionDecl] = &[];
    fn from_values(_: &Values<'_>) -> crate::Result<Self> {
        Ok(())
    }
}

/// Values as received from the host.
#[derive(Debug, Clone, Copy)]
pub struct Values<'a>(pub(crate) &'a [Value]);

impl Values<'_> {
    /// Returns the value of one option.
    ///
    /// # Errors
    /// When it is missing or of another type.
    #[doc(hidden)]
    pub fn get<T: OptionType>(&self, name: &CStr) -> crate::Result<T> {
        // SAFETY: the host's strings are NUL-terminated and live for the call.
        let value = self.0.iter().find(|v| unsafe { CStr::from_ptr(v.name) } == name);
        T::receive(value.map(Received)).ok_or_else(|| {
            let message = format!("the host gave no valid value for option {}", name.to_string_lossy());
            crate::Error::new(crate::ErrorKind::Internal, message)
        })
    }
}

/// One value as received.
#[derive(Debug, Clone, Copy)]
pub struct Received<'a>(&'a Value);

impl Received<'_> {
    fn text(&self) -> Option<String> {
        if self.0.s.is_null() {
            return None;
        }
        // SAFETY: not null, NUL-terminated and alive for the call.
        Some(unsafe { CStr::from_ptr(self.0.s) }.to_string_lossy().into_owned())
    }
}

/// Type of a field of an options struct.
pub trait OptionType: Sized {
    /// Type code on the boundary.
    const TYPE: i32;
    /// False for `Option<T>`.
    const REQUIRED: bool = true;
    /// Converts the value; `None` when it is missing or of another type.
    #[doc(hidden)]
    fn receive(received: Option<Received<'_>>) -> Option<Self>;
}

macro_rules! option_type {
    ($($ty:ty = $code:ident, |$r:ident| $take:expr;)*) => { $(
        impl OptionType for $ty {
            const TYPE: i32 = option_type::$code;
            fn receive(received: Option<Received<'_>>) -> Option<Self> {
                let $r = received?;
                $take
            }
        }
    )* };
}

option_type! {
    bool = BOOL, |r| Some(r.0.i != 0);
    i64 = INT, |r| Some(r.0.i);
    f64 = FLOAT, |r| Some(r.0.f);
    String = STRING, |r| r.text();
    PathBuf = PATH, |r| r.text().map(PathBuf::from);
    std::time::Duration = DURATION, |r| std::time::Duration::try_from_secs_f64(r.0.f).ok();
    Vec<f64> = FLOAT_LIST, |r| {
        if r.0.n == 0 {
            return Some(Vec::new());
        }
        if r.0.list.is_null() {
            return None;
        }
        // SAFETY: the host's list has n numbers and lives for the call.
        Some(unsafe { std::slice::from_raw_parts(r.0.list, usize::try_from(r.0.n).ok()?) }.to_vec())
    };
}

impl<T: OptionType> OptionType for Option<T> {
    const TYPE: i32 = T::TYPE;
    const REQUIRED: bool = false;
    fn receive(received: Option<Received<'_>>) -> Option<Self> {
        match received {
            None => Some(None),
            some => T::receive(some).map(Some),
        }
    }
}

/// Declaration of one field, collected by [`options!`](crate::options).
#[doc(hidden)]
#[derive(Debug, Clone, Copy)]
pub struct Declared {
    pub name: &'static str,
    pub doc: &'static str,
    pub default_text: Option<&'static str>,
    pub unit: Option<&'static str>,
    pub min: Option<f64>,
    pub max: Option<f64>,
    pub choices: Option<&'static [*const c_char]>,
}

const fn pointer(text: Option<&'static str>) -> *const c_char {
    match text {
        Some(text) => text.as_ptr().cast(),
        None => std::ptr::null(),
    }
}

/// Returns a bound and its flag; 0 without a bound.
const fn bound(bound: Option<f64>, flag: u32) -> (f64, u32) {
    match bound {
        Some(bound) => (bound, flag),
        None => (0.0, 0),
    }
}

/// Makes a row of the table. The texts must end in NUL; the macro appends it.
#[doc(hidden)]
pub const fn declare<T: OptionType>(declared: Declared) -> OptionDecl {
    let required = T::REQUIRED && declared.default_text.is_none();
    let (min, has_min) = bound(declared.min, option_flag::HAS_MIN);
    let (max, has_max) = bound(declared.max, option_flag::HAS_MAX);
    let (kind, choices) = match declared.choices {
        Some(choices) => (option_type::CHOICE, choices.as_ptr()),
        None => (T::TYPE, std::ptr::null()),
    };
    OptionDecl {
        struct_size: size_of::<OptionDecl>() as u32,
        kind,
        flags: has_min | has_max | if required { option_flag::REQUIRED } else { 0 },
        reserved: 0,
        name: pointer(Some(declared.name)),
        unit: pointer(declared.unit),
        doc: pointer(Some(declared.doc)),
        default_text: pointer(declared.default_text),
        min,
        max,
        choices,
    }
}

/// Declares a struct of options; see the example of the crate.
///
/// Each field is `/// doc`, `name: Type`, optionally `= default`, `, unit "m"`, `, min 0.0`, `, max 1.0`,
/// `, choices ["a", "b"]`, in this order, and a semicolon.
#[macro_export]
macro_rules! options {
    ($(#[$meta:meta])* $vis:vis struct $name:ident { $(
        $(#[doc = $doc:literal])* $field:ident : $ty:ty
        $(= $default:literal)? $(, unit $unit:literal)? $(, min $min:literal)? $(, max $max:literal)?
        $(, choices [$($choice:literal),+ $(,)?])? ;
    )* }) => {
        $(#[$meta])*
        #[derive(Debug, Clone)]
        $vis struct $name { $( $(#[doc = $doc])* pub $field: $ty, )* }

        impl $crate::Options for $name {
            const TABLE: &'static [$crate::abi::OptionDecl] = &[ $(
                $crate::shim::declare::<$ty>($crate::shim::Declared {
                    name: concat!(stringify!($field), "\0"),
                    doc: concat!($($doc, "\n",)* "\0"),
                    default_text: $crate::options!(@text $($default)?),
                    unit: $crate::options!(@plain $($unit)?),
                    min: $crate::options!(@number $($min)?),
                    max: $crate::options!(@number $($max)?),
                    choices: $crate::options!(@choices $($($choice),+)?),
                })
            ),* ];
            fn from_values(values: &$crate::Values<'_>) -> $crate::Result<Self> {
                Ok(Self { $( $field: values.get(
                    const { match ::std::ffi::CStr::from_bytes_with_nul(concat!(stringify!($field), "\0").as_bytes()) {
                        Ok(name) => name,
                        Err(_) => c"",
                    } }
                )?, )* })
            }
        }
    };
    (@text) => { None };
    (@text $default:literal) => { Some(concat!(stringify!($default), "\0")) };
    (@plain) => { None };
    (@plain $text:literal) => { Some(concat!($text, "\0")) };
    (@number) => { None };
    (@number $number:literal) => { Some($number as f64) };
    (@choices) => { None };
    (@choices $($choice:literal),+) => {
        Some(&[$(concat!($choice, "\0").as_ptr().cast(),)+ ::std::ptr::null()])
    };
}

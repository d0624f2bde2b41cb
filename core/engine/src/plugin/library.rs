//! Loading of a plugin library: inspected as data (ELF) first, symbols bound at once (`RTLD_NOW`), never unloaded.
#![allow(unsafe_code, reason = "the loader")]

use std::collections::BTreeMap;
use std::ffi::CString;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use libloading::os::unix::{Library as Handle, RTLD_LOCAL, RTLD_NOW};
use object::read::elf::{ElfFile64, ProgramHeader};
use object::{Object, ObjectSymbol};
use platen_abi as abi;

use super::{Descriptor, PluginError, host_table};

/// A loaded library with one plugin; stays loaded until the program ends.
#[derive(Debug, Clone)]
pub struct Library(Arc<Loaded>);

#[derive(Debug)]
struct Loaded {
    path: PathBuf,
    entry: &'static abi::Entry,
    descriptor: Descriptor,
}

/// Loaded libraries by file, so that each is initialised once.
static LOADED: Mutex<BTreeMap<PathBuf, Library>> = Mutex::new(BTreeMap::new());

impl Library {
    /// Loads a file, or returns the library already loaded from it.
    ///
    /// # Errors
    /// Not a plugin, wrong ABI, failed to load. No code of the library runs before the first two are excluded.
    pub fn load(path: &Path) -> Result<Self, PluginError> {
        let path = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
        let mut loaded = LOADED.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(library) = loaded.get(&path) {
            return Ok(library.clone());
        }
        look(&path)?;
        let library = open(&path)?;
        loaded.insert(path, library.clone());
        Ok(library)
    }

    /// Returns the description of the plugin.
    pub fn descriptor(&self) -> &Descriptor {
        &self.0.descriptor
    }

    /// File.
    pub fn path(&self) -> &Path {
        &self.0.path
    }

    pub(super) fn entry(&self) -> &'static abi::Entry {
        self.0.entry
    }
}

/// Reads the file as data: a truncated library would end the process inside the loader, and another kind of library
/// would run its constructors.
fn look(path: &Path) -> Result<(), PluginError> {
    let not_a_plugin = |why: &str| PluginError::NotAPlugin { path: path.to_path_buf(), why: why.to_owned() };
    let bytes = std::fs::read(path).map_err(|e| not_a_plugin(&format!("it cannot be read ({e})")))?;
    let elf = ElfFile64::<object::Endianness>::parse(bytes.as_slice())
        .map_err(|_| not_a_plugin("no library for this machine, or a damaged one"))?;
    let endian = elf.endian();
    let cut = elf.elf_program_headers().iter().any(|h| {
        let end = h.p_offset(endian).checked_add(h.p_filesz(endian));
        end.is_none_or(|end| end > bytes.len() as u64)
    });
    if cut || elf.elf_section_table().is_empty() {
        return Err(not_a_plugin("the file is cut off"));
    }
    let entries: Vec<&str> = elf
        .dynamic_symbols()
        .filter(|s| s.is_definition())
        .filter_map(|s| s.name().ok())
        .filter(|name| name.starts_with("platen_entry_"))
        .collect();
    let ours = abi::ENTRY_SYMBOL.to_str().unwrap_or_default();
    if entries.contains(&ours) {
        return Ok(());
    }
    Err(match entries.first() {
        Some(other) => PluginError::WrongAbi {
            path: path.to_path_buf(),
            found: other.trim_start_matches("platen_entry_").to_owned(),
            ours: ours.trim_start_matches("platen_entry_").to_owned(),
        },
        None => not_a_plugin("it exports no platen_entry"),
    })
}

/// Returns a loading error with its sources, which contain the reason.
fn reasons(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text = format!("{text}: {cause}");
        source = cause.source();
    }
    text
}

fn open(path: &Path) -> Result<Library, PluginError> {
    let failed = |why: String| PluginError::FailedToLoad { path: path.to_path_buf(), why };
    // SAFETY: the file is a library that says it is a plugin; who may write it may run code, by design.
    let handle =
        unsafe { Handle::open(Some(path), RTLD_NOW | RTLD_LOCAL) }.map_err(|e| failed(reasons(&e)))?;
    // SAFETY: the symbol's name carries the version of its type.
    let entry: &'static abi::Entry = unsafe {
        let symbol = handle.get::<*const abi::Entry>(abi::ENTRY_SYMBOL).map_err(|e| failed(reasons(&e)))?;
        &*symbol.into_raw().cast::<abi::Entry>()
    };
    // Never unloaded: its code may be in use by threads and thread locals until the process ends.
    std::mem::forget(handle);
    let descriptor = check(path, entry)?;
    init(path, entry)?;
    Ok(Library(Arc::new(Loaded { path: path.to_path_buf(), entry, descriptor })))
}

fn check(path: &Path, entry: &abi::Entry) -> Result<Descriptor, PluginError> {
    let wrong_abi = |found: String| PluginError::WrongAbi {
        path: path.to_path_buf(),
        found,
        ours: format!("1.{}", abi::ABI_MINOR),
    };
    let needed = size_of::<abi::Entry>();
    if (entry.struct_size as usize) < needed {
        return Err(wrong_abi(format!("1.{} with a table of {} bytes", entry.abi_minor, entry.struct_size)));
    }
    let not_a_plugin = |why: String| PluginError::NotAPlugin { path: path.to_path_buf(), why };
    // SAFETY: `desc` may be called before `init`; its answer is static data.
    let desc =
        unsafe { (entry.desc)(0).as_ref() }.ok_or_else(|| not_a_plugin("it describes no plugin".into()))?;
    if (desc.struct_size as usize) < size_of::<abi::Desc>() {
        return Err(wrong_abi(format!(
            "1.{} with a descriptor of {} bytes",
            entry.abi_minor, desc.struct_size
        )));
    }
    // SAFETY: the descriptor is the plugin's static data.
    unsafe { Descriptor::read(desc) }.map_err(not_a_plugin)
}

fn init(path: &Path, entry: &abi::Entry) -> Result<(), PluginError> {
    let folder = path.parent().unwrap_or(path).as_os_str().as_bytes();
    let folder = CString::new(folder).unwrap_or_default();
    let mut error = host_table::empty_error();
    // SAFETY: once for each library, before anything else of it; the host's table lives for ever.
    let status = unsafe { (entry.init)(host_table::get(), folder.as_ptr(), &raw mut error) };
    if status == abi::status::OK {
        return Ok(());
    }
    Err(PluginError::FailedToLoad {
        path: path.to_path_buf(),
        why: format!("it refused to start: {}", host_table::message(&error)),
    })
}

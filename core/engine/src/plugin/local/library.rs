//! Loader of a plugin library: the file is checked as data (ELF) first, symbols are bound at once (`RTLD_NOW`), and it
//! is never unloaded.
#![allow(unsafe_code, reason = "the loader")]

use std::collections::BTreeMap;
use std::ffi::CString;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use libloading::os::unix::{Library as Handle, RTLD_LOCAL, RTLD_NOW};
use object::read::elf::{ElfFile64, ProgramHeader};
use object::{Object, ObjectSymbol};
use platen_abi::{self as abi, Table as _};
use sha2::{Digest, Sha256};

use super::super::worker::{LoadFault, LoadedLibrary};
use super::super::{Descriptor, Kind};
use super::{descriptor, host_table};

/// A loaded library; stays loaded until the process ends.
#[derive(Debug)]
pub(in crate::plugin) struct Library {
    entry: abi::Entry,
    about: LoadedLibrary,
}

/// Loaded libraries by file, so that each is initialised once.
static LOADED: Mutex<BTreeMap<PathBuf, Arc<Library>>> = Mutex::new(BTreeMap::new());

impl Library {
    /// Loads a file, or returns the library already loaded from it. No code of the library runs before it is found to
    /// be a plugin of this major version.
    ///
    /// # Errors
    /// Not a plugin, wrong version, failed to load.
    pub(in crate::plugin) fn load(path: &Path) -> Result<Arc<Self>, LoadFault> {
        let mut loaded = LOADED.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(library) = loaded.get(path) {
            return Ok(Arc::clone(library));
        }
        let sha256 = look(path)?;
        let library = Arc::new(open(path, sha256)?);
        loaded.insert(path.to_owned(), Arc::clone(&library));
        Ok(library)
    }

    pub(in crate::plugin) fn about(&self) -> &LoadedLibrary {
        &self.about
    }

    pub(super) fn entry(&self) -> &abi::Entry {
        &self.entry
    }

    /// Lets the library clean up, after the last instance.
    pub(in crate::plugin) fn end(&self) {
        if let Some(deinit) = self.entry.deinit {
            // SAFETY: nothing of the library is called afterwards: the process ends.
            unsafe { deinit() };
        }
    }
}

/// Checks the file as data and returns its SHA-256: a truncated library would end the process inside the loader, and
/// another kind of library would run its constructors.
fn look(path: &Path) -> Result<String, LoadFault> {
    let not_a_plugin = |why: &str| LoadFault::NotAPlugin(why.to_owned());
    let bytes = std::fs::read(path).map_err(|e| not_a_plugin(&format!("it cannot be read ({e})")))?;
    let elf = whole(&bytes).map_err(|why| not_a_plugin(&why))?;
    let entries: Vec<&str> = elf
        .dynamic_symbols()
        .filter(|s| s.is_definition())
        .filter_map(|s| s.name().ok())
        .filter(|name| name.starts_with("platen_entry_"))
        .collect();
    let ours = abi::ENTRY_SYMBOL.to_str().unwrap_or_default();
    if entries.contains(&ours) {
        return Ok(Sha256::digest(&bytes).iter().map(|byte| format!("{byte:02x}")).collect());
    }
    Err(match entries.first() {
        Some(other) => LoadFault::WrongAbi(other.trim_start_matches("platen_entry_").to_owned()),
        None => not_a_plugin("it exports no platen_entry"),
    })
}

/// Returns the names that a library exports, read from the file as data.
///
/// # Errors
/// The reason why it is not a complete library for this machine.
pub fn exported_symbols(path: &Path) -> Result<Vec<String>, String> {
    let bytes = std::fs::read(path).map_err(|e| format!("{} cannot be read ({e})", path.display()))?;
    let elf = whole(&bytes)?;
    let symbols = elf.dynamic_symbols().filter(|symbol| symbol.is_definition() && symbol.is_global());
    Ok(symbols.filter_map(|symbol| symbol.name().ok()).map(str::to_owned).collect())
}

/// Returns the library in these bytes if it is not truncated.
fn whole(bytes: &[u8]) -> Result<ElfFile64<'_, object::Endianness>, String> {
    let elf = ElfFile64::<object::Endianness>::parse(bytes)
        .map_err(|_| "no library for this machine, or a damaged one".to_owned())?;
    let endian = elf.endian();
    let cut = elf.elf_program_headers().iter().any(|h| {
        let end = h.p_offset(endian).checked_add(h.p_filesz(endian));
        end.is_none_or(|end| end > bytes.len() as u64)
    });
    if cut || elf.elf_section_table().is_empty() { Err("the file is cut off".into()) } else { Ok(elf) }
}

/// Returns a loading error together with its sources, which contain the reason.
fn reasons(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text = format!("{text}: {cause}");
        source = cause.source();
    }
    text
}

fn open(path: &Path, sha256: String) -> Result<Library, LoadFault> {
    let failed = |e: libloading::Error| {
        LoadFault::FailedToLoad(format!("{}; install what it needs beside it", reasons(&e)))
    };
    // SAFETY: the file is a library that exports the entry of a plugin; whoever may write it may run code, by design.
    let handle = unsafe { Handle::open(Some(path), RTLD_NOW | RTLD_LOCAL) }.map_err(failed)?;
    // SAFETY: the symbol's name carries the version of its type, and the struct is as long as its struct_size.
    let entry = unsafe {
        let symbol = handle.get::<*const abi::Entry>(abi::ENTRY_SYMBOL).map_err(failed)?;
        abi::Entry::read(symbol.into_raw().cast::<abi::Entry>())
    };
    // Never unloaded: threads and thread-local storage may use its code until the process ends.
    std::mem::forget(handle);
    let entry = entry.map_err(|size| {
        LoadFault::NotAPlugin(format!(
            "its {} has {size} bytes, {} are needed",
            abi::Entry::NAME,
            abi::Entry::LEAST
        ))
    })?;
    let plugins = describe(&entry).map_err(LoadFault::NotAPlugin)?;
    init(path, &entry)?;
    Ok(Library { entry, about: LoadedLibrary { abi_minor: entry.abi_minor, sha256, plugins } })
}

/// Reads the descriptors of all plugins of a library.
fn describe(entry: &abi::Entry) -> Result<Vec<Descriptor>, String> {
    let (Some(_), Some(count), Some(desc), Some(_)) = (entry.init, entry.count, entry.desc, entry.create)
    else {
        return Err(format!("its {} lacks a function", abi::Entry::NAME));
    };
    // SAFETY: both may be called before `init`; the answers are static data.
    let read = |index| unsafe {
        let at = desc(index);
        if at.is_null() { Err("it describes no plugin".to_owned()) } else { descriptor::read(at) }
    };
    // SAFETY: as above.
    let n = unsafe { count() };
    let plugins: Vec<Descriptor> = (0..n.min(MOST)).map(read).collect::<Result<_, String>>()?;
    if plugins.is_empty() {
        return Err("it describes no plugin".into());
    }
    for plugin in &plugins {
        let (inputs, outputs) = formats(plugin.kind);
        if let Some(other) = plugin.inputs.iter().find(|format| !inputs.contains(&format.as_str())) {
            return Err(format!("{} reads {other}; this platen gives {}", plugin.id, inputs.join(", ")));
        }
        if let Some(other) = plugin.outputs.iter().find(|format| !outputs.contains(&format.as_str())) {
            return Err(format!("{} writes {other}; this platen reads {}", plugin.id, outputs.join(", ")));
        }
    }
    Ok(plugins)
}

/// Largest number of plugins in a library.
const MOST: u32 = 64;

/// Returns the formats that the host passes to a kind of plugin, and the formats that it accepts from it.
fn formats(kind: Kind) -> (&'static [&'static str], &'static [&'static str]) {
    match kind {
        Kind::Scanner => (&["platen.window/1"], &["platen.scan/1", "platen.column/2", "platen.scan-end/1"]),
        Kind::Flattening => (&["platen.mesh/2"], &["platen.chart/1"]),
        Kind::Comparison => (&["platen.task/1", "platen.surface/1"], &["platen.findings/1", "platen.grid/1"]),
        Kind::Advisor => (&["platen.record/1", "platen.surface/1"], &["platen.advice/1"]),
    }
}

fn init(path: &Path, entry: &abi::Entry) -> Result<(), LoadFault> {
    let folder = path.parent().unwrap_or(path).as_os_str().as_bytes();
    let folder = CString::new(folder).unwrap_or_default();
    let mut error = host_table::empty_error();
    let Some(init) = entry.init else { return Ok(()) };
    // SAFETY: once for each library, before anything else of it; the host's table lives for ever.
    match unsafe { init(host_table::get(), folder.as_ptr(), &raw mut error) } {
        abi::status::OK => Ok(()),
        status => Err(LoadFault::FailedToLoad(format!(
            "it refused to start: {}",
            host_table::message(&error, status)
        ))),
    }
}

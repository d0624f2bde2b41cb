//! Shared memory between host and worker: sealed memfds, mapped on both sides.
//!
//! A seal prevents either side from resizing it, which would kill the other by SIGBUS. An input is also sealed against
//! new writable mappings before it is sent: the host has written it, the worker can only read it.
#![allow(unsafe_code, reason = "maps memory")]

use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::ptr::NonNull;

use rustix::fs::{MemfdFlags, SealFlags, fcntl_add_seals, fstat, ftruncate, memfd_create};
use rustix::mm::{MapFlags, ProtFlags, mmap, mmap_anonymous, munmap};

/// Size of a page of memory.
pub(super) const PAGE: usize = 4096;

/// Mapped memfd with an unmapped page before and behind it: a write past its end is stopped by the processor.
#[derive(Debug)]
pub(in crate::plugin) struct SharedMemory {
    fd: OwnedFd,
    data: NonNull<u8>,
    bytes: usize,
    writable: bool,
}

// SAFETY: plain memory that stays mapped as long as the struct lives; who writes where is settled by the users.
unsafe impl Send for SharedMemory {}
// SAFETY: as above.
unsafe impl Sync for SharedMemory {}

impl SharedMemory {
    /// Creates zeroed memory that cannot be resized.
    pub(in crate::plugin) fn new(bytes: usize) -> io::Result<Self> {
        let fd = memfd_create("platen", MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING)?;
        ftruncate(&fd, bytes as u64)?;
        fcntl_add_seals(&fd, SealFlags::SHRINK | SealFlags::GROW)?;
        Self::map(fd, bytes, true)
    }

    /// Maps memory of the other side.
    pub(super) fn attach(fd: OwnedFd, bytes: u64, writable: bool) -> io::Result<Self> {
        let held = fstat(&fd)?.st_size;
        match usize::try_from(bytes) {
            Ok(size) if u64::try_from(held).is_ok_and(|held| held >= bytes) => Self::map(fd, size, writable),
            _ => Err(io::Error::other(format!("{bytes} bytes of memory were named, {held} are there"))),
        }
    }

    fn map(fd: OwnedFd, bytes: usize, writable: bool) -> io::Result<Self> {
        let whole = bytes.next_multiple_of(PAGE) + 2 * PAGE;
        let access = if writable { ProtFlags::READ | ProtFlags::WRITE } else { ProtFlags::READ };
        // SAFETY: a fresh reservation, of which the middle is then replaced.
        let data = unsafe {
            let reserved =
                mmap_anonymous(std::ptr::null_mut(), whole, ProtFlags::empty(), MapFlags::PRIVATE)?;
            let middle = reserved.cast::<u8>().add(PAGE);
            if bytes > 0 {
                let mapped = mmap(middle.cast(), bytes, access, MapFlags::SHARED | MapFlags::FIXED, &fd, 0);
                if let Err(error) = mapped {
                    let _ = munmap(reserved, whole);
                    return Err(error.into());
                }
            }
            middle
        };
        let data = NonNull::new(data).ok_or_else(|| io::Error::other("mapped to nothing"))?;
        Ok(Self { fd, data, bytes, writable })
    }

    /// Forbids further writable mappings, so that the content is final.
    pub(in crate::plugin) fn seal(&self) -> io::Result<()> {
        Ok(fcntl_add_seals(&self.fd, SealFlags::FUTURE_WRITE | SealFlags::SEAL)?)
    }

    pub(in crate::plugin) fn len(&self) -> usize {
        self.bytes
    }

    pub(in crate::plugin) fn data(&self) -> *mut u8 {
        self.data.as_ptr()
    }

    /// Copies a part; `None` beyond the end. The other side may write at the same time, so the copy is checked, not the
    /// original.
    pub(super) fn copy(&self, offset: u64, bytes: u64, into: &mut [u8]) -> Option<()> {
        let (start, n) = (usize::try_from(offset).ok()?, usize::try_from(bytes).ok()?);
        if start.checked_add(n)? > self.bytes || into.len() != n {
            return None;
        }
        // SAFETY: within the mapping as just checked.
        unsafe { std::ptr::copy_nonoverlapping(self.data.as_ptr().add(start), into.as_mut_ptr(), n) };
        Some(())
    }
}

impl AsFd for SharedMemory {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.fd.as_fd()
    }
}

impl AsMut<[u8]> for SharedMemory {
    fn as_mut(&mut self) -> &mut [u8] {
        assert!(self.writable, "inputs are read-only");
        // SAFETY: mapped for writing; before it is sent no other process maps it.
        unsafe { std::slice::from_raw_parts_mut(self.data.as_ptr(), self.bytes) }
    }
}

impl Drop for SharedMemory {
    fn drop(&mut self) {
        let whole = self.bytes.next_multiple_of(PAGE) + 2 * PAGE;
        // SAFETY: the reservation of `map`, which nothing uses after the struct.
        let _ = unsafe { munmap(self.data.as_ptr().sub(PAGE).cast(), whole) };
    }
}

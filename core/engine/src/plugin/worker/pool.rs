//! Frame pool of a plugin: parts of one shared memory, allocated by the worker and released by the host.
//!
//! The first page holds one number: the count of frames that the host has copied, in the order in which they were
//! emitted. If the pool is full, the worker waits for that number to change (futex). A slow host therefore slows the
//! plugin down, and no frame is lost. The lowest part that fits is allocated, so that the same pages are used again;
//! this saves the page faults of new ones.
#![allow(unsafe_code, reason = "a number in shared memory")]

use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use rustix::thread::futex;

use super::memory::{PAGE, SharedMemory};
use super::wire::timespec;

/// Period at which a waiting thread checks whether its job was cancelled.
const POLL: Duration = Duration::from_millis(20);

/// Distance between parts: no two share a cache line.
const GRAIN: usize = 64;

/// Returns the count of frames that the host has taken.
fn taken(memory: &SharedMemory) -> &AtomicU32 {
    // SAFETY: the first page is mapped, aligned, and used for this number alone; any value is valid.
    unsafe { AtomicU32::from_ptr(memory.data().cast()) }
}

/// Counts a frame as copied, on the host's side.
pub(super) fn release(memory: &SharedMemory) {
    let taken = taken(memory);
    taken.fetch_add(1, Ordering::Release);
    let _ = futex::wake(taken, futex::Flags::empty(), 1);
}

/// Part of the pool: an extent.
#[derive(Debug, Clone, Copy)]
pub(in crate::plugin) struct Extent {
    pub(in crate::plugin) offset: usize,
    pub(in crate::plugin) bytes: usize,
}

impl Extent {
    /// Returns the number of bytes that it occupies in the pool.
    fn held(self) -> usize {
        self.bytes.max(1).next_multiple_of(GRAIN)
    }
}

/// Worker's side of the pool.
#[derive(Debug)]
pub(in crate::plugin) struct Pool {
    memory: SharedMemory,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    /// Free parts: offset, length.
    free: BTreeMap<usize, usize>,
    /// Frames in transit to the host, in order, and the count at which each has been copied.
    emitted: VecDeque<(u32, Extent)>,
    count: u32,
}

impl State {
    fn give(&mut self, extent: Extent) {
        let (mut offset, mut length) = (extent.offset, extent.held());
        if let Some(next) = self.free.remove(&(offset + length)) {
            length += next;
        }
        if let Some((before, n)) = self.free.range(..offset).next_back().map(|(o, n)| (*o, *n))
            && before + n == offset
        {
            (offset, length) = (before, n + length);
        }
        self.free.insert(offset, length);
    }

    fn take(&mut self, bytes: usize) -> Option<Extent> {
        let wanted = Extent { offset: 0, bytes };
        let (offset, length) =
            self.free.iter().find(|(_, length)| **length >= wanted.held()).map(|(o, n)| (*o, *n))?;
        self.free.remove(&offset);
        if length > wanted.held() {
            self.free.insert(offset + wanted.held(), length - wanted.held());
        }
        Some(Extent { offset, bytes })
    }

    /// Frees the parts that the host has copied.
    fn collect(&mut self, taken: u32) {
        while let Some((count, extent)) = self.emitted.front().copied()
            && taken.wrapping_sub(count) as i32 >= 0
        {
            self.emitted.pop_front();
            self.give(extent);
        }
    }
}

impl Pool {
    pub(super) fn new(memory: SharedMemory) -> Self {
        let room = memory.len().saturating_sub(PAGE) / GRAIN * GRAIN;
        let count = taken(&memory).load(Ordering::Acquire);
        let state = State { free: BTreeMap::from([(PAGE, room)]), emitted: VecDeque::new(), count };
        Self { memory, state: Mutex::new(state) }
    }

    /// Returns an extent; waits for one until `stopped`. `None` when stopped, or when the plugin itself holds the
    /// missing parts.
    pub(in crate::plugin) fn allocate(&self, bytes: usize, stopped: impl Fn() -> bool) -> Option<Extent> {
        let taken = taken(&self.memory);
        loop {
            let seen = taken.load(Ordering::Acquire);
            {
                let mut state = self.state();
                state.collect(seen);
                if let Some(extent) = state.take(bytes) {
                    return Some(extent);
                }
                if state.emitted.is_empty() || stopped() {
                    return None;
                }
            }
            // Returns at once if the count has changed since.
            let _ = futex::wait(taken, futex::Flags::empty(), seen, Some(&timespec(POLL)));
        }
    }

    /// Frees an extent that will not be emitted.
    pub(in crate::plugin) fn free(&self, extent: Extent) {
        self.state().give(extent);
    }

    /// Sends an extent: `send` passes it to the host. The host copies extents in the order of these calls.
    pub(in crate::plugin) fn emit<T>(&self, extent: Extent, send: impl FnOnce() -> T) -> T {
        let mut state = self.state();
        state.count = state.count.wrapping_add(1);
        let count = state.count;
        state.emitted.push_back((count, extent));
        send()
    }

    pub(in crate::plugin) fn data(&self, extent: Extent) -> *mut u8 {
        // SAFETY: extents lie in the memory.
        unsafe { self.memory.data().add(extent.offset) }
    }

    fn state(&self) -> std::sync::MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use std::os::fd::AsFd;

    use super::*;

    #[test]
    fn extents_never_overlap_and_all_come_back() {
        let seed = std::time::UNIX_EPOCH.elapsed().map_or(0, |t| t.as_nanos() as u64);
        println!("seed {seed}");
        let mut random = fastrand::Rng::with_seed(seed);
        let pool = Pool::new(SharedMemory::new(64 << 10).unwrap());
        let mut held: Vec<Extent> = Vec::new();
        let mut under_way = VecDeque::new();
        for _ in 0..20_000 {
            match random.u32(0..4) {
                0 | 1 => {
                    if let Some(new) = pool.allocate(random.usize(0..9000), || true) {
                        let apart = |old: &Extent| {
                            old.offset + old.held() <= new.offset || new.offset + new.held() <= old.offset
                        };
                        assert!(held.iter().chain(&under_way).all(apart));
                        assert!(new.offset >= PAGE && new.offset + new.bytes <= pool.memory.len());
                        held.push(new);
                    }
                }
                2 if !held.is_empty() => {
                    let extent = held.swap_remove(random.usize(0..held.len()));
                    if random.bool() {
                        pool.free(extent);
                    } else {
                        pool.emit(extent, || under_way.push_back(extent));
                    }
                }
                _ => {
                    if under_way.pop_front().is_some() {
                        release(&pool.memory);
                    }
                }
            }
        }
        held.into_iter().for_each(|extent| pool.free(extent));
        under_way.iter().for_each(|_| release(&pool.memory));
        assert_eq!(pool.allocate(60 << 10, || true).map(|extent| extent.offset), Some(PAGE));
    }

    #[test]
    fn a_full_pool_waits_for_the_host_and_gives_up_with_the_job() {
        let memory = SharedMemory::new(PAGE + 1024).unwrap();
        let other =
            SharedMemory::attach(memory.as_fd().try_clone_to_owned().unwrap(), memory.len() as u64, true)
                .unwrap();
        let pool = Pool::new(memory);
        let all = pool.allocate(1024, || false).unwrap();
        // The plugin holds all of it: no part can be freed.
        assert!(pool.allocate(1, || false).is_none());
        pool.emit(all, || ());
        assert!(pool.allocate(1, || true).is_none());
        std::thread::scope(|scope| {
            let waiting = scope.spawn(|| pool.allocate(1024, || false));
            release(&other);
            assert!(waiting.join().unwrap().is_some());
        });
    }
}

//! Sandbox of a worker: resource limits for every plugin, and isolation from the system for those that need no access
//! to it.
//!
//! Flattenings and comparisons are pure functions. Once they are created, they lose access to every file, socket,
//! program and other process:
//!
//! - Landlock (landlock.io) removes access to files and ports where the kernel has it.
//! - seccomp ends a process that makes a system call other than those for memory, threads, clocks and its open
//!   descriptors.
//!
//! Scanner drivers are not isolated: their libraries need devices, sockets and licences.
//!
//! Limits: descriptors that a plugin opened before it was created stay open.
#![allow(unsafe_code, reason = "a signal handler")]

use std::collections::BTreeMap;

use landlock::{
    ABI, Access, AccessFs, AccessNet, CompatLevel, Compatible, Ruleset, RulesetAttr, RulesetError,
    RulesetStatus,
};
use rustix::process::{Resource, Rlimit, nice, setrlimit};
use seccompiler::{
    BpfProgram, SeccompAction, SeccompCmpArgLen, SeccompCmpOp, SeccompCondition, SeccompFilter, SeccompRule,
    apply_filter_all_threads,
};

use super::Limits;

/// Lower priority than the host, which communicates with the press.
const NICE: i32 = 5;

/// Sets the resource limits of this process.
pub(super) fn limit(limits: &Limits) {
    let set = |resource, most| {
        let _ = setrlimit(resource, Rlimit { current: Some(most), maximum: Some(most) });
    };
    set(Resource::Data, limits.memory);
    set(Resource::Nofile, limits.files);
    set(Resource::Core, 0);
    let _ = nice(NICE);
}

/// Removes access to files from this thread and the threads that it starts; returns the isolation in force.
pub(super) fn files() -> super::Confinement {
    let restrict = || -> Result<bool, RulesetError> {
        let newest = ABI::V5;
        let ruleset = Ruleset::default()
            .set_compatibility(CompatLevel::BestEffort)
            .handle_access(AccessFs::from_all(newest))?
            .handle_access(AccessNet::from_all(newest))?;
        Ok(ruleset.create()?.restrict_self()?.ruleset != RulesetStatus::NotEnforced)
    };
    super::Confinement { landlock: restrict().unwrap_or(false), seccomp: false }
}

/// System calls of computing: memory, threads, clocks, open descriptors, exit.
const ALLOWED: &[i64] = &[
    libc::SYS_read,
    libc::SYS_write,
    libc::SYS_readv,
    libc::SYS_writev,
    libc::SYS_pread64,
    libc::SYS_lseek,
    libc::SYS_fstat,
    libc::SYS_close,
    libc::SYS_fcntl,
    libc::SYS_recvmsg,
    libc::SYS_sendmsg,
    libc::SYS_ppoll,
    libc::SYS_mmap,
    libc::SYS_munmap,
    libc::SYS_mprotect,
    libc::SYS_mremap,
    libc::SYS_madvise,
    libc::SYS_brk,
    libc::SYS_membarrier,
    libc::SYS_futex,
    libc::SYS_set_robust_list,
    libc::SYS_get_robust_list,
    libc::SYS_rseq,
    libc::SYS_clone,
    libc::SYS_clone3,
    libc::SYS_gettid,
    libc::SYS_getpid,
    libc::SYS_tgkill,
    libc::SYS_sched_yield,
    libc::SYS_sched_getaffinity,
    libc::SYS_getcpu,
    libc::SYS_prctl,
    libc::SYS_rt_sigaction,
    libc::SYS_rt_sigprocmask,
    libc::SYS_rt_sigreturn,
    libc::SYS_sigaltstack,
    libc::SYS_clock_gettime,
    libc::SYS_clock_getres,
    libc::SYS_clock_nanosleep,
    libc::SYS_nanosleep,
    libc::SYS_gettimeofday,
    libc::SYS_getrandom,
    libc::SYS_getrusage,
    libc::SYS_sysinfo,
    libc::SYS_restart_syscall,
    libc::SYS_exit,
    libc::SYS_exit_group,
];
#[cfg(target_arch = "x86_64")]
const ALLOWED_HERE: &[i64] = &[libc::SYS_poll, libc::SYS_time, libc::SYS_arch_prctl];
#[cfg(not(target_arch = "x86_64"))]
const ALLOWED_HERE: &[i64] = &[];

/// Removes access to every other system call from all threads; returns whether the filter is in force.
pub(super) fn system_calls() -> bool {
    name_what_was_called();
    let arch = std::env::consts::ARCH;
    let program = |calls: &[i64], others: SeccompAction, these: SeccompAction| -> Option<BpfProgram> {
        let mut rules: BTreeMap<i64, Vec<_>> = calls.iter().map(|call| (*call, Vec::new())).collect();
        rules.extend(calls.contains(&libc::SYS_fstat).then(status_of_descriptors).flatten());
        SeccompFilter::new(rules, others, these, arch.try_into().ok()?).ok()?.try_into().ok()
    };
    // A new process differs from a new thread in an argument that only `clone` shows: the C library falls back to it.
    let threads = fork_free(arch);
    let clone3 =
        program(&[libc::SYS_clone3], SeccompAction::Allow, SeccompAction::Errno(libc::ENOSYS as u32));
    let calls = program(&[ALLOWED, ALLOWED_HERE].concat(), SeccompAction::Trap, SeccompAction::Allow);
    let all = [threads, clone3, calls];
    all.iter()
        .all(|program| program.as_ref().is_some_and(|program| apply_filter_all_threads(program).is_ok()))
}

/// Status of an open descriptor, which the C library reads before it prints; never the status of a path.
fn status_of_descriptors() -> Option<(i64, Vec<SeccompRule>)> {
    let flag = libc::AT_EMPTY_PATH as u64;
    let empty = SeccompCondition::new(3, SeccompCmpArgLen::Dword, SeccompCmpOp::MaskedEq(flag), flag).ok()?;
    Some((libc::SYS_newfstatat, vec![SeccompRule::new(vec![empty]).ok()?]))
}

/// Returns a filter under which `clone` makes threads only.
fn fork_free(arch: &str) -> Option<BpfProgram> {
    let thread = libc::CLONE_THREAD as u64;
    let process =
        SeccompCondition::new(0, SeccompCmpArgLen::Qword, SeccompCmpOp::MaskedEq(thread), 0).ok()?;
    let rules = BTreeMap::from([(libc::SYS_clone, vec![SeccompRule::new(vec![process]).ok()?])]);
    SeccompFilter::new(rules, SeccompAction::Allow, SeccompAction::Trap, arch.try_into().ok()?)
        .ok()?
        .try_into()
        .ok()
}

/// Installs a handler that prints the number of a forbidden system call before the process ends.
fn name_what_was_called() {
    // SAFETY: a handler that is safe in a signal: it writes, restores the default and raises the signal again.
    unsafe {
        let mut action: libc::sigaction = std::mem::zeroed();
        action.sa_sigaction = named as extern "C" fn(_, _, _) as usize;
        action.sa_flags = libc::SA_SIGINFO;
        libc::sigaction(libc::SIGSYS, &raw const action, std::ptr::null_mut());
    }
}

extern "C" fn named(_: libc::c_int, info: *const libc::siginfo_t, _: *const libc::c_void) {
    /// Offset of `si_syscall` in `siginfo_t` on 64-bit Linux: after three ints, padding and a pointer.
    const SI_SYSCALL: usize = 24;
    let mut text = *b"system call      is closed to flattenings and comparisons once they are created\n";
    // SAFETY: the kernel's struct; the calls are safe in a signal.
    unsafe {
        let mut number = info.cast::<u8>().add(SI_SYSCALL).cast::<libc::c_int>().read();
        for place in (12..16).rev() {
            if number > 0 || place == 15 {
                text[place] = b'0' + (number % 10) as u8;
            }
            number /= 10;
        }
        libc::write(2, text.as_ptr().cast(), text.len());
        libc::signal(libc::SIGSYS, libc::SIG_DFL);
        libc::raise(libc::SIGSYS);
    }
}

/// Ends the process without running any more of its code.
pub(super) fn end_at_once() -> ! {
    // SAFETY: ends the process.
    unsafe { libc::_exit(0) }
}

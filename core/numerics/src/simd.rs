//! Vector instructions: dispatch to the widest ones, and isolation from kernels that leave their registers dirty.

/// Runs `work` compiled for the widest vector registers of this processor.
///
/// Everything that is to be vectorised must be inlined into `work`. Results are the same to the last bit as without.
#[inline(always)]
pub fn dispatch_simd<T>(work: impl FnOnce() -> T) -> T {
    pulp::Arch::new().dispatch(work)
}

/// Runs work on faer's dense kernels on a thread of its own, and waits for it.
///
/// The kernels (assembly of private-gemm-x86 0.1.22) return without `vzeroupper` and leave the upper halves of the vector registers dirty. From
/// then on every SSE instruction of that thread between the AVX ones of the C library's `sin`, `exp` and `log` costs a transition: outline
/// and extraction were measured 5 to 10 times slower after the first plate. The registers go with the thread; starting one
/// costs 0.05 ms.
pub fn on_own_thread<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    std::thread::scope(|scope| match scope.spawn(work).join() {
        Ok(done) => done,
        Err(panic) => std::panic::resume_unwind(panic),
    })
}

//! Run-time dispatch to the widest vector registers of the processor.

/// Runs `work` compiled for the widest vector registers of this processor. Code to be vectorised must be inlined into
/// it. Results are equal to the last bit with and without it.
///
/// Its five users together save 6 to 8 % of the total of `platen bench tables` (8 % of extraction, 12 % of the fit; AMD
/// EPYC, alternating runs).
#[inline(always)]
pub fn dispatch_simd<T>(work: impl FnOnce() -> T) -> T {
    pulp::Arch::new().dispatch(work)
}

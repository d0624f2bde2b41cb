//! Clean-up of vector registers after kernels that leave their upper halves set.

/// Guard that clears the upper halves of the vector registers when it is dropped (`vzeroupper`).
///
/// A guard must exist wherever faer's dense kernels run: their assembly (private-gemm-x86 0.1.22) returns without the
/// instruction. On Intel processors every later SSE instruction between the AVX instructions of the C library's `sin`,
/// `exp` and `log` then costs a transition: outline and extraction of the next plate were measured 5 to 10 times
/// slower. AMD processors are not affected.
#[derive(Debug, Default)]
pub(crate) struct ClearVectorRegisters;

impl Drop for ClearVectorRegisters {
    #[inline]
    fn drop(&mut self) {
        #[cfg(target_arch = "x86_64")]
        if let Some(avx) = pulp::core_arch::x86::Avx::try_new() {
            avx._mm256_zeroupper();
        }
    }
}

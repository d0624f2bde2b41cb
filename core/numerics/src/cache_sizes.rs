//! Sizes of the processor's caches, by which faer's dense kernels divide their work.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};

use crate::vector_registers::ClearVectorRegisters;

/// Least size of a product that is no special case of faer.
const SIZE: usize = 32;

/// Has faer read the sizes of the caches, which it keeps. On processors without AVX2 it reads them from files (`/sys/devices/system/cpu`) at its first large product: a program
/// that gives up opening files, as a confined plugin does after its creation, calls this before.
pub fn read() {
    let _clear = ClearVectorRegisters;
    let zero = Mat::<f64>::zeros(SIZE, SIZE);
    let mut product = Mat::<f64>::zeros(SIZE, SIZE);
    matmul(product.as_mut(), Accum::Replace, zero.as_ref(), zero.as_ref(), 1.0, Par::Seq);
}

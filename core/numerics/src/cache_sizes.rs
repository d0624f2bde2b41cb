//! Cache sizes of the processor, by which faer's dense kernels divide their work: early reading of them.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};

use crate::vector_registers::ClearVectorRegisters;

/// Least size of a product that faer does not treat as a special case.
const SIZE: usize = 32;

/// Causes faer to read the sizes of the caches, which it stores.
///
/// On processors without AVX2 faer reads them from files (`/sys/devices/system/cpu`) at its first large product. A
/// program that later drops its permission to open files, such as a confined plugin after its creation, must call this
/// function first.
pub fn read() {
    let _clear = ClearVectorRegisters;
    let zero = Mat::<f64>::zeros(SIZE, SIZE);
    let mut product = Mat::<f64>::zeros(SIZE, SIZE);
    matmul(product.as_mut(), Accum::Replace, zero.as_ref(), zero.as_ref(), 1.0, Par::Seq);
}

//! Numerics of platen: linear solvers, splines, smoothing and sampling, without reference to a plate or a scan.
//!
//! The modules in order of use; each uses only those above it:
//!
//! | module | method |
//! |---|---|
//! | [`simd`], `vector_registers`, [`cache_sizes`] | dispatch to wide vector registers; clean-up after the dense kernels; early reading of the cache sizes |
//! | [`union_find`], [`random`], [`normal_distribution`], [`median`] | disjoint sets, SplitMix64, the error function, median by selection |
//! | [`join`] | concurrent execution of two functions |
//! | [`adaptive_metropolis`] | mean and covariance of an unnormalised density (Vihola 2012) |
//! | [`sparse`] | sparse Cholesky on meshes, ordered by nested dissection |
//! | [`uniform_knots`], [`penalised_curve`], [`tensor_spline`] | uniform cubic B-splines: basis, smoothing curve, surface |
//! | [`block_banded`] | Cholesky factor of a tensor spline's normal matrix: layout and variances |
//! | [`block_banded_cholesky`] | Cholesky factor of a tensor spline's normal matrix, and the band of its inverse |
//! | [`reml`], `normal_equations`, [`spline_fit`] | penalised least squares on scattered points, smoothing by restricted maximum likelihood |
//!
//! Every routine except [`join`] runs on one thread, and its results are the same to the last bit in each run, whatever
//! the load of the machine. Lengths have no unit here. The crate reads no clock and no files except those of
//! [`cache_sizes`], and random numbers follow from a given seed.

pub mod adaptive_metropolis;
pub mod block_banded;
#[cfg(feature = "solvers")]
pub mod block_banded_cholesky;
#[cfg(feature = "solvers")]
pub mod cache_sizes;
pub mod join;
pub mod median;
pub mod normal_distribution;
#[cfg(feature = "solvers")]
mod normal_equations;
pub mod penalised_curve;
pub mod random;
#[cfg(feature = "solvers")]
pub mod reml;
#[cfg(feature = "solvers")]
pub mod simd;
#[cfg(feature = "solvers")]
pub mod sparse;
#[cfg(feature = "solvers")]
pub mod spline_fit;
pub mod tensor_spline;
pub mod uniform_knots;
pub mod union_find;
#[cfg(feature = "solvers")]
mod vector_registers;

//! Surface as plain numbers, to be stored or sent across a library boundary.

use platen_numerics::block_banded::BlockBandedFactor;
use platen_numerics::tensor_spline::TensorSpline;
use platen_numerics::uniform_knots::UniformKnots;

use super::Surface;
use super::mask::Mask;

/// Data of a [`Surface`]. Control values lie v outer, u inner.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SurfaceParts {
    /// Knots of u: uniform, three beyond each end.
    pub knots_u: Vec<f64>,
    /// Knots of v.
    pub knots_v: Vec<f64>,
    /// Control points of the mid-surface, metres, scanner frame.
    pub control: Vec<[f64; 3]>,
    /// Thickness of the plate, metres.
    pub thickness: f64,
    /// Cholesky factor of the control values' precision: for each row of the net across its longer axis (v when they
    /// are equal) the blocks that couple it to itself and to the three rows before, each square over the shorter axis,
    /// column-major.
    pub precision_factor: Vec<f64>,
    /// Per control value: covariances with the control values up to three away, 7 x 7, v outer, u inner, metres
    /// squared.
    pub covariance: Vec<[f64; 49]>,
    /// Share of the covariance that is scatter of the scan, mean over the plate; above 0, at most 1.
    pub noise_share: f32,
    /// Number of mask cells along u and along v.
    pub mask_cells: [usize; 2],
    /// Per mask cell, v outer, u inner: whether it was seen.
    pub seen: Vec<bool>,
}

/// Error: the parts do not fit together; the program that made them is at fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("surface: {what}; the program that sent this surface is at fault, report it")]
pub struct SurfaceError {
    /// The first fault found.
    pub what: &'static str,
}

impl Surface {
    /// Checks the parts and puts them together.
    ///
    /// # Errors
    /// [`SurfaceError`] when lengths do not fit, knots are not uniform or a number is not finite.
    pub fn from_parts(parts: SurfaceParts) -> Result<Self, SurfaceError> {
        let fault = |what| SurfaceError { what };
        let u = UniformKnots::from_knots(&parts.knots_u).ok_or(fault("knots of u are not uniform"))?;
        let v = UniformKnots::from_knots(&parts.knots_v).ok_or(fault("knots of v are not uniform"))?;
        let (n_u, n_v) = (u.n_coefficients(), v.n_coefficients());
        if parts.control.len() != n_u * n_v || parts.covariance.len() != n_u * n_v {
            return Err(fault("the control net does not fit its knots"));
        }
        let numbers = parts.control.iter().flatten().chain(parts.covariance.iter().flatten());
        if !numbers.chain(&parts.precision_factor).chain([&parts.thickness]).all(|x| x.is_finite()) {
            return Err(fault("a number is not finite"));
        }
        if !(parts.noise_share > 0.0 && parts.noise_share <= 1.0) {
            return Err(fault("the share of noise is not above 0 to 1"));
        }
        let precision = BlockBandedFactor::from_blocks(n_u, n_v, parts.precision_factor)
            .ok_or(fault("the factor does not fit the control net"))?;
        let mask = Mask::from_cells(u.end(), v.end(), parts.mask_cells, parts.seen)
            .ok_or(fault("the mask does not fit its cells"))?;
        let spline = TensorSpline { u, v, control: parts.control };
        let SurfaceParts { thickness, covariance, noise_share, .. } = parts;
        Ok(Self { spline, thickness, precision, covariance, noise_share, mask })
    }

    /// Returns the parts of this surface.
    #[must_use]
    pub fn to_parts(&self) -> SurfaceParts {
        SurfaceParts {
            knots_u: self.spline.u.knots(),
            knots_v: self.spline.v.knots(),
            control: self.spline.control.clone(),
            thickness: self.thickness,
            precision_factor: self.precision.blocks().to_vec(),
            covariance: self.covariance.clone(),
            noise_share: self.noise_share,
            mask_cells: self.mask.cells(),
            seen: self.mask.seen_cells().to_vec(),
        }
    }
}

//! St. Venant-Kirchhoff membrane energy of the map from the flat plate to the measured mesh: value, gradient, projected
//! Hessian.
//!
//! The unknowns are the material positions x = (u, v) of the mesh's vertices; the positions in space are given. In a
//! triangle the deformation gradient F = [P1 - P0, P2 - P0] M^-1, M = [x1 - x0, x2 - x0], is constant, and
//!
//! ```text
//! C = F'F = M^-T G M^-1      G: the triangle's metric in space
//! E = (C - I) / 2            Green's strain
//! psi = 1/2 S : E            S = ((1 - nu) E + nu tr(E) I) / (1 - nu^2), plane stress, Young's modulus 1
//! W = sum over triangles of psi det(M) / 2
//! ```
//!
//! W has the unit of an area; multiplied by Young's modulus and the thickness it is the membrane energy. A movement of
//! the material positions by dx = H x changes C by -(H'C + C H) and the area by tr H, so that dW = A (psi I - C S) : H,
//! with Eshelby's stress in brackets. In the frame where C is diagonal the second derivative separates into a 2 x 2
//! quadratic form of the stretches (H11, H22) and one of the shears (H12, H21). Each is projected onto the positive
//! semidefinite forms by dropping its negative eigenvalue. For small strain the forms are those of linear elasticity.

use platen_numerics::sparse::Spd;
use platen_shape::DiskMesh;
use platen_shape::flatten::signed_area;

/// Membrane of one mesh.
pub(crate) struct Membrane<'a> {
    pub(crate) triangles: &'a [[u32; 3]],
    /// Metric of each triangle in space: (e1.e1, e1.e2, e2.e2) of its sides from the first corner.
    pub(crate) metrics: Vec<[f64; 3]>,
    poisson: f64,
}

/// Symmetric 2 x 2 tensor: 11, 22, 12.
pub(crate) type Sym = [f64; 3];

/// Strain of a triangle, and its place on the flat plate.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Strained {
    /// Area on the flat plate.
    pub(crate) area: f64,
    /// Green's strain.
    pub(crate) strain: Sym,
    /// Material position of its centre.
    pub(crate) centre: [f64; 2],
}

/// State of one triangle at given material positions.
pub(crate) struct State {
    /// Area on the flat plate.
    pub(crate) area: f64,
    /// Gradients of the three linear shape functions (hat functions).
    pub(crate) hats: [[f64; 2]; 3],
    stretch: Sym,
    stress: Sym,
    /// Energy density.
    density: f64,
}

impl<'a> Membrane<'a> {
    pub(crate) fn new(mesh: &'a DiskMesh, poisson: f64) -> Self {
        let metric = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| mesh.vertices[v as usize]);
            let (e1, e2) = (b - a, c - a);
            [e1.dot(&e1), e1.dot(&e2), e2.dot(&e2)]
        };
        Self { triangles: &mesh.triangles, metrics: mesh.triangles.iter().map(metric).collect(), poisson }
    }

    /// Returns the energy at the material positions `x`; infinite if a triangle is inverted.
    pub(crate) fn energy(&self, x: &[[f64; 2]]) -> f64 {
        let mut sum = 0.0;
        for (t, metric) in self.triangles.iter().zip(&self.metrics) {
            match self.state(t, metric, x) {
                Some(state) => sum += state.area * state.density,
                None => return f64::INFINITY,
            }
        }
        sum
    }

    /// Adds the derivative of the energy by each material position to `gradient`.
    pub(crate) fn add_gradient(&self, x: &[[f64; 2]], gradient: &mut [[f64; 2]]) {
        for (t, metric) in self.triangles.iter().zip(&self.metrics) {
            let Some(state) = self.state(t, metric, x) else { continue };
            let eshelby = state.eshelby();
            for (v, hat) in t.iter().zip(state.hats) {
                let slot = &mut gradient[*v as usize];
                slot[0] += state.area * (eshelby[0] * hat[0] + eshelby[2] * hat[1]);
                slot[1] += state.area * (eshelby[2] * hat[0] + eshelby[1] * hat[1]);
            }
        }
    }

    /// Adds the positive part of each triangle's second derivative to `spd`, whose nodes are the vertices.
    pub(crate) fn add_hessian(&self, x: &[[f64; 2]], spd: &mut Spd<2>) {
        for (t, metric) in self.triangles.iter().zip(&self.metrics) {
            let Some(state) = self.state(t, metric, x) else { continue };
            let forms = Forms::of(&state, self.poisson).positive();
            for (a, b) in [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)] {
                spd.add(t[a], t[b], forms.block(state.hats[a], state.hats[b], state.area));
            }
        }
    }

    /// Returns the strain of every triangle, in the mesh's order.
    pub(crate) fn strains(&self, x: &[[f64; 2]]) -> Vec<Strained> {
        let of_triangle = |(t, metric): (&[u32; 3], &Sym)| {
            let [a, b, c] = t.map(|v| x[v as usize]);
            let centre = [0, 1].map(|k| (a[k] + b[k] + c[k]) / 3.0);
            let state = self.state(t, metric, x);
            let (area, strain) = state.map_or((0.0, [0.0; 3]), |state| (state.area, state.strain()));
            Strained { area, strain, centre }
        };
        self.triangles.iter().zip(&self.metrics).map(of_triangle).collect()
    }

    pub(crate) fn state(&self, t: &[u32; 3], &[g11, g12, g22]: &Sym, x: &[[f64; 2]]) -> Option<State> {
        let corners = t.map(|v| x[v as usize]);
        let area = signed_area(corners);
        if area.is_nan() || area <= 0.0 {
            return None;
        }
        let [a, b, c] = corners;
        let hat = |p: [f64; 2], q: [f64; 2]| [(p[1] - q[1]) / (2.0 * area), (q[0] - p[0]) / (2.0 * area)];
        let hats = [hat(b, c), hat(c, a), hat(a, b)];
        // M^-1 has the gradients of the second and third hat function as its rows.
        let [_, r, s] = hats;
        let entry =
            |i: usize, j: usize| r[i] * g11 * r[j] + (r[i] * s[j] + s[i] * r[j]) * g12 + s[i] * g22 * s[j];
        let stretch = [entry(0, 0), entry(1, 1), entry(0, 1)];
        let strain = green(stretch);
        let stress = stress(strain, self.poisson);
        let density = 0.5 * (stress[0] * strain[0] + stress[1] * strain[1] + 2.0 * stress[2] * strain[2]);
        Some(State { area, hats, stretch, stress, density })
    }
}

impl State {
    fn strain(&self) -> Sym {
        green(self.stretch)
    }

    /// Returns psi I - C S, symmetric because C and S commute.
    pub(crate) fn eshelby(&self) -> Sym {
        let ([c11, c22, c12], [s11, s22, s12]) = (self.stretch, self.stress);
        [
            self.density - (c11 * s11 + c12 * s12),
            self.density - (c12 * s12 + c22 * s22),
            -(c11 * s12 + c12 * s22),
        ]
    }
}

fn green(stretch: Sym) -> Sym {
    [0.5 * (stretch[0] - 1.0), 0.5 * (stretch[1] - 1.0), 0.5 * stretch[2]]
}

/// Returns the plane stress of a strain, Young's modulus 1.
pub(crate) fn stress([e11, e22, e12]: Sym, poisson: f64) -> Sym {
    let scale = 1.0 / (1.0 - poisson * poisson);
    [scale * (e11 + poisson * e22), scale * (e22 + poisson * e11), scale * (1.0 - poisson) * e12]
}

/// Second derivative of a triangle's energy per area: two quadratic forms in H, in the principal frame of C.
pub(crate) struct Forms {
    /// Cosine and sine of the angle from u to the first axis of the frame.
    turn: [f64; 2],
    /// Form in (H11, H22).
    stretches: Sym,
    /// Form in (H12, H21).
    shears: Sym,
}

impl Forms {
    pub(crate) fn of(state: &State, poisson: f64) -> Self {
        let [c11, c22, c12] = state.stretch;
        let (mean, half) = (0.5 * (c11 + c22), 0.5 * (c11 - c22));
        let radius = (half * half + c12 * c12).sqrt();
        // Half the angle whose cosine is half / radius. Where C is a multiple of I any frame is principal.
        let cos = if radius > 0.0 { (0.5 * (1.0 + half / radius)).max(0.0).sqrt() } else { 1.0 };
        let sin = (1.0 - cos * cos).max(0.0).sqrt().copysign(c12);
        let [c1, c2] = [mean + radius, mean - radius];
        let [s1, s2, _] = stress(green([c1, c2, 0.0]), poisson);
        let ([p1, p2], psi) = ([c1 * s1, c2 * s2], state.density);
        let young = 1.0 / (1.0 - poisson * poisson);
        let shear = 0.5 * (1.0 - poisson) * young;
        let stretches =
            [p1 + young * c1 * c1, p2 + young * c2 * c2, psi - p1 - p2 + young * poisson * c1 * c2];
        let shears = [c1 * s2 + shear * c1 * c1, c2 * s1 + shear * c2 * c2, p1 + p2 - psi + shear * c1 * c2];
        Self { turn: [cos, sin], stretches, shears }
    }

    /// Returns the nearest positive semidefinite forms.
    pub(crate) fn positive(self) -> Self {
        Self { stretches: positive_part(self.stretches), shears: positive_part(self.shears), ..self }
    }

    /// Returns the 2 x 2 Hessian block of two vertices with the given hat gradients.
    pub(crate) fn block(&self, a: [f64; 2], b: [f64; 2], area: f64) -> [[f64; 2]; 2] {
        let [cos, sin] = self.turn;
        let turned = |g: [f64; 2]| [cos * g[0] + sin * g[1], cos * g[1] - sin * g[0]];
        let (a, b) = (turned(a), turned(b));
        let ([aa, dd, ad], [bb, ee, be]) = (self.stretches, self.shears);
        let k11 = area * (aa * a[0] * b[0] + bb * a[1] * b[1]);
        let k22 = area * (ee * a[0] * b[0] + dd * a[1] * b[1]);
        let k12 = area * (ad * a[0] * b[1] + be * a[1] * b[0]);
        let k21 = area * (ad * a[1] * b[0] + be * a[0] * b[1]);
        // Rotation back: R K R' with the axes of the frame as columns of R.
        let (m11, m12) = (cos * k11 - sin * k21, cos * k12 - sin * k22);
        let (m21, m22) = (sin * k11 + cos * k21, sin * k12 + cos * k22);
        [[m11 * cos - m12 * sin, m11 * sin + m12 * cos], [m21 * cos - m22 * sin, m21 * sin + m22 * cos]]
    }
}

/// Returns the nearest positive semidefinite form.
pub(crate) fn positive_part([a, d, b]: Sym) -> Sym {
    let (mean, radius) = (0.5 * (a + d), (0.5 * (a - d)).hypot(b));
    let [high, low] = [mean + radius, mean - radius];
    if low >= 0.0 {
        return [a, d, b];
    }
    if high <= 0.0 {
        return [0.0; 3];
    }
    // high times the projector on its eigenvector, (form - low I) / (high - low).
    let share = high / (high - low);
    [share * (a - low), share * (d - low), share * b]
}

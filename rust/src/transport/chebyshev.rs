//! Factors of the Chebyshev iteration.

/// `(keep, add)` of each step of `x ← x + keep · (x − the x before) + add · D⁻¹ (b − A x)`, which damps
/// the eigenvalues of D⁻¹A that lie between two.
pub(super) fn factors<const DEGREE: usize>([low, high]: [f32; 2]) -> [(f32, f32); DEGREE] {
    let (center, half) = (f32::midpoint(low, high), (high - low) / 2.0);
    let mut rho = half / center;
    let mut factors = [(0.0, 1.0 / center); DEGREE];
    for factors in factors.iter_mut().skip(1) {
        let next = 1.0 / (2.0 * center / half - rho);
        *factors = (next * rho, 2.0 * next / half);
        rho = next;
    }
    factors
}

//! Vectors in the plane: complex numbers, and three phases.

pub(super) const ROOT_3: f64 = 1.732_050_807_568_877_2;
const HALF_ROOT_3: f64 = 0.5 * ROOT_3;

/// The phases' axes in the stator's frame.
pub(super) const AXES: [[f64; 2]; 3] = [[1.0, 0.0], [-0.5, HALF_ROOT_3], [-0.5, -HALF_ROOT_3]];

/// Returns the weighted sum of the axes: 3/2 of the weights' Clarke transform.
#[inline(always)] // in each period
pub(super) fn along_axes([a, b, c]: [f64; 3]) -> [f64; 2] {
    [a - 0.5 * (b + c), HALF_ROOT_3 * (b - c)]
}

/// Returns the three phases of a vector.
#[inline(always)] // in each period
pub(super) fn phases([alpha, beta]: [f64; 2]) -> [f64; 3] {
    let half_root_3_beta = HALF_ROOT_3 * beta;
    [
        alpha,
        half_root_3_beta - 0.5 * alpha,
        -half_root_3_beta - 0.5 * alpha,
    ]
}

/// Returns the greatest magnitude of a vector's three phases.
#[inline(always)] // in each period
pub(super) fn largest([alpha, beta]: [f64; 2]) -> f64 {
    let (alpha, beta) = (alpha.abs(), beta.abs());
    // Of b and c, the one whose parts have the same sign.
    alpha.max(HALF_ROOT_3 * beta + 0.5 * alpha)
}

/// Returns the product of two vectors as complex numbers.
#[inline(always)] // in each period
pub(super) fn turn([a, b]: [f64; 2], [cos, sin]: [f64; 2]) -> [f64; 2] {
    [a * cos - b * sin, a * sin + b * cos]
}

/// Returns the product with the conjugate: the vector `a` seen from a direction.
#[inline(always)] // in each period
pub(super) fn back([a, b]: [f64; 2], [cos, sin]: [f64; 2]) -> [f64; 2] {
    [a * cos + b * sin, b * cos - a * sin]
}

/// Returns their scalar product.
#[inline(always)] // in each period
pub(super) fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_phase_is_that_of_the_three() {
        for turns in 0..24 {
            let (sin, cos) = libm::sincos(f64::from(turns) * 0.27);
            let vector = [3.0 * cos, 3.0 * sin];
            let wanted = phases(vector).map(f64::abs).into_iter().fold(0.0, f64::max);
            assert!((largest(vector) - wanted).abs() < 1e-12, "{vector:?}");
        }
    }
}

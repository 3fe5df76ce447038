//! Rotations as unit quaternions, four numbers instead of nine.

use super::frame::{choose, dot, times};
use super::svd3;
use crate::simd::Real;

/// The rotation of the unit quaternion (x, y, z, w), w the scalar part.
#[inline(always)]
pub fn rotation_from_quaternion<T: Real>([x, y, z, w]: [T; 4]) -> [[T; 3]; 3] {
    let (x2, y2, z2) = (x + x, y + y, z + z);
    let (xx, yy, zz) = (x * x2, y * y2, z * z2);
    let (wx, wy, wz) = (w * x2, w * y2, w * z2);
    let one = T::one();
    [
        [one - (yy + zz), x.mul_add(y2, -wz), x.mul_add(z2, wy)],
        [x.mul_add(y2, wz), one - (xx + zz), y.mul_add(z2, -wx)],
        [x.mul_add(z2, -wy), y.mul_add(z2, wx), one - (xx + yy)],
    ]
}

/// A unit quaternion (x, y, z, w) of a proper rotation, w the scalar part; its sign is arbitrary.
///
/// All ten products of 4 q q^T are linear in the rotation; the row with the largest diagonal entry (at least 1) is
/// normalised (Shepperd 1978).
#[inline(always)]
pub fn quaternion_from_rotation<T: Real>(r: [[T; 3]; 3]) -> [T; 4] {
    let [[r00, r01, r02], [r10, r11, r12], [r20, r21, r22]] = r;
    let (sum, difference) = (r00 + r11, r00 - r11);
    let (up, down) = (r22 + 1.0, -r22 + T::one());
    let (xx, yy, zz, ww) = (down + difference, down - difference, up - sum, up + sum);
    let (xy, xz, yz) = (r01 + r10, r02 + r20, r12 + r21);
    let (wx, wy, wz) = (r21 - r12, r02 - r20, r10 - r01);
    let xy_row = choose(xx.ge(yy), [xx, xy, xz, wx], [xy, yy, yz, wy]);
    let zw_row = choose(zz.ge(ww), [xz, yz, zz, wz], [wx, wy, wz, ww]);
    let row = choose(xx.max(yy).ge(zz.max(ww)), xy_row, zw_row);
    times(row, dot(row, row).rsqrt())
}

/// The signed decomposition of a 3x3 matrix with U and V as unit quaternions (x, y, z, w): (U, s, V), eleven numbers.
#[inline(always)]
pub fn svd3_quat<T: Real>(a: [[T; 3]; 3]) -> ([T; 4], [T; 3], [T; 4]) {
    let svd = svd3(a);
    (quaternion_from_rotation(svd.u), svd.s, quaternion_from_rotation(svd.v))
}

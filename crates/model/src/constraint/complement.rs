//! What is orthogonal to a few vectors.

/// An orthonormal basis of the complement of some vectors of n numbers: the last columns of the orthogonal factor of
/// Householder's decomposition. A vector that is in the span of those before it, to rounding of the longest, adds nothing.
/// O(n^2) numbers.
pub(super) fn complement(vectors: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let n = vectors.first().map_or(0, Vec::len);
    let mut a = vectors.to_vec();
    let length = |c: &[f64]| c.iter().map(|c| c * c).sum::<f64>().sqrt();
    let longest = a.iter().map(|c| length(c)).fold(0.0, f64::max);
    let least = 4.0 * n as f64 * f64::EPSILON * longest;
    let mut mirrors: Vec<Vec<f64>> = Vec::with_capacity(a.len());
    for j in 0..a.len() {
        let rank = mirrors.len();
        let left = a[j].get(rank..).map_or(0.0, length);
        if !(left > least) {
            continue;
        }
        let mut w = vec![0.0; n];
        w[rank..].copy_from_slice(&a[j][rank..]);
        w[rank] += if w[rank] < 0.0 { -left } else { left };
        a[j + 1..].iter_mut().for_each(|column| mirror(&w, column));
        mirrors.push(w);
    }
    let column = |j: usize| {
        let mut e = vec![0.0; n];
        e[j] = 1.0;
        mirrors.iter().rev().for_each(|w| mirror(w, &mut e));
        e
    };
    (mirrors.len()..n).map(column).collect()
}

/// x <- x - 2 w (w . x) / |w|^2
fn mirror(w: &[f64], x: &mut [f64]) {
    let squared: f64 = w.iter().map(|c| c * c).sum();
    let along = 2.0 * w.iter().zip(&*x).map(|(w, x)| w * x).sum::<f64>() / squared;
    x.iter_mut().zip(w).for_each(|(x, w)| *x -= along * w);
}

#[cfg(test)]
mod tests {
    use super::complement;

    fn check(vectors: &[Vec<f64>], wanted: usize) {
        let basis = complement(vectors);
        assert_eq!(basis.len(), wanted);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        for (i, b) in basis.iter().enumerate() {
            assert!(vectors.iter().all(|v| dot(v, b).abs() < 1e-15 * 10.0 * dot(v, v).sqrt().max(1.0)));
            assert!(
                basis.iter().enumerate().all(|(j, c)| (dot(b, c) - f64::from(u8::from(i == j))).abs() < 1e-15 * 10.0)
            );
        }
    }

    #[test]
    fn it_is_orthonormal_and_orthogonal() {
        let vectors = [vec![1.0; 6], vec![0.3, -1.0, 2.0, 0.1, -0.7, -0.7], vec![1.0, 0.0, 0.5, -2.0, 0.25, 0.25]];
        check(&vectors, 3);
    }

    #[test]
    fn vectors_that_depend_on_others_count_for_nothing() {
        let a = vec![0.3, -1.0, 2.0, 0.1, -0.7];
        let twice: Vec<f64> = a.iter().map(|a| -2.0 * a).collect();
        check(&[a.clone(), twice, vec![0.0; 5], vec![1.0; 5]], 3);
        check(&[a, vec![1e9; 5]], 3);
        check(&[vec![0.0; 4]], 4);
        check(&[vec![1.0, 0.0], vec![0.0, 1.0]], 0);
        check(&[], 0);
    }
}

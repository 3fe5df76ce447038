//! Random numbers that are the same on every machine.

/// The generator SplitMix64 (Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014).
#[derive(Clone, Debug)]
pub struct SplitMix(u64);

impl SplitMix {
    /// A generator whose numbers depend on `seed` only.
    pub fn new(seed: u64) -> Self {
        SplitMix(seed)
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [low, high).
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        let unit = (self.bits() >> 11) as f64 / (1_u64 << 53) as f64;
        low + (high - low) * unit
    }

    /// Uniform in [low, high) in the logarithm; both positive.
    pub fn log_uniform(&mut self, low: f64, high: f64) -> f64 {
        self.uniform(low.ln(), high.ln()).exp()
    }

    /// Standard normal (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform(0.0, 1.0)).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform(0.0, 1.0)).cos()
    }

    /// Uniform in 0 .. n; 0 if n is 0.
    pub fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.bits()) * n as u128) >> 64) as usize
    }

    /// N numbers uniform in [low, high).
    pub fn array<const N: usize>(&mut self, low: f64, high: f64) -> [f64; N] {
        std::array::from_fn(|_| self.uniform(low, high))
    }

    /// A random rotation, row by row, uniform (a normalised quaternion of normal numbers).
    pub fn rotation(&mut self) -> [[f64; 3]; 3] {
        let mut q: [f64; 4] = std::array::from_fn(|_| self.normal());
        let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt();
        if norm < 1e-12 {
            return [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        }
        q = q.map(|x| x / norm);
        let [w, x, y, z] = q;
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_sequence() {
        let mut r = SplitMix::new(1_234_567);
        assert_eq!(
            [r.bits(), r.bits(), r.bits()],
            [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423]
        );
    }

    #[test]
    fn moments_and_bounds() {
        let mut r = SplitMix::new(1);
        let n = 100_000;
        let (mut mean, mut square, mut seen) = (0.0, 0.0, [0; 5]);
        for _ in 0..n {
            let u = r.uniform(-2.0, 4.0);
            assert!((-2.0..4.0).contains(&u));
            mean += u / n as f64;
            square += r.normal().powi(2) / n as f64;
            seen[r.below(5)] += 1;
        }
        assert!((mean - 1.0).abs() < 0.02 && (square - 1.0).abs() < 0.02, "{mean} {square}");
        assert!(seen.iter().all(|c| (*c as f64 / n as f64 - 0.2).abs() < 0.01), "{seen:?}");
    }

    #[test]
    fn rotations_are_proper() {
        let mut r = SplitMix::new(2);
        for _ in 0..100 {
            let q = r.rotation();
            for i in 0..3 {
                for j in 0..3 {
                    let dot: f64 = (0..3).map(|n| q[i][n] * q[j][n]).sum();
                    assert!((dot - f64::from(u8::from(i == j))).abs() < 1e-14);
                }
            }
            let det = q[0][0] * (q[1][1] * q[2][2] - q[1][2] * q[2][1])
                - q[0][1] * (q[1][0] * q[2][2] - q[1][2] * q[2][0])
                + q[0][2] * (q[1][0] * q[2][1] - q[1][1] * q[2][0]);
            assert!((det - 1.0).abs() < 1e-14);
        }
    }
}

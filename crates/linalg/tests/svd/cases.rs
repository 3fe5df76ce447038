//! Matrices that a decomposition must survive, from a seeded generator.

/// Splitmix64.
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    /// Uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }
    /// Uniform in [-1, 1).
    pub fn signed(&mut self) -> f64 {
        2.0 * self.uniform() - 1.0
    }
    pub fn below(&mut self, n: u64) -> u64 {
        self.bits() % n
    }
    /// 10^x, x uniform in [low, high).
    pub fn power(&mut self, low: f64, high: f64) -> f64 {
        10f64.powf(low + (high - low) * self.uniform())
    }
    pub fn matrix<const R: usize, const C: usize>(&mut self) -> [[f64; C]; R] {
        [[0.0; C]; R].map(|row| row.map(|_| self.signed()))
    }
    /// Rows are orthonormal to rounding: Gram-Schmidt, twice.
    pub fn orthonormal<const N: usize>(&mut self) -> [[f64; N]; N] {
        let mut q: [[f64; N]; N] = self.matrix();
        for k in 0..N {
            for _ in 0..2 {
                for j in 0..k {
                    let along: f64 = (0..N).map(|c| q[k][c] * q[j][c]).sum();
                    for c in 0..N {
                        q[k][c] -= along * q[j][c];
                    }
                }
                let length = q[k].iter().map(|x| x * x).sum::<f64>().sqrt();
                q[k] = q[k].map(|x| x / length);
            }
        }
        q
    }
}

pub fn product<const R: usize, const K: usize, const C: usize>(a: &[[f64; K]; R], b: &[[f64; C]; K]) -> [[f64; C]; R] {
    std::array::from_fn(|r| std::array::from_fn(|c| (0..K).map(|k| a[r][k] * b[k][c]).sum()))
}

/// Stretches of a class, descending or not, of either sign.
fn stretches<const C: usize>(random: &mut Random) -> [f64; C] {
    let tiny = random.power(-20.0, 0.0);
    let equal = [1.0, 1.0 + tiny, 1.0 - tiny * random.uniform()];
    let three = match random.below(15) {
        0 => [1.0, 1.0, 1.0],
        1 => equal,
        2 => [1.0, 1.0 + tiny, random.power(-18.0, 2.0)],
        3 => [1.0, 1e-5, 1e-10],
        4 => [1.0, random.power(-20.0, 0.0), random.power(-20.0, 0.0)],
        5 => [1.0, random.uniform(), 0.0],
        6 => [1.0, 0.0, 0.0],
        7 => [1.0, tiny, tiny],
        8 => [1.0, 1.0, -1.0],
        9 => [1.0, 1.0, 0.0],
        10 => [1.0, 1.0, tiny],
        11 => [1.0, 1.0 + tiny, -1.0],
        12 => [1.0, 0.5 + tiny, -0.5],
        13 => {
            // The middle square is almost the mean of the others: which eigenvalue stands apart is undecided.
            let third = random.uniform();
            [1.0, (0.5 * (1.0 + third * third)).sqrt() + random.signed() * tiny, third]
        }
        _ => [random.signed(), random.signed(), random.signed()],
    };
    let turn = random.below(3) as usize;
    let mut s = std::array::from_fn(|k| three[(k + turn) % 3]);
    if random.below(4) == 0 {
        s[0] = -s[0];
    }
    s
}

/// The next matrix: of one of many classes.
pub fn matrix<const R: usize, const C: usize>(random: &mut Random) -> [[f64; C]; R] {
    let identity = |r: usize, c: usize| f64::from(u8::from(r == c));
    match random.below(12) {
        0 => random.matrix(),
        1 => {
            // Near the identity.
            let size = random.power(-18.0, 0.0);
            std::array::from_fn(|r| std::array::from_fn(|c| identity(r, c) + size * random.signed()))
        }
        2 => {
            // Near a rotation or reflection.
            let (q, size) = (random.orthonormal::<R>(), random.power(-18.0, -2.0));
            std::array::from_fn(|r| std::array::from_fn(|c| q[r][c] + size * random.signed()))
        }
        3 => {
            // Small whole numbers: many are exactly singular, repeated or zero.
            [[0.0; C]; R].map(|row| row.map(|_| random.below(3) as f64 - 1.0))
        }
        4 => {
            // Entries of all magnitudes.
            [[0.0; C]; R].map(|row| row.map(|_| random.signed() * random.power(-30.0, 0.0)))
        }
        5 => {
            // A diagonal of stretches, exactly.
            let s = stretches::<C>(random);
            std::array::from_fn(|r| std::array::from_fn(|c| if r == c { s[c] } else { 0.0 }))
        }
        6 => {
            // Sparse, of all magnitudes.
            [[0.0; C]; R].map(|row| {
                row.map(|_| if random.below(2) == 0 { 0.0 } else { random.signed() * random.power(-200.0, 0.0) })
            })
        }
        _ => {
            let (u, v, s) = (random.orthonormal::<R>(), random.orthonormal::<C>(), stretches::<C>(random));
            let scaled: [[f64; C]; R] = std::array::from_fn(|r| std::array::from_fn(|c| u[r][c] * s[c]));
            let size = match random.below(8) {
                0 => 1e-150,
                1 => 1e150,
                2 => random.power(-290.0, 290.0),
                _ => 1.0,
            };
            product(&scaled, &v).map(|row| row.map(|x| x * size))
        }
    }
}

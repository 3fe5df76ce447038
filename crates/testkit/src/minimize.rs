//! Minimisation without derivatives, by looking everywhere.

/// A point and the value there.
#[derive(Clone, Debug)]
pub struct Minimum {
    /// The point.
    pub x: Vec<f64>,
    /// The value.
    pub value: f64,
}

/// Nelder and Mead's simplex method from a simplex of size `size` at `start`, restarted until a restart gains
/// nothing; f may be +inf. Points are exact to about 1e-8 of their size, values to rounding.
pub fn nelder_mead(f: &dyn Fn(&[f64]) -> f64, start: &[f64], size: f64) -> Minimum {
    let mut best = Minimum { x: start.to_vec(), value: f(start) };
    let mut size = size;
    for _ in 0..20 {
        let next = simplex(f, &best.x, size);
        let gain = best.value - next.value;
        if next.value <= best.value {
            best = next;
        }
        size = (size * 0.1).max(1e-6);
        if gain <= best.value.abs() * 1e-15 {
            break;
        }
    }
    best
}

fn simplex(f: &dyn Fn(&[f64]) -> f64, start: &[f64], size: f64) -> Minimum {
    let n = start.len();
    let at = |x: Vec<f64>| {
        let value = f(&x);
        Minimum { x, value: if value.is_nan() { f64::INFINITY } else { value } }
    };
    let mut corners = vec![at(start.to_vec())];
    for i in 0..n {
        let mut x = start.to_vec();
        x[i] += size;
        corners.push(at(x));
    }
    let between =
        |a: &[f64], b: &[f64], t: f64| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a + t * (b - a)).collect() };
    for _ in 0..2000 {
        corners.sort_by(|a, b| a.value.total_cmp(&b.value));
        let spread: f64 = (1..=n)
            .flat_map(|c| (0..n).map(move |i| (c, i)))
            .fold(0.0, |m: f64, (c, i)| m.max((corners[c].x[i] - corners[0].x[i]).abs()));
        if spread < 1e-11 {
            break;
        }
        let mut centre = vec![0.0; n];
        for c in &corners[..n] {
            for i in 0..n {
                centre[i] += c.x[i] / n as f64;
            }
        }
        let worst = corners[n].clone();
        let reflected = at(between(&centre, &worst.x, -1.0));
        let next = if reflected.value < corners[0].value {
            let expanded = at(between(&centre, &worst.x, -2.0));
            if expanded.value < reflected.value { expanded } else { reflected }
        } else if reflected.value < corners[n - 1].value {
            reflected
        } else {
            let t = if reflected.value < worst.value { -0.5 } else { 0.5 };
            at(between(&centre, &worst.x, t))
        };
        if next.value < worst.value {
            corners[n] = next;
        } else {
            let first = corners[0].x.clone();
            for c in &mut corners[1..] {
                *c = at(between(&first, &c.x, 0.5));
            }
        }
    }
    corners.sort_by(|a, b| a.value.total_cmp(&b.value));
    corners.swap_remove(0)
}

/// The global minimum of energy(s) + k/2 |s - v|^2 over the box [low, high]^K, K = 1, 2 or 3: all points of a grid of
/// `cells` cells a side, then [`nelder_mead`] from the best eight that are no neighbours.
pub fn prox_by_force(energy: &dyn Fn(&[f64]) -> f64, v: &[f64], k: f64, low: f64, high: f64, cells: usize) -> Minimum {
    let objective = |s: &[f64]| {
        if s.iter().any(|x| !(low..=high).contains(x)) {
            return f64::INFINITY;
        }
        energy(s) + 0.5 * k * s.iter().zip(v).map(|(s, v)| (s - v) * (s - v)).sum::<f64>()
    };
    let (n, cell) = (v.len(), (high - low) / cells as f64);
    let side = cells + 1;
    let mut grid: Vec<Minimum> = (0..side.pow(n as u32))
        .map(|index| {
            let x: Vec<f64> = (0..n).map(|i| low + cell * ((index / side.pow(i as u32)) % side) as f64).collect();
            let value = objective(&x);
            Minimum { x, value }
        })
        .filter(|m| m.value.is_finite())
        .collect();
    grid.sort_by(|a, b| a.value.total_cmp(&b.value));
    let mut starts: Vec<Minimum> = Vec::new();
    for m in grid {
        let far = |s: &Minimum| s.x.iter().zip(&m.x).any(|(a, b)| (a - b).abs() > 1.5 * cell);
        if starts.len() < 8 && starts.iter().all(far) {
            starts.push(m);
        }
    }
    let mut best = Minimum { x: v.to_vec(), value: f64::INFINITY };
    for s in starts {
        let m = nelder_mead(&objective, &s.x, 0.5 * cell);
        if m.value < best.value {
            best = m;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_valley_of_rosenbrock() {
        let f = |x: &[f64]| (1.0 - x[0]).powi(2) + 100.0 * (x[1] - x[0] * x[0]).powi(2);
        let m = nelder_mead(&f, &[-1.2, 1.0], 0.5);
        assert!((m.x[0] - 1.0).abs() < 1e-6 && (m.x[1] - 1.0).abs() < 1e-6 && m.value < 1e-12, "{m:?}");
    }

    #[test]
    fn the_deeper_of_two_wells_in_every_dimension() {
        // (x^2 - 1)^2 has wells at +-1; the prox of v = -0.2 pulls to the left one.
        for n in 1..=3 {
            let energy = |s: &[f64]| s.iter().map(|x| (x * x - 1.0).powi(2)).sum();
            let m = prox_by_force(&energy, &vec![-0.2; n], 0.5, -2.0, 2.0, 24);
            for x in &m.x {
                let slope = 4.0 * x * (x * x - 1.0) + 0.5 * (x + 0.2);
                assert!(*x < -0.9 && slope.abs() < 1e-5, "{m:?}");
            }
        }
    }

    #[test]
    fn a_quadratic_in_closed_form_and_a_bound() {
        let energy = |s: &[f64]| s.iter().map(|x| (x - 1.0).powi(2)).sum();
        let m = prox_by_force(&energy, &[3.0, -5.0], 2.0, 0.0, 4.0, 20);
        assert!((m.x[0] - 2.0).abs() < 1e-7 && m.x[1].abs() < 1e-7, "{m:?}");
    }
}

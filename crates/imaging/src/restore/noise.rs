//! Figures of noise.

/// The standard deviation of white noise in an image: the median of |mixed second differences| over .6745 * 6, in each
/// channel, and the root mean square of the channels. Smooth parts, slopes and straight edges along rows and columns leave
/// nothing in these differences (Immerkaer 1996), and the median does not see what is rare (Donoho and Johnstone 1994). Fine
/// texture counts as noise, so that it is an upper estimate for sharp images; of blurred ones it is exact to a few percent.
///
/// None where the image is less than 3 pixels wide or high.
pub fn noise_level(width: usize, height: usize, channels: &[Vec<f64>]) -> Option<f64> {
    level(width, height, channels, |difference, _| Some(difference.abs()))
}

/// The same for counts of light, whose variance is s^2 times their value: s, the root of the value of one count. Differences are
/// divided by the root of the mean of the nine pixels, weighed by the squares of their factors.
///
/// None where the image is less than 3 pixels wide or high, or nowhere positive.
pub fn count_level(width: usize, height: usize, channels: &[Vec<f64>]) -> Option<f64> {
    level(width, height, channels, |difference, mean| (mean > 0.0).then(|| difference.abs() / mean.sqrt()))
}

/// By what is made of a mixed second difference and a mean.
fn level(width: usize, height: usize, channels: &[Vec<f64>], of: impl Fn(f64, f64) -> Option<f64>) -> Option<f64> {
    /// The third quartile of |normal numbers|'s half: their median.
    const MEDIAN: f64 = 0.674_489_750_196_082;
    /// The norm of the 3 x 3 stencil (1, -2, 1)^T (1, -2, 1).
    const STENCIL: f64 = 6.0;
    if width < 3 || height < 3 || channels.is_empty() {
        return None;
    }
    let mut square = 0.0;
    for plane in channels {
        let mut sizes = Vec::with_capacity((width - 2) * (height - 2));
        for rows in plane.chunks_exact(width).collect::<Vec<_>>().windows(3) {
            let second = |row: &[f64], j: usize| row[j - 1] - 2.0 * row[j] + row[j + 1];
            let mean = |row: &[f64], j: usize| (row[j - 1] + 4.0 * row[j] + row[j + 1]) / 6.0;
            for j in 1..width - 1 {
                let difference = second(rows[0], j) - 2.0 * second(rows[1], j) + second(rows[2], j);
                let mean = (mean(rows[0], j) + 4.0 * mean(rows[1], j) + mean(rows[2], j)) / 6.0;
                sizes.extend(of(difference, mean));
            }
        }
        if sizes.is_empty() {
            return None;
        }
        let middle = sizes.len() / 2;
        let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
        square += (*median / (MEDIAN * STENCIL)).powi(2);
    }
    Some((square / channels.len() as f64).sqrt())
}

/// 10 log10(1 / mean squared difference), in dB, for values in [0, 1]; infinite for equal images.
pub fn psnr(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let pairs = || a.iter().flatten().zip(b.iter().flatten());
    let n = pairs().count().max(1) as f64;
    -10.0 * (pairs().map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / n).log10()
}

//! Whether acceleration pays: what it has cost against what it has gained.

/// Iterations that are plain at first, and between the first trials of acceleration.
const PLAIN: usize = 24;
/// Times that the wait after a trial that did not pay is doubled, at most.
const DOUBLINGS: usize = 6;
/// What acceleration may cost beyond its gain: this part of the cost so far, or of what plain iterations would cost
/// for six digits more, if that is more ..
const PART: f64 = 0.03;
const SIX_DIGITS: f64 = 13.8;
/// (but not of more than so many times the cost so far) ..
const AHEAD: f64 = 10.0;
/// .. and so many plain iterations, which the first ones take to show what they are worth: a history has to be gathered.
const GRACE: f64 = 2.5;
/// Gains are judged by the best of so many residuals, since those of accelerated points rise and fall.
const RECENT: usize = 3;
/// Accelerated iterations that a trial takes to show anything: none begins before what may be lost pays for them.
const TRIAL: f64 = 6.0;
/// A plain iteration that lowers the logarithm of the residual by less stands still.
const STILL: f64 = 1e-3;

/// Keeps account of an iteration that can be accelerated: it is run plainly for a while, which shows the rate of its
/// residual, then accelerated for as long as the gain is worth the price; else plainly again, and longer each time.
///
/// Costs are in plain iterations, and counted, never timed: with what plain iterations have shown their rate to be, what
/// acceleration has cost beyond what plain iterations with the same gain would have is at most 3 % of all the cost so far, or
/// of what six digits more would cost plainly, two and a half iterations, and the last one that did not pay. The dearer an
/// accelerated iteration is and the faster plain ones converge, the later the first trial. The same run makes the same
/// decisions on any machine.
#[derive(Clone, Debug)]
pub struct Account {
    price: f64, // of an accelerated iteration
    cost: f64,  // so far
    lost: f64,  // what earlier trials cost beyond their gain
    phase: Phase,
    failures: usize,
    plain: usize,
    accelerated: usize,
}

#[derive(Clone, Debug)]
enum Phase {
    /// Logarithms of residuals after plain iterations, until there are so many.
    Plain { logs: Vec<f64>, until: usize },
    /// Where it began, the rate of plain iterations then, the last residuals, and what it has cost.
    Accelerated { from: f64, rate: f64, recent: Vec<f64>, spent: f64 },
}

impl Account {
    /// For accelerated iterations that cost so many plain ones when their history is full.
    pub fn new(price: f64) -> Self {
        Account {
            price,
            cost: 0.0,
            lost: 0.0,
            phase: Phase::Plain { logs: Vec::new(), until: PLAIN },
            failures: 0,
            plain: 0,
            accelerated: 0,
        }
    }

    /// For another run of the same iteration.
    #[must_use]
    pub fn renewed(&self) -> Self {
        Self::new(self.price)
    }

    /// Whether the next iteration is to be accelerated.
    pub fn accelerates(&self) -> bool {
        matches!(self.phase, Phase::Accelerated { .. })
    }

    /// The cost so far, in plain iterations.
    pub fn cost(&self) -> f64 {
        self.cost
    }

    /// Plain and accelerated iterations so far.
    pub fn iterations(&self) -> (usize, usize) {
        (self.plain, self.accelerated)
    }

    /// Takes the cost of an iteration and its residual, a square.
    pub fn note(&mut self, cost: f64, square: f64) {
        self.cost += cost;
        let log = 0.5 * square.ln();
        match &mut self.phase {
            Phase::Plain { logs, until } => {
                self.plain += 1;
                logs.push(log);
                let rate = rate(logs);
                if logs.len() >= *until && self.lost + TRIAL * self.price <= allowance(self.cost, rate) {
                    let from = log;
                    self.phase = Phase::Accelerated { from, rate, recent: Vec::new(), spent: 0.0 };
                }
            }
            Phase::Accelerated { from, rate, recent, spent } => {
                self.accelerated += 1;
                *spent += cost;
                if recent.len() == RECENT {
                    recent.remove(0);
                }
                recent.push(log);
                let gain = *from - recent.iter().copied().fold(f64::INFINITY, f64::min);
                // A NaN is no gain.
                let worth = if gain > 0.0 { gain / *rate } else { 0.0 };
                let debt = *spent - worth;
                if debt + self.lost > allowance(self.cost, *rate) || !gain.is_finite() {
                    self.lost += debt.max(0.0);
                    let until = PLAIN << self.failures.min(DOUBLINGS);
                    self.failures += 1;
                    self.phase = Phase::Plain { logs: Vec::new(), until };
                } else if debt < 0.0 && self.failures > 0 && *spent > self.cost / 2.0 {
                    // It pays now: what was learnt from failures is of another time.
                    self.failures = 0;
                }
            }
        }
    }
}

/// What acceleration may cost beyond its gain.
fn allowance(cost: f64, rate: f64) -> f64 {
    PART * cost.max((SIX_DIGITS / rate).min(AHEAD * cost)) + GRACE
}

/// By how much a plain iteration lowers the logarithm of the residual: over the later half, when what came before has died
/// away.
fn rate(logs: &[f64]) -> f64 {
    let later = &logs[logs.len() / 2..];
    let [first, .., last] = later else { return STILL };
    let rate = (first - last) / (later.len() - 1) as f64;
    if rate > STILL { rate } else { STILL }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs an iteration whose residual falls by these factors until it is below 1e-6; the account.
    fn run(plain: f64, accelerated: f64, price: f64) -> Account {
        let mut account = Account::new(price);
        let mut residual = 1.0_f64;
        while residual > 1e-6 {
            let (factor, cost) = if account.accelerates() { (accelerated, price) } else { (plain, 1.0) };
            residual *= factor;
            account.note(cost, residual * residual);
        }
        account
    }

    #[test]
    fn acceleration_is_used_where_it_is_worth_its_price() {
        let alone = |factor: f64| (1e-6_f64.ln() / factor.ln()).ceil();
        for plain in [0.6, 0.9, 0.95, 0.99, 0.999] {
            for power in [0.2, 0.8, 1.0, 1.5, 2.0, 3.0, 6.0] {
                for price in [1.05, 1.7, 2.7, 6.0] {
                    let account = run(plain, plain.powf(power), price);
                    let (least, cost) = (alone(plain), account.cost());
                    assert!(cost <= 1.05 * least + 3.0 + price, "{plain} {power} {price}: {cost} {least}");
                    let pays = power > 1.2 * price;
                    if pays && least > 100.0 {
                        // What is left to gain when the first trial may begin is gained.
                        let wanted = |cost: &f64| TRIAL * price <= allowance(*cost, -plain.ln());
                        let begun = (PLAIN..).map(|cost| cost as f64).find(wanted).unwrap_or(least).min(least);
                        let best = begun + (least - begun) / power * price;
                        assert!(cost <= 1.1 * best + price, "{plain} {power} {price}: {cost} {best}");
                    }
                }
            }
        }
    }

    #[test]
    fn it_comes_back_where_it_begins_to_pay() {
        let mut account = Account::new(2.0);
        let mut residual = 1.0_f64;
        for k in 0..600 {
            // Plain iterations are as good as accelerated ones at first, and hardly move later.
            let plain: f64 = if k < 60 { 0.8 } else { 0.995 };
            let accelerated: f64 = if k < 60 { 0.8 } else { 0.95 };
            let (factor, cost) = if account.accelerates() { (accelerated, 2.0) } else { (plain, 1.0) };
            residual *= factor;
            account.note(cost, residual * residual);
        }
        let (plain, accelerated) = account.iterations();
        assert!(accelerated > 400, "{plain} plain, {accelerated} accelerated");
    }

    #[test]
    fn residuals_that_are_no_numbers_end_a_trial() {
        let mut account = Account::new(1.05);
        (0..PLAIN).for_each(|_| account.note(1.0, 1.0));
        assert!(account.accelerates());
        account.note(2.0, f64::NAN);
        assert!(!account.accelerates());
    }
}

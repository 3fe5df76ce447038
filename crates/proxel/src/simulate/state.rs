//! All that a simulation carries from frame to frame, as bytes.

use super::contact::Known;
use serde::{Deserialize, Serialize};

/// What the next frame begins with.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// Frames done.
    pub(super) frame: usize,
    /// Positions and velocities of nodes.
    pub(super) x: Vec<f64>,
    pub(super) v: Vec<f64>,
    /// Those of a step before and the length of the last step, for methods of two steps.
    pub(super) before: Option<(Vec<f64>, Vec<f64>, f64)>,
    /// Forces between points and walls.
    pub(super) known: Known,
    /// Stresses that hold elements within hard limits, as [`proxel_model::strain_limit::StrainLimits::multipliers`].
    pub(super) stresses: Vec<f64>,
}

/// A [`State`] as plain numbers, for files.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlainState {
    frame: usize,
    /// Positions and velocities of nodes, as the solver numbers them, three numbers each.
    x: Vec<f64>,
    v: Vec<f64>,
    /// Those of the step before, and its length.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    before: Option<(Vec<f64>, Vec<f64>, f64)>,
    /// Forces between points and walls: point, wall, force.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    contacts: Vec<(u32, u32, f64)>,
    /// Stresses that hold elements within hard limits, twelve numbers each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    stresses: Vec<f64>,
}

impl PlainState {
    /// All its numbers.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = &f64> {
        let before = self.before.iter().flat_map(|(x, v, h)| x.iter().chain(v).chain([h]));
        self.x.iter().chain(&self.v).chain(before).chain(self.contacts.iter().map(|c| &c.2)).chain(&self.stresses)
    }
}

/// What the bytes begin with: the format and its version.
const MAGIC: &[u8; 8] = b"PXLSIM2\n";

impl State {
    /// Frames done.
    pub fn frame(&self) -> usize {
        self.frame
    }

    pub(crate) fn plain(&self) -> PlainState {
        PlainState {
            frame: self.frame,
            x: self.x.clone(),
            v: self.v.clone(),
            before: self.before.clone(),
            contacts: self.known.iter().map(|((point, wall), force)| (*point, *wall, *force)).collect(),
            stresses: self.stresses.clone(),
        }
    }

    /// None where lengths do not fit each other, or a point and a wall come twice.
    pub(crate) fn of_plain(plain: PlainState) -> Option<Self> {
        let PlainState { frame, x, v, before, contacts, stresses } = plain;
        let n = x.len();
        let fits = |(y, w, h): &(Vec<f64>, Vec<f64>, f64)| y.len() == n && w.len() == n && *h > 0.0;
        if v.len() != n || !before.as_ref().is_none_or(fits) {
            return None;
        }
        let count = contacts.len();
        let known: Known = contacts.into_iter().map(|(point, wall, force)| ((point, wall), force)).collect();
        (known.len() == count).then_some(State { frame, x, v, before, known, stresses })
    }

    /// As bytes, numbers in full.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = MAGIC.to_vec();
        let mut number = |n: u64| out.extend_from_slice(&n.to_le_bytes());
        number(self.frame as u64);
        number(self.x.len() as u64);
        let (xs, vs, h) = self.before.as_ref().map_or((&[][..], &[][..], 0.0), |(x, v, h)| (&x[..], &v[..], *h));
        number(xs.len() as u64);
        number(h.to_bits());
        number(self.known.len() as u64);
        number(self.stresses.len() as u64);
        [&self.x[..], &self.v, xs, vs, &self.stresses].into_iter().flatten().for_each(|v| number(v.to_bits()));
        for ((point, wall), force) in &self.known {
            number(u64::from(*point) << 32 | u64::from(*wall));
            number(force.to_bits());
        }
        let sum = checksum(&out);
        out.extend_from_slice(&sum.to_le_bytes());
        out
    }

    /// From bytes; `None` where they are not all there, or not those that were written.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (body, sum) = bytes.split_last_chunk::<8>()?;
        if u64::from_le_bytes(*sum) != checksum(body) {
            return None;
        }
        let rest = body.strip_prefix(MAGIC)?;
        let (words, []) = rest.as_chunks::<8>() else { return None };
        let mut words = words.iter().map(|w| u64::from_le_bytes(*w));
        let frame = usize::try_from(words.next()?).ok()?;
        let n = usize::try_from(words.next()?).ok()?;
        let m = usize::try_from(words.next()?).ok()?;
        let h = f64::from_bits(words.next()?);
        let k = usize::try_from(words.next()?).ok()?;
        let s = usize::try_from(words.next()?).ok()?;
        // What is left tells whether the counts are true, before memory is taken for them.
        let wanted =
            n.checked_mul(2)?.checked_add(m.checked_mul(2)?)?.checked_add(k.checked_mul(2)?)?.checked_add(s)?;
        if words.len() != wanted || (m != 0 && m != n) {
            return None;
        }
        let mut take = |n: usize| -> Vec<f64> { words.by_ref().take(n).map(f64::from_bits).collect() };
        let (x, v, xs, vs, stresses) = (take(n), take(n), take(m), take(m), take(s));
        let mut known = Known::new();
        for _ in 0..k {
            let who = words.next()?;
            known.insert(((who >> 32) as u32, who as u32), f64::from_bits(words.next()?));
        }
        let before = (m > 0).then_some((xs, vs, h));
        Some(State { frame, x, v, before, known, stresses })
    }
}

/// Fowler, Noll and Vo's hash, FNV-1a.
fn checksum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, b| (hash ^ u64::from(*b)).wrapping_mul(0x100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_come_back_to_the_bit_and_broken_ones_do_not() {
        let state = State {
            frame: 7,
            x: vec![0.1, -0.0, f64::MIN_POSITIVE],
            v: vec![1e300, 2.0, -3.5],
            before: Some((vec![1.0, 2.0, 3.0], vec![4.0, 5.0, 6.0], 0.1)),
            known: Known::from([((3, 0), 0.25), ((9, 2), 1e-20)]),
            stresses: vec![0.5, -0.0],
        };
        let bytes = state.to_bytes();
        assert_eq!(State::from_bytes(&bytes), Some(state.clone()));
        assert_eq!(State::from_bytes(&State::default().to_bytes()), Some(State::default()));
        for cut in 0..bytes.len() {
            assert_eq!(State::from_bytes(&bytes[..cut]), None);
        }
        for at in 0..bytes.len() {
            let mut other = bytes.clone();
            other[at] ^= 0x40;
            assert_eq!(State::from_bytes(&other), None, "byte {at}");
        }
        // Counts that lie, with a true checksum.
        let mut lie = bytes[..bytes.len() - 8].to_vec();
        lie[16..24].copy_from_slice(&u64::MAX.to_le_bytes());
        let sum = checksum(&lie);
        lie.extend_from_slice(&sum.to_le_bytes());
        assert_eq!(State::from_bytes(&lie), None);
    }
}

//! Which vertices a group means.

use super::{Combine, Group, InputError};

impl Group {
    /// The vertices by their rest positions: `indices` as listed where nothing else chooses, else
    /// ascending.
    pub(crate) fn select(&self, file: &str, name: &str, rest: &[[f64; 3]]) -> Result<Vec<u32>, InputError> {
        let mut listed: Option<Vec<u32>> = None;
        if let Some(indices) = &self.indices {
            if let Some(v) = indices.iter().find(|v| v.0 as usize >= rest.len()) {
                return Err(out_of_range(file, v.0, rest.len(), &format!("group `{name}`: ")));
            }
            listed = Some(indices.iter().map(|v| v.0).collect());
        }
        let selected = if self.region.is_none() && self.sphere.is_none() && self.plane.is_none() {
            listed.unwrap_or_default()
        } else {
            let mut in_list = listed.map(|list| {
                let mut mask = vec![false; rest.len()];
                list.iter().for_each(|&v| mask[v as usize] = true);
                mask
            });
            (0..rest.len())
                .filter(|&v| self.chooses(in_list.as_mut().map(|m| m[v]), rest[v]))
                .map(|v| v as u32)
                .collect()
        };
        if selected.is_empty() {
            let what = format!("group `{name}` chooses none of the {} vertices", rest.len());
            return Err(InputError::new(file, what, "correct its indices, box, sphere or plane"));
        }
        Ok(selected)
    }

    fn chooses(&self, in_list: Option<bool>, p: [f64; 3]) -> bool {
        let in_box = self.region.map(|r| (0..3).all(|c| r.min[c] <= p[c] && p[c] <= r.max[c]));
        let in_sphere = self.sphere.map(|s| {
            let d = [0, 1, 2].map(|c| p[c] - s.center[c]);
            d.iter().map(|x| x * x).sum::<f64>() <= s.radius * s.radius
        });
        let on_side = self.plane.map(|h| (0..3).map(|c| (p[c] - h.point[c]) * h.normal[c]).sum::<f64>() >= 0.0);
        let mut answers = [in_list, in_box, in_sphere, on_side].into_iter().flatten();
        match self.combine.unwrap_or_default() {
            Combine::All => answers.all(|a| a),
            Combine::Any => answers.any(|a| a),
        }
    }
}

pub(super) fn out_of_range(file: &str, v: u32, n: usize, group: &str) -> InputError {
    let range =
        if n == 0 { "there are no vertices".to_owned() } else { format!("vertices are numbered 0 to {}", n - 1) };
    InputError::new(
        file,
        format!("{group}vertex index {v} is out of range, {range}"),
        "give indices of this mesh, counted from 0",
    )
}

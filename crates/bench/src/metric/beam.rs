//! Beams held at both ends, one of which is moved: bodies for any Poisson's ratio.

use crate::BenchError;
use crate::data::Model;
use proxel::deform::DeformInput;
use proxel::mesh::generate::{CellSplit, beam};
use std::f64::consts::{FRAC_PI_2, TAU};

/// What is done to one end of a beam of length 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// A third of a turn about its axis, and a tenth outwards.
    Twist,
    /// Half outwards.
    Stretch,
    /// Three tenths sideways.
    Shear,
    /// A quarter of a turn about an axis across.
    Bend,
}

impl Motion {
    /// All of them.
    pub const ALL: [Motion; 4] = [Motion::Twist, Motion::Stretch, Motion::Shear, Motion::Bend];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Motion::Twist => "twist",
            Motion::Stretch => "stretch",
            Motion::Shear => "shear",
            Motion::Bend => "bend",
        }
    }

    /// Where a point of the end goes.
    fn of(self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        match self {
            Motion::Twist => {
                let (sin, cos) = (TAU / 3.0).sin_cos();
                [x + 0.1, cos * y - sin * z, sin * y + cos * z]
            }
            Motion::Stretch => [x + 0.5, y, z],
            Motion::Shear => [x, y + 0.3, z],
            Motion::Bend => {
                let (sin, cos) = FRAC_PI_2.sin_cos();
                [0.2 - sin * y, 0.5 + cos * y, z]
            }
        }
    }

    /// A beam of cubic cells, its inside at rest; without a reference.
    ///
    /// # Errors
    /// No cells.
    pub fn model(self, cells: [usize; 3]) -> Result<Model, BenchError> {
        let size = cells.map(|n| n as f64 / cells[0] as f64);
        let rest = beam(cells, size, CellSplit::Six).map_err(BenchError::from_display)?;
        let mut start = rest.points.clone();
        let mut fixed = Vec::new();
        let end = 0.5 - 1e-9;
        for (v, p) in start.iter_mut().enumerate().filter(|(_, p)| p[0].abs() > end) {
            if p[0] > 0.0 {
                *p = self.of(*p);
            }
            fixed.push((v as u32, *p));
        }
        let input = DeformInput { rest, start: Some(start), fixed, ..DeformInput::default() };
        Ok(Model { name: self.name().to_string(), input, read: 0.0 })
    }
}

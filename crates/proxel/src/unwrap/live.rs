//! A map that is made step by step, and follows when what holds it changes.

use super::assemble::{self, Laid};
use super::chart::{self, ChartInput, Prepared};
use super::order::Order;
use super::problem::shown;
use super::{UnwrapError, UnwrapInput, cut, pool};
use crate::settings::UnwrapSettings;
use proxel_mesh::charts::Charts;
use proxel_mesh::uv::UvMap;
use proxel_split::{Evaluation, Method, Status};

/// A surface being mapped: cut, started and analysed once, then moved by [`step`](Self::step). After a change of pins or seams
/// it goes on from the map that it has got to; charts that the change does not touch stay as they are.
pub struct Unwrapper {
    input: UnwrapInput,
    settings: UnwrapSettings,
    charts: Charts,
    live: Vec<Live>,
    pool: rayon::ThreadPool,
    iteration: usize,
}

/// How far a map is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standing {
    /// Steps so far.
    pub iteration: usize,
    /// The normalised symmetric Dirichlet energy, 1 at an isometry, or another energy as it is: the area-weighted mean over
    /// charts; infinite while triangles are flipped.
    pub energy: f64,
    /// Triangles that are flipped.
    pub flips: u64,
    /// Charts that have not converged.
    pub open: usize,
}

/// One chart.
struct Live {
    order: Order,
    method: Option<Box<dyn Method>>, // none where nothing is free
    threshold: f64,                  // of the gradient
    state: Evaluation,
    is_open: bool,
    pins: Vec<(u32, [f64; 2])>,
    is_loose: bool, // whether nothing keeps the map from turning
    start: Vec<[f64; 2]>,
    unit: f64,         // length of the mesh in a unit of the solver
    uv: Vec<[f64; 2]>, // where there is no method
}

impl Live {
    fn new(input: &ChartInput<'_>, settings: &UnwrapSettings) -> Result<Self, UnwrapError> {
        let pins = input.pins.clone();
        let none = Evaluation::default();
        let Some(flat) = input.flat() else {
            let (order, uv) = (Order::none(), vec![[0.0; 2]; input.points.len()]);
            return Ok(Live {
                order,
                method: None,
                threshold: 0.0,
                state: none,
                is_open: false,
                pins,
                is_loose: false,
                start: Vec::new(),
                unit: 0.0,
                uv,
            });
        };
        let unit = flat.scale.recip();
        let Prepared { order, start, method, failure } = chart::prepare(&flat, input, settings)?;
        if let Some(failure) = failure {
            return Err(UnwrapError(failure));
        }
        let uv = chart::in_units(&flat, &start.uv, input);
        let is_loose = pins.is_empty() && !settings.fixed_boundary;
        let mut live = Live {
            order,
            method,
            threshold: 0.0,
            state: none,
            is_open: false,
            pins,
            is_loose,
            start: Vec::new(),
            unit,
            uv,
        };
        if let Some(method) = &mut live.method {
            live.threshold = chart::tolerance(&start, settings, method.as_mut()).threshold();
            live.look();
        }
        live.start = start.uv;
        Ok(live)
    }

    /// Where it is, and whether that is the minimum.
    fn look(&mut self) {
        if let Some(method) = &mut self.method {
            self.state = method.evaluate();
            let barred = method.problem().barrier && self.state.energy.inverted > 0;
            self.is_open = barred || self.state.gradient_norm.is_nan() || self.state.gradient_norm > self.threshold;
        }
    }

    /// In units of length of the mesh.
    fn uv(&self) -> Vec<[f64; 2]> {
        let Some(method) = &self.method else { return self.uv.clone() };
        let mut uv = self.order.user(method.x());
        if self.is_loose {
            chart::turn_back(&mut uv, &self.start);
        }
        uv.iter_mut().for_each(|p| *p = p.map(|v| v * self.unit));
        for (v, target) in &self.pins {
            uv[*v as usize] = *target;
        }
        uv
    }
}

impl Unwrapper {
    /// Cuts the surface, makes the start and puts the methods together.
    ///
    /// # Errors
    /// As [`unwrap`](super::unwrap), and settings that need more than steps: `bijective`, `max_stretch`.
    pub fn new(input: UnwrapInput, settings: UnwrapSettings) -> Result<Self, UnwrapError> {
        settings.check().map_err(UnwrapError)?;
        if settings.bijective || settings.max_stretch.is_some() {
            let what = "maps without overlaps or with a bound on stretch are made in one call; use unwrap";
            return Err(UnwrapError(what.to_string()));
        }
        let pool = pool(&settings)?;
        let (charts, live) = pool.install(|| -> Result<_, UnwrapError> {
            let charts = cut(&input)?;
            let live = begin(&input, &charts, &settings)?;
            Ok((charts, live))
        })?;
        Ok(Unwrapper { input, settings, charts, live, pool, iteration: 0 })
    }

    /// One iteration of every chart that has not converged.
    ///
    /// # Errors
    /// A system that cannot be factored; the map is then as before.
    pub fn step(&mut self) -> Result<Standing, UnwrapError> {
        let live = &mut self.live;
        self.pool.install(|| -> Result<(), UnwrapError> {
            for chart in live.iter_mut().filter(|chart| chart.is_open) {
                if let Some(method) = &mut chart.method {
                    method.step().map_err(|e| UnwrapError(e.to_string()))?;
                }
                chart.look();
            }
            Ok(())
        })?;
        self.iteration += 1;
        Ok(self.standing())
    }

    /// Steps until all charts have converged, `settings.max_iters` steps were taken, or `more` says no; it is asked after each
    /// step.
    ///
    /// # Errors
    /// As [`step`](Self::step).
    pub fn run(&mut self, more: &mut dyn FnMut(&Standing) -> bool) -> Result<Status, UnwrapError> {
        for _ in 0..self.settings.max_iters {
            if self.standing().open == 0 {
                return Ok(Status::Converged);
            }
            let standing = self.step()?;
            if !more(&standing) {
                return Ok(Status::Cancelled);
            }
        }
        Ok(if self.standing().open == 0 { Status::Converged } else { Status::Stopped })
    }

    /// How far it is.
    pub fn standing(&self) -> Standing {
        let (mut energy, mut area, mut flips, mut open) = (0.0, 0.0, 0, 0);
        for chart in self.live.iter().filter(|chart| chart.method.is_some()) {
            let own = chart.unit * chart.unit;
            energy += own * shown(&self.settings, chart.state.energy.value);
            area += own;
            flips += chart.state.energy.inverted;
            open += usize::from(chart.is_open);
        }
        Standing { iteration: self.iteration, energy: if area > 0.0 { energy / area } else { 1.0 }, flips, open }
    }

    /// Holds these vertices, and no others, from now on; see [`UnwrapInput::pins`].
    ///
    /// # Errors
    /// A vertex that does not exist or is held twice; pins are then as before.
    pub fn set_pins(&mut self, pins: Vec<(u32, [f64; 2])>) -> Result<(), UnwrapError> {
        let input = UnwrapInput { pins, start: Some(self.in_place()), ..self.input.clone() };
        let (charts, settings) = (&self.charts, &self.settings);
        let before: Vec<_> = self.live.iter().map(|live| live.pins.clone()).collect();
        let changed = self.pool.install(|| -> Result<Vec<Option<Live>>, UnwrapError> {
            let inputs = chart::inputs(&input, charts)?;
            let again = |(input, pins): (&ChartInput<'_>, &Vec<_>)| match input.pins == *pins {
                true => Ok(None),
                false => Live::new(input, settings).map(Some),
            };
            inputs.iter().zip(&before).map(again).collect()
        })?;
        for (live, changed) in self.live.iter_mut().zip(changed) {
            if let Some(changed) = changed {
                *live = changed;
            }
        }
        self.input.pins = input.pins;
        Ok(())
    }

    /// Cuts the surface along these edges, and no others, from now on; corners go on from where they are.
    ///
    /// # Errors
    /// An edge that is none of the mesh; seams are then as before.
    pub fn set_seams(&mut self, seams: Vec<[u32; 2]>) -> Result<(), UnwrapError> {
        let input = UnwrapInput { seams, start: Some(self.in_place()), ..self.input.clone() };
        let settings = &self.settings;
        let (charts, live) = self.pool.install(|| -> Result<_, UnwrapError> {
            let charts = cut(&input)?;
            let live = begin(&input, &charts, settings)?;
            Ok((charts, live))
        })?;
        (self.charts, self.live) = (charts, live);
        self.input.seams = input.seams;
        Ok(())
    }

    /// The map as it is, packed where the settings say so.
    ///
    /// # Errors
    /// Charts that cannot be packed.
    pub fn map(&self) -> Result<UvMap, UnwrapError> {
        Ok(self.placed()?.0)
    }

    /// The same, and the texels per unit of length where it was packed.
    ///
    /// # Errors
    /// As [`map`](Self::map).
    pub fn placed(&self) -> Result<(UvMap, Option<f64>), UnwrapError> {
        let uv: Vec<Vec<[f64; 2]>> = self.live.iter().map(Live::uv).collect();
        let laid: Vec<Laid<'_>> = uv
            .iter()
            .zip(&self.live)
            .map(|(uv, live)| Laid { uv, area: live.unit * live.unit, held: !live.pins.is_empty() })
            .collect();
        let (mesh, charts, settings) = (&self.input.mesh, &self.charts, &self.settings);
        let placed = self.pool.install(|| assemble::place(mesh, charts, &laid, settings))?;
        Ok((placed.uv, placed.density))
    }

    /// What it was built from, with the pins and seams of now.
    pub fn input(&self) -> &UnwrapInput {
        &self.input
    }

    /// The charts of the surface.
    pub fn charts(&self) -> &Charts {
        &self.charts
    }

    /// The map with every chart where the solver has it.
    fn in_place(&self) -> UvMap {
        let mut uv = UvMap::default();
        let mut first = Vec::with_capacity(self.live.len());
        for live in &self.live {
            first.push(uv.coordinates.len() as u32);
            uv.coordinates.extend(live.uv());
        }
        let corner = |p: &proxel_mesh::charts::Place| first[p.chart as usize] + p.vertex;
        uv.corners = self.charts.places.iter().map(|p| p.as_ref().map_or(UvMap::NONE, corner)).collect();
        uv
    }
}

fn begin(input: &UnwrapInput, charts: &Charts, settings: &UnwrapSettings) -> Result<Vec<Live>, UnwrapError> {
    chart::inputs(input, charts)?.iter().map(|input| Live::new(input, settings)).collect()
}

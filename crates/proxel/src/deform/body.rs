//! The body as the solver sees it: centred, sorted, with its elements, loads and anchors.

use super::check::{check_size, check_vectors};
use super::elements::{Cells, add_weights, build};
use super::own::{self, OwnTerm};
use super::{DeformError, DeformInput, constraints, planar, sheet, start};
use crate::settings::{DeformSettings, MethodName};
use proxel_mesh::{Mesh, check, topology};
use proxel_split::{PointSpring, Precision, Problem, Quadratic, SystemError, Term};

/// A deformation problem, and the way between the user's numbering and units and the solver's.
pub struct Body {
    name: String,
    dim: usize, // 2 in the plane, else 3
    center: [f64; 3],
    order: Vec<u32>, // the user's vertex at each place: free ones first
    n_free: usize,
    obstacles: std::ops::Range<usize>, // their terms
    targets: Vec<(u32, [f64; 3])>,     // fixed vertices and where, in the user's numbering and units
    reference: Option<Vec<f64>>,       // in the solver's
    repaired_tets: Option<Vec<[u32; 4]>>,
    warnings: Vec<String>,
    repaired: Vec<String>,
    problem: Option<Problem>,
}

impl Body {
    /// Checks the input, numbers the vertices, builds the elements.
    ///
    /// # Errors
    /// Input that describes no problem: names the file, the item and the remedy.
    pub fn new(input: &DeformInput, settings: &DeformSettings) -> Result<Self, DeformError> {
        let mesh = &input.rest;
        let name = if mesh.name.is_empty() { "rest mesh".to_string() } else { mesh.name.clone() };
        let n = mesh.n_verts();
        mesh.check_indices()?;
        mesh.check_repeated()?;
        check_size(&name, mesh)?;
        check_vectors(&name, n, input)?;
        let mut body = Body {
            name,
            dim: if settings.planar { 2 } else { 3 },
            center: [0.0; 3],
            order: Vec::new(),
            n_free: 0,
            obstacles: 0..0,
            targets: Vec::new(),
            reference: None,
            repaired_tets: None,
            warnings: Vec::new(),
            repaired: Vec::new(),
            problem: None,
        };
        body.check_volumes(input, settings)?;
        let tets = body.repaired_tets.as_deref().unwrap_or(&mesh.tets);
        let mut kinds = Cells::all(mesh, tets, settings);
        if kinds.iter().all(|cells| cells.len() == 0) {
            return Err(DeformError(format!(
                "{}: it has no elements; give a mesh of tetrahedra, triangles or edges",
                body.name
            )));
        }
        if settings.planar {
            planar::check(&body.name, input, settings, &kinds)?;
            body.repaired.extend(planar::orient(&body.name, mesh, settings, &mut kinds)?);
        }
        sheet::check(&body.name, &mesh.points, settings, &kinds)?;
        // Parts of a body that share a cell of a lattice may share its tetrahedra, each with its own fill.
        if input.fill.is_none() {
            body.warnings.extend(sheet::repeated(&body.name, &kinds));
        }
        body.anchor(input, settings, &kinds)?;
        body.number(mesh.points.as_slice());
        let number = body.numbers();
        let rest = body.centred(&mesh.points);
        let mut quadratic = body.quadratic(input, settings, &kinds, &rest, &number);
        quadratic.form = sheet::bending(&body.name, settings, &kinds, &number, &rest, &mut body.warnings);
        let mut terms = Vec::new();
        let mut barrier = false;
        if let Some(energy) = &input.energy {
            own::check(&body.name, input.fill.is_some(), &kinds, settings)?;
            let name = &body.name;
            for cells in &kinds {
                let all: Vec<usize> = (0..cells.len()).collect();
                let like = build(cells, &all, None, &number, &rest, &settings.material, settings, name)?.term;
                if let Cells::Tets(tets) = cells.renumbered(&number) {
                    terms.push(Box::new(OwnTerm::new(like, energy.clone(), tets, &rest)) as Box<dyn Term>);
                    barrier |= energy.0.is_barrier();
                }
            }
        }
        for cells in kinds.iter().filter(|_| input.energy.is_none()) {
            for (material, chosen) in cells.by_material(mesh, settings) {
                let built =
                    build(cells, &chosen, input.fill.as_deref(), &number, &rest, material, settings, &body.name)?;
                terms.push(built.term);
                barrier |= built.barrier;
            }
        }
        let modulus = settings.material.modulus().map_err(|e| DeformError(e.to_string()))?;
        let mut points = quadratic.points.clone();
        points.iter_mut().for_each(|p| p.stiffness /= modulus);
        let at_targets = body.with_targets(rest.clone());
        let smooth = || start::smooth(&kinds, &number, &rest, at_targets, body.n_free, body.dim, points);
        let mut problem = Problem { dim: body.dim, n_free: body.n_free, x0: Vec::new(), terms, quadratic, barrier };
        match &input.start {
            Some(start) => {
                problem.x0 = body.with_targets(body.centred(start));
                if settings.method == MethodName::Auto {
                    let warning = start::replace_if_hopeless(&mut problem, smooth)?;
                    body.warnings.extend(warning);
                }
            }
            None => problem.x0 = smooth()?,
        }
        body.reference = input.reference.as_ref().map(|r| body.centred(r));
        let around =
            constraints::Around { name: &body.name, input, number: &number, center: body.center, kinds: &kinds };
        let obstacles = problem.terms.len();
        body.warnings.extend(around.add(&mut problem, settings)?);
        body.obstacles = obstacles..problem.terms.len();
        body.problem = Some(problem);
        Ok(body)
    }

    /// The problem; once.
    pub(super) fn take_problem(&mut self) -> Problem {
        self.problem.take().unwrap_or_else(Problem::empty)
    }

    /// Sends fixed vertices elsewhere, and writes that into the solver's positions; others than fixed ones are ignored.
    pub(super) fn send(&mut self, fixed: &[(u32, [f64; 3])], number: &[u32], x: &mut [f64]) {
        for (v, target) in fixed {
            let Ok(at) = self.targets.binary_search_by_key(v, |t| t.0) else { continue };
            self.targets[at].1 = *target;
            for d in 0..self.dim {
                x[number[*v as usize] as usize * self.dim + d] = target[d] - self.center[d];
            }
        }
    }

    /// Where the solver's origin is.
    pub(super) fn center(&self) -> [f64; 3] {
        self.center
    }

    /// Number of vertices that are not fixed.
    pub(super) fn n_free(&self) -> usize {
        self.n_free
    }

    /// What it is called in messages.
    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// The harmonic displacement of the free vertices of this body, which also follow `points` of the user's vertices.
    pub(super) fn harmonic(
        &self,
        input: &DeformInput,
        settings: &DeformSettings,
        points: &[PointSpring],
    ) -> Result<start::Harmonic, DeformError> {
        let mesh = &input.rest;
        let mut kinds = Cells::all(mesh, self.repaired_tets.as_deref().unwrap_or(&mesh.tets), settings);
        if settings.planar {
            planar::orient(&self.name, mesh, settings, &mut kinds)?;
        }
        let modulus = settings.material.modulus().map_err(|e| DeformError(e.to_string()))?;
        let number = self.numbers();
        let solver = |p: &PointSpring| PointSpring {
            nodes: p.nodes.map(|v| number[v as usize]),
            stiffness: p.stiffness / modulus,
            ..*p
        };
        let points = points.iter().map(solver).collect();
        let rest = self.centred(&mesh.points);
        start::Harmonic::new(&kinds, &number, &rest, self.n_free, self.dim, points, Precision::Single)
    }

    /// The terms that are obstacles.
    pub(super) fn obstacles(&self) -> std::ops::Range<usize> {
        self.obstacles.clone()
    }

    /// What the user should know.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// What was repaired.
    pub fn repaired(&self) -> &[String] {
        &self.repaired
    }

    /// The tetrahedra as they are used, where orientations were repaired.
    pub fn repaired_tets(&self) -> Option<Vec<[u32; 4]>> {
        self.repaired_tets.clone()
    }

    fn check_volumes(&mut self, input: &DeformInput, settings: &DeformSettings) -> Result<(), DeformError> {
        let mesh = &input.rest;
        let mut report = check::check_tets(&mesh.points, &mesh.tets);
        if settings.fix_orientation && !report.negative.is_empty() {
            let mut tets = mesh.tets.clone();
            let turned = check::fix_orientation(&mesh.points, &mut tets);
            self.repaired.push(format!(
                "{}: {turned} tetrahedra of negative volume were turned, the first is {} (0-based)",
                self.name, report.negative[0]
            ));
            report = check::check_tets(&mesh.points, &tets);
            self.repaired_tets = Some(tets);
        }
        if !report.negative.is_empty() || !report.zero.is_empty() {
            match &self.repaired_tets {
                None => {
                    check::require_volumes(mesh)?;
                }
                Some(tets) => {
                    let turned = Mesh { tets: tets.clone(), ..mesh.clone() };
                    check::require_volumes(&turned)?;
                }
            }
        }
        if let Some(first) = report.slivers.first() {
            self.warnings.push(format!(
                "{}: {} of {} tetrahedra are slivers (mean ratio below {}), the first is {first} (0-based); they slow convergence",
                self.name,
                report.slivers.len(),
                mesh.tets.len(),
                check::SLIVER_MEAN_RATIO
            ));
        }
        Ok(())
    }

    /// Collects fixed vertices: the user's, unreferenced ones in place, and one of each component that nothing holds.
    fn anchor(&mut self, input: &DeformInput, settings: &DeformSettings, kinds: &[Cells]) -> Result<(), DeformError> {
        let n = input.rest.n_verts();
        let components =
            topology::components(n, kinds.iter().flat_map(|cells| cells.corners().chunks_exact(cells.size())));
        let mut fixed: Vec<Option<[f64; 3]>> = vec![None; n];
        for (v, target) in &input.fixed {
            fixed[*v as usize] = Some(*target);
        }
        let positions = input.start.as_ref().unwrap_or(&input.rest.points);
        let mut unreferenced = 0;
        let mut first = None;
        for v in components.unreferenced() {
            if fixed[v as usize].is_none() {
                fixed[v as usize] = Some(positions[v as usize]);
                unreferenced += 1;
                first.get_or_insert(v);
            }
        }
        if let Some(first) = first {
            self.warnings.push(format!(
                "{}: {unreferenced} vertices belong to no element, the first is {first} (0-based); they stay in place",
                self.name
            ));
        }
        // An obstacle may be all that holds a body up, and a body that it does not is told by the run.
        let mut held = vec![!input.obstacles.is_empty(); components.count];
        let mut loaded = vec![settings.weighs() || constraints::pushes(input, kinds); components.count];
        let mut lowest = vec![u32::MAX; components.count];
        let mut seen = vec![Seen::default(); components.count];
        for v in 0..n {
            if let Some(c) = components.of_vertex[v] {
                held[c as usize] |= fixed[v].is_some();
                lowest[c as usize] = lowest[c as usize].min(v as u32);
                if input.skin.is_none() {
                    seen[c as usize].add(v);
                }
            }
        }
        for (v, (nodes, _)) in input.skin.iter().flat_map(|s| (0..s.n()).filter_map(|v| Some((v, s.at(v as u32)?)))) {
            if let Some(c) = components.of_vertex[nodes[0] as usize] {
                seen[c as usize].add(v);
            }
        }
        for (v, _, k) in &input.soft {
            if let Some(c) = components.of_vertex[*v as usize] {
                held[c as usize] |= *k > 0.0;
            }
        }
        for tie in input.ties.iter().filter(|t| t.stiffness > 0.0) {
            for (v, _) in tie.nodes.iter().zip(&tie.weights).filter(|(_, w)| **w != 0.0) {
                if let Some(c) = components.of_vertex[*v as usize] {
                    held[c as usize] = true;
                }
            }
        }
        for (v, force) in &input.loads {
            if let Some(c) = components.of_vertex[*v as usize] {
                loaded[c as usize] |= *force != [0.0; 3];
            }
        }
        let mut anchored = Vec::new();
        for c in 0..components.count {
            if held[c] {
                continue;
            }
            if loaded[c] {
                return Err(DeformError(format!(
                    "{}: the component of vertex {} (0-based), with {} vertices, is loaded but nothing holds it; pin at \
                     least three of its vertices (--pins) or remove its loads",
                    self.name, seen[c].first, seen[c].count
                )));
            }
            fixed[lowest[c] as usize] = Some(positions[lowest[c] as usize]);
            anchored.push(&seen[c]);
        }
        match (anchored.first(), components.count) {
            (None, _) => {}
            (Some(Seen { first, .. }), 1) => self
                .warnings
                .push(format!("{}: nothing is pinned; vertex {first} (0-based) was anchored in place", self.name)),
            (Some(Seen { first, count: vertices }), count) => self.warnings.push(format!(
                "{}: nothing holds {} of {count} components; each was anchored in place at its first vertex, such as \
                 that of vertex {first} (0-based), with {vertices} vertices",
                self.name,
                anchored.len()
            )),
        }
        self.targets = fixed.iter().enumerate().filter_map(|(v, target)| Some((v as u32, (*target)?))).collect();
        Ok(())
    }

    /// Free vertices first, each kind along a space-filling curve.
    fn number(&mut self, points: &[[f64; 3]]) {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for p in points {
            for d in 0..3 {
                low[d] = low[d].min(p[d]);
                high[d] = high[d].max(p[d]);
            }
        }
        self.center = std::array::from_fn(|d| low[d] / 2.0 + high[d] / 2.0);
        let size = (0..3).map(|d| high[d] - low[d]).fold(0.0, f64::max);
        let mut is_fixed = vec![false; points.len()];
        for (v, _) in &self.targets {
            is_fixed[*v as usize] = true;
        }
        let mut keyed: Vec<(bool, u64, u32)> = points
            .iter()
            .enumerate()
            .map(|(v, p)| (is_fixed[v], proxel_model::elements::morton(*p, low, size), v as u32))
            .collect();
        keyed.sort_unstable();
        self.n_free = points.len() - self.targets.len();
        self.order = keyed.into_iter().map(|(_, _, v)| v).collect();
    }

    /// The solver's number of each of the user's vertices.
    pub(super) fn numbers(&self) -> Vec<u32> {
        let mut number = vec![0; self.order.len()];
        for (place, v) in self.order.iter().enumerate() {
            number[*v as usize] = place as u32;
        }
        number
    }

    /// Loads and soft springs.
    fn quadratic(
        &self,
        input: &DeformInput,
        settings: &DeformSettings,
        kinds: &[Cells],
        rest: &[f64],
        number: &[u32],
    ) -> Quadratic {
        let n = number.len();
        let mut forces = Vec::new();
        if settings.weighs() || !input.loads.is_empty() {
            forces = vec![[0.0; 3]; n];
        }
        for (v, force) in &input.loads {
            for d in 0..3 {
                forces[number[*v as usize] as usize][d] += force[d];
            }
        }
        if settings.weighs() {
            let renumbered: Vec<Cells> = kinds.iter().map(|cells| cells.renumbered(number)).collect();
            add_weights(&renumbered, kinds, &input.rest, settings, rest, self.dim, &mut forces);
        }
        // sum b . x of the user's x = x + center
        let constant = forces.iter().map(|b| -(0..self.dim).map(|d| b[d] * self.center[d]).sum::<f64>()).sum();
        let loads = forces.iter().flat_map(|b| &b[..self.dim]).copied().collect();
        let springs = input
            .soft
            .iter()
            .map(|(v, target, k)| (number[*v as usize], *k, std::array::from_fn(|d| target[d] - self.center[d])))
            .collect();
        let points = input
            .ties
            .iter()
            .map(|tie| PointSpring {
                nodes: tie.nodes.map(|v| number[v as usize]),
                // The weights of a point add up to 1, or the centre would not drop out.
                target: std::array::from_fn(|d| tie.target[d] - self.center[d]),
                ..*tie
            })
            .collect();
        Quadratic { springs, points, loads, constant, ..Quadratic::default() }
    }

    /// The user's positions from the solver's; fixed vertices are exactly where they were to be held.
    pub fn positions(&self, x: &[f64]) -> Vec<[f64; 3]> {
        let mut out = self.vectors(x);
        for p in &mut out {
            // In the plane the third coordinate is that of the plane.
            *p = std::array::from_fn(|d| p[d] + self.center[d]);
        }
        for (v, target) in &self.targets {
            out[*v as usize] = *target;
        }
        out
    }

    /// One vector for each of the user's vertices from the solver's flat numbers; 0 where a coordinate is not the solver's.
    pub fn vectors(&self, x: &[f64]) -> Vec<[f64; 3]> {
        let mut out = vec![[0.0; 3]; self.order.len()];
        for (v, x) in self.order.iter().zip(x.chunks_exact(self.dim)) {
            out[*v as usize][..self.dim].copy_from_slice(x);
        }
        out
    }

    /// The solver's flat numbers from one vector for each of the user's vertices: the way back of [`Self::vectors`].
    pub(super) fn flat(&self, vectors: &[[f64; 3]]) -> Vec<f64> {
        self.order.iter().flat_map(|v| &vectors[*v as usize][..self.dim]).copied().collect()
    }

    /// The tetrahedra of the mesh as they are used.
    pub(super) fn tets<'a>(&'a self, mesh: &'a Mesh) -> &'a [[u32; 4]] {
        self.repaired_tets.as_deref().unwrap_or(&mesh.tets)
    }

    /// The solver's positions from the user's.
    pub fn centred(&self, positions: &[[f64; 3]]) -> Vec<f64> {
        let dim = self.dim;
        self.order.iter().flat_map(|v| (0..dim).map(|d| positions[*v as usize][d] - self.center[d])).collect()
    }

    /// Whether the user's vertex is held.
    pub fn is_fixed(&self, v: u32) -> bool {
        self.targets.binary_search_by_key(&v, |t| t.0).is_ok()
    }

    /// Puts the fixed vertices where they are to be held.
    fn with_targets(&self, mut x: Vec<f64>) -> Vec<f64> {
        let number = self.numbers();
        for (v, target) in &self.targets {
            for d in 0..self.dim {
                x[number[*v as usize] as usize * self.dim + d] = target[d] - self.center[d];
            }
        }
        x
    }

    /// |x - X*| / |x0 - X*| over free vertices, where there is a reference.
    pub fn reference_error(&self, x: &[f64], x0: &[f64]) -> Option<f64> {
        let reference = &self.reference.as_ref()?[..self.n_free * self.dim];
        let distance = |x: &[f64]| x.iter().zip(reference).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt();
        Some(distance(x) / distance(x0).max(f64::MIN_POSITIVE))
    }

    /// An error of the system, in the user's numbering.
    pub fn explain(&self, e: &SystemError) -> String {
        match e {
            SystemError::Singular { node } => {
                format!(
                    "{}: {}",
                    self.name,
                    SystemError::Singular { node: self.order.get(*node).map_or(*node, |v| *v as usize) }
                )
            }
            SystemError::Factor(_) | SystemError::Stalled(_) => format!("{}: {e}", self.name),
        }
    }
}

/// A component as the user knows it: by vertices of the skin where there is one.
#[derive(Clone, Debug, Default)]
struct Seen {
    first: usize, // its first vertex
    count: usize,
}

impl Seen {
    fn add(&mut self, v: usize) {
        if self.count == 0 {
            self.first = v;
        }
        self.count += 1;
    }
}

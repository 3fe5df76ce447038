//! Everything there is to say about a mesh, for `proxel info`.

use std::fmt;

use super::orientation::{TetCheck, check_tets, check_triangles, require_volumes, volume_error};
use super::quality::{Spread, TetQuality, tet_quality, triangle_angles};
use super::surface::{SurfaceTopology, surface_topology};
use crate::error::{ErrorKind, Item, MeshError, Result};
use crate::mesh::{Mesh, Polygons, repeated};
use crate::topology::{self, Components, mesh_components, tet_faces};
use crate::vec3::{norm, sub};

/// How bad a problem is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// Solved all the same.
    Warning,
    /// Refused.
    Error,
}

/// Something that is wrong with a mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Whether it hinders solving.
    pub severity: Severity,
    /// The first vertex or element concerned.
    pub item: Option<Item>,
    /// How many there are.
    pub count: usize,
    /// What it is and what to do, one line.
    pub text: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let word = if self.severity == Severity::Error { "error" } else { "warning" };
        write!(f, "{word}: {}", self.text)
    }
}

/// What a mesh is and what is wrong with it. `Display` gives the lines of `proxel info`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// The name of the mesh.
    pub name: String,
    /// The number of vertices.
    pub n_verts: usize,
    /// The number of tetrahedra.
    pub n_tets: usize,
    /// The numbers of triangles, quads and larger polygons.
    pub n_faces: [usize; 3],
    /// The number of edge elements.
    pub n_edges: usize,
    /// Whether the file is two-dimensional.
    pub planar: bool,
    /// The smallest and the largest corner of the bounding box.
    pub bounding_box: Option<([f64; 3], [f64; 3])>,
    /// The connected components of the elements.
    pub components: usize,
    /// The vertices that no element uses.
    pub unreferenced: usize,
    /// The number of distinct regions of the tetrahedra (else of the faces); `None` without regions.
    pub regions: Option<usize>,
    /// The lengths of all edges of all elements.
    pub edge_length: Option<Spread>,
    /// The sum of the volumes of the tetrahedra, signed.
    pub volume: Option<f64>,
    /// The shapes of the tetrahedra.
    pub tets: Option<TetQuality>,
    /// The area of the surface: of the faces, or of the boundary of a body without faces.
    pub area: Option<f64>,
    /// The angles of the faces, polygons taken as fans, in degrees.
    pub face_angles: Option<Spread>,
    /// The topology of the surface: of the boundary of a body, else of the faces.
    pub surface: Option<SurfaceTopology>,
    /// What is wrong, errors first.
    pub problems: Vec<Problem>,
}

impl Report {
    /// Whether nothing hinders solving.
    pub fn is_sound(&self) -> bool {
        self.problems.iter().all(|p| p.severity != Severity::Error)
    }
}

/// Examines a mesh, whatever state it is in.
pub fn diagnose(mesh: &Mesh) -> Report {
    let mut report = Report {
        name: mesh.name.clone(),
        n_verts: mesh.n_verts(),
        n_tets: mesh.tets.len(),
        n_edges: mesh.edges.len(),
        planar: mesh.planar,
        ..Report::default()
    };
    for p in mesh.faces.iter() {
        report.n_faces[p.len().clamp(3, 5) - 3] += 1;
    }
    if let Err(e) = mesh.check_indices() {
        report.problems.push(error(&e, 1));
        return report; // nothing else can be trusted
    }
    report.bounding_box = mesh.bounding_box();
    report.regions = mesh.tet_regions.as_ref().or(mesh.face_regions.as_ref()).map(|r| {
        let mut r = r.clone();
        r.sort_unstable();
        r.dedup();
        r.len()
    });
    let body = tet_faces(&mesh.tets);
    let boundary = Polygons::from(&body.boundary[..]);
    shapes(mesh, &boundary, &mut report);
    connectivity(mesh, &body.non_manifold, &boundary, &mut report);
    report.problems.sort_by_key(|p| p.severity == Severity::Warning);
    report
}

/// Sizes, angles, volumes and areas.
fn shapes(mesh: &Mesh, boundary: &Polygons, report: &mut Report) {
    let mut edges = topology::tet_edges(&mesh.tets);
    edges.extend(topology::face_edges(&mesh.faces));
    edges.extend(mesh.edges.iter().map(|&[a, b]| [a.min(b), a.max(b)]));
    edges.sort_unstable();
    edges.dedup();
    let length = |e: &[u32; 2]| norm(sub(mesh.points[e[1] as usize], mesh.points[e[0] as usize]));
    report.edge_length = Spread::of(edges.iter().map(length));

    if !mesh.tets.is_empty() {
        report.tets = tet_quality(&mesh.points, &mesh.tets);
        let check = check_tets(&mesh.points, &mesh.tets);
        report.volume = Some(check.total);
        if let Some(e) = volume_error(mesh, &check) {
            report.problems.push(error(&e, check.negative.len() + check.zero.len()));
        }
        report.problems.extend(sliver_warning(mesh, &check));
    }
    let triangles = if mesh.faces.is_empty() { boundary } else { &mesh.faces }.fan_triangles();
    if !triangles.is_empty() {
        let check = check_triangles(&mesh.points, &triangles, mesh.planar);
        report.area = Some(check.total);
        let angles = |t: &[u32; 3]| triangle_angles(t.map(|v| mesh.points[v as usize]));
        report.face_angles = Spread::of(triangles.iter().flat_map(angles));
    }
    if let Some(triangles) = mesh.faces.as_triangles() {
        let check = check_triangles(&mesh.points, &triangles, mesh.planar);
        if let Some(&first) = check.zero.first() {
            let (n, item) = (check.zero.len(), Item::Face(first as usize));
            let text = format!(
                "{n} of {} faces have no area, the first is {item}; move its vertices or remove it",
                triangles.len()
            );
            report.problems.push(warning(Some(item), n, text));
        }
        let n = check.negative.len();
        if n > 0 && n < triangles.len() {
            let item = Item::Face(check.negative[0] as usize);
            let text =
                format!("{n} of {} faces turn clockwise, the first is {item}; turn them around", triangles.len());
            report.problems.push(warning(Some(item), n, text));
        }
    }
}

/// Components, manifoldness, duplicates.
fn connectivity(mesh: &Mesh, non_manifold: &[[u32; 3]], boundary: &Polygons, report: &mut Report) {
    if mesh.check_repeated().is_err() {
        let elements = mesh.tets.iter().map(|t| &t[..]).chain(mesh.faces.iter());
        let all = elements.chain(mesh.edges.iter().map(|e| &e[..]));
        let count = all.filter(|e| repeated(e).is_some()).count();
        report.problems.extend(mesh.check_repeated().err().map(|e| error(&e, count)));
    }
    if mesh.tets.is_empty() && mesh.faces.is_empty() && mesh.edges.is_empty() {
        let text = "there are no elements; give a mesh with tetrahedra, faces or edges".to_owned();
        report.problems.push(Problem { severity: Severity::Error, item: None, count: 1, text });
    }
    let components = mesh_components(mesh);
    report.components = components.count;
    report.unreferenced = components.unreferenced().count();
    report.problems.extend(unreferenced_warning(&components));
    let tets = mesh.tets.iter().map(|&(mut t)| {
        t.sort_unstable();
        t
    });
    let faces = mesh.faces.iter().map(|p| {
        let mut p = p.to_vec();
        p.sort_unstable();
        p
    });
    for (first, n, is_tet) in [(duplicates(tets), true), (duplicates(faces), false)]
        .into_iter()
        .filter_map(|(d, is_tet)| d.map(|(first, n)| (first, n, is_tet)))
    {
        let item = if is_tet { Item::Tetrahedron(first) } else { Item::Face(first) };
        let text = format!("{n} elements repeat an earlier one, the first is {item}; remove them");
        report.problems.push(warning(Some(item), n, text));
    }
    if let Some([a, b, c]) = non_manifold.first() {
        let n = non_manifold.len();
        let text = format!(
            "{n} triangles belong to more than two tetrahedra, the first has vertices {a}, {b}, {c} (0-based); remove what overlaps"
        );
        report.problems.push(warning(None, n, text));
    }
    let surface = if mesh.tets.is_empty() { &mesh.faces } else { boundary };
    if surface.is_empty() {
        return;
    }
    let topology = surface_topology(mesh.n_verts(), surface);
    let whose = if mesh.tets.is_empty() { "" } else { " of the boundary" };
    if let Some([a, b]) = topology.non_manifold_edges.first() {
        let n = topology.non_manifold_edges.len();
        let text = format!(
            "{n} edges{whose} have more than two faces, the first has vertices {a}, {b} (0-based); split the mesh there"
        );
        report.problems.push(warning(None, n, text));
    }
    if let Some([a, b]) = topology.misoriented_edges.first() {
        let n = topology.misoriented_edges.len();
        let text = format!(
            "along {n} edges{whose} the two faces are turned against each other, the first has vertices {a}, {b} (0-based); turn faces around"
        );
        report.problems.push(warning(None, n, text));
    }
    report.surface = Some(topology);
}

/// Whether a body of tetrahedra can be deformed, and what is odd about it all the same: much quicker
/// than [`diagnose`].
///
/// # Errors
/// Bad indices, a repeated vertex, no tetrahedra, zero or negative volumes; the first of each kind.
pub fn require_solvable(mesh: &Mesh) -> Result<Vec<Problem>> {
    mesh.check_indices()?;
    mesh.check_repeated()?;
    if mesh.tets.is_empty() {
        return Err(mesh.error(ErrorKind::Empty, "no tetrahedra", "give a mesh of tetrahedra"));
    }
    let check = require_volumes(mesh)?;
    let components = mesh_components(mesh);
    Ok(sliver_warning(mesh, &check).into_iter().chain(unreferenced_warning(&components)).collect())
}

fn sliver_warning(mesh: &Mesh, check: &TetCheck) -> Option<Problem> {
    let item = Item::Tetrahedron(*check.slivers.first()? as usize);
    let n = check.slivers.len();
    let text = format!(
        "{n} of {} tetrahedra are slivers, the first is {item}; the smallest volume is {:.1e} of the largest; they \
         slow convergence down",
        mesh.tets.len(),
        check.volumes.0 / check.volumes.1
    );
    Some(warning(Some(item), n, text))
}

fn unreferenced_warning(components: &Components) -> Option<Problem> {
    let item = Item::Vertex(components.unreferenced().next()? as usize);
    let n = components.unreferenced().count();
    let of = components.of_vertex.len();
    let text = format!("{n} of {of} vertices belong to no element, the first is {item}; they stay in place");
    Some(warning(Some(item), n, text))
}

/// The first element with the same (sorted) corners as an earlier one, and how many there are.
fn duplicates<K: Ord>(corners: impl Iterator<Item = K>) -> Option<(usize, usize)> {
    let mut keys: Vec<(K, usize)> = corners.zip(0..).collect();
    keys.sort_unstable();
    let repeats = keys.windows(2).filter(|w| w[0].0 == w[1].0).map(|w| w[1].1);
    let n = repeats.clone().count();
    repeats.min().map(|first| (first, n))
}

fn warning(item: Option<Item>, count: usize, text: String) -> Problem {
    Problem { severity: Severity::Warning, item, count, text }
}

fn error(e: &MeshError, count: usize) -> Problem {
    Problem { severity: Severity::Error, item: e.item(), count, text: e.to_string() }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.name)?;
        let mut line = |name: &str, text: String| writeln!(f, "  {name:<14} {text}");
        line("vertices", self.n_verts.to_string())?;
        let counts = [
            ("tetrahedra", self.n_tets),
            ("triangles", self.n_faces[0]),
            ("quads", self.n_faces[1]),
            ("polygons", self.n_faces[2]),
            ("edges", self.n_edges),
        ];
        for (name, n) in counts.into_iter().filter(|c| c.1 > 0) {
            line(name, n.to_string())?;
        }
        if let Some((lo, hi)) = self.bounding_box {
            line("bounding box", format!("{lo:?} to {hi:?}"))?;
        }
        line("components", self.components.to_string())?;
        if let Some(n) = self.regions {
            line("regions", n.to_string())?;
        }
        if let Some(s) = self.edge_length {
            line("edge length", s.to_string())?;
        }
        if let Some(v) = self.volume {
            line("volume", format!("{v:.6e}"))?;
        }
        if let Some(a) = self.area {
            line("surface area", format!("{a:.6e}"))?;
        }
        if let Some(q) = self.tets {
            line("tet volume", q.volume.to_string())?;
            line("dihedral", format!("{:.2} to {:.2} degrees", q.dihedral.min, q.dihedral.max))?;
            let r = q.mean_ratio;
            line("mean ratio", format!("{:.4} to {:.4}, mean {:.4}", r.min, r.max, r.mean))?;
        }
        if let Some(a) = self.face_angles {
            line("face angles", format!("{:.2} to {:.2} degrees", a.min, a.max))?;
        }
        if let Some(s) = &self.surface {
            let closed = match s.boundary_edges {
                0 => "closed".to_owned(),
                n => format!("open ({n} boundary edges in {} loops)", s.boundary_loops),
            };
            line("surface", format!("{} faces, {closed}, Euler characteristic {}", s.n_faces, s.euler()))?;
        }
        if self.problems.is_empty() {
            line("problems", "none".to_owned())?;
        }
        for p in &self.problems {
            writeln!(f, "  {p}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::{CellSplit, beam, cloth};

    #[test]
    fn a_clean_beam() {
        let r = diagnose(&beam([4, 2, 2], [4.0, 2.0, 2.0], CellSplit::Six).unwrap());
        assert!(r.is_sound() && r.problems.is_empty(), "{r}");
        assert!((r.volume.unwrap() - 16.0).abs() < 1e-12);
        assert!((r.area.unwrap() - 40.0).abs() < 1e-12);
        assert_eq!((r.components, r.surface.as_ref().unwrap().euler()), (1, 2));
        let q = r.tets.unwrap();
        assert!((q.dihedral.min - 45.0).abs() < 1e-9 && (q.dihedral.max - 90.0).abs() < 1e-9);
    }

    #[test]
    fn every_defect_is_listed_once() {
        let mut mesh = beam([2, 1, 1], [2.0, 1.0, 1.0], CellSplit::Five).unwrap();
        mesh.points.push([9.0; 3]);
        mesh.tets.push(mesh.tets[0]);
        mesh.tets[3].swap(0, 1);
        mesh.tets.push([0, 1, 2, 2]);
        let r = diagnose(&mesh);
        let text = r.to_string();
        assert!(!r.is_sound());
        for part in [
            "error: beam: tetrahedron 3 (0-based): its volume is negative (-1.667e-1); 1 of 12 are negative and 1 zero",
            "error: beam: tetrahedron 11 (0-based): vertex 2 occurs twice",
            "warning: 1 of 13 vertices belong to no element, the first is vertex 12",
            "warning: 1 elements repeat an earlier one, the first is tetrahedron 10",
        ] {
            assert!(text.contains(part), "`{part}` is not in\n{text}");
        }
    }

    #[test]
    fn solvable_with_warnings() {
        let mut mesh = beam([2, 1, 1], [2.0, 1.0, 1.0], CellSplit::Five).unwrap();
        assert!(require_solvable(&mesh).unwrap().is_empty());
        mesh.points.push([1.0 + 1e-9, 0.0, 0.0]);
        mesh.points.push([9.0; 3]);
        mesh.tets.push([2, 5, 11, 12]);
        crate::check::fix_orientation(&mesh.points, &mut mesh.tets);
        let warnings = require_solvable(&mesh).unwrap();
        assert_eq!(warnings.len(), 2, "{warnings:?}");
        assert!(warnings[0].text.starts_with("1 of 11 tetrahedra are slivers"), "{}", warnings[0]);
        assert!(warnings[1].text.starts_with("1 of 14 vertices belong to no element"), "{}", warnings[1]);
        mesh.tets.clear();
        assert_eq!(require_solvable(&mesh).unwrap_err().kind(), ErrorKind::Empty);
    }

    #[test]
    fn surfaces() {
        let r = diagnose(&cloth([2, 2], [1.0, 1.0]).unwrap());
        let s = r.surface.unwrap();
        assert_eq!((s.euler(), s.boundary_edges, s.boundary_loops), (1, 8, 1));
        let mut mesh = cloth([2, 2], [1.0, 1.0]).unwrap();
        mesh.points[4] = mesh.points[3];
        let r = diagnose(&mesh);
        assert!(r.is_sound());
        assert!(r.to_string().contains("faces have no area"), "{r}");
    }
}

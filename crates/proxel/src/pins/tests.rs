use super::*;

/// The corners of the unit cube; vertex 4 z + 2 y + x.
fn cube() -> Vec<[f64; 3]> {
    (0..8).map(|v| [v & 1, v >> 1 & 1, v >> 2].map(f64::from)).collect()
}

fn toml(text: &str) -> Result<PinFile, InputError> {
    PinFile::from_toml("p.toml", text)
}

fn handles(text: &str) -> Handles {
    toml(text).unwrap().resolve(&cube(), None).unwrap()
}

/// The message of what is wrong, while reading or while resolving on the cube.
fn refusal(text: &str) -> String {
    match toml(text) {
        Err(e) => e.to_string(),
        Ok(pins) => pins.resolve(&cube(), None).unwrap_err().to_string(),
    }
}

fn assert_close(a: [f64; 3], b: [f64; 3]) {
    assert!((0..3).all(|c| (a[c] - b[c]).abs() < 1e-14), "{a:?} is not {b:?}");
}

#[test]
fn a_list_is_sorted_and_pinned_at_the_start_bit_for_bit() {
    let pins = PinFile::from_text("p.txt", "# handles\n5 2\n\n 7 # last\n").unwrap();
    let mut start = cube();
    start[5] = [0.1 + 0.2, -0.0, 1e-300];
    let h = pins.resolve(&cube(), Some(&start)).unwrap();
    assert_eq!(h.fixed.iter().map(|f| f.0).collect::<Vec<_>>(), [2, 5, 7]);
    assert_eq!(h.fixed[1].1.map(f64::to_bits), start[5].map(f64::to_bits));
    assert_eq!(h.groups, [("pins".to_owned(), vec![2, 5, 7])]);
    assert!(!h.moved && h.warnings.is_empty() && h.soft.is_empty() && h.loads.is_empty());
}

#[test]
fn an_empty_list_pins_nothing() {
    let h = PinFile::from_text("p.txt", "# none\n").unwrap().resolve(&cube(), None).unwrap();
    assert!(h.fixed.is_empty());
}

#[test]
fn a_list_refuses_what_is_no_index() {
    let say = |text: &str| PinFile::from_text("p.txt", text).unwrap_err().to_string();
    assert_eq!(
        say("1 2\n3 four 5"),
        "p.txt: line 2: `four` is no vertex index; give integers parted by blanks; comments start with #"
    );
    assert_eq!(say("-3"), "p.txt: line 1: `-3` is negative; give 0-based vertex indices");
    assert_eq!(say("1.5"), "p.txt: line 1: `1.5` is no integer; give 0-based vertex indices");
    assert!(say("4294967295").contains("too large"));
    assert!(say("1,2").contains("`1,2` is no vertex index"));
}

#[test]
fn a_list_out_of_range_and_duplicates() {
    let resolve = |text: &str| PinFile::from_text("p.txt", text).unwrap().resolve(&cube(), None);
    assert_eq!(
        resolve("1\n8").unwrap_err().to_string(),
        "p.txt: line 2: vertex index 8 is out of range, vertices are numbered 0 to 7; give indices \
         of this mesh, counted from 0"
    );
    let h = resolve("1 2\n2 1 1").unwrap();
    assert_eq!(h.fixed.len(), 2);
    assert_eq!(h.warnings, ["p.txt: 3 duplicate pins ignored, first vertex 2 in line 2"]);
}

#[test]
fn regions_choose_by_rest_positions_and_combine() {
    let vertices = |text: &str| handles(text).groups[0].1.clone();
    assert_eq!(vertices("[groups.a]\nbox = { min = [0, 0, 1], max = [1, 0.5, 2] }"), [4, 5]);
    assert_eq!(vertices("[groups.a]\nsphere = { center = [0, 0, 0], radius = 1 }"), [0, 1, 2, 4]);
    assert_eq!(vertices("[groups.a]\nplane = { point = [1, 0, 0], normal = [2, 0, 0] }"), [1, 3, 5, 7]);
    let both = "[groups.a]\nplane = { point = [1, 0, 0], normal = [1, 0, 0] }\nindices = [0, 7, 1]\n";
    assert_eq!(vertices(both), [1, 7]);
    assert_eq!(vertices(&format!("{both}combine = \"any\"")), [0, 1, 3, 5, 7]);
}

#[test]
fn motions_apply_in_order_around_the_centroid() {
    // The face x = 1: centroid (1, 1/2, 1/2).
    let face = "[groups.a]\nplane = { point = [1, 0, 0], normal = [1, 0, 0] }\n";
    let h = handles(&format!("{face}translate = [0.5, 0, 0]"));
    assert!(h.moved);
    assert_eq!(h.fixed[0], (1, [1.5, 0.0, 0.0]));
    let h = handles(&format!("{face}rotate = {{ axis = [3, 0, 0], angle = 90 }}"));
    assert_close(h.fixed[0].1, [1.0, 1.0, 0.0]); // (1, 0, 0) turns y to z
    let h = handles(&format!("{face}scale = 3\nrotate = {{ axis = [1, 0, 0], angle = -90 }}\ntranslate = [0, 0, 1]"));
    assert_close(h.fixed[0].1, [1.0, -1.0, 3.0]);
    let h = handles(&format!("{face}rotate = {{ axis = [0, 0, 1], angle = 45, center = [0, 0, 0] }}"));
    assert_close(h.fixed[0].1, [0.5f64.sqrt(), 0.5f64.sqrt(), 0.0]);
    let h = handles(&format!("{face}scale = {{ factors = [1, 1, 2], center = [0, 0, 0] }}"));
    assert_close(h.fixed[3].1, [1.0, 1.0, 2.0]);
}

#[test]
fn targets_belong_to_indices_in_their_order() {
    let h = handles("[groups.a]\nindices = [3, 1]\ntargets = [[3, 3, 3], [1, 1, 1]]");
    assert_eq!(h.fixed, [(1, [1.0; 3]), (3, [3.0; 3])]);
}

#[test]
fn springs_and_loads() {
    let h = handles(
        "[groups.s]\nindices = [2]\nstiffness = 10\ntranslate = [0, 1, 0]\n\
         [groups.f]\nindices = [3, 4]\nforce = { total = [2, 0, 0] }\n\
         [groups.g]\nindices = [4, 5]\nforce = { each = [0, 1, 0] }",
    );
    assert_eq!(h.soft, [(2, [0.0, 2.0, 0.0], 10.0)]);
    assert_eq!(h.loads, [(3, [1.0, 0.0, 0.0]), (4, [1.0, 1.0, 0.0]), (5, [0.0, 1.0, 0.0])]);
    assert!(h.fixed.is_empty() && h.moved);
}

#[test]
fn loads_on_pins_are_dropped_with_a_warning() {
    let h = handles(
        "[groups.a]\nindices = [1, 2, 1]\n[groups.f]\nindices = [2, 3]\nforce = { each = [1, 0, 0] }\n\
         [groups.s]\nindices = [4]\nstiffness = 1\n[groups.t]\nindices = [4]\nstiffness = 2",
    );
    assert_eq!((h.loads.len(), h.soft.len(), h.fixed.len()), (1, 2, 2), "springs add up");
    assert_eq!(
        h.warnings,
        [
            "p.toml: 1 duplicate pin ignored, first vertex 1 in group `a`",
            "p.toml: 1 loads on pinned vertices have no effect"
        ]
    );
}

#[test]
fn groups_that_agree_may_share_vertices() {
    let h = handles("[groups.a]\nindices = [1, 2]\n[groups.b]\nindices = [2, 3]");
    assert_eq!(h.fixed.iter().map(|f| f.0).collect::<Vec<_>>(), [1, 2, 3]);
    assert_eq!(h.groups, [("a".to_owned(), vec![1, 2]), ("b".to_owned(), vec![2, 3])]);
}

#[test]
fn groups_that_contradict_each_other_are_refused() {
    assert_eq!(
        refusal("[groups.a]\nindices = [1, 2]\n[groups.s]\nindices = [3, 1]\nstiffness = 1"),
        "p.toml: groups `a` and `s` overlap: the one holds vertex 1, the other pulls at it; take the vertex out of one of them"
    );
    assert_eq!(
        refusal("[groups.a]\nindices = [1, 2]\n[groups.b]\nindices = [2]\ntranslate = [1, 0, 0]"),
        "p.toml: groups `a` and `b` send vertex 2 to different places, [0.0, 1.0, 0.0] and [1.0, 1.0, 0.0]; take the vertex out of one of \
         them, or give it a stiffness"
    );
    assert!(refusal("[groups.a]\nindices = [1, 1]\ntargets = [[0,0,0],[0,0,1]]").contains("vertex 1 has two targets"));
}

#[test]
fn groups_that_make_no_sense_are_refused() {
    for (text, part) in [
        ("", "it has no groups"),
        ("[groups]", "it has no groups"),
        ("[groups.a]", "group `a`: it chooses no vertices"),
        ("[groups.a]\nindices = []", "group `a` chooses none of the 8 vertices"),
        ("[groups.a]\nsphere = { center = [9, 9, 9], radius = 1 }", "chooses none of the 8 vertices"),
        ("[groups.a]\nindices = [8]", "group `a`: vertex index 8 is out of range, vertices are numbered 0 to 7"),
        ("[groups.a]\n\nindices = [1, -3]", "line 3: vertex index -3 is negative"),
        ("[groups.a]\nindices = [\"one\"]", "line 2: invalid type: string \"one\", expected a 0-based vertex index"),
        ("[groups.a]\nindices = [1.5]", "expected a 0-based vertex index"),
        ("[groups.a]\nindexes = [1]", "line 2: unknown key `indexes`; did you mean `indices`?"),
        ("[groups.a]\nsphere = { centre = [0,0,0], radius = 1 }", "did you mean `center`?"),
        ("[groups.a]\nsphere = { center = [0,0,nan], radius = 1 }", "a number of `sphere` is NaN"),
        ("[groups.a]\nindices = [1]\ntranslate = [inf, 0, 0]", "a number of `translate` is inf"),
        ("[groups.a]\nindices = [1]\ntargets = [[0, 0, 0], [1, 1, 1]]", "2 targets for 1 indices"),
        ("[groups.a]\nsphere = { center = [0,0,0], radius = 9 }\ntargets = [[0,0,0]]", "targets need indices"),
        ("[groups.a]\nindices = [1]\nstiffness = 0", "the stiffness is 0"),
        ("[groups.a]\nindices = [1]\nrotate = { axis = [0,0,0], angle = 1 }", "a normal or axis is zero"),
        ("[groups.a]\nindices = [1]\nforce = { each = [1,0,0] }\nstiffness = 1", "exclude each other"),
        ("[groups.a]\nindices = [1]\ntranslate = [0, 1e999, 0]", "line 3: floating-point number overflowed"),
        (
            "[groups.a]\nindices = [1, 2]\nscale = [1.7e308, 1, 1]\nrotate = { axis = [0,0,1], angle = 30, center = [-1e308,0,0] }",
            "not finite",
        ),
        ("[groups.a]\nbox = { min = [1,0,0], max = [0,0,0] }", "the box has its x from 1 to 0"),
        ("[groups.a]\nindices = [1]\nscale = \"big\"", "expected a factor, three factors"),
        ("groups = 3", "expected groups by name"),
        ("[groups.a]\nindices = [1]\nforce = { each = [1,0,0] }\npressure = 1", "exclude each other"),
        ("[groups.a]\nindices = [1]\npressure = nan", "a number of `pressure` is NaN"),
        ("[[equality]]\nvertices = []", "equality 0 (0-based) names no vertices"),
        ("[[equality]]\nvertices = [1, 9]", "equality 0 (0-based): vertex index 9 is out of range"),
        (
            "[[equality]]\nvertices = [1, 1]\ncoefficients = [1, -1]",
            "equality 0 (0-based) has coefficients that are or add",
        ),
        ("[[equality]]\nvertices = [1, 2]\ncoefficients = [1]", "1 coefficients for 2 vertices"),
        ("[[equality]]\nvertices = [1]\nvalue = [0, inf, 0]", "has the number inf"),
        ("[[equality]]\nvertex = [1]", "unknown field `vertex`, expected one of `vertices`"),
        ("[[obstacle]]\npoint = [0, 0, 0]\nnormal = [0, 0, 0]", "obstacle 0 (0-based)"),
        ("[groups.a\nindices = [1]", "line 1:"),
    ] {
        let message = refusal(text);
        assert!(message.contains(part), "{text:?} gave {message:?}");
        assert!(message.starts_with("p.toml: ") && !message.contains('\n'));
    }
}

#[test]
fn json_is_the_same_and_refuses_a_name_given_twice() {
    let a = PinFile::from_json("p", r#"{"groups": {"a": {"indices": [1], "scale": 2, "force": null}}}"#).unwrap();
    let b = PinFile::from_toml("p", "[groups.a]\nindices = [1]\nscale = 2").unwrap();
    assert_eq!(a, b);
    let e = PinFile::from_json("p.json", "{\"groups\": {\"a\": {\"indices\": [1]},\n\"a\": {\"indices\": [2]}}}");
    assert_eq!(e.unwrap_err().to_string(), "p.json: line 2: group `a` is there twice; correct it");
    let e = PinFile::from_json("p.json", "{\"groups\": ").unwrap_err();
    assert_eq!(e.line(), Some(1));
}

#[test]
fn refined_pins_have_the_midpoints_of_pinned_ends() {
    let edges = [[0, 1], [1, 2], [1, 3], [2, 5]];
    let list = PinFile::from_text("p.txt", "3 1 1").unwrap().refined(&cube(), &edges).unwrap();
    assert_eq!(list.to_text(Path::new("q.txt")).unwrap(), "1\n3\n10\n");
    let groups = toml(
        "[groups.a]\nindices = [3, 1]\ntargets = [[3, 3, 3], [1, 1, 2]]\n\
         [groups.b]\nindices = [0, 1]\nforce = { each = [0, 0, 1] }\n\
         [groups.c]\nindices = [2, 5]\nrotate = { axis = [0, 0, 1], angle = 90 }",
    );
    let fine = groups.unwrap().refined(&cube(), &edges).unwrap();
    let text = fine.to_text(Path::new("q.toml")).unwrap();
    assert_eq!(toml(&text).unwrap().content, fine.content, "what is written reads back:\n{text}");
    let groups = fine.groups().unwrap();
    let indices = |g: &str| groups[g].indices.clone().unwrap().iter().map(|i| i.0).collect::<Vec<_>>();
    assert_eq!((indices("a"), indices("b"), indices("c")), (vec![3, 1, 10], vec![0, 1, 8], vec![2, 5, 11]));
    assert_eq!(groups["a"].targets.as_ref().unwrap()[2], [2.0, 2.0, 2.5]);
    assert_eq!(groups["b"].force, Some(Force::Total([0.0, 0.0, 2.0])));
    assert_eq!(groups["c"].rotate.unwrap().center, Some([0.5, 0.5, 0.5]));
    assert!(fine.to_text(Path::new("q.txt")).is_err());
}

#[test]
fn files_that_cannot_be_read() {
    let say = |p: &str| PinFile::read(Path::new(p)).unwrap_err().to_string();
    assert_eq!(say("/no/such/pins.txt"), "/no/such/pins.txt: no such file; check the path");
    let dir = std::env::temp_dir();
    assert!(say(dir.to_str().unwrap()).contains("it is a folder"));
}

#[test]
fn pressures_equalities_and_obstacles_are_read_and_written() {
    let text = "[groups.p]\nindices = [1, 3, 5]\npressure = 2.5\n\
                [[equality]]\nvertices = [1, 2, 1]\ncoefficients = [1, -2, 0.5]\nvalue = [0, 1, 0]\n\
                [[equality]]\nvertices = [4, 0]\n\
                [[obstacle]]\npoint = [0, -1, 0]\nnormal = [0, 2, 0]\n";
    let h = handles(text);
    assert_eq!(h.pressures, [(vec![1, 3, 5], 2.5)]);
    let row = |nodes: &[(u32, f64)], value| proxel_split::Equality { nodes: nodes.to_vec(), value };
    assert_eq!(h.equalities[0], row(&[(1, 1.5), (2, -2.0)], [0.0, 1.0, 0.0]));
    assert_eq!(h.equalities[1], row(&[(0, 1.0), (4, 1.0)], [0.0; 3]));
    assert_eq!((h.obstacles.len(), h.obstacles[0].normal), (1, [0.0, 2.0, 0.0]));
    let file = toml(text).unwrap();
    for name in ["q.toml", "q.json"] {
        let written = file.to_text(Path::new(name)).unwrap();
        let again = if name == "q.json" { PinFile::from_json("p.toml", &written) } else { toml(&written) };
        assert_eq!(again.unwrap(), file, "{written}");
    }
    assert!(toml("[[obstacle]]\npoint = [0, 0, 0]\nnormal = [0, 1, 0]").is_ok(), "no groups are needed");
}

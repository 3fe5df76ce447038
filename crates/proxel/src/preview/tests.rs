use super::*;

/// A cube of edge 2 around `c`.
fn cube(c: V3, size: f64) -> Model {
    let points = (0..8).map(|v| {
        let at = |bit: u32, i: usize| c[i] + size * (f64::from(v >> bit & 1) * 2.0 - 1.0);
        [at(0, 0), at(1, 1), at(2, 2)]
    });
    let triangles = [
        [0, 2, 1],
        [1, 2, 3],
        [4, 5, 6],
        [5, 7, 6],
        [0, 1, 4],
        [1, 5, 4],
        [2, 6, 3],
        [3, 6, 7],
        [0, 4, 2],
        [2, 4, 6],
        [1, 3, 5],
        [3, 7, 5],
    ];
    Model::new(points.collect(), triangles.to_vec())
}

fn picture(models: Vec<Model>) -> Image {
    let style = Style { ground: false, samples: 2, ..Style::default() };
    render(&[Scene { models }], &Camera::default(), &style, 60, 40)
}

/// The columns and rows where anything but background is.
fn drawn(image: &Image) -> [usize; 4] {
    let empty = picture(vec![]);
    let differs = |x: usize, y: usize| image.pixels()[y * 60 + x] != empty.pixels()[y * 60 + x];
    let at: Vec<(usize, usize)> = (0..2400).map(|i| (i % 60, i / 60)).filter(|&(x, y)| differs(x, y)).collect();
    let min_max = |c: Vec<usize>| [*c.iter().min().unwrap(), *c.iter().max().unwrap()];
    let ([x0, x1], [y0, y1]) = (min_max(at.iter().map(|a| a.0).collect()), min_max(at.iter().map(|a| a.1).collect()));
    [x0, x1, y0, y1]
}

#[test]
fn the_camera_frames_a_body_of_any_size_anywhere() {
    let here = picture(vec![cube([0.0; 3], 1.0)]);
    let [x0, x1, y0, y1] = drawn(&here);
    assert!((2..=5).contains(&y0) && (35..=38).contains(&y1), "fills the height: {y0} to {y1}");
    assert!((x0 + x1).abs_diff(59) <= 1, "is in the middle: {x0} to {x1}");
    let far = picture(vec![cube([1e6, -1e6, 3e6], 1.0)]);
    let tiny = picture(vec![cube([0.0; 3], 1e-9)]);
    assert_eq!(drawn(&far), [x0, x1, y0, y1]);
    assert_eq!(drawn(&tiny), [x0, x1, y0, y1]);
}

#[test]
fn the_nearer_surface_hides_the_farther() {
    // A red square before a green one, given in both orders.
    let square = |z: f64, color: [f32; 3]| Model {
        points: vec![[-1.0, -1.0, z], [1.0, -1.0, z], [1.0, 1.0, z], [-1.0, 1.0, z]],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        colors: vec![color; 4],
        checker: None,
        contours: None,
    };
    let (red, green) = (square(0.1, [1.0, 0.0, 0.0]), square(-0.1, [0.0, 1.0, 0.0]));
    for models in [vec![red.clone(), green.clone()], vec![green, red]] {
        let [r, g, _] = picture(models).pixels()[20 * 60 + 30];
        assert!(r > 2 * g, "the middle is red: {r} {g}");
    }
}

#[test]
fn pictures_do_not_depend_on_threads() {
    let scene =
        Scene { models: vec![cube([0.0; 3], 1.0).pinned([0, 3]), cube([1.5, 0.3, 0.0], 0.5).colored_by(&[0.3; 8])] };
    let draw = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render(&[scene.clone(), scene.clone()], &Camera::default(), &Style::default(), 97, 45))
    };
    assert_eq!(draw(1), draw(3));
}

#[test]
fn nothing_strange_is_drawn_and_nothing_panics() {
    let empty = picture(vec![]);
    let mut strange = cube([0.0; 3], 1.0);
    strange.points.iter_mut().for_each(|p| p[1] = f64::NAN);
    assert_eq!(picture(vec![strange]), empty);
    let mut out_of_range = cube([0.0; 3], 1.0);
    out_of_range.triangles = vec![[0, 1, 99]];
    assert_eq!(picture(vec![out_of_range]), empty);
    let point = Model::new(vec![[5.0; 3]; 3], vec![[0, 1, 2]]);
    assert_eq!(picture(vec![point]), empty);
    render(&[], &Camera { toward_eye: [0.0; 3], up: [0.0; 3], opening: f64::NAN }, &Style::default(), 3, 0);
}

#[test]
fn colours_run_from_dark_to_light() {
    let lightness = |t: f64| {
        let [r, g, b] = colour_map(t).map(color::to_linear);
        0.2126 * r + 0.7152 * g + 0.0722 * b
    };
    let steps: Vec<f32> = (0..=20).map(|i| lightness(f64::from(i) / 20.0)).collect();
    assert!(steps.windows(2).all(|w| w[0] < w[1]), "{steps:?}");
    assert_eq!(colour_map(-3.0), colour_map(0.0));
    assert_eq!(colour_map(f64::NAN), [0.6; 3]);
    assert_eq!([0.0, 0.5, 1.0].map(|c| color::to_byte(color::to_linear(c))), [0, 128, 255]);
}

#[test]
fn png_files_read_back() {
    let image = picture(vec![cube([0.0; 3], 1.0)]);
    let path = std::env::temp_dir().join(format!("proxel-preview-{}.png", std::process::id()));
    image.write_png(&path).unwrap();
    let decoder = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(&path).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    std::fs::remove_file(&path).unwrap();
    assert_eq!((info.width, info.height), (60, 40));
    assert_eq!(bytes, image.pixels().as_flattened());
}

use super::*;

fn near(a: [u8; 3], color: [f32; 3]) -> bool {
    let b = color.map(|c| color::to_byte(color::to_linear(c)));
    (0..3).all(|k| a[k].abs_diff(b[k]) <= 2)
}

fn count(image: &Image, color: [f32; 3]) -> usize {
    image.pixels().iter().filter(|p| near(**p, color)).count()
}

/// A square of 8 triangles around a vertex in the middle, as a map: the surface itself.
type Mapped = (Vec<[f64; 3]>, Vec<[u32; 3]>, Vec<[[f64; 2]; 3]>);

fn fan() -> Mapped {
    let mut points = vec![[0.5, 0.5, 0.0]];
    points.extend([[0, 0], [1, 0], [2, 0], [2, 1], [2, 2], [1, 2], [0, 2], [0, 1]].map(|p| {
        let [x, y] = p.map(|c| 0.5 * f64::from(c));
        [x, y, 0.0]
    }));
    let triangles: Vec<[u32; 3]> = (0..8).map(|i| [0, i + 1, (i + 1) % 8 + 1]).collect();
    let uv = triangles.iter().map(|t| t.map(|v| [points[v as usize][0], points[v as usize][1]])).collect();
    (points, triangles, uv)
}

#[test]
fn singular_values_are_those_of_the_map() {
    let (mut points, triangles, uv) = fan();
    for p in &mut points {
        *p = [3.0 * p[0], 0.0, 0.5 * p[1]]; // on another plane; the map shrinks x to 1/3 and doubles y
    }
    for s in singular_values(&points, &triangles, &uv) {
        assert!((s[0] - 2.0).abs() < 1e-12 && (s[1] - 1.0 / 3.0).abs() < 1e-12, "{s:?}");
    }
    let mirrored: Vec<_> = uv.iter().map(|t| t.map(|p| [-p[0], p[1]])).collect();
    assert!(singular_values(&points, &triangles, &mirrored).iter().all(|s| (s[1] + 1.0 / 3.0).abs() < 1e-12));
    points[0] = points[1];
    assert!(singular_values(&points, &triangles, &uv)[0][0].is_nan());
    assert!(singular_values(&points, &[[0, 1, 99]], &uv)[0][0].is_nan());
}

#[test]
fn stretches_do_not_depend_on_the_scale_of_the_map() {
    let (points, triangles, mut uv) = fan();
    for t in &mut uv {
        *t = t.map(|p| [1e-3 * p[0], 2e-3 * p[1]]);
    }
    // Scaled best, the map has the singular values sqrt 2 and 1 / sqrt 2.
    for s in stretches(&points, &triangles, &uv) {
        assert!((s.max(1.0 / s) - 2_f64.sqrt()).abs() < 1e-12, "{s}");
    }
    let t = uv[3];
    uv[3] = [t[0], t[2], t[1]]; // flipped
    let s = stretches(&points, &triangles, &uv);
    assert!(s[3] < 0.0 && s.iter().filter(|s| **s > 0.0).count() == 7);
}

#[test]
fn colours_tell_stretched_squeezed_and_flipped_apart() {
    let [red, light, blue] = [3.0, 1.0, 1.0 / 3.0].map(stretch_color);
    assert!(red[0] > red[2] + 0.3 && blue[2] > blue[0] + 0.3 && light.iter().all(|c| *c > 0.9));
    assert_eq!([stretch_color(-1.0), stretch_color(0.0)], [FLIPPED; 2]);
    assert_eq!(stretch_color(f64::NAN), [0.6; 3]);
    assert_eq!([stretch_color(1e9), stretch_color(1e-9)], [4.0, 0.25].map(stretch_color));
}

#[test]
fn a_map_shows_stretch_flips_borders_and_seams() {
    let (_, triangles, uv) = fan();
    let mut stretch = vec![2.0; 8];
    let picture = |uv: &[[[f64; 2]; 3]], stretch: &[f64], triangles: &[[u32; 3]]| {
        draw_uv_map(&UvPicture { triangles, uv, stretch, unit_square: false }, 120, 100)
    };
    let (border, seam) = ([0.16, 0.16, 0.18], [0.0, 0.42, 0.24]);
    let plain = picture(&uv, &stretch, &triangles);
    assert!(count(&plain, stretch_color(2.0)) > 7000, "the square is 93 pixels wide");
    assert!(count(&plain, border) > 4 * 85 && count(&plain, seam) == 0 && count(&plain, FLIPPED) == 0);
    stretch[2] = -1.0;
    let flipped = picture(&uv, &stretch, &triangles);
    assert!(count(&flipped, FLIPPED) > 800, "an eighth of the square");
    // A flipped triangle far too small to be seen is marked.
    let mut tiny = uv.clone();
    tiny.push([[0.3, 0.3], [0.3, 0.3 + 1e-6], [0.3 + 1e-6, 0.3]]);
    stretch[2] = 1.0;
    stretch.push(-1.0);
    let more = [&triangles[..], &[[20, 21, 22]]].concat();
    assert!(count(&picture(&tiny, &stretch, &more), FLIPPED) > 15);
    // The triangles are torn apart: every edge that they share is a seam.
    let torn: Vec<_> = uv.iter().enumerate().map(|(i, t)| t.map(|p| [p[0] + 1.5 * i as f64, p[1]])).collect();
    let cut = picture(&torn, &stretch, &triangles);
    assert!(count(&cut, seam) > 20, "{}", count(&cut, seam));
}

#[test]
fn the_unit_square_is_drawn_around_packed_maps() {
    let (_, triangles, uv) = fan();
    let small: Vec<_> = uv.iter().map(|t| t.map(|p| p.map(|c| 0.1 + 0.3 * c))).collect();
    let draw = |unit_square: bool| {
        draw_uv_map(&UvPicture { triangles: &triangles, uv: &small, stretch: &[], unit_square }, 100, 100)
    };
    let grey = [0.6; 3];
    let (loose, framed) = (draw(false), draw(true));
    assert!(count(&loose, grey) > 7000, "it fills the picture");
    let part = count(&framed, grey) as f64 / (93.0 * 93.0);
    assert!((part - 0.09).abs() < 0.02, "it fills 0.09 of the square: {part}");
    assert!(count(&framed, [0.72, 0.73, 0.76]) > 300);
    // v is upward: the map is on the lower left.
    assert!(near(framed.pixels()[75 * 100 + 25], grey) && !near(framed.pixels()[25 * 100 + 25], grey));
}

#[test]
fn maps_that_cannot_be_drawn_are_left_out() {
    let (_, triangles, mut uv) = fan();
    let view = |uv: &[[[f64; 2]; 3]]| {
        draw_uv_map(&UvPicture { triangles: &triangles, uv, stretch: &[1.0; 8], unit_square: false }, 60, 40)
    };
    let whole = view(&uv);
    uv[0][1][0] = f64::NAN;
    let part = view(&uv);
    assert!(count(&part, stretch_color(1.0)) < count(&whole, stretch_color(1.0)));
    assert_eq!(count(&view(&[]), [1.0; 3]), 2400);
    assert_eq!(view(&[[[2.0; 2]; 3]; 8]).width(), 60);
    assert_eq!(draw_uv_map(&UvPicture { triangles: &[], uv: &uv, stretch: &[], unit_square: true }, 0, 0).height(), 0);
}

#[test]
fn the_checkerboard_has_both_colours_on_both_sides() {
    let (points, triangles, uv) = fan();
    let camera = Camera { toward_eye: [0.0, 0.0, 1.0], ..Camera::default() };
    let image = draw_checkerboard(&points, &triangles, &uv, &camera, 200, 100);
    let bluish = |p: &[u8; 3]| i32::from(p[2]) > i32::from(p[0]) + 50;
    let warm = |p: &[u8; 3]| p[0] > 200 && p[0] > p[2];
    for side in 0..2 {
        let pixels = || (0..100).flat_map(|y| image.pixels()[200 * y + 100 * side..][10..90].iter());
        let (dark, light) = (pixels().filter(|p| bluish(p)).count(), pixels().filter(|p| warm(p)).count());
        assert!(dark > 1000 && light > 1000, "{side}: {dark} {light}");
    }
    // About 34 squares along each side of the body, since 48 span its diagonal: 33 changes along a row.
    let checker = Checker::new(&points, &triangles, uv.clone(), 48.0);
    assert!((checker.edge - 2_f64.sqrt() / 48.0).abs() < 1e-12);
    let mirrored: Vec<_> = uv.iter().map(|t| t.map(|p| [-p[0], p[1]])).collect();
    let image = draw_checkerboard(&points, &triangles, &mirrored, &camera, 200, 100);
    let loud = |p: &&[u8; 3]| p[0] > 150 && i32::from(p[1]) + 60 < i32::from(p[2]);
    assert!(image.pixels().iter().filter(loud).count() > 1000, "flipped triangles are seen");
}

#[test]
fn heat_maps_are_means_over_the_faces_around_a_vertex() {
    let (mut points, triangles, _) = fan();
    points.push([9.0; 3]); // in no triangle
    let stretch = [2.0, 0.5, 1.0, 1.0, 1.0, 1.0, 1.0, -1.0];
    let fields = heat_map(&points, &triangles, &stretch).unwrap();
    let (colors, values) = (fields.colors.unwrap(), &fields.point[0].data);
    assert_eq!(fields.point[0].name, "distortion");
    // Vertex 2 is between triangles 0 and 1, both with distortion 2, whose logarithms cancel.
    assert!((values[2] - 2.0).abs() < 1e-12 && near(colors[2], stretch_color(1.0)));
    assert!((values[0] - 10.0 / 8.0).abs() < 1e-12 && near(colors[0], FLIPPED));
    assert!(near(colors[8], FLIPPED) && near(colors[5], stretch_color(1.0)));
    assert!(values[9].is_nan() && near(colors[9], [0.6; 3]));
    assert!(heat_map(&points, &triangles, &[1.0]).is_err());
}

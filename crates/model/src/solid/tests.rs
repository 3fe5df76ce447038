use super::*;
use std::sync::Arc;

/// Points of the space around the origin, some of them on axes and planes.
fn samples() -> impl Iterator<Item = V3> {
    let steps = [-2.3, -1.1, -0.6, -0.2, 0.0, 0.31, 0.7, 1.4, 2.9];
    steps.into_iter().flat_map(move |x| steps.into_iter().flat_map(move |y| steps.into_iter().map(move |z| [x, y, z])))
}

/// Slow twin: whether a point is inside, by definition.
type Inside = fn(V3) -> bool;

fn solids() -> Vec<(Arc<dyn Solid>, Inside)> {
    vec![
        (Arc::new(Ground { normal: [0.0, 1.0, 0.0] }), |x| x[1] < 0.0),
        (Arc::new(Sphere { radius: 0.9 }), |x| norm(x) < 0.9),
        (Arc::new(Brick { half: [0.8, 1.2, 0.4] }), |x| x[0].abs() < 0.8 && x[1].abs() < 1.2 && x[2].abs() < 0.4),
        (Arc::new(Capsule { half: [1.0, 0.0, 0.0], radius: 0.5 }), |x| {
            norm([x[0] - x[0].clamp(-1.0, 1.0), x[1], x[2]]) < 0.5
        }),
        (Arc::new(Cylinder { axis: [0.0, 0.0, 1.0], radius: 0.75, half: 1.0 }), |x| {
            x[0].hypot(x[1]) < 0.75 && x[2].abs() < 1.0
        }),
        (Arc::new(Cylinder { axis: [0.0, 0.0, 1.0], radius: 0.75, half: f64::INFINITY }), |x| x[0].hypot(x[1]) < 0.75),
        (Arc::new(Pit { normal: [0.0, 1.0, 0.0], radius: 1.25 }), |x| x[1] < 0.0 && norm(x) > 1.25),
    ]
}

#[test]
fn signs_distances_and_normals_fit_each_other() {
    for (solid, inside) in solids() {
        for x in samples() {
            let near = solid.nearest(x);
            let gap = norm(add(x, -1.0, near.point));
            assert!((gap - near.distance.abs()).abs() < 1e-12, "{solid:?} {x:?} {near:?}");
            assert!((norm(near.normal) - 1.0).abs() < 1e-12, "{solid:?} {x:?} {near:?}");
            let back = add(near.point, near.distance, near.normal);
            assert!(norm(add(back, -1.0, x)) < 1e-12, "{solid:?} {x:?} {near:?}: x = point + distance normal");
            if gap > 1e-12 {
                assert_eq!(near.distance < 0.0, inside(x), "{solid:?} {x:?} {near:?}");
            }
            // The point is on the surface: a little out of it is outside, a little into it inside.
            let (out, within) = (add(near.point, 1e-7, near.normal), add(near.point, -1e-7, near.normal));
            // (Into the rim of a pit, seen along its plane, is along the plane.)
            let is_in = inside(within) || solid.nearest(within).distance.abs() < 1e-15;
            assert!(!inside(out) && is_in, "{solid:?} {x:?} {near:?}");
        }
    }
}

#[test]
fn nothing_of_the_surface_is_nearer() {
    // Slow twin: the sign of `inside` changes nowhere in a ball of the distance around x.
    for (solid, inside) in solids() {
        for x in samples() {
            let near = solid.nearest(x);
            let side = inside(x);
            for direction in samples().filter(|d| norm(*d) > 0.0) {
                let y = add(x, 0.999 * near.distance.abs() / norm(direction), direction);
                assert!(near.distance.abs() < 1e-9 || inside(y) == side, "{solid:?} {x:?} {y:?} {near:?}");
            }
        }
    }
}

#[test]
fn solids_are_where_they_are_placed() {
    let (sin, cos) = 0.7f64.sin_cos();
    let placement =
        Placement { rotation: [[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]], shift: [3.0, -1.0, 2.0] };
    let solid = Arc::new(Brick { half: [0.5, 1.0, 2.0] });
    let placed = Placed { solid: solid.clone(), placement };
    for x in samples() {
        let (own, world) = (solid.nearest(x), placed.nearest(placement.apply(x)));
        assert!((own.distance - world.distance).abs() < 1e-13);
        // Of several nearest points rounding picks one.
        assert!((norm(add(world.point, -1.0, placement.apply(x))) - own.distance.abs()).abs() < 1e-13);
        assert!(solid.nearest(placement.undo(world.point)).distance.abs() < 1e-13);
        assert!(norm(add(placement.undo(placement.apply(x)), -1.0, x)) < 1e-14);
    }
    let far = Placed { solid: Arc::new(Sphere { radius: 1.0 }), placement: Placement::at([50.0, 0.0, 0.0]) };
    let both = [placed, far];
    assert!(deepest(&both, [50.2, 0.0, 0.0]).is_some_and(|n| n.distance < -0.7));
    assert!(deepest(&[], [0.0; 3]).is_none());
}

#[test]
fn patches_tell_inside_from_outside() {
    for (solid, inside) in solids() {
        for x in samples() {
            let near = solid.nearest(x);
            if near.distance.abs() < 1e-12 {
                continue;
            }
            let on = solid.on_patch(solid.patch(x), x);
            assert_eq!(on.distance < 0.0, inside(x), "{solid:?} {x:?} {on:?}");
            // A patch is a part of its smooth surface, which is no farther.
            assert!(on.distance.abs() <= near.distance.abs() + 1e-12, "{solid:?} {x:?} {on:?} {near:?}");
            let back = add(on.point, on.distance, on.normal);
            assert!(norm(add(back, -1.0, x)) < 1e-12, "{solid:?} {x:?} {on:?}: x = point + distance normal");
        }
    }
}

#[test]
fn what_is_in_front_of_one_patch_needs_no_other() {
    let brick = Brick { half: [0.8, 1.2, 0.4] };
    // Over the edge of two faces, in front of both: neither is needed as long as the other is there.
    assert!((brick.away(0, [0.8, 1.5, 0.0]) - 0.3).abs() < 1e-15);
    assert_eq!(brick.away(2, [0.8, 1.5, 0.0]), 0.0);
    let pit = Pit { normal: [0.0, 1.0, 0.0], radius: 1.25 };
    assert!((pit.away(0, [0.25, 0.0, 0.0]) - 1.0).abs() < 1e-15 && pit.away(0, [2.0, 0.0, 0.0]) == 0.0);
}

#[test]
fn ways_enter_where_they_meet_a_solid_first() {
    let rod = Placed {
        solid: Arc::new(Cylinder { axis: [0.0, 0.0, 1.0], radius: 0.1, half: 9.0 }),
        placement: Placement::at([0.0, 1.0, 0.0]),
    };
    // Through the rod and out on the other side: its near side is met.
    let (patch, at) = rod.entered([0.01, 2.0, 0.0], [0.01, 0.0, 0.0], 1e-9, &[]).unwrap();
    assert!(patch == 0 && at[1] > 1.09, "{patch} {at:?}");
    assert!(rod.entered([0.01, 2.0, 0.0], [0.01, 0.0, 0.0], 1e-9, &[0]).is_none(), "known");
    assert!(rod.entered([0.3, 2.0, 0.0], [0.3, 0.0, 0.0], 1e-9, &[]).is_none(), "passes by");
    assert!(rod.entered([0.0, 2.0, 0.0], [0.0, 2.0, 0.0], 1e-9, &[]).is_none(), "stays");
    let end = rod.entered([0.0, 1.0, 12.0], [0.0, 1.0, 0.0], 1e-9, &[]).unwrap();
    assert!(end.0 == 1 && (end.1[2] - 9.0).abs() < 1e-6, "{end:?}");
}

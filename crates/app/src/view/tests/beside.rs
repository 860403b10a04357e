//! What is shown beside the solids: where it lies, and nowhere else.

use std::collections::BTreeSet;

use glam::Vec3;

use super::*;
use crate::view::{Cells, Ink, Patch, Stretch, Tint, Tinted, second};

/// The ring and the ball on a canvas, and a whole look at them.
fn easel(card: &Card) -> (Canvas, Look, Object) {
    let meta = FieldMeta {
        iso: Some(0.0),
        ..FieldMeta::default()
    };
    let object = Object::of(solid().into(), meta);
    let (canvas, look) = on_canvas(card, &object);
    (canvas, look, object)
}

fn pixels(canvas: &mut Canvas, look: &Look) -> Vec<u8> {
    canvas.pixels(look, SIZE.map(|n| n as u32), false).unwrap()
}

/// The pixel of a place of the world.
fn pixel(look: &Look, p: DVec3) -> usize {
    let place = look.camera.place(p) * SIZE[1] as f64;
    let x = 0.5 * SIZE[0] as f64 + place.x;
    let y = 0.5 * SIZE[1] as f64 - place.y;
    y as usize * SIZE[0] + x as usize
}

fn color(picture: &[u8], n: usize) -> [u8; 3] {
    [picture[3 * n], picture[3 * n + 1], picture[3 * n + 2]]
}

/// Pixels in which two pictures differ by more than rounding.
fn differing(a: &[u8], b: &[u8]) -> BTreeSet<usize> {
    let all = 0..a.len() / 3;
    all.filter(|n| (0..3).any(|c| a[3 * n + c].abs_diff(b[3 * n + c]) > 6))
        .collect()
}

/// A line before the solid is seen all along, one behind it not at all, and what is cut off is cut off of lines too.
#[test]
fn lines_are_hidden_by_what_is_before_them() {
    let Some(card) = card("lines") else { return };
    let (mut canvas, look, _) = easel(&card);
    let look = Look {
        show: Show {
            floor: true,
            ..Show::default()
        },
        ..look
    };
    let bare = pixels(&mut canvas, &look);
    let [right, _, back] = look.camera.axes();
    let origin = canvas.origin();
    // The ball stands before the middle of the ring.
    let middle = DVec3::new(1.5, 2.5, 5.0);
    let line = |toward: f64| {
        let ends = [-1.5, 1.5].map(|x| (middle + x * right + toward * back - origin).as_vec3().to_array());
        [Stretch {
            start: ends[0],
            end: ends[1],
            color: [0, 255, 0, 255],
        }]
    };
    canvas.put_lines(Ink::Floor, &line(4.0));
    let before = pixels(&mut canvas, &look);
    let seen = differing(&bare, &before);
    for x in [-1.2, -0.5, 0.0, 0.7, 1.2] {
        let at = pixel(&look, middle + x * right + 4.0 * back);
        assert!(seen.contains(&at), "nothing at {x}");
        let [r, g, b] = color(&before, at);
        assert!(g > r && g > b, "{r} {g} {b}");
    }
    let long = 3.0 / look.camera.height * SIZE[1] as f64;
    assert!(
        (seen.len() as f64) < 5.0 * long,
        "{} pixels of {long}",
        seen.len()
    );
    canvas.put_lines(Ink::Floor, &line(-4.0));
    assert_eq!(pixels(&mut canvas, &look), bare);
    // Before the plane.
    canvas.put_lines(Ink::Floor, &line(4.0));
    let cut = Look {
        cut: Some((middle, back)),
        ..look
    };
    let with = pixels(&mut canvas, &cut);
    canvas.put_lines(Ink::Floor, &[]);
    assert_eq!(pixels(&mut canvas, &cut), with);
}

/// The cut shows the density that the field has there, from black to white, in a whole picture and by rays alike.
#[test]
fn the_cut_shows_the_density() {
    let Some(card) = card("density on the cut") else {
        return;
    };
    let (mut canvas, look, object) = easel(&card);
    let back = look.camera.axes()[2];
    let look = Look {
        cut: Some((DVec3::new(1.5, 2.5, 5.0), back)),
        density: [0.0, 3.0],
        ..look
    };
    let by_mesh = pixels(&mut canvas, &look);
    let field = object.field.as_field();
    let mut compared = 0;
    for n in 0..SIZE[0] * SIZE[1] {
        let (x, y) = ((n % SIZE[0]) as f64 + 0.5, (n / SIZE[0]) as f64 + 0.5);
        let at = DVec2::new(x - 0.5 * SIZE[0] as f64, 0.5 * SIZE[1] as f64 - y) / SIZE[1] as f64;
        let ray = look.camera.ray(at);
        let p = ray.from + (look.cut.unwrap().0 - ray.from).dot(back) / ray.along.dot(back) * ray.along;
        let f = field.value(p);
        // At its rim a pixel shows more than the cut.
        if !(0.4..2.9).contains(&f) {
            continue;
        }
        let share = f / 3.0;
        for (c, (thin, dense)) in [(0.045, 0.86), (0.04, 0.80), (0.04, 0.70)]
            .into_iter()
            .enumerate()
        {
            let linear: f64 = thin + share * share * (dense - thin);
            let wished = 255.0 * (1.055 * linear.powf(1.0 / 2.4) - 0.055);
            let found = f64::from(by_mesh[3 * n + c]);
            assert!((wished - found).abs() < 5.0, "{found} for {wished} at {p}");
        }
        compared += 1;
    }
    assert!(compared > 500, "only {compared} pixels show the cut");
    let rays = Look {
        mode: Mode::Rays,
        ..look
    };
    let (mean, far) = difference(&by_mesh, &pixels(&mut canvas, &rays));
    assert!(mean < 4.0 && far < 0.03, "mean {mean}, far {far}");
}

/// A second surface is looked through: it tints what it lies round, and leaves all else as it is. By rays too.
#[test]
fn a_second_surface_is_looked_through() {
    let Some(card) = card("second surface") else {
        return;
    };
    let (mut canvas, look, object) = easel(&card);
    let origin = canvas.origin();
    let outer = second(&object, -1.0, DAffine3::IDENTITY, origin, 100_000).unwrap();
    let shown = Look {
        show: Show {
            second: true,
            ..Show::default()
        },
        ..look
    };
    for mode in [Mode::Mesh, Mode::Rays] {
        let [bare, shown] = [look, shown].map(|look| Look { mode, ..look });
        canvas.put_veil(&[], None);
        let first = pixels(&mut canvas, &bare);
        assert_eq!(pixels(&mut canvas, &shown), first);
        canvas.put_veil(&outer, None);
        let veiled = pixels(&mut canvas, &shown);
        assert_eq!(pixels(&mut canvas, &bare), first, "{mode:?}: it is not wished");
        let differs = differing(&first, &veiled);
        // Over the ball it lets clay through: redder than itself, bluer than clay.
        let at = pixel(&shown, DVec3::new(1.5, 2.5, 8.0));
        let ([r0, _, b0], [r, _, b]) = (color(&first, at), color(&veiled, at));
        assert!(
            differs.contains(&at) && b > b0 && r > b,
            "{mode:?}: {r0} {b0} became {r} {b}"
        );
        // Far from the solid nothing.
        let corner = [0, SIZE[0] - 1, SIZE[0] * SIZE[1] - 1];
        assert!(corner.iter().all(|n| !differs.contains(n)));
    }
    // One within the first is seen through that.
    let inner = second(&object, 1.0, DAffine3::IDENTITY, origin, 100_000).unwrap();
    canvas.put_veil(&inner, Some("solid"));
    let first = pixels(&mut canvas, &look);
    let around = pixels(&mut canvas, &shown);
    let at = pixel(&shown, DVec3::new(1.5, 2.5, 8.0));
    let ([r0, _, b0], [r, _, b]) = (color(&first, at), color(&around, at));
    assert!(b > b0 && r > b, "{r0} {b0} became {r} {b}");
}

/// In a volume it lies where the field has its density: lines that meet it there lose light to it, also where the volume is clear, and
/// no others do.
#[test]
fn a_second_surface_is_seen_in_a_volume() {
    let Some(card) = card("second surface in a volume") else {
        return;
    };
    let (mut canvas, look, object) = easel(&card);
    // All clear, and with the mist that is within the first surface.
    for density in [[50.0, 60.0], [0.0, 40.0]] {
        let look = Look {
            mode: Mode::Volume,
            density,
            ..look
        };
        canvas.put_second(None);
        let bare = pixels(&mut canvas, &look);
        // Where it is nowhere, lines that look for it all the way find nothing else either.
        canvas.put_second(Some(("solid".into(), -1e3)));
        let lost = differing(&bare, &pixels(&mut canvas, &look));
        assert!(lost.len() < 5, "{density:?}: {} pixels differ", lost.len());
        for second in [-1.0, 1.0] {
            canvas.put_second(Some(("another".into(), second)));
            assert_eq!(pixels(&mut canvas, &look), bare);
            canvas.put_second(Some(("solid".into(), second)));
            let seen = differing(&bare, &pixels(&mut canvas, &look));
            let within = object.field.world_box();
            let (mut met, mut wrong) = (0, 0);
            for n in 0..SIZE[0] * SIZE[1] {
                let (x, y) = ((n % SIZE[0]) as f64 + 0.5, (n / SIZE[0]) as f64 + 0.5);
                let at = DVec2::new(x - 0.5 * SIZE[0] as f64, 0.5 * SIZE[1] as f64 - y) / SIZE[1] as f64;
                let is_met = pick(object.field.as_field(), second, &within, &look.camera.ray(at)).is_some();
                met += usize::from(is_met);
                wrong += usize::from(is_met != seen.contains(&n));
            }
            // At its rim a line looks past it between two steps.
            assert!(
                met > 2000 && wrong < met / 25,
                "{density:?}, {second}: {wrong} of {met}"
            );
        }
    }
    // What is edited keeps it, and it goes when it is not wished.
    let volume = Look {
        mode: Mode::Volume,
        density: [50.0, 60.0],
        ..look
    };
    let shown = pixels(&mut canvas, &volume);
    canvas.put_solid("solid", Solid::of(&object, 0.5, DAffine3::IDENTITY).unwrap());
    assert_eq!(pixels(&mut canvas, &volume), shown);
    canvas.put_second(None);
    assert_ne!(pixels(&mut canvas, &volume), shown);
}

/// As fine as the first surface, but never of more triangles than it may have.
#[test]
fn a_second_surface_has_no_more_triangles_than_it_may() {
    let object = Object::of(bumps().into(), FieldMeta::default());
    let count = |most| {
        let patches = second(&object, 0.5, DAffine3::IDENTITY, DVec3::ZERO, most).unwrap();
        patches.iter().map(|p: &Patch| p.indices.len() / 3).sum::<usize>()
    };
    let (coarsest, all) = (count(0), count(usize::MAX));
    assert!(coarsest < all, "{coarsest} of {all}");
    for most in [all / 2, all - 1, all] {
        let found = count(most);
        assert!(
            found <= most.max(coarsest),
            "{found} of {most}, {coarsest} at the least"
        );
    }
}

/// Colours tell the share at a place, by triangles and by rays; without one they tell that nothing is known.
#[test]
fn colours_tell_shares() {
    let Some(card) = card("colours") else { return };
    let (mut canvas, look, _) = easel(&card);
    let right = look.camera.axes()[0];
    let middle = DVec3::new(1.5, 2.5, 5.0);
    let shares = move |_: &str, places: &[DVec3]| {
        let share = |p: &DVec3| f32::from(u8::from((*p - middle).dot(right) > 0.0));
        places.iter().map(share).collect()
    };
    canvas.tint_by(Some(Tinted(Arc::new(shares))));
    let look = Look {
        show: Show {
            tint: Tint::Errors,
            ..Show::default()
        },
        ..look
    };
    let up = look.camera.axes()[1];
    let at = |side: f64| {
        pixel(
            &look,
            middle + 1.6 * side * right + 0.5 * up + 2.0 * look.camera.axes()[2],
        )
    };
    for mode in [Mode::Mesh, Mode::Rays] {
        let picture = pixels(&mut canvas, &Look { mode, ..look });
        let [r, g, b] = color(&picture, at(-1.0));
        assert!(b > g && r > g, "{mode:?}: {r} {g} {b} is no violet");
        let [r, g, b] = color(&picture, at(1.0));
        assert!(r > b && g > b, "{mode:?}: {r} {g} {b} is no yellow");
    }
    canvas.tint_by(None);
    let clay = pixels(&mut canvas, &look);
    let [r, g, b] = color(&clay, at(1.0));
    assert!(r > g && g > b, "{r} {g} {b} is no clay");
}

/// Painted stiffness is where it is on triangles and by rays.
#[test]
fn paint_shows_by_rays_too() {
    let Some(card) = card("paint by rays") else { return };
    let (mut canvas, look, object) = easel(&card);
    let mut shape = Shape::new(&object, 0.0, DAffine3::IDENTITY, Budget::PROCESSOR).unwrap();
    let middle = DVec3::new(1.5, 2.5, 5.0);
    for mut patch in shape.all("solid", canvas.origin()) {
        for vertex in &mut patch.vertices {
            let p = Vec3::from(vertex.at).as_dvec3() + canvas.origin();
            vertex.paint = if p.distance(middle) < 3.5 { 4.0 } else { 0.0 };
        }
        canvas.put(&patch);
    }
    let blue = |mode, paint, canvas: &mut Canvas| {
        let picture = pixels(canvas, &Look { mode, paint, ..look });
        let is_blue = |n: &usize| picture[3 * n + 2] > picture[3 * n].saturating_add(10);
        (0..picture.len() / 3).filter(is_blue).collect::<BTreeSet<_>>()
    };
    let without = blue(Mode::Mesh, false, &mut canvas).len();
    let [by_mesh, by_rays] = [Mode::Mesh, Mode::Rays].map(|mode| blue(mode, true, &mut canvas));
    assert_eq!(without, 0);
    assert!(by_mesh.len() > 300, "{}", by_mesh.len());
    let differ = by_mesh.symmetric_difference(&by_rays).count();
    assert!(differ * 12 < by_mesh.len(), "{differ} of {}", by_mesh.len());
    assert!(blue(Mode::Rays, false, &mut canvas).is_empty());
}

/// What is hidden leaves the paper, in every mode, and comes back.
#[test]
fn hidden_objects_are_not_drawn() {
    let Some(card) = card("hidden objects") else {
        return;
    };
    let (mut canvas, look, _) = easel(&card);
    for mode in [Mode::Mesh, Mode::Rays, Mode::Volume] {
        let look = Look { mode, ..look };
        let shown = pixels(&mut canvas, &look);
        canvas.hide(&BTreeSet::from(["solid".to_string()]));
        let hidden = pixels(&mut canvas, &look);
        let row = |n: usize| color(&hidden, n * SIZE[0]);
        let is_paper = |n: usize| (0..3).all(|c| color(&hidden, n)[c].abs_diff(row(n / SIZE[0])[c]) < 2);
        assert!((0..hidden.len() / 3).all(is_paper), "{mode:?}");
        canvas.hide(&BTreeSet::new());
        assert_eq!(pixels(&mut canvas, &look), shown, "{mode:?}");
    }
}

/// Wires lie on the solid alone; cells and points are drawn only where they are wished.
#[test]
fn what_is_not_wished_is_not_drawn() {
    let Some(card) = card("wishes") else { return };
    let (mut canvas, look, _) = easel(&card);
    let bare = pixels(&mut canvas, &look);
    let at = (DVec3::new(1.5, 2.5, 5.0) + 4.0 * look.camera.axes()[2] - canvas.origin())
        .as_vec3()
        .to_array();
    let dot = [Stretch {
        start: at,
        end: at,
        color: [255; 4],
    }];
    canvas.put_lines(Ink::Cells, &dot);
    canvas.put_lines(Ink::Points, &dot);
    assert_eq!(pixels(&mut canvas, &look), bare);
    let by = |show: Show, canvas: &mut Canvas| differing(&bare, &pixels(canvas, &Look { show, ..look }));
    let usual = Show::default();
    let cells = by(
        Show {
            cells: Cells::Level,
            ..usual
        },
        &mut canvas,
    );
    let points = by(
        Show {
            points: true,
            ..usual
        },
        &mut canvas,
    );
    assert!(!cells.is_empty() && cells.len() < 60, "{}", cells.len());
    assert_eq!(cells, points);
    let wires = by(
        Show {
            wireframe: true,
            ..usual
        },
        &mut canvas,
    );
    let paper = color(&bare, 0);
    assert!(wires.len() > 2000, "{}", wires.len());
    assert!(!wires.contains(&0), "{paper:?}");
}

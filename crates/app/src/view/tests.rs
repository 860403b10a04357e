//! The graphics card against the processor, against the field itself, and against how it drew before.

mod beside;
mod laid;
mod stereo;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use bspline::hierarchical::{BlockEdit, BrickKey, Change, DenseCorrections, Lattice, LevelCorrections};
use bspline::polygonize::{BlockMesh, Mesh, PolygonizeOptions};
use bspline::{Aabb, Frame, HierarchicalSpline};
use document::Object;
use formats::field::FieldMeta;
use glam::{DAffine3, DVec2, DVec3};

use super::shape::Vertex;
use super::still::easel;
use super::{
    BUDGET, Budget, Camera, Canvas, Card, Look, MESH, Manner, Mode, Paper, Patch, SKY, Shape, Show, Solid,
    pick, read, still,
};
use crate::picture::{Drawing, Scene, Surface, View, clay, depths};

const SIZE: [usize; 2] = [240, 180];

/// A card, or a loud skip.
fn card(what: &str) -> Option<Card> {
    match Card::open() {
        Ok(card) => Some(card),
        Err(why) if std::env::var_os("ISOCLAY_NEEDS_CARD").is_some() => panic!("{what}: {why}"),
        Err(why) => {
            eprintln!("SKIPPED {what}: {why}");
            None
        }
    }
}

/// A ring with a ball before it, so that one hides a part of the other and throws a shadow on it.
fn solid() -> HierarchicalSpline<f32> {
    let lattice = Lattice {
        world_from_lattice: DAffine3::from_translation(DVec3::splat(-12.0)),
        cells: [24; 3],
    };
    let ring = |p: DVec3| 2.2 - DVec3::new(p.truncate().length() - 6.5, 0.0, p.z).length();
    let ball = |p: DVec3| 3.0 - p.distance(DVec3::new(1.5, 2.5, 5.0));
    HierarchicalSpline::schoenberg(lattice, 1.0, |p| ring(p).max(ball(p))).unwrap()
}

fn meshed(field: &HierarchicalSpline<f32>) -> Mesh {
    let frame = Frame::over(&field.lattice().world_box(), [96; 3]);
    let (mesh, _) = BlockMesh::new(field, &frame, &PolygonizeOptions::default()).unwrap();
    mesh.mesh().unwrap()
}

/// Depths that lines to the field find, one for each pixel.
fn lines(field: &HierarchicalSpline<f32>, look: &Look, center: DVec3) -> Vec<Option<f64>> {
    let [w, h] = SIZE.map(|n| n as f64);
    let within = field.lattice().world_box();
    let depth = |n: usize| {
        let (x, y) = ((n % SIZE[0]) as f64 + 0.5, (n / SIZE[0]) as f64 + 0.5);
        let at = DVec2::new((x - 0.5 * w) / h, (0.5 * h - y) / h);
        let (p, _) = pick(field, 0.0, &within, &look.camera.ray(at))?;
        Some((p - center).dot(look.camera.axes()[2]))
    };
    (0..SIZE[0] * SIZE[1]).map(depth).collect()
}

/// The same on one side with small bumps, in finer bricks there alone.
fn bumps() -> HierarchicalSpline<f32> {
    let base = solid();
    let mut levels: Vec<LevelCorrections<f32>> = vec![
        base.corrections(0),
        LevelCorrections::new(),
        LevelCorrections::new(),
    ];
    for (level, reach) in [(1, 13.0_f64), (2, 14.0)] {
        let scale = f64::from(1 << level);
        let mut bricks: BTreeMap<BrickKey, DenseCorrections<f32>> = BTreeMap::new();
        let count = 24 * (1 << level) + 3;
        for function in
            (0..count * count * count).map(|n| [n / (count * count), n / count % count, n % count])
        {
            let p = DVec3::from_array(function.map(|i| (f64::from(i) - 1.0) / scale)) - 12.0;
            if p.x + p.z < reach - 10.0 || p.z < 2.0 {
                continue;
            }
            let wave = 0.25 / scale * (2.1 * p.x * scale).sin() * (1.7 * p.y * scale).cos();
            let key = BrickKey::of(function);
            let slot = function.map(|i| i as usize % 8);
            bricks
                .entry(key)
                .or_insert_with(DenseCorrections::empty)
                .set(slot, wave as f32);
        }
        levels[level] = bricks
            .into_iter()
            .map(|(key, dense)| (key, Arc::new(dense.pack())))
            .collect();
    }
    HierarchicalSpline::from_corrections(*base.lattice(), 1.0, levels)
}

fn cast(field: &HierarchicalSpline<f32>) -> Solid {
    Solid {
        field: field.clone(),
        iso: 0.0,
        world_from_object: DAffine3::IDENTITY,
        second: None,
    }
}

fn by(mode: Mode, solid: &Solid) -> Manner<'_> {
    Manner {
        mode,
        solid: Some(solid),
        ..MESH
    }
}

fn scene<'a>(field: &'a HierarchicalSpline<f32>, mesh: &'a Mesh) -> Scene<'a> {
    Scene {
        field,
        seen: surface(mesh),
        shading: surface(mesh),
    }
}

fn surface(mesh: &Mesh) -> Surface<'_> {
    Surface {
        positions: &mesh.positions,
        triangles: &mesh.triangles,
    }
}

/// Views from three sides.
fn views(mesh: &Mesh) -> [View; 3] {
    [(0.4, 0.3, 1.0), (-0.8, 0.7, 0.5), (0.1, -0.9, 0.4)]
        .map(|(x, y, z)| View::of(&surface(mesh), SIZE, DVec3::new(x, y, z), DVec3::Y))
}

/// What lies in the pixels round one.
fn round<T: Copy>(all: &[T], n: usize) -> impl Iterator<Item = T> {
    let [w, h] = SIZE.map(|n| n as isize);
    let (x, y) = (n as isize % w, n as isize / w);
    let places = (-1..=1).flat_map(move |j| (-1..=1).map(move |i| (x + i, y + j)));
    let inside = places.filter(move |(x, y)| (0..w).contains(x) && (0..h).contains(y));
    inside.map(move |(x, y)| all[(y * w + x) as usize])
}

/// Of depths in pixels the first that has none like it in the same pixel of `others` or beside it, within a tolerance. At rims depths
/// fall too steeply for that: there any will do.
fn unlike(some: &[Option<f64>], others: &[Option<f64>], tolerance: f64) -> Option<usize> {
    (0..some.len()).find(|n| {
        let near: Vec<Option<f64>> = round(others, *n).collect();
        let Some(depth) = some[*n] else {
            return near.iter().all(Option::is_some);
        };
        if near.contains(&None) {
            return near.iter().all(Option::is_none);
        }
        let (low, high) = near
            .iter()
            .flatten()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), d| {
                (l.min(*d), h.max(*d))
            });
        !(low - tolerance..=high + tolerance).contains(&depth)
    })
}

/// Silhouettes within a pixel, depths within a tolerance: of the card and of the processor, which show one mesh, a third of a pixel's
/// width; of lines to the field itself twice that, as the mesh leaves it by a fifth of a pixel.
#[test]
fn the_card_the_processor_and_the_field_show_one_solid() {
    let Some(card) = card("card against processor") else {
        return;
    };
    let field = solid();
    let mesh = meshed(&field);
    let scene = scene(&field, &mesh);
    for view in views(&mesh) {
        let (mut canvas, look) = easel(&card, &scene, &view, MESH);
        let by_card = canvas.depths(&look, SIZE.map(|n| n as u32)).unwrap();
        let by_processor = depths(&scene.seen, &view);
        let by_lines = lines(&field, &look, view.center);
        let count = by_card.iter().flatten().count();
        assert!(count > 5000, "only {count} pixels show anything");
        for (name, others, tolerance) in [("processor", &by_processor, 0.03), ("field", &by_lines, 0.06)] {
            for (a, b) in [(&by_card, others), (others, &by_card)] {
                let at = unlike(a, b, tolerance);
                assert_eq!(at.map(|n| (n, a[n], b[n])), None, "card against {name}");
            }
        }
        // A solid that is moved by two pixels is another one.
        let moved: Vec<Option<f64>> = (by_card[2..].iter().copied()).chain([None; 2]).collect();
        assert!(unlike(&moved, &by_processor, 0.03).is_some());
    }
}

/// Lines through the bricks on the card find what lines find that the processor follows through the field: silhouettes within a pixel,
/// depths within a thousandth of one. Triangles leave the field by more, most where it has small bumps.
#[test]
fn rays_show_the_field_itself() {
    let Some(card) = card("rays against the field") else {
        return;
    };
    let count = SIZE.map(|n| n as u32);
    for (n, field, leaves) in [(0, solid(), 0.06), (1, bumps(), 0.3)] {
        let mesh = meshed(&field);
        let scene = scene(&field, &mesh);
        let view = views(&mesh)[n];
        let solid = cast(&field);
        let (mut canvas, look) = easel(&card, &scene, &view, by(Mode::Rays, &solid));
        let by_rays = canvas.depths(&look, count).unwrap();
        let by_lines = lines(&field, &look, view.center);
        let by_mesh = canvas
            .depths(
                &Look {
                    mode: Mode::Mesh,
                    ..look
                },
                count,
            )
            .unwrap();
        assert!(by_rays.iter().flatten().count() > 5000);
        for (other, others, tolerance) in [("lines", &by_lines, 1e-3), ("mesh", &by_mesh, leaves)] {
            for (a, b) in [(&by_rays, others), (others, &by_rays)] {
                let at = unlike(a, b, tolerance);
                assert_eq!(at.map(|n| (n, a[n], b[n])), None, "{n}: rays against {other}");
            }
        }
    }
}

/// Strip by strip, before the second look and in it, nothing is shown that was not drawn: neither clay nor sky is black.
#[test]
fn whole_pictures_are_never_black_on_the_way() {
    let Some(card) = card("strips") else { return };
    let meta = FieldMeta {
        iso: Some(0.0),
        ..FieldMeta::default()
    };
    let (mut canvas, look) = on_canvas(&card, &Object::of(solid().into(), meta));
    let look = Look {
        mode: Mode::Rays,
        ..look
    };
    for count in 1.. {
        let drawn = canvas.draw(&look, SIZE.map(|n| n as u32), false);
        let bytes = read::bytes(&card.device, &card.queue, &drawn.picture).unwrap();
        let pixels = (drawn.rows * SIZE[1] as f32) as usize * SIZE[0];
        let black = bytes.chunks_exact(4).take(pixels).position(|p| p[..3] == [0; 3]);
        assert_eq!(black, None, "call {count}, {} of the rows", drawn.rows);
        if drawn.is_done {
            assert!(count >= 4, "{count} calls");
            break;
        }
        let _ = card
            .device
            .poll(eframe::egui_wgpu::wgpu::PollType::wait_indefinitely());
    }
}

/// With room for a few bricks alone all of the solid is there, only coarser; with room for all it is as fine as it is.
#[test]
fn bricks_without_room_are_drawn_coarser() {
    let Some(card) = card("too small a budget") else {
        return;
    };
    let field = bumps();
    let mesh = meshed(&field);
    let scene = scene(&field, &mesh);
    let view = views(&mesh)[0];
    let solid = cast(&field);
    let depths = [BUDGET, 300_000, 60_000].map(|bricks| {
        let manner = Manner {
            bricks,
            ..by(Mode::Rays, &solid)
        };
        let (mut canvas, look) = easel(&card, &scene, &view, manner);
        let depths = canvas.depths(&look, SIZE.map(|n| n as u32)).unwrap();
        assert_eq!(canvas.is_whole(), bricks == BUDGET, "{bricks} bytes");
        depths
    });
    let missing = |some: &[Option<f64>], others: &[Option<f64>]| {
        let all = some.iter().zip(others);
        all.filter(|(a, b)| a.is_some() != b.is_some()).count()
    };
    let count = depths[0].iter().flatten().count();
    let misses = [1, 2].map(|n| missing(&depths[0], &depths[n]));
    assert!(
        misses[0] < count / 100 && misses[0] < misses[1] && misses[1] < count / 8,
        "{misses:?} of {count}"
    );
    let at = unlike(&depths[1], &depths[0], 1e-3);
    assert!(at.is_some(), "coarser bricks show the same");
}

/// The card and the processor find as much light taken from lines through the density, by many small steps.
#[test]
fn volumes_take_the_light_that_their_density_takes() {
    let Some(card) = card("volume against the field") else {
        return;
    };
    let field = solid();
    let mesh = meshed(&field);
    let scene = scene(&field, &mesh);
    let view = views(&mesh)[0];
    let solid = cast(&field);
    let manner = Manner {
        density: [0.0, 40.0],
        ..by(Mode::Volume, &solid)
    };
    let (mut canvas, look) = easel(&card, &scene, &view, manner);
    let size = SIZE.map(|n| n as u32);
    let seen = canvas.pixels(&look, size, false).unwrap();
    let empty = canvas
        .pixels(
            &Look {
                density: [50.0, 60.0],
                ..look
            },
            size,
            false,
        )
        .unwrap();
    let by_mesh = canvas
        .depths(
            &Look {
                mode: Mode::Mesh,
                ..look
            },
            size,
        )
        .unwrap();
    let differs = |n: usize| {
        (0..3)
            .map(|c| seen[3 * n + c].abs_diff(empty[3 * n + c]))
            .max()
            .unwrap()
    };
    // Beside the solid nothing is above black; in its middle something is.
    let beside = (0..by_mesh.len()).filter(|n| round(&by_mesh, *n).all(|d| d.is_none()));
    assert!(beside.into_iter().all(|n| differs(n) == 0));
    let within: Vec<usize> = (0..by_mesh.len()).filter(|n| by_mesh[*n].is_some()).collect();
    let seen_within = within.iter().filter(|n| differs(**n) > 4).count();
    assert!(
        seen_within * 10 > within.len() * 8,
        "{seen_within} of {}",
        within.len()
    );
}

/// Light, shadows and paper are those of `isoclay picture`: its pixels have two samples a side, and its edges another curve of grey.
#[test]
fn the_card_and_the_processor_have_one_look() {
    let Some(card) = card("look of the card") else {
        return;
    };
    let field = solid();
    let mesh = meshed(&field);
    let scene = scene(&field, &mesh);
    for view in views(&mesh) {
        let by_card = still(&card, &scene, &view, MESH).unwrap();
        let by_processor = Drawing::new(&scene, &view).pixels(&clay);
        let (mean, far) = difference(&by_card, &by_processor);
        assert!(mean < 4.0 && far < 0.02, "mean {mean}, far {far}");
    }
}

/// Mean difference of two pictures, and the share of bytes that differ by more than 32.
fn difference(a: &[u8], b: &[u8]) -> (f64, f64) {
    assert_eq!(a.len(), b.len());
    let all = || a.iter().zip(b).map(|(a, b)| a.abs_diff(*b));
    let mean = all().map(f64::from).sum::<f64>() / a.len() as f64;
    let far = all().filter(|d| *d > 32).count() as f64 / a.len() as f64;
    (mean, far)
}

/// The object that a field is.
fn of(field: HierarchicalSpline<f32>) -> Object {
    let meta = FieldMeta {
        iso: Some(0.0),
        ..FieldMeta::default()
    };
    Object::of(field.into(), meta)
}

/// An object on the canvas of a window, and a look at it.
fn on_canvas(card: &Card, object: &Object) -> (Canvas, Look) {
    let mut shape = Shape::new(object, 0.0, DAffine3::IDENTITY, Budget::PROCESSOR).unwrap();
    let bounds: Aabb = shape.bounding_box().unwrap();
    let origin = bounds.center();
    let radius = 0.5 * bounds.size().length();
    let mut canvas = Canvas::new(&card.device, &card.queue, SKY, BUDGET);
    canvas.begin(origin, radius);
    shape
        .all("solid", origin)
        .iter()
        .for_each(|patch| canvas.put(patch));
    canvas.put_solid("solid", Solid::of(object, 0.0, DAffine3::IDENTITY).unwrap());
    let look = Look {
        camera: Camera::onto(origin, radius, DVec3::Y),
        cut: None,
        paint: true,
        mode: Mode::Mesh,
        density: [0.0, 3.0],
        paper: Paper::Dark,
        show: Show::default(),
        line: 1.0 / 120.0,
    };
    (canvas, look)
}

/// A solid of so many triangles that it cannot be drawn 20 times a second: a box full of small balls.
fn balls() -> HierarchicalSpline<f32> {
    const SIDE: u32 = 14;
    let lattice = Lattice {
        world_from_lattice: DAffine3::IDENTITY,
        cells: [6 * SIDE; 3],
    };
    let ball = |p: DVec3| 2.2 - (p - 6.0 * (p / 6.0).floor() - 3.0).length();
    HierarchicalSpline::schoenberg(lattice, 1.0, ball).unwrap()
}

/// What is much is drawn coarser while something moves, and to the same silhouette; what a stroke changes is drawn as it is.
#[test]
fn many_triangles_are_fewer_while_something_moves() {
    let Some(card) = card("rough triangles") else {
        return;
    };
    let field = balls();
    let object = of(field.clone());
    let mut shape = Shape::new(&object, 0.0, DAffine3::IDENTITY, Budget::PROCESSOR).unwrap();
    let origin = object.field.world_box().center();
    let all = shape.all("solid", origin);
    let whole: usize = all.iter().map(|patch| patch.indices.len() / 3).sum();
    let rough: usize = all
        .iter()
        .flat_map(|patch| &patch.rough)
        .map(|rough| rough.len() / 3)
        .sum();
    assert!(
        whole > 250_000 && rough <= 200_000 && rough > 20_000,
        "{rough} of {whole}"
    );
    let (mut canvas, look) = on_canvas(&card, &object);
    let size = SIZE.map(|n| n as u32);
    let fresh = canvas.pixels(&look, size, true).unwrap();
    canvas.pixels(&look, size, false).unwrap();
    let turned = Look {
        line: 1.01 * look.line,
        ..look
    };
    let rough = canvas.pixels(&turned, size, true).unwrap();
    assert_ne!(fresh, rough, "what no whole picture has shown is drawn as it is");
    let (mean, far) = difference(&fresh, &rough);
    assert!(mean < 4.0 && far < 0.04, "{mean} {far}");
    // Both follow a dent.
    let dent = BlockEdit {
        level: 0,
        first: [40; 3],
        shape: [3; 3],
        change: Change::Add(vec![-0.5; 27]),
    };
    let dented = of(field.edited_blocks(&[dent]).unwrap());
    let of_stroke = shape.follow_stroke("solid", &dented, origin).unwrap();
    let both = shape.follow("solid", &dented, origin).unwrap();
    for patches in [&of_stroke, &both] {
        assert!(!patches.is_empty() && patches.len() < all.len());
    }
    let mut again = Shape::new(&dented, 0.0, DAffine3::IDENTITY, Budget::PROCESSOR).unwrap();
    let again = again.all("solid", origin);
    let same = |patches: &[Patch], patch: &Patch, corners: fn(&Patch) -> Vec<Vertex>| {
        let other = patches.iter().find(|p| p.part == patch.part);
        corners(patch) == other.map(corners).unwrap_or_default()
    };
    for patch in &of_stroke {
        assert!(same(&again, patch, fine), "{:?}", patch.part);
        assert!(
            same(&all, patch, coarse),
            "the coarser surface is seen by nobody yet"
        );
    }
    assert!(both.iter().any(|patch| !same(&all, patch, coarse)));
    for patch in &both {
        assert!(
            same(&again, patch, fine) && same(&again, patch, coarse),
            "{:?}",
            patch.part
        );
    }
}

/// The corners of its triangles, one after another.
fn fine(patch: &Patch) -> Vec<Vertex> {
    corners(patch, &patch.indices)
}

/// Those of the coarser ones.
fn coarse(patch: &Patch) -> Vec<Vertex> {
    corners(patch, patch.rough.as_ref().expect("these are many"))
}

fn corners(patch: &Patch, indices: &[u32]) -> Vec<Vertex> {
    indices.iter().map(|n| patch.vertices[*n as usize]).collect()
}

/// Where fewer triangles are wished, it is the error that grows.
#[test]
fn solids_have_no_more_triangles_than_are_wished() {
    let object = of(balls());
    let count = |most| {
        let budget = Budget {
            still: most,
            ..Budget::PROCESSOR
        };
        let mut shape = Shape::new(&object, 0.0, DAffine3::IDENTITY, budget).unwrap();
        let patches = shape.all("solid", DVec3::ZERO);
        let triangles: usize = patches.iter().map(|p| p.indices.len() / 3).sum();
        (triangles, shape.area_and_volume()[0])
    };
    let (all, area) = count(Budget::CARD.still);
    for most in [all, all / 2, all / 3] {
        let (fewer, less) = count(most);
        assert!(fewer <= most && 5 * fewer > most, "{fewer} of {most}");
        assert!((less / area - 1.0).abs() < 0.1, "{less} of {area}");
    }
}

/// What shares its triangles with a hundred others is seen, if in more than its share.
#[test]
fn the_coarsest_triangles_are_made_whatever_their_number() {
    let budget = Budget {
        still: 100,
        moving: 100,
    };
    let mut shape = Shape::new(&of(balls()), 0.0, DAffine3::IDENTITY, budget).unwrap();
    let patches = shape.all("solid", DVec3::ZERO);
    let triangles: usize = patches.iter().map(|p| p.indices.len() / 3).sum();
    assert!(triangles > 100, "{triangles}");
}

/// Where triangles change, the sky is drawn again as if it were drawn whole.
#[test]
fn light_follows_what_changes() {
    let Some(card) = card("light") else { return };
    let field = balls();
    let (object, size) = (of(field.clone()), SIZE.map(|n| n as u32));
    let (mut canvas, look) = on_canvas(&card, &object);
    let before = canvas.pixels(&look, size, false).unwrap();
    let mut shape = Shape::new(&object, 0.0, DAffine3::IDENTITY, Budget::PROCESSOR).unwrap();
    let all = shape.all("solid", canvas.origin()).len();
    // A corner goes that the eye sees, and the shadows of its balls.
    let cut = BlockEdit {
        level: 0,
        first: [66; 3],
        shape: [20; 3],
        change: Change::Add(vec![-9.0; 8000]),
    };
    let less = of(field.edited_blocks(&[cut]).unwrap());
    let patches = shape.follow("solid", &less, canvas.origin()).unwrap();
    assert!(!patches.is_empty() && 2 * patches.len() < all);
    patches.iter().for_each(|patch| canvas.put(patch));
    let followed = canvas.pixels(&look, size, false).unwrap();
    canvas.renew();
    assert_eq!(canvas.pixels(&look, size, false).unwrap(), followed);
    assert!(difference(&before, &followed).1 > 2e-3);
}

/// A scan may fill its box, which cuts it off: the sides are lit as sides, whatever the field says there.
#[test]
fn what_the_box_cuts_off_has_the_normals_of_its_sides() {
    let lattice = Lattice {
        world_from_lattice: DAffine3::from_translation(DVec3::splat(-8.0)),
        cells: [16; 3],
    };
    // Round a place beyond a side: the field's own normal there points back into the box.
    let ball = |p: DVec3| 11.0 - p.distance(DVec3::new(0.0, 0.0, 11.0));
    let field = HierarchicalSpline::schoenberg(lattice, 1.0, ball).unwrap();
    let mut shape = Shape::new(&of(field), 0.0, DAffine3::IDENTITY, Budget::PROCESSOR).unwrap();
    let patches = shape.all("ball", DVec3::ZERO);
    let vertices = patches.iter().flat_map(|patch| &patch.vertices);
    let on_sides = vertices.filter(|v| v.at.iter().any(|x| x.abs() > 7.9999));
    let mut count = 0;
    for v in on_sides {
        let (at, normal) = (glam::Vec3::from(v.at), glam::Vec3::from(v.normal));
        let flat = glam::Vec3::AXES[at.abs().max_position()] * at[at.abs().max_position()].signum();
        assert!(normal.dot(flat) > 0.499, "{at} {normal}");
        count += 1;
    }
    assert!(count > 100, "{count}");
}

/// The viewport as it was looked at and found good. `UPDATE_SNAPSHOTS=1` draws it anew.
#[test]
fn the_viewport_looks_as_it_did() {
    let Some(card) = card("snapshots of the viewport") else {
        return;
    };
    let meta = FieldMeta {
        iso: Some(0.0),
        ..FieldMeta::default()
    };
    let object = Object::of(solid().into(), meta);
    let (mut canvas, whole) = on_canvas(&card, &object);
    let origin = canvas.origin();
    let cut = Look {
        cut: Some((origin, whole.camera.axes()[2])),
        ..whole
    };
    let by = |mode, look: Look| Look { mode, ..look };
    for (name, look, is_rough) in [
        ("whole", whole, false),
        ("rough", whole, true),
        ("cut", cut, false),
        ("rays", by(Mode::Rays, whole), false),
        ("rays_rough", by(Mode::Rays, whole), true),
        ("rays_cut", by(Mode::Rays, cut), false),
        ("volume", by(Mode::Volume, whole), false),
        ("volume_rough", by(Mode::Volume, whole), true),
    ] {
        let seen = canvas.pixels(&look, SIZE.map(|n| n as u32), is_rough).unwrap();
        let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("src/view/snapshots/{name}.png"));
        if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
            write(&path, &seen);
        }
        let (mean, far) = difference(&seen, &recorded(&path));
        // Two drivers of Mesa differ in some pixels at edges.
        assert!(mean < 1.0 && far < 0.01, "{name}: mean {mean}, far {far}");
    }
}

fn write(path: &std::path::Path, pixels: &[u8]) {
    let file = std::fs::File::create(path).unwrap();
    let [w, h] = SIZE.map(|n| n as u32);
    let mut encoder = png::Encoder::new(file, w, h);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(pixels).unwrap();
}

fn recorded(path: &std::path::Path) -> Vec<u8> {
    let file = std::fs::File::open(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut reader = png::Decoder::new(std::io::BufReader::new(file))
        .read_info()
        .unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    pixels
}

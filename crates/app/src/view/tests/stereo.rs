//! A picture for each eye.

use super::*;
use crate::view::stereo::{Eyes, by_eye};
use crate::view::{Pair, Stereo, read};

const HALF: [usize; 2] = [SIZE[0] / 2, SIZE[1]];

/// What both eyes see, as bytes of red, green and blue.
fn seen(card: &Card, eyes: &mut Eyes, canvas: &mut Canvas, look: &Look, is_rough: bool) -> Vec<u8> {
    loop {
        let drawn = eyes.draw(canvas, look, SIZE.map(|n| n as u32), is_rough);
        if drawn.is_done {
            assert_eq!(drawn.rows, 1.0);
            let bytes = read::bytes(&card.device, &card.queue, &drawn.picture).unwrap();
            return bytes.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
        }
        let _ = card
            .device
            .poll(eframe::egui_wgpu::wgpu::PollType::wait_indefinitely());
    }
}

fn with(look: Look, pair: Pair) -> Look {
    let stereo = Stereo { pair, apart: 0.08 };
    let show = Show { stereo, ..look.show };
    Look { show, ..look }
}

/// One half of a picture.
fn half(picture: &[u8], which: usize) -> Vec<u8> {
    let rows = picture.chunks_exact(3 * SIZE[0]);
    rows.flat_map(|row| row[3 * HALF[0] * which..][..3 * HALF[0]].to_vec())
        .collect()
}

fn ring(card: &Card) -> (Canvas, Look) {
    let meta = FieldMeta {
        iso: Some(0.0),
        ..FieldMeta::default()
    };
    on_canvas(card, &Object::of(solid().into(), meta))
}

/// By triangles, by rays and as mist: each half is what its eye sees, to the byte; over one another the left eye is red and the right one
/// green and blue; and off is what was seen before.
#[test]
fn each_eye_has_its_own_picture() {
    let Some(card) = card("stereo") else { return };
    let (mut canvas, look) = ring(&card);
    let mut eyes = Eyes::default();
    let whole = SIZE.map(|n| n as u32);
    for (mode, is_rough) in [
        (Mode::Mesh, false),
        (Mode::Mesh, true),
        (Mode::Rays, false),
        (Mode::Volume, false),
    ] {
        let look = Look { mode, ..look };
        let before = canvas.pixels(&look, whole, is_rough).unwrap();
        let beside = with(look, Pair::Beside);
        let picture = seen(&card, &mut eyes, &mut canvas, &beside, is_rough);
        let by_itself = [0, 1].map(|eye| {
            let of_eye = by_eye(&beside, eye);
            canvas.pixels(&of_eye, HALF.map(|n| n as u32), is_rough).unwrap()
        });
        let halves = [0, 1].map(|which| half(&picture, which));
        assert!(
            halves == by_itself,
            "{mode:?}: halves are not what the eyes see: {:?}",
            [0, 1].map(|n| difference(&halves[n], &by_itself[n]))
        );
        let (mean, _) = difference(&halves[0], &halves[1]);
        assert!(mean > 1.0, "{mode:?}: both eyes see the same: {mean}");

        let over = with(look, Pair::Anaglyph);
        let picture = seen(&card, &mut eyes, &mut canvas, &over, is_rough);
        let [left, right] = [0, 1].map(|eye| canvas.pixels(&by_eye(&over, eye), whole, is_rough).unwrap());
        let colors = |picture: &[u8], colors: [usize; 3]| -> Vec<u8> {
            let pixels = picture.chunks_exact(3);
            pixels.flat_map(|p| colors.map(|c| p[c])).collect()
        };
        assert!(
            colors(&picture, [0; 3]) == colors(&left, [0; 3]),
            "{mode:?}: red is not the left eye's"
        );
        let cyan = [1, 2, 1];
        assert!(
            colors(&picture, cyan) == colors(&right, cyan),
            "{mode:?}: cyan is not the right eye's"
        );
        assert!(colors(&left, [0; 3]) != colors(&right, [0; 3]));

        let off = seen(&card, &mut eyes, &mut canvas, &look, is_rough);
        assert!(off == before, "{mode:?}: another picture without stereo");
    }
}

/// Another scene is another picture; the same one is drawn once.
#[test]
fn what_changes_is_drawn_anew_for_both_eyes() {
    let Some(card) = card("stereo of another scene") else {
        return;
    };
    let (mut canvas, look) = ring(&card);
    let mut eyes = Eyes::default();
    for pair in [Pair::Beside, Pair::Anaglyph] {
        let look = with(look, pair);
        let before = seen(&card, &mut eyes, &mut canvas, &look, false);
        canvas.hide(&["solid".to_string()].into());
        let empty = seen(&card, &mut eyes, &mut canvas, &look, false);
        canvas.hide(&Default::default());
        let again = seen(&card, &mut eyes, &mut canvas, &look, false);
        assert!(before != empty && before == again, "{pair:?}");
    }
}

/// What the camera goes round is in one place for both eyes; what is nearer is farther left for the right eye, what is farther away is
/// farther right. A picture taken aside shows the field where lines from that eye meet it.
#[test]
fn only_the_focus_has_no_parallax() {
    let Some(card) = card("parallax") else { return };
    let field = solid();
    let mesh = meshed(&field);
    let scene = scene(&field, &mesh);
    let solid = cast(&field);
    for mode in [Mode::Mesh, Mode::Rays] {
        let view = views(&mesh)[0];
        let (mut canvas, look) = easel(&card, &scene, &view, by(mode, &solid));
        let stereo = with(look, Pair::Beside);
        for perspective in [false, true] {
            let camera = Camera {
                perspective,
                ..stereo.camera
            };
            let eyes = [0, 1].map(|eye| by_eye(&Look { camera, ..stereo }, eye).camera);
            let back = camera.axes()[2];
            let parallax = |p: DVec3| {
                let [left, right] = eyes.map(|eye| eye.place(p));
                assert!((left.y - right.y).abs() < 1e-12);
                right.x - left.x
            };
            assert!(parallax(camera.center).abs() < 1e-12);
            assert!(parallax(camera.center + back) < -1e-4);
            assert!(parallax(camera.center - back) > 1e-4);
        }
        let (eye, tolerance) = match mode {
            Mode::Mesh => (0, 0.08),
            _ => (1, 1e-3),
        };
        let size = SIZE.map(|n| n as u32);
        let by_middle = canvas.depths(&stereo, size).unwrap();
        let look = by_eye(&stereo, eye);
        let drawn = canvas.depths(&look, size).unwrap();
        let by_lines = lines(&field, &look, view.center);
        for (a, b) in [(&drawn, &by_lines), (&by_lines, &drawn)] {
            let at = unlike(a, b, tolerance);
            assert_eq!(at.map(|n| (n, a[n], b[n])), None, "{mode:?}, eye {eye}");
        }
        assert!(unlike(&drawn, &by_middle, tolerance).is_some(), "{mode:?}");
    }
}

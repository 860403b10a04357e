//! Pictures without a window.

use bspline::Jet;
use glam::DVec3;

use super::canvas::{Canvas, Look, Paper};
use super::lights::MOST;
use super::shape::{NOTHING, Vertex};
use super::{Camera, Card, Patch};
use crate::picture::{Scene, Surface, View};

/// The picture that [`crate::picture`] draws, drawn by a card: RGB bytes, rows from the top.
///
/// # Errors
/// That the card is lost or has no memory left.
pub fn still(card: &Card, scene: &Scene, view: &View) -> Result<Vec<u8>, String> {
    let (mut canvas, look) = easel(card, scene, view);
    card.trying(|| canvas.pixels(&look, view.size.map(|n| n as u32), false))
}

/// A canvas with a scene on it, and how a view looks at it.
pub fn easel(card: &Card, scene: &Scene, view: &View) -> (Canvas, Look) {
    let origin = view.center;
    let places = scene.seen.positions.iter().chain(scene.shading.positions);
    let radius = places.map(|p| p.distance(origin)).fold(0.0, f64::max);
    let mut canvas = Canvas::new(&card.device, &card.queue, MOST);
    canvas.begin(origin, radius);
    canvas.put(&patch(scene, &scene.seen, origin));
    canvas.shade_by(&patch(scene, &scene.shading, origin));
    let [_, up, back] = [0, 1, 2].map(|n| view.axes.row(n));
    let height = view.size[1] as f64 / view.pixels_per_length;
    let look = Look {
        camera: Camera::along(origin, height, back, up),
        cut: None,
        paint: false,
        paper: Paper::Light,
    };
    (canvas, look)
}

fn patch(scene: &Scene, surface: &Surface, origin: DVec3) -> Patch {
    let places = surface.positions;
    let mut jets: Vec<Jet> = vec![NOTHING; places.len()];
    scene.field.jets(places, &mut jets);
    let vertices = places.iter().zip(&jets).map(|(p, jet)| Vertex {
        at: (*p - origin).as_vec3().to_array(),
        normal: (-jet.gradient).normalize_or_zero().as_vec3().to_array(),
        ridge: 0.0,
        paint: 0.0,
    });
    Patch {
        object: String::new(),
        part: [0; 3],
        vertices: vertices.collect(),
        indices: surface.triangles.iter().flatten().copied().collect(),
    }
}

//! Pictures without a window.

use bspline::Jet;
use glam::DVec3;

use super::canvas::Canvas;
use super::lights::MOST;
use super::look::{LINE, Look, Paper};
#[cfg(test)]
use super::rays::BUDGET;
use super::rays::Solid;
use super::shape::{NOTHING, Vertex};
use super::{Camera, Card, Mode, Patch, Show};
use crate::picture::{Scene, Surface, View};

/// How a picture without a window is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Manner<'a> {
    /// How solids become pixels.
    pub mode: Mode,
    /// What is drawn without triangles, if anything is.
    pub solid: Option<&'a Solid>,
    /// Densities that are black and white, where densities are shown.
    pub density: [f64; 2],
    /// Bytes that bricks may take on the card.
    pub bricks: u64,
}

/// By triangles.
#[cfg(test)]
pub const MESH: Manner<'_> = Manner {
    mode: Mode::Mesh,
    solid: None,
    density: [0.0, 1.0],
    bricks: BUDGET,
};

/// The picture that [`crate::picture`] draws, drawn by a card: RGB bytes, rows from the top.
///
/// # Errors
/// That the card is lost or has no memory left.
pub fn still(card: &Card, scene: &Scene, view: &View, manner: Manner) -> Result<Vec<u8>, String> {
    let (mut canvas, look) = easel(card, scene, view, manner);
    if look.mode != Mode::Mesh && !canvas.can_cast() {
        return Err(format!(
            "{}: lets pictures read too little memory for rays and volumes",
            card.name
        ));
    }
    card.trying(|| canvas.pixels(&look, view.size.map(|n| n as u32), false))
}

/// A canvas with a scene on it, and how a view looks at it.
pub fn easel(card: &Card, scene: &Scene, view: &View, manner: Manner) -> (Canvas, Look) {
    let origin = view.center;
    let places = scene.seen.positions.iter().chain(scene.shading.positions);
    let radius = places.map(|p| p.distance(origin)).fold(0.0, f64::max);
    let mut canvas = Canvas::new(&card.device, &card.queue, MOST, manner.bricks);
    canvas.begin(origin, radius);
    canvas.put(&patch(scene, &scene.seen, origin));
    canvas.shade_by(&patch(scene, &scene.shading, origin));
    if let Some(solid) = manner.solid {
        canvas.put_solid("", solid.clone());
    }
    let [_, up, back] = [0, 1, 2].map(|n| view.axes.row(n));
    let height = view.size[1] as f64 / view.pixels_per_length;
    let look = Look {
        camera: Camera::along(origin, height, back, up),
        cut: None,
        paint: false,
        mode: manner.mode,
        density: manner.density,
        paper: Paper::Light,
        show: Show::default(),
        line: LINE,
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
        rough: None,
        is_open: true,
    }
}

//! Densities of scans off their surface.

use bspline::hierarchical::{HierarchicalSpline, Lattice};
use bspline::{AnyField, Field};
use document::{Command, CommandError, Object, State};
use fitting::Control;
use formats::field::{FieldMeta, SourceKind};
use glam::{DAffine3, DVec3};

const SIDE: u32 = 32;
/// Density of the skin, which is the surface, and what the fit may leave.
const SKIN: f64 = -300.0;
const TOLERANCE: f64 = 20.0;

/// A body of 40 in air of −1000 with a bone of 1000, far inside.
fn body(p: DVec3) -> f64 {
    let share = |depth: f64| (0.5 + depth / 4.0).clamp(0.0, 1.0);
    let r = p.distance(DVec3::splat(16.0));
    let bone = share(2.5 - p.distance(DVec3::new(15.0, 17.0, 16.0)));
    -1000.0 + 1040.0 * share(13.0 - r) + 960.0 * bone
}

/// The surface alone would let the bone fade on its way: its densities lie far from that of the skin.
#[test]
fn bone_below_the_skin_moves_with_its_density() {
    let lattice = Lattice {
        world_from_lattice: DAffine3::IDENTITY,
        cells: [SIDE; 3],
    };
    let before = HierarchicalSpline::<f32>::schoenberg(lattice, 250.0, body).unwrap();
    let meta = FieldMeta {
        source: SourceKind::Volume,
        iso: Some(SKIN),
        report: format!("{{\"tolerance\": {TOLERANCE}}}"),
        ..FieldMeta::default()
    };
    let object = Object::new(&AnyField::F32(before.clone()), meta).unwrap();
    assert_eq!(object.density(), Some(TOLERANCE));
    let state = State::default().with("body", object).unwrap();
    let text = "[[stroke]]\nmove = { motion = { shift = { region = { min = [10, 11, 10], max = [22, 22, 22] }, by = [1.3, -2.2, 0.6], blend = 6 } } }\n";
    let named = |_: Option<&str>| Ok::<_, CommandError>("body".to_string());
    let command = &Command::of_script(text, named).unwrap()[0];
    let (state, _) = command.apply(&state, &mut Control::default()).unwrap();
    let now = state.object("body").unwrap().field.levels().unwrap().clone();
    let (mut worst, mut densest) = (0.0f64, 0.0f64);
    for n in 0..9 * 9 * 9 {
        let p = DVec3::from_array([n % 9, n / 9 % 9, n / 81].map(|i| 12.0 + f64::from(i)));
        let came = before.value(p - DVec3::new(1.3, -2.2, 0.6));
        worst = worst.max((now.value(p) - came).abs());
        densest = densest.max(came);
    }
    assert!(densest > 600.0 && worst <= TOLERANCE, "{densest} {worst}");
}

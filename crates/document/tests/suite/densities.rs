//! Densities of scans off their surface.

use bspline::{AnyField, Field, HierarchicalSpline};
use document::{Command, CommandError, Object, State};
use fitting::Control;
use fitting::volume::{VolumeOptions, VolumeView, fit_volume};
use formats::field::{FieldMeta, SourceKind};
use glam::{DAffine3, DVec3};

const SIDE: usize = 48;
/// Density of the skin, which is the surface, and what the fit may leave.
const SKIN: f64 = -300.0;
const TOLERANCE: f64 = 20.0;

/// A body of 40 in air of −1000 with a bone of 1000, far inside.
fn body(p: DVec3) -> f64 {
    let share = |depth: f64| (0.5 + depth / 4.0).clamp(0.0, 1.0);
    let r = p.distance(DVec3::splat(24.0));
    let bone = share(2.5 - p.distance(DVec3::new(23.0, 25.0, 24.0)));
    -1000.0 + 1040.0 * share(20.0 - r) + 960.0 * bone
}

fn place(n: usize, from: f64, count: usize) -> DVec3 {
    let at = [n % count, n / count % count, n / (count * count)];
    DVec3::from_array(at.map(|i| from + i as f64))
}

/// The field of the body, and objects of it with their surfaces at these densities.
fn scanned(surfaces: &[(&str, f64)]) -> (HierarchicalSpline<f32>, State) {
    let voxels = (0..SIDE * SIDE * SIDE).map(|n| body(place(n, 0.0, SIDE)) as f32);
    let voxels: Vec<f32> = voxels.collect();
    let view = VolumeView {
        dims: [SIDE; 3],
        values: (&voxels[..]).into(),
        world_from_voxel: DAffine3::IDENTITY,
    };
    let options = VolumeOptions {
        tolerance: Some(TOLERANCE),
        ..VolumeOptions::default()
    };
    let (field, report) = fit_volume::<f32>(&view, &options, &mut Control::default()).unwrap();
    let state = surfaces.iter().fold(State::default(), |state, (name, iso)| {
        let meta = FieldMeta {
            source: SourceKind::Volume,
            iso: Some(*iso),
            report: format!("{{\"tolerance\": {}}}", report.tolerance),
            ..FieldMeta::default()
        };
        let object = Object::new(&AnyField::F32(field.clone()), meta).unwrap();
        assert_eq!(object.density(), Some(2.0 * TOLERANCE));
        state.with(name, object).unwrap()
    });
    (field, state)
}

/// The field of "body" after a stroke.
fn sculpted(state: &State, tool: &str) -> HierarchicalSpline<f32> {
    let named = |_: Option<&str>| Ok::<_, CommandError>("body".to_string());
    let command = &Command::of_script(&format!("[[stroke]]\n{tool}\n"), named).unwrap()[0];
    let (state, _) = command.apply(state, &mut Control::default()).unwrap();
    state.object("body").unwrap().field.levels().unwrap().clone()
}

/// The surface alone would let the bone fade on its way: its densities lie far from that of the skin.
#[test]
fn bone_below_the_skin_moves_with_its_density() {
    let (before, state) = scanned(&[("body", SKIN)]);
    let now = sculpted(
        &state,
        "move = { motion = { shift = { region = { min = [18, 19, 18], max = [30, 30, 30] }, by = [1.3, -2.2, 0.6], blend = 6 } } }",
    );
    let (mut worst, mut densest) = (0.0f64, 0.0f64);
    for n in 0..9 * 9 * 9 {
        let p = place(n, 20.0, 9);
        let came = before.value(p - DVec3::new(1.3, -2.2, 0.6));
        worst = worst.max((now.value(p) - came).abs());
        densest = densest.max(came);
    }
    assert!(densest > 600.0 && worst <= 2.0 * TOLERANCE, "{densest} {worst}");
}

/// Densities are no distances: neither their scale nor the surface of the object that they come from changes them.
#[test]
fn what_is_pasted_between_scans_keeps_its_densities() {
    let (before, state) = scanned(&[("body", SKIN), ("bone", 500.0)]);
    for from in ["body", "bone"] {
        let now = sculpted(
            &state,
            &format!(
                "paste = {{ from = {from:?}, region = {{ min = [19, 21, 20], max = [27, 29, 28] }}, by = [0, -12, 0], scale = 1.5, blend = 1 }}"
            ),
        );
        let middle = DVec3::new(23.0, 25.0, 24.0);
        for n in 0..5 * 5 * 5 {
            let way = place(n, -2.0, 5);
            let (came, is) = (
                before.value(middle + way),
                now.value(middle - DVec3::Y * 12.0 + 1.5 * way),
            );
            assert!(
                (came - is).abs() <= 2.0 * TOLERANCE,
                "{from}: {came} {is} at {way}"
            );
        }
    }
}

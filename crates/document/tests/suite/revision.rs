//! Edits of an object in the scan that it was fitted to.

use bspline::hierarchical::{HierarchicalSpline, Lattice};
use bspline::{Aabb, AnyField, Field};

use document::{Command, Journey, Object, State, VolumeRevision, revise_volume};
use fitting::Control;
use fitting::volume::{VolumeOptions, VolumeView, fit_volume};
use formats::Unit;
use formats::field::FieldMeta;
use formats::volumes::{Change, Orientation, Volume, VolumeHeader, VoxelType};
use glam::{DAffine3, DMat3, DVec3};
use tools::canvas::Canvas;
use tools::geometric::{Geometric, Operation};
use tools::limits::Limits;
use tools::others::Others;

use super::common::Draw;

const SIDE: usize = 24;
const ISO: f64 = 50.0;
const FILL: f64 = 3.0;

/// A ball with a rim that shares its voxels with what lies outside, 0 to 100.
fn ball(p: DVec3) -> f64 {
    let depth = 9.0 - p.distance(DVec3::splat(12.0));
    100.0 * (0.5 + depth / 2.0).clamp(0.0, 1.0)
}

fn fitted() -> HierarchicalSpline<f32> {
    let lattice = Lattice {
        world_from_lattice: DAffine3::IDENTITY,
        cells: [SIDE as u32; 3],
    };
    HierarchicalSpline::schoenberg(lattice, 50.0, ball).unwrap()
}

/// What was scanned: the ball, with noise that no fit has. The voxels stand askew.
fn scan() -> Volume {
    let map = DAffine3::from_mat3_translation(
        DMat3::from_rotation_z(0.3) * DMat3::from_diagonal(DVec3::new(0.7, -0.7, 0.9)),
        DVec3::new(4.0, 17.0, 1.0),
    );
    let mut draw = Draw(5);
    let values = (0..SIDE * SIDE * SIDE).map(|v| {
        let noise = f64::from(draw.below(1000)) / 100.0;
        (ball(map.transform_point3(index(v))) + noise) as f32
    });
    Volume {
        values: values.collect(),
        header: VolumeHeader {
            dims: [SIDE; 3],
            world_from_voxel: map,
            unit: Unit::Millimetre,
            orientation: Orientation::Directions,
            stored: VoxelType::I16,
            rescale: None,
        },
        replaced_count: 0,
        notes: Vec::new(),
    }
}

fn index(voxel: usize) -> DVec3 {
    let at = [voxel % SIDE, voxel / SIDE % SIDE, voxel / (SIDE * SIDE)];
    DVec3::from_array(at.map(|i| i as f64))
}

fn sphere(centre: DVec3, radius: f64) -> Geometric {
    let [x, y, z] = centre.to_array();
    toml::from_str(&format!(
        "along = [[{x:?}, {y:?}, {z:?}]]\nshape.sphere.radius = {radius:?}"
    ))
    .unwrap()
}

fn edited(operation: Operation, tool: &Geometric) -> (HierarchicalSpline<f32>, VolumeRevision) {
    revised(operation, tool, &fitted(), &scan())
}

fn revised(
    operation: Operation,
    tool: &Geometric,
    before: &HierarchicalSpline<f32>,
    scan: &Volume,
) -> (HierarchicalSpline<f32>, VolumeRevision) {
    let (now, _) = tool
        .apply(
            operation,
            before,
            ISO,
            &Others::default(),
            &Limits::default(),
            &mut Control::default(),
        )
        .unwrap();
    let revision = revise_volume(before, &now, scan, ISO, FILL, &Journey::default()).unwrap();
    (now, revision)
}

#[test]
fn an_object_that_was_not_edited_changes_no_voxel() {
    let revision = revise_volume(&fitted(), &fitted(), &scan(), ISO, FILL, &Journey::default()).unwrap();
    assert_eq!(revision, VolumeRevision::default());
}

/// The wall of a lung is as steep as bone, and no surface of it.
#[test]
fn a_tool_for_bone_leaves_a_wall_alone_beside_which_there_is_none() {
    // Bone in a corner of the tool's box, which the tool does not reach.
    let bone = |p: DVec3| 300.0 * (1.2 - p.distance(DVec3::new(16.0, 15.0, 17.0))).max(0.0);
    let wall = |p: DVec3| bone(p) - 100.0 + 130.0 * (0.5 + 0.7 * (p.x - 12.0)).clamp(0.0, 1.0);
    let before = HierarchicalSpline::schoenberg(*fitted().lattice(), 50.0, wall).unwrap();
    let mut scan = scan();
    scan.header.world_from_voxel = DAffine3::IDENTITY;
    scan.values = (0..SIDE * SIDE * SIDE).map(|v| wall(index(v)) as f32).collect();
    let tool = sphere(DVec3::new(12.0, 11.0, 12.5), 5.0);
    let (now, revision) = revised(Operation::Carve, &tool, &before, &scan);
    let p = DVec3::new(14.0, 11.0, 12.0);
    assert!(now.value(p) < before.value(p) - 50.0, "the field is carved");
    assert_eq!(revision, VolumeRevision::default());
}

/// The field of a tool rises by the slope at the surface alone, and that of bone below a skin by much more.
#[test]
fn bone_beside_what_is_carved_keeps_its_density() {
    let matter = |p: DVec3| 60.0 + 940.0 * (p.x - 13.5).clamp(0.0, 1.0);
    let before = HierarchicalSpline::schoenberg(*fitted().lattice(), 50.0, matter).unwrap();
    let mut scan = scan();
    scan.header.world_from_voxel = DAffine3::IDENTITY;
    scan.values = (0..SIDE * SIDE * SIDE).map(|v| matter(index(v)) as f32).collect();
    let (now, revision) = revised(
        Operation::Carve,
        &sphere(DVec3::new(8.0, 12.0, 12.0), 4.0),
        &before,
        &scan,
    );
    let bone = DVec3::new(15.0, 12.0, 12.0);
    assert!(
        now.value(bone) < 500.0,
        "the field of the tool is no denser there"
    );
    let lowered = revision.changes.iter().filter(|c| index(c.voxel).x >= 14.0);
    assert_eq!(lowered.count(), 0);
    assert!(revision.carved > 200, "{}", revision.carved);
}

#[test]
fn what_was_solid_keeps_its_noise_where_more_is_added() {
    let mut scan = scan();
    scan.header.world_from_voxel = DAffine3::IDENTITY;
    let mut draw = Draw(7);
    let values = (0..SIDE * SIDE * SIDE).map(|v| ball(index(v)) + 0.04 * f64::from(draw.below(1000)) - 20.0);
    scan.values = values.map(|v| v as f32).collect();
    let tool = sphere(DVec3::new(18.0, 12.0, 12.0), 6.0);
    let (_, revision) = revised(Operation::Add, &tool, &fitted(), &scan);
    let deep = |c: &&Change| index(c.voxel).distance(DVec3::splat(12.0)) < 7.0;
    assert!(revision.added > 100, "{}", revision.added);
    for change in revision.changes.iter().filter(deep) {
        let by = change.density - f64::from(scan.values[change.voxel]);
        // The field rounds the crease where the two meet.
        assert!((-4.0..2.0).contains(&by), "{}: {by}", index(change.voxel));
    }
}

#[test]
fn what_is_carved_is_filled_and_leaves_no_ghost_of_its_surface() {
    let centre = DVec3::new(12.0, 12.0, 21.0);
    let tool = sphere(centre, 4.0);
    let (now, revision) = edited(Operation::Carve, &tool);
    let (before, scan) = (fitted(), scan());
    let mut densities: Vec<f64> = scan.values.iter().map(|v| f64::from(*v)).collect();
    revision
        .changes
        .iter()
        .for_each(|c| densities[c.voxel] = c.density);
    assert!(revision.changes.is_sorted_by(|a, b| a.voxel < b.voxel));
    let (mut deep, mut kept) = (0, 0);
    for (voxel, new) in densities.iter().enumerate() {
        let place = scan.header.world_from_voxel.transform_point3(index(voxel));
        let old = f64::from(scan.values[voxel]);
        let depth = 4.0 - place.distance(centre);
        if depth > 1.6 {
            deep += 1;
            // Air as it was there, noise and all, or the fill.
            assert!(*new <= 10.0, "{place}: {old} became {new}");
        }
        if depth < -6.0 {
            assert_eq!(*new, old, "{place} lies beside the tool");
        }
        let [f, g] = [before.value(place), now.value(place)];
        if g >= ISO && f - g > 0.01 {
            kept += 1;
            // Over the voxel beside the new surface it falls at most as the field does; a voxel is 0.7 wide.
            let is_beside = g < ISO + 0.7 * 50.0;
            let least = if is_beside { old + g - f } else { old };
            assert!(
                *new <= old && *new >= least - 1e-9,
                "{place}: {old} became {new}, the field {f} {g}"
            );
        }
    }
    assert!(
        deep > 100 && kept > 20 && revision.carved > 100,
        "{deep} {kept} {}",
        revision.carved
    );
    // A crease is rounded, and may stand up a little.
    assert!(revision.added * 20 < revision.carved, "{}", revision.added);
}

/// The field falls as steeply at a tool as the scan does at its own edges, however noisy it is.
#[test]
fn what_lies_two_voxels_beside_the_tool_keeps_its_density() {
    let mut scan = scan();
    scan.header.world_from_voxel = DAffine3::IDENTITY;
    let centre = DVec3::new(12.0, 12.0, 17.0);
    for seed in 0..5 {
        let mut draw = Draw(seed);
        for (voxel, value) in scan.values.iter_mut().enumerate() {
            *value = (ball(index(voxel)) + f64::from(draw.below(200)) / 100.0) as f32;
        }
        let view = VolumeView {
            dims: scan.header.dims,
            values: (&scan.values[..]).into(),
            world_from_voxel: scan.header.world_from_voxel,
        };
        let (before, _) =
            fit_volume::<f32>(&view, &VolumeOptions::default(), &mut Control::default()).unwrap();
        // 100 over two voxels; the median gradient, of noise, is 1.
        assert!((25.0..60.0).contains(&before.slope()), "{}", before.slope());
        let (_, revision) = revised(Operation::Carve, &sphere(centre, 3.0), &before, &scan);
        let beside = revision.changes.iter().filter(|c| {
            let depth = 3.0 - index(c.voxel).distance(centre);
            depth < -2.0
        });
        assert_eq!(beside.count(), 0, "seed {seed}");
    }
}

#[test]
fn what_is_added_is_no_denser_than_most_of_the_scan() {
    let centre = DVec3::new(12.0, 12.0, 18.0);
    let (now, revision) = edited(Operation::Add, &sphere(centre, 5.0));
    let (before, scan) = (fitted(), scan());
    let mut solid: Vec<f64> = scan.values.iter().map(|v| f64::from(*v)).collect();
    solid.retain(|v| *v >= ISO);
    solid.sort_by(f64::total_cmp);
    let (usual, largest) = (solid[solid.len() / 2], solid[solid.len() - 1]);
    assert!(usual + 3.0 < largest);
    assert!(
        revision.added > 100 && revision.carved == 0,
        "{} {}",
        revision.added,
        revision.carved
    );
    let reach = Aabb::new(centre - 11.0, centre + 11.0);
    for change in &revision.changes {
        let place = scan.header.world_from_voxel.transform_point3(index(change.voxel));
        assert!(
            place.cmpge(reach.min).all() && place.cmple(reach.max).all(),
            "{place}"
        );
        assert!(change.density <= largest);
        if before.value(place) < ISO && now.value(place) >= ISO {
            assert!(change.density <= usual, "{place}: {}", change.density);
        }
        if now.value(place) > ISO + 25.0 && place.distance(centre) < 4.0 {
            assert!(change.density > ISO, "{place}: {}", change.density);
        }
    }
}

#[test]
fn what_is_moved_takes_the_noise_of_its_scan_along() {
    let before = fitted();
    let by = DVec3::new(3.0, 0.0, 0.0);
    // All of the ball, and well beyond it.
    let text = "[[stroke]]\nmove = { motion = { shift = { region = { min = [0, 0, 0], max = [24, 24, 24] }, by = [3, 0, 0], blend = 9 } } }\n";
    let named = |_: Option<&str>| Ok::<_, document::CommandError>("ball".to_string());
    let commands = Command::of_script(text, named).unwrap();
    let Command::Stroke { stroke, .. } = &commands[0] else {
        unreachable!()
    };
    let tool = stroke.motion.as_ref().unwrap();
    let limits = Limits::default();
    let (now, _) = tool
        .apply(&before, ISO, &limits, &mut Control::default())
        .unwrap();
    let journey = Journey::new(&commands, "ball", &before.lattice().world_box(), |_| None);
    let (scan, mut checked, mut worst) = (scan(), 0, 0.0f64);
    let revision = revise_volume(&before, &now, &scan, ISO, FILL, &journey).unwrap();
    let value = |p: DVec3| ball(p);
    for change in &revision.changes {
        let place = scan.header.world_from_voxel.transform_point3(index(change.voxel));
        let origin = place - by;
        // Inside, away from the rim, the field is flat and all that moves is the noise.
        if value(place) == 100.0 && value(origin) == 100.0 && now.value(place) > 99.9 {
            let at = scan.header.world_from_voxel.inverse().transform_point3(origin);
            if at.cmplt(DVec3::ONE).any() || at.cmpgt(DVec3::splat(SIDE as f64 - 2.0)).any() {
                continue;
            }
            let expected = trilinear(&scan, at);
            worst = worst.max((change.density - expected).abs());
            checked += 1;
        }
    }
    assert!(checked > 50 && worst < 1.0, "{checked} {worst}");
}

#[test]
fn what_comes_from_beyond_the_scan_is_nothing() {
    let bar = |p: DVec3| 100.0 * (5.5 - (p.y - 12.0).hypot(p.z - 12.0)).clamp(0.0, 1.0);
    let before = HierarchicalSpline::schoenberg(*fitted().lattice(), 50.0, bar).unwrap();
    let mut scan = scan();
    scan.header.world_from_voxel = DAffine3::IDENTITY;
    for (v, value) in scan.values.iter_mut().enumerate() {
        *value = bar(index(v)) as f32 + (v * 7919 % 10) as f32;
    }
    let text = "[[stroke]]\nmove = { motion = { shift = { region = { min = [0, 0, 0], max = [24, 24, 24] }, by = [4, 0, 0], blend = 9 } } }\n";
    let changes = changed_by(&before, &scan, text);
    let inside = |p: DVec3| bar(p) == 100.0;
    let (mut filled, mut carried) = (0, 0);
    for (place, [_, density], [_, now]) in changes.into_iter().filter(|(p, ..)| inside(*p)) {
        if place.x < 3.0 {
            assert!(now < ISO && density < ISO, "{place}: {density}, {now}");
            filled += usize::from(density == FILL);
        } else if place.x > 4.0 {
            assert!(density >= 100.0, "{place}: {density}, {now}");
            carried += 1;
        }
    }
    assert!(filled > 100 && carried > 500, "{filled} {carried}");
}

/// What a script leaves of a field, and the way there.
fn by_script(before: &HierarchicalSpline<f32>, text: &str) -> (HierarchicalSpline<f32>, Journey) {
    let commands = Command::of_script(text, |_| Ok::<_, document::CommandError>("ball".to_string())).unwrap();
    let meta = FieldMeta {
        iso: Some(ISO),
        ..FieldMeta::default()
    };
    let object = Object::new(&AnyField::F32(before.clone()), meta).unwrap();
    let mut states = vec![State::default().with("ball", object).unwrap()];
    for command in &commands {
        states.push(
            command
                .apply(&states[states.len() - 1], &mut Control::default())
                .unwrap()
                .0,
        );
    }
    let others = |n: usize| {
        let mut others = Others::default();
        for (name, object) in states[n].objects() {
            let put = others.put(
                name,
                &object.field,
                ISO,
                DAffine3::IDENTITY,
                object.density().is_some(),
            );
            put.unwrap();
        }
        Some(others)
    };
    let journey = Journey::new(&commands, "ball", &before.lattice().world_box(), others);
    let now = states[commands.len()].object("ball").unwrap();
    (now.field.levels().unwrap().clone(), journey)
}

/// The changes that a script makes: the voxel's place, what it was, what it became, and what the field became.
fn changed_by(
    before: &HierarchicalSpline<f32>,
    scan: &Volume,
    text: &str,
) -> Vec<(DVec3, [f64; 2], [f64; 2])> {
    let (now, journey) = by_script(before, text);
    let revision = revise_volume(before, &now, scan, ISO, FILL, &journey).unwrap();
    let change = |c: &Change| {
        let place = scan.header.world_from_voxel.transform_point3(index(c.voxel));
        let densities = [f64::from(scan.values[c.voxel]), c.density];
        (place, densities, [before.value(place), now.value(place)])
    };
    revision.changes.iter().map(change).collect()
}

fn usual(scan: &Volume) -> f64 {
    let mut solid: Vec<f64> = scan.values.iter().map(|v| f64::from(*v)).collect();
    solid.retain(|v| *v >= ISO);
    solid.sort_by(f64::total_cmp);
    solid[solid.len() / 2]
}

#[test]
fn what_was_moved_is_carved_and_added_to_like_what_was_not() {
    let (before, scan) = (fitted(), scan());
    let shift = "[[stroke]]\nmove = { motion = { shift = { region = { min = [0, 0, 0], max = [24, 24, 24] }, by = [1, 0, 0], blend = 9 } } }\n";
    let carve = "[[stroke]]\ncarve = { shape = { sphere = { radius = 3 } }, along = [[13, 12, 12]] }\n";
    let changes = changed_by(&before, &scan, &format!("{shift}{carve}"));
    let hole = changes
        .iter()
        .filter(|(p, ..)| p.distance(DVec3::new(13.0, 12.0, 12.0)) < 1.4);
    let hole: Vec<f64> = hole.map(|(_, [_, new], _)| *new).collect();
    assert!(hole.len() > 10 && hole.iter().all(|d| *d == FILL), "{hole:?}");

    let add = "[[stroke]]\nadd = { shape = { sphere = { radius = 4 } }, along = [[13, 12, 20]] }\n";
    let changes = changed_by(&before, &scan, &format!("{shift}{add}"));
    let usual = usual(&scan);
    let joined = changes
        .iter()
        .filter(|(_, _, [was, now])| *was < ISO - 25.0 && *now > ISO + 25.0);
    let joined: Vec<f64> = joined.map(|(_, [_, new], _)| *new).collect();
    assert!(
        joined.len() > 50 && joined.iter().all(|d| *d <= usual),
        "{joined:?}"
    );
}

/// Soft matter in a hard shell is no part of the solid of the shell.
#[test]
fn what_never_was_in_the_solid_stays_where_a_tool_passes() {
    let mut scan = scan();
    let matter = |p: DVec3| match p.distance(DVec3::splat(12.0)) {
        r if r < 6.0 => ball(p) - 70.0 * (6.0 - r).min(1.0),
        _ => ball(p),
    };
    let map = scan.header.world_from_voxel;
    for (voxel, value) in scan.values.iter_mut().enumerate() {
        *value +=
            (matter(map.transform_point3(index(voxel))) - ball(map.transform_point3(index(voxel)))) as f32;
    }
    let lattice = *fitted().lattice();
    let before = HierarchicalSpline::schoenberg(lattice, 50.0, matter).unwrap();
    let carve = "[[stroke]]\ncarve = { shape = { sphere = { radius = 8 } }, along = [[12, 12, 18]] }\n";
    let changes = changed_by(&before, &scan, carve);
    let soft = changes
        .iter()
        .filter(|(p, ..)| p.distance(DVec3::splat(12.0)) < 3.0);
    let soft: Vec<_> = soft.collect();
    assert!(soft.is_empty(), "{soft:?}");
    let hard = changes
        .iter()
        .filter(|(p, _, [was, _])| p.distance(DVec3::new(12.0, 12.0, 18.0)) < 6.0 && *was > ISO + 25.0);
    let hard: Vec<f64> = hard.map(|(_, [_, new], _)| *new).collect();
    assert!(hard.len() > 50 && hard.iter().all(|d| *d == FILL), "{hard:?}");
}

#[test]
fn the_surface_that_something_is_added_to_becomes_no_denser_than_most() {
    let (before, mut scan) = (fitted(), scan());
    // Metal elsewhere.
    scan.values[0] = 1000.0;
    let add = "[[stroke]]\nadd = { shape = { sphere = { radius = 4 } }, along = [[12, 12, 19]] }\n";
    let usual = usual(&scan);
    let changes = changed_by(&before, &scan, add);
    assert!(changes.len() > 100);
    for (place, [old, new], _) in changes {
        assert!(new <= usual.max(old), "{place}: {old} became {new}");
    }
}

#[test]
fn what_is_smoothed_follows_the_field() {
    let (before, scan) = (fitted(), scan());
    let smooth = "[[stroke]]\nsmooth = { along = [[12, 12, 21]], radius = 6, level = 3 }\n";
    let changes = changed_by(&before, &scan, smooth);
    let left = changes
        .iter()
        .filter(|(_, _, [was, now])| *was >= ISO && *now < ISO);
    assert!(left.count() > 5);
    let highest = scan.values.iter().fold(0.0, |m: f32, v| m.max(*v)).into();
    for (place, [old, new], [was, now]) in changes {
        let meant = (old + now - was).clamp(FILL.min(old), highest);
        assert!(
            (new - meant).abs() < 0.1,
            "{place}: {old} became {new}, not {meant}"
        );
    }
}

/// The density of a tool grows with the depth in it; what a brush that mixes meets of it is no matter.
#[test]
fn beside_a_brush_that_mixes_tools_leave_the_fill_and_the_usual() {
    let (before, mut scan) = (fitted(), scan());
    // Metal and padding elsewhere.
    scan.values[0] = 1000.0;
    scan.values[1] = -3000.0;
    let smooth = "[[stroke]]\nsmooth = { along = [[15, 12, 19]], radius = 6, level = 2 }\n";
    let push = "[[stroke]]\npush = { along = [[15, 12, 20]], radius = 4, speed = 0.5 }\n";
    let top = DVec3::new(12.0, 12.0, 18.0);
    let tool = |verb: &str| {
        format!(
            "[[stroke]]\n{verb} = {{ shape = {{ sphere = {{ radius = 4 }} }}, along = [[12, 12, 18]] }}\n"
        )
    };
    for brush in [smooth, push] {
        for verb in ["carve", "add"] {
            for text in [tool(verb) + brush, brush.to_string() + &tool(verb)] {
                let changes = changed_by(&before, &scan, &text);
                let (mut holes, mut clay) = (0, 0);
                for (place, [old, new], [was, now]) in changes {
                    assert!(
                        (0.0..=110.0).contains(&new),
                        "{text}: {place}: {old} became {new}"
                    );
                    if place.distance(top) < 2.0 {
                        holes += usize::from(was > ISO && now < 0.0 && new == FILL);
                        clay += usize::from(now > ISO + 50.0);
                    }
                }
                let told = if verb == "carve" { holes } else { clay };
                assert!(told > 5, "{text}: {told}");
            }
        }
    }
}

#[test]
fn what_is_pasted_keeps_the_densities_and_the_noise_of_its_scan() {
    let (before, scan) = (fitted(), scan());
    let paste = "[[stroke]]\npaste = { from = \"ball\", region = { min = [9, 9, 6], max = [15, 15, 10] }, by = [0, 0, 12], blend = 1 }\n";
    let copy = "[[stroke]]\ncopy = { to = \"twin\" }\n";
    for text in [
        paste.to_string(),
        format!("{copy}{}", paste.replace("\"ball\"", "\"twin\"")),
    ] {
        let (mut checked, mut squares) = (0, 0.0);
        for (place, [_, new], _) in changed_by(&before, &scan, &text) {
            let origin = place - DVec3::new(0.0, 0.0, 12.0);
            let at = scan.header.world_from_voxel.inverse().transform_point3(origin);
            let is_inside = origin.cmpgt(DVec3::new(10.0, 10.0, 7.0)).all()
                && origin.cmplt(DVec3::new(14.0, 14.0, 9.0)).all();
            if is_inside && at.cmpge(DVec3::ONE).all() && at.cmple(DVec3::splat(SIDE as f64 - 2.0)).all() {
                squares += (new - trilinear(&scan, at)).powi(2);
                checked += 1;
            }
        }
        // The noise of another place is off by four.
        let off = (squares / f64::from(checked)).sqrt();
        assert!(checked > 20 && off < 1.5, "{checked} {off}");
    }
}

#[test]
fn what_is_pasted_from_another_object_is_as_dense_as_there() {
    let text = "[[stroke]]\ncopy = { to = \"twin\" }\n
        [[stroke]]\nobject = \"twin\"\nadd = { shape = { sphere = { radius = 4 } }, along = [[12, 12, 8]] }\n
        [[stroke]]\npaste = { from = \"twin\", region = { min = [9, 9, 6], max = [15, 15, 10] }, by = [0, 0, 12], blend = 1 }\n";
    let (before, scan) = (fitted(), scan());
    let most = scan.values.iter().copied().fold(0.0_f32, f32::max);
    let changes = changed_by(&before, &scan, text);
    let densest = changes.into_iter().map(|(_, [_, new], [_, now])| (new, now));
    let (new, now) = densest.fold((0.0, 0.0), |a, b| if b.0 > a.0 { b } else { a });
    assert!(
        new > f64::from(most) + 50.0 && (new - now).abs() < 20.0,
        "{new} of {now}"
    );
}

/// Both halves of the ball go up, the second because of the symmetry alone.
#[test]
fn a_move_on_both_sides_takes_the_noise_of_both_along() {
    let before = fitted();
    let text = "[[stroke]]\nsymmetry = { at = [12, 0, 0], normal = [1, 0, 0] }\nmove = { motion = { shift = { region = { min = [15, -9, -9], max = [33, 33, 33] }, by = [0, 1, 0], blend = 3 } } }\n";
    let commands = Command::of_script(text, |_| Ok::<_, document::CommandError>("ball".to_string())).unwrap();
    let journey = Journey::new(&commands, "ball", &before.lattice().world_box(), |_| None);
    let Command::Stroke { stroke, .. } = &commands[0] else {
        unreachable!()
    };
    let canvas = Canvas::alone(before.clone(), ISO, 0);
    let (now, _) = stroke.apply(canvas, &mut Control::default()).unwrap();
    let scan = scan();
    let revision = revise_volume(&before, &now.field, &scan, ISO, FILL, &journey).unwrap();
    let mut checked = [0; 2];
    for change in &revision.changes {
        let place = scan.header.world_from_voxel.transform_point3(index(change.voxel));
        let origin = place - DVec3::Y;
        let is_inside =
            ball(place) == 100.0 && ball(origin) == 100.0 && (now.field.value(place) - 100.0).abs() < 0.1;
        let at = scan.header.world_from_voxel.inverse().transform_point3(origin);
        let is_in_scan = at.cmpge(DVec3::ONE).all() && at.cmple(DVec3::splat(SIDE as f64 - 2.0)).all();
        if (place.x - 12.0).abs() > 3.5 && is_inside && is_in_scan {
            let off = (change.density - trilinear(&scan, at)).abs();
            assert!(off < 1.0, "{place}: {off}");
            checked[usize::from(place.x > 12.0)] += 1;
        }
    }
    assert!(checked.iter().all(|n| *n > 20), "{checked:?}");
}

/// The ball moves under a mask: what the mask keeps stays, and at its border the scan follows the field.
#[test]
fn a_move_under_a_mask_keeps_what_is_masked() {
    let (before, scan) = (fitted(), scan());
    let half = "{ min = [-9, -9, -9], max = [33, 33, 12] }";
    let keep = format!(
        "[[stroke]]\ncopy = {{ to = \"keep\" }}\n[[stroke]]\nobject = \"keep\"\ncut = {{ region = {} }}\n",
        half.replace("33, 33, 12", "33, 33, 33")
            .replace("-9, -9, -9", "-9, -9, 12")
    );
    let shift = "move = { motion = { shift = { region = { min = [0, 0, 0], max = [24, 24, 24] }, by = [3, 0, 0], blend = 9 } } }\n";
    let place = |voxel: usize| scan.header.world_from_voxel.transform_point3(index(voxel));
    let left_by_fit = (0..scan.values.len())
        .map(|v| f64::from(scan.values[v]) - before.value(place(v)))
        .fold((0.0f64, 0.0f64), |(lo, hi), off| (lo.min(off), hi.max(off)));
    for (before_it, limits) in [
        ("", format!("within = {half}")),
        ("", format!("mask = {{ boxes = [{half}] }}")),
        ("", format!("mask = {{ boxes = [{half}], soft = 4 }}")),
        (keep.as_str(), "mask = { object = \"keep\" }".to_string()),
    ] {
        let text = format!("{before_it}[[stroke]]\n{limits}\n{shift}");
        let (now, journey) = by_script(&before, &text);
        let revision = revise_volume(&before, &now, &scan, ISO, FILL, &journey).unwrap();
        let mut moved = 0;
        for change in &revision.changes {
            let place = place(change.voxel);
            let (was, is) = (before.value(place), now.value(place));
            assert_ne!(was, is, "{limits}: {place} was changed");
            let came_from = scan
                .header
                .world_from_voxel
                .inverse()
                .transform_point3(place - 3.0 * DVec3::X);
            if came_from.cmplt(DVec3::ZERO).any() || came_from.cmpgt(DVec3::splat(SIDE as f64 - 1.0)).any() {
                continue;
            }
            let off = change.density - is;
            assert!(
                left_by_fit.0 - 3.0 < off && off < left_by_fit.1 + 3.0,
                "{limits}: {place}: {was} became {is}, in the scan {}",
                change.density
            );
            moved += usize::from((is - was).abs() > 20.0);
        }
        assert!(moved > 20, "{limits}: {moved}");
    }
}

fn trilinear(scan: &Volume, at: DVec3) -> f64 {
    let cell = at.floor();
    (0..8)
        .map(|corner: usize| {
            let step = DVec3::new(
                (corner & 1) as f64,
                (corner >> 1 & 1) as f64,
                (corner >> 2) as f64,
            );
            let weight = (1.0 - (at - cell - step).abs())
                .to_array()
                .iter()
                .product::<f64>();
            let [x, y, z] = (cell + step).to_array().map(|v| v as usize);
            weight * f64::from(scan.values[x + SIDE * (y + SIDE * z)])
        })
        .sum()
}

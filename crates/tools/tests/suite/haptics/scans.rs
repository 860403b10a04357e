//! The scans of the repository under a tool: where it rests against where it should, by looking everywhere on the surface.

use std::path::PathBuf;
use std::sync::{Arc, LazyLock};

use bspline::{Aabb, Field, HierarchicalSpline};
use fitting::Control;
use fitting::mesh::{MeshOptions, fit_mesh};
use fitting::volume::{VolumeMethod, VolumeOptions, VolumeView, fit_volume, otsu_threshold};
use formats::ReadLimits;
use glam::{DAffine3, DVec3};
use tools::haptics::{
    Demand, FieldObstacle, MatterMap, Obstacle, Pose, ProbeOptions, Proxy, ProxyOptions, Renderer, Snapshot,
    SnapshotMaker, Touch, TouchedObject,
};
use tools::paint::{Layer, LayerError, Layers, Substance};

/// A scan, where its surface is, and where it stands.
struct Scan {
    field: Arc<HierarchicalSpline<f32>>,
    iso: f64,
    world_from_object: DAffine3,
}

fn data(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../data")
        .join(name)
}

/// Its voxels are 1 mm; the surface is the skin, at half the value between air and tissue: no value that was fitted.
fn head(options: VolumeOptions) -> Scan {
    let (as_it_is, limits) = (formats::volumes::VolumeOptions::default(), ReadLimits::default());
    let volume = formats::volumes::read(&data("head.nii.gz"), &as_it_is, &limits).unwrap();
    let view = VolumeView {
        dims: volume.header.dims,
        values: (&volume.values).into(),
        world_from_voxel: volume.header.world_from_voxel,
    };
    Scan {
        field: Arc::new(fit_volume(&view, &options, &mut Control::default()).unwrap().0),
        iso: 0.5 * otsu_threshold(&volume.values).unwrap(),
        world_from_object: DAffine3::IDENTITY,
    }
}

/// With a quarter of the coefficients that an ordinary fit takes, so that it is quick.
static HEAD: LazyLock<Scan> = LazyLock::new(|| {
    head(VolumeOptions {
        coefficients: Some(60_000),
        ..VolumeOptions::default()
    })
});

/// Through every voxel, with all its noise.
static NOISY: LazyLock<Scan> = LazyLock::new(|| {
    head(VolumeOptions {
        method: VolumeMethod::Interpolate,
        ..VolumeOptions::default()
    })
});

/// Some 10 units high, here 100 mm.
static BUNNY: LazyLock<Scan> = LazyLock::new(|| {
    let mesh = formats::meshes::read(&data("bunny.obj.gz"), &ReadLimits::default()).unwrap();
    let options = MeshOptions {
        tolerance: Some(0.02),
        max_depth: Some(6),
        ..MeshOptions::default()
    };
    let fitted = fit_mesh(&mesh.vertices, &mesh.triangles, &options, &mut Control::default());
    Scan {
        field: Arc::new(fitted.unwrap().0),
        iso: 0.0,
        world_from_object: DAffine3::from_scale(DVec3::splat(10.0)),
    }
});

impl Scan {
    /// Depth of a place, in the world, to first order, and the way inward.
    fn look(&self, p: DVec3) -> (f64, DVec3) {
        let back = self.world_from_object.inverse();
        let (value, g) = self.field.value_gradient(back.transform_point3(p));
        let g = back.matrix3.transpose() * g;
        ((value - self.iso) / g.length(), g.normalize())
    }

    /// A place of the surface near another.
    fn onto(&self, mut x: DVec3) -> DVec3 {
        for _ in 0..4 {
            let (depth, inward) = self.look(x);
            x -= depth.clamp(-0.5, 0.5) * inward;
        }
        x
    }

    /// Where a way into it first meets the surface.
    fn first(&self, from: DVec3, way: DVec3) -> DVec3 {
        let at = |n: u32| from + way * (0.25 * f64::from(n));
        let hit = (1..1000).find(|n| self.look(at(*n)).0 > 0.0);
        self.onto(at(hit.expect("a way that meets it")))
    }

    /// Places of the surface in a box, on all lines along the axes that are `step` apart.
    fn places(&self, b: &Aabb, step: f64) -> Vec<DVec3> {
        let back = self.world_from_object.inverse();
        let count = (b.size() / step).ceil().to_array().map(|n| n as usize);
        let mut found = Vec::new();
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            for i in 0..=count[u] {
                for j in 0..=count[v] {
                    let place = |n: usize| {
                        let mut p = b.min;
                        (p[axis], p[u], p[v]) = (
                            p[axis] + n as f64 * step,
                            p[u] + i as f64 * step,
                            p[v] + j as f64 * step,
                        );
                        p
                    };
                    let is_in = |n: usize| self.field.value(back.transform_point3(place(n))) > self.iso;
                    let mut last = is_in(0);
                    for n in 1..=count[axis] {
                        let now = is_in(n);
                        if now != last {
                            found.push(self.onto(place(n - 1).midpoint(place(n))));
                        }
                        last = now;
                    }
                }
            }
        }
        found
    }

    /// Distance from the surface: of all its places that are nearly nearest, each slid to where the way stands upright on it.
    fn distance(&self, all: &[DVec3], p: DVec3, step: f64) -> f64 {
        let near = all.iter().map(|x| x.distance(p)).fold(f64::INFINITY, f64::min);
        let around = all.iter().filter(|x| x.distance(p) < near + 0.2 * step);
        let slid = |x: &DVec3| {
            let (mut x, mut best) = (*x, x.distance(p));
            for _ in 0..12 {
                let n = self.look(x).1;
                let side = (p - x) - (p - x).dot(n) * n;
                x = self.onto(x + (0.5 * side).clamp_length_max(step));
                best = best.min(x.distance(p));
            }
            best
        };
        around.map(slid).fold(near, f64::min)
    }

    fn snapshot(&self, demand: Demand, at: DVec3) -> Arc<Snapshot> {
        let layers = Layers::new();
        let object = TouchedObject {
            id: 0,
            field: self.field.clone(),
            iso: self.iso,
            world_from_object: self.world_from_object,
            layers: &layers,
            default: Touch::default(),
        };
        SnapshotMaker::new(demand).make(at, &[object], 0)
    }

    /// Rolls a ball in two circles about a place of the surface, the hand 2 mm too deep, and returns what its middle is off by from the surface's
    /// offset, wherever it is pressed, least first.
    fn rolled(&self, demand: Demand, at: DVec3) -> Vec<f64> {
        let (radius, step) = (demand.radius, 0.3);
        let inward = self.look(at).1;
        let (u, v) = inward.any_orthonormal_pair();
        let snapshot = self.snapshot(demand, at);
        let all = self.places(&Aabb::new(at, at).widened(5.0 + 2.0 * radius + 2.0), step);
        let mut proxy = Proxy::new(ProxyOptions {
            radius,
            ..ProxyOptions::default()
        });
        let mut off = Vec::new();
        for n in 0..2400u32 {
            let share = f64::from(n) / 2400.0;
            let (sine, cosine) = libm::sincos(2.0 * std::f64::consts::TAU * share);
            let way = (1.0 + 3.0 * share) * (sine * u + cosine * v);
            let deep = 2.0 - (radius + 6.0) * (1.0 - 8.0 * share).max(0.0);
            let felt = proxy.tick(&*snapshot, &Pose::at(at + way + (deep - radius) * inward), 1e-3);
            if n % 12 == 0 && felt.force.length() > 0.05 {
                off.push((self.distance(&all, felt.proxy.at, step) - radius).abs());
            }
        }
        off.sort_by(f64::total_cmp);
        println!(
            "ball {radius} mm at {at}, nodes {} mm: off by {:.5} mm (median), {:.5} (95 %), {:.5} (worst) at {} places; {:?}",
            snapshot.parts()[0].shape.spacing(),
            off[off.len() / 2],
            off[off.len() * 95 / 100],
            off[off.len() - 1],
            off.len(),
            snapshot.unresolved()
        );
        off
    }
}

/// Three places where a way from the front first meets the skin: on the forehead, beside the eye, on the cheek.
fn places_of(head: &Scan) -> [DVec3; 3] {
    let from = |x: f64, z: f64| head.first(DVec3::new(x, 110.0, z), DVec3::NEG_Y);
    [from(15.0, 20.0), from(43.0, -7.0), from(43.0, -37.0)]
}

/// At the distance of nodes that is chosen; and where every voxel's noise is kept, whose hollows are sharper, at half of it.
#[test]
fn a_ball_of_5_mm_rolls_over_the_head_within_a_tenth_of_a_millimetre() {
    let closer = Demand {
        spacing: Some(0.5),
        reach: 12.0,
        ..Demand::of_ball(5.0)
    };
    for (head, demand) in [(&*HEAD, Demand::of_ball(5.0)), (&*NOISY, closer)] {
        for at in places_of(head) {
            let off = head.rolled(demand, at);
            assert!(off.len() > 100 && off[off.len() - 1] < 0.1, "{:?}", off.last());
        }
    }
}

#[test]
fn a_point_rests_on_the_skin_within_10_micrometres() {
    for head in [&*HEAD, &*NOISY] {
        for at in places_of(head) {
            let off = head.rolled(Demand::of_ball(0.0), at);
            assert!(off.len() > 100 && off[off.len() - 1] < 0.01, "{:?}", off.last());
        }
    }
}

#[test]
fn the_bunny_is_touched_where_it_is() {
    let back = BUNNY.first(DVec3::new(-15.0, 200.0, 0.0), DVec3::NEG_Y);
    for (radius, most) in [(5.0, 0.1), (2.0, 0.05), (0.0, 0.01)] {
        let off = BUNNY.rolled(Demand::of_ball(radius), back);
        assert!(off.len() > 100 && off[off.len() - 1] < most, "{:?}", off.last());
    }
    // Straight from the field it is where the brick says.
    let (snapshot, field) = (
        BUNNY.snapshot(Demand::of_ball(0.0), back),
        FieldObstacle::new(BUNNY.field.clone(), 0.0, BUNNY.world_from_object, 2.0),
    );
    let inward = BUNNY.look(back).1;
    let (u, v) = inward.any_orthonormal_pair();
    let mut count = 0;
    for n in 0..200 {
        let (sine, cosine) = libm::sincos(f64::from(n));
        let near = back + 0.02 * f64::from(n) * (sine * u + cosine * v) + 0.3 * cosine * inward;
        let ((a, g), (b, h)) = (snapshot.distance(near), field.distance(near));
        // The field itself is first of all a distance near its surface.
        if b.abs() < 0.3 {
            count += 1;
            assert!(
                (a - b).abs() < 0.01 && g.angle_between(h) < 0.03,
                "{near}: {a} and {b}, {g} and {h}"
            );
        }
    }
    assert!(count > 50, "{count}");
}

/// From readings at rest alone, on a grid of places, a stiff ball buried in the head is found: where it is and how large, within a tenth of its
/// radius.
#[test]
fn a_stiff_ball_in_the_head_is_found_by_readings_alone() {
    let (at, radius) = (DVec3::new(20.0, 40.0, -5.0), 4.0);
    let whole = Layer::empty(HEAD.field.lattice(), HEAD.field.level_count());
    let about = Aabb::new(at, at).widened(radius + 1.0);
    let painted = whole.painted(&about, |p, _| {
        Ok::<_, LayerError>((p.distance(at) < radius).then_some(9.0))
    });
    let layers = Layers::from([(Substance::Stiffness, painted.unwrap())]);
    let options = ProbeOptions::of_radius(1.0);
    let field: &dyn Field = &*HEAD.field;
    let reach = 8.0;
    let map = MatterMap::new(
        (field, HEAD.iso),
        &DAffine3::IDENTITY,
        &layers,
        &options,
        at + DVec3::new(1.7, -1.2, 0.9),
        reach,
    );
    let (step, side) = (0.5, 14);
    let mut readings = Vec::new();
    for x in -side..=side {
        for y in -side..=side {
            for z in -side..=side {
                let p = at + DVec3::new(1.7, -1.2, 0.9) + DVec3::new(x.into(), y.into(), z.into()) * step;
                readings.push((p, map.reading(p)));
            }
        }
    }
    let most = readings.iter().map(|r| r.1).fold(0.0, f64::max);
    let least = readings.iter().map(|r| r.1).fold(f64::INFINITY, f64::min);
    // Unpainted tissue reads 1.
    let half = 0.5 * (1.0 + most);
    let stiff: Vec<DVec3> = readings.iter().filter(|r| r.1 > half).map(|r| r.0).collect();
    let center = stiff.iter().sum::<DVec3>() / stiff.len() as f64;
    let found = (stiff.len() as f64 * f64::powi(step, 3) * 3.0 / (4.0 * std::f64::consts::PI)).cbrt();
    println!("found at {center} for {at}, radius {found}, readings from {least} to {most}");
    assert!(center.distance(at) < 0.1 * radius, "{center}");
    assert!((found - radius).abs() < 0.1 * radius, "{found}");
}

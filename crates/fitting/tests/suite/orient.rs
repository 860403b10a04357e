//! Normals for clouds that have none, against the normals the clouds were drawn with.

use fitting::orient::{OrientOptions, Orientation, Route, UNSURE, orient_points};
use fitting::phantoms::{CloudOptions, SampledCloud, Solid, SplitMix64, sample_cloud};
use fitting::{Cancel, Control, FitError};
use glam::DVec3;

fn cloud(solid: Solid, options: CloudOptions) -> SampledCloud {
    sample_cloud(&*solid.field(), &solid.within(), &options).expect("phantoms have a surface")
}

fn of(count: usize) -> CloudOptions {
    CloudOptions {
        count,
        ..CloudOptions::default()
    }
}

fn orient(positions: &[DVec3]) -> Orientation {
    by(Route::WindingNumber, positions)
}

fn by(route: Route, positions: &[DVec3]) -> Orientation {
    orient_points(positions, &OrientOptions { route }, &mut Control::default()).expect("a usable cloud")
}

fn refusal(positions: &[DVec3]) -> FitError {
    orient_points(positions, &OrientOptions::default(), &mut Control::default())
        .expect_err("an unusable cloud")
}

/// Share of the points with a true normal that got one on the right side.
fn right(o: &Orientation, truth: &[DVec3]) -> f64 {
    let real = truth.iter().filter(|t| **t != DVec3::ZERO).count();
    let good = o
        .normals
        .iter()
        .zip(truth)
        .filter(|(n, t)| n.dot(**t) > 0.0)
        .count();
    good as f64 / real as f64
}

/// Points of a ball, evenly spread (a spiral), with the sign of their outward normal.
fn shell(centre: DVec3, radius: f64, count: usize, sign: f64) -> Vec<(DVec3, DVec3)> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..count)
        .map(|i| {
            let z = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
            let (s, c) = (golden * i as f64).sin_cos();
            let n = DVec3::new(c, s, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z;
            (centre + n * radius, n * sign)
        })
        .collect()
}

fn split(points: Vec<(DVec3, DVec3)>) -> (Vec<DVec3>, Vec<DVec3>) {
    points.into_iter().unzip()
}

#[test]
fn normals_of_clean_solids_point_outward() {
    for solid in [Solid::Sphere, Solid::Torus, Solid::Tetrahedron] {
        let c = cloud(solid, of(8000));
        let o = orient(&c.positions);
        let share = right(&o, &c.normals);
        assert!(share > 0.999, "{}: {share}", solid.name());
        assert!(o.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-9));
        assert_eq!(o.noise, None, "{}", solid.name());
    }
}

#[test]
fn normals_of_a_smooth_solid_are_exact_to_a_degree() {
    let c = cloud(Solid::Torus, of(20_000));
    let o = orient(&c.positions);
    let mut angles: Vec<f64> = o
        .normals
        .iter()
        .zip(&c.normals)
        .map(|(n, t)| n.dot(*t).clamp(-1.0, 1.0).acos().to_degrees())
        .collect();
    angles.sort_by(f64::total_cmp);
    assert!(angles[angles.len() / 2] < 0.5, "{}", angles[angles.len() / 2]);
    assert!(angles[angles.len() * 99 / 100] < 3.0);
}

#[test]
fn the_wall_of_a_cavity_points_into_the_cavity() {
    let mut points = shell(DVec3::ZERO, 1.0, 6000, 1.0);
    points.extend(shell(DVec3::new(0.1, 0.0, 0.0), 0.5, 1500, -1.0));
    let (positions, truth) = split(points);
    assert_eq!(right(&orient(&positions), &truth), 1.0);
}

#[test]
fn two_balls_that_touch_both_point_outward() {
    let mut points = shell(-DVec3::X, 0.995, 4000, 1.0);
    points.extend(shell(DVec3::X, 0.995, 4000, 1.0));
    let (positions, truth) = split(points);
    let o = orient(&positions);
    // Where they are nearer than a spacing, the points of both are one crowd.
    let spacing = (4.0 * std::f64::consts::PI / 4000.0).sqrt();
    for ((p, n), t) in positions.iter().zip(&o.normals).zip(&truth) {
        let gap = 2.0 * p.x.abs();
        assert!(gap < 1.5 * spacing || n.dot(*t) > 0.0, "{p}");
    }
}

#[test]
fn the_two_faces_of_a_thin_plate_point_apart() {
    // As thick as 2.8 spacings, which must not pass for noise. Normals on its rim, as narrow, are means over edges.
    let c = cloud(Solid::Sheet, of(12_000));
    let o = orient(&c.positions);
    assert_eq!(o.noise, None);
    assert!(right(&o, &c.normals) > 0.995, "{}", right(&o, &c.normals));
}

#[test]
fn noise_is_found_and_does_not_turn_normals_over() {
    let clean = cloud(Solid::Torus, of(12_000));
    let diagonal = 2.0 * (1.4f64.powi(2) * 2.0 + 0.4f64.powi(2)).sqrt();
    for share in [0.0025, 0.005] {
        let sigma = share * diagonal;
        let mut random = SplitMix64::new(3);
        let noisy: Vec<DVec3> = clean
            .positions
            .iter()
            .map(|p| *p + random.normal3() * sigma)
            .collect();
        let o = orient(&noisy);
        let found = o.noise.expect("there is noise");
        assert!((found / sigma - 1.0).abs() < 0.3, "{found} for {sigma}");
        assert!(
            right(&o, &clean.normals) > 0.998,
            "{share}: {}",
            right(&o, &clean.normals)
        );
    }
}

#[test]
fn outliers_are_named_and_do_not_disturb_the_rest() {
    let c = cloud(Solid::Torus, of(10_000));
    let (mut positions, mut truth) = (c.positions, c.normals);
    let mut random = SplitMix64::new(5);
    let size = DVec3::new(2.8, 2.8, 0.8);
    for _ in 0..1000 {
        positions.push((random.uniform3() - 0.5) * size);
        truth.push(DVec3::ZERO);
    }
    let o = orient(&positions);
    let named = |real: bool| {
        let is_real = |i: &usize| (truth[*i] != DVec3::ZERO) == real;
        (0..positions.len())
            .filter(is_real)
            .filter(|&i| o.outlier[i])
            .count()
    };
    // Those nearer to the surface than two spacings cannot be told from it.
    assert!(named(false) > 700, "{}", named(false));
    assert!(named(true) < 10, "{}", named(true));
    assert!(right(&o, &truth) > 0.999, "{}", right(&o, &truth));
    assert!(o.notes.iter().any(|n| n.contains("no surface")), "{:?}", o.notes);
    assert!(
        (0..positions.len())
            .all(|i| !o.outlier[i] || (o.normals[i] == DVec3::ZERO && o.confidence[i] == 0.0))
    );
}

#[test]
fn density_of_thirty_to_one_does_not_matter() {
    let c = cloud(
        Solid::Torus,
        CloudOptions {
            count: 12_000,
            density_ratio: 30.0,
            ..CloudOptions::default()
        },
    );
    let o = orient(&c.positions);
    assert!(right(&o, &c.normals) > 0.999, "{}", right(&o, &c.normals));
    assert!(o.outlier.iter().filter(|o| **o).count() < 12);
}

#[test]
fn holes_do_not_matter() {
    let c = cloud(
        Solid::Torus,
        CloudOptions {
            count: 12_000,
            hole_count: 5,
            ..CloudOptions::default()
        },
    );
    let o = orient(&c.positions);
    assert!(right(&o, &c.normals) > 0.999, "{}", right(&o, &c.normals));
}

#[test]
fn an_open_sheet_has_no_inside_and_says_so() {
    let mut random = SplitMix64::new(2);
    let sheet: Vec<DVec3> = (0..4000)
        .map(|_| random.uniform3() * DVec3::new(1.0, 1.0, 0.0))
        .collect();
    let o = orient(&sheet);
    assert!(o.unsure_count > 3900, "{}", o.unsure_count);
    assert!(
        o.notes.iter().any(|n| n.contains("unsure sign between")),
        "{:?}",
        o.notes
    );
    assert!(o.normals.iter().all(|n| n.z.abs() > 0.999));
}

/// Points of hills over a square, `raised`, with their normals upward.
fn terrain(count: usize, seed: u64, raised: f64) -> (Vec<DVec3>, Vec<DVec3>) {
    let mut random = SplitMix64::new(seed);
    let waves: Vec<[f64; 4]> = (0..12)
        .map(|_| {
            let [u, v] = [random.uniform() - 0.5, random.uniform() - 0.5].map(|f| 40.0 * f);
            [u, v, 6.0 * random.uniform(), 0.12 / (4.0 + u.hypot(v))]
        })
        .collect();
    let point = |_| {
        let at = random.uniform3();
        let (mut z, mut slope) = (raised, DVec3::ZERO);
        for [u, v, phase, height] in &waves {
            let (sin, cos) = (u * at.x + v * at.y + phase).sin_cos();
            z += height * sin;
            slope += DVec3::new(*u, *v, 0.0) * (height * cos);
        }
        (at.with_z(z), (DVec3::Z - slope).normalize())
    };
    (0..count).map(point).unzip()
}

#[test]
fn terrain_faces_up() {
    for seed in 0..4 {
        let (points, truth) = terrain(4000, seed, 0.0);
        let o = orient(&points);
        assert!(right(&o, &truth) > 0.999, "seed {seed}: {}", right(&o, &truth));
        assert!(o.notes.iter().any(|n| n.contains("open sheets")), "{:?}", o.notes);
    }
}

#[test]
fn two_noisy_shells_that_nearly_touch_are_no_open_sheet() {
    // Most signs are unsure; the normals of neighbours contradict each other whatever is followed.
    let mut random = SplitMix64::new(5);
    let both = [(1.0, 1200), (0.85, 900)];
    let shells = both.map(|(radius, count)| split(shell(DVec3::ZERO, radius, 10 * count, 1.0)).0);
    let points: Vec<DVec3> = shells
        .into_iter()
        .flatten()
        .map(|p| p + (random.uniform3() - 0.5) * 0.1)
        .collect();
    let o = orient(&points);
    assert!(o.unsure_count > points.len() / 3, "{}", o.unsure_count);
    assert!(
        !o.notes.iter().any(|n| n.contains("open sheets")),
        "{:?}",
        o.notes
    );
}

#[test]
fn an_open_bowl_faces_away_from_its_hollow() {
    // Three quarters of a ball, lying on its side, and one more than half open.
    for most in [0.5, -0.3] {
        let ball = shell(DVec3::ZERO, 1.0, 8000, 1.0);
        let (points, outward) = split(ball.into_iter().filter(|p| p.0.x < most).collect());
        let o = orient(&points);
        assert!(right(&o, &outward) > 0.999, "{most}: {}", right(&o, &outward));
    }
}

#[test]
fn a_closed_solid_over_terrain_keeps_its_own_sides() {
    let (mut points, mut truth) = terrain(8000, 3, -2.0);
    let (ball, outward) = split(shell(DVec3::ZERO, 0.3, 3000, 1.0));
    points.extend(ball);
    truth.extend(outward);
    let o = orient(&points);
    assert!(right(&o, &truth) > 0.999, "{}", right(&o, &truth));
    let sure = o.confidence[8000..].iter().filter(|c| **c > UNSURE).count();
    assert!(sure > 2900, "{sure}");
}

#[test]
fn wrong_signs_are_among_the_unsure_ones() {
    // Every twentieth point of a clean ball is kept: the exterior leaks in for the tagging route.
    let c = cloud(Solid::Gyroid, of(6000));
    let o = by(Route::Tagging, &c.positions);
    let wrong: Vec<usize> = (0..6000)
        .filter(|&i| o.normals[i].dot(c.normals[i]) < 0.0)
        .collect();
    let unsure = wrong.iter().filter(|&&i| o.confidence[i] < UNSURE).count();
    assert!(unsure * 10 >= wrong.len() * 8, "{unsure} of {}", wrong.len());
}

#[test]
fn tagging_orients_closed_solids() {
    for solid in [Solid::Sphere, Solid::Torus] {
        let c = cloud(solid, of(8000));
        let o = by(Route::Tagging, &c.positions);
        assert!(
            right(&o, &c.normals) > 0.995,
            "{}: {}",
            solid.name(),
            right(&o, &c.normals)
        );
        assert_eq!(o.route, Route::Tagging);
    }
}

#[test]
fn doubles_get_the_normal_of_the_point_they_repeat() {
    let (single, truth) = split(shell(DVec3::ZERO, 1.0, 2000, 1.0));
    let mut positions = single.clone();
    positions.extend_from_slice(&single);
    let o = orient(&positions);
    assert_eq!(o.normals[..2000], o.normals[2000..]);
    assert_eq!(o.normals[..2000], orient(&single).normals);
    assert_eq!(right(&o, &truth), 1.0);
}

#[test]
fn points_that_are_not_numbers_get_no_normal_and_are_told() {
    let (mut positions, truth) = split(shell(DVec3::ZERO, 1.0, 2000, 1.0));
    positions[7].x = f64::NAN;
    positions[8].z = f64::INFINITY;
    positions[9] = DVec3::splat(1e9);
    let o = orient(&positions);
    for i in [7, 8, 9] {
        assert!(o.outlier[i] && o.normals[i] == DVec3::ZERO);
    }
    assert_eq!(right(&o, &truth), 1997.0 / 2000.0);
    assert!(o.notes.iter().any(|n| n.contains("not finite")), "{:?}", o.notes);
    assert!(o.notes.iter().any(|n| n.contains("ten extents")), "{:?}", o.notes);
}

#[test]
fn clouds_without_a_surface_are_refused() {
    let too_few = |found| FitError::NotEnoughSamples { found, needed: 10 };
    assert_eq!(refusal(&[]), too_few(0));
    assert_eq!(refusal(&[DVec3::ONE]), too_few(1));
    assert_eq!(refusal(&[DVec3::NAN; 50]), too_few(0));
    assert!(matches!(refusal(&[DVec3::ONE; 50]), FitError::Degenerate(_)));
    let line: Vec<DVec3> = (0..100)
        .map(|i| DVec3::new(1.0, 2.0, -1.0) * f64::from(i))
        .collect();
    assert!(refusal(&line).to_string().contains("line"));
}

#[test]
fn the_smallest_cloud_is_oriented() {
    let (positions, truth) = split(shell(DVec3::ZERO, 1.0, 12, 1.0));
    assert_eq!(right(&orient(&positions), &truth), 1.0);
}

#[test]
fn a_million_away_changes_no_sign() {
    let (positions, truth) = split(shell(DVec3::ZERO, 1.0, 3000, 1.0));
    let far: Vec<DVec3> = positions.iter().map(|p| *p + DVec3::splat(1e6)).collect();
    let (near, far) = (orient(&positions), orient(&far));
    assert_eq!(right(&far, &truth), 1.0);
    let worst = near
        .normals
        .iter()
        .zip(&far.normals)
        .map(|(a, b)| (*a - *b).length())
        .fold(0.0, f64::max);
    // Rounding of the positions is 1e-10, of the spacing 2e-9; a normal is their ratio, squared by the quadric.
    assert!(worst < 1e-5, "{worst}");
}

#[test]
fn the_bits_do_not_depend_on_threads() {
    let c = cloud(
        Solid::Tetrahedron,
        CloudOptions {
            count: 5000,
            noise: 0.01,
            ..CloudOptions::default()
        },
    );
    for route in Route::ALL {
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .expect("threads");
            pool.install(|| by(route, &c.positions))
        };
        let one = with(1);
        assert_eq!(one, with(2));
        assert_eq!(one, with(8));
    }
}

#[test]
fn a_raised_flag_and_a_low_ceiling_stop_it() {
    let (positions, _) = split(shell(DVec3::ZERO, 1.0, 2000, 1.0));
    let options = OrientOptions::default();
    let mut control = Control {
        memory_limit: Some(100_000),
        ..Control::default()
    };
    let refused = orient_points(&positions, &options, &mut control);
    assert!(
        matches!(refused, Err(FitError::MemoryLimit { .. })),
        "{refused:?}"
    );
    let cancel = Cancel::new();
    let raised = cancel.clone();
    let mut control = Control {
        on_progress: Box::new(move |p| {
            if p.fraction > 0.3 {
                raised.cancel();
            }
        }),
        cancel,
        memory_limit: None,
    };
    assert_eq!(
        orient_points(&positions, &options, &mut control),
        Err(FitError::Cancelled)
    );
}

//! Work below a shell: the outer surface stays to the bit.

use bspline::hierarchical::{BRICK, HierarchicalSpline, Lattice};
use bspline::polygonize::{PolygonizeOptions, polygonize};
use bspline::{Field, Frame};
use glam::{DAffine3, DVec3};
use tools::coefficients::support;

use super::{ISO, SLOPE, block, done, random, refused};

const MIDDLE: DVec3 = DVec3::new(12.0, 12.0, 12.0);
const RADIUS: f64 = 9.0;
const WALL: f64 = 2.0;

/// A ball whose density only falls with the distance, not as it.
fn ball() -> HierarchicalSpline<f32> {
    let lattice = Lattice {
        world_from_lattice: DAffine3::from_scale(DVec3::splat(0.5)),
        cells: [48; 3],
    };
    let density = |p: DVec3| ISO + SLOPE * (RADIUS.powi(2) - p.distance_squared(MIDDLE)) / (2.0 * RADIUS);
    HierarchicalSpline::schoenberg(lattice, SLOPE, density).unwrap()
}

/// Functions that differ, and of them the least distance of a support from the outer surface.
fn changed(before: &HierarchicalSpline<f32>, after: &HierarchicalSpline<f32>) -> (usize, f64) {
    let (mut count, mut least) = (0, f64::INFINITY);
    for brick in before.difference(after).unwrap().bricks {
        for slot in 0..BRICK * BRICK * BRICK {
            let [old, new] = [&brick.old, &brick.new].map(|side| side.as_ref().and_then(|c| c.get(slot)));
            if old == new {
                continue;
            }
            let at = [slot / 64, slot / 8 % 8, slot % 8];
            let function = std::array::from_fn(|a| brick.key.0[a] * 8 + at[a] as u32);
            let (_, b) = support(before, brick.level, function);
            let far = (b.min - MIDDLE).abs().max((b.max - MIDDLE).abs());
            count += 1;
            least = least.min(RADIUS - far.length());
        }
    }
    (count, least)
}

/// Vertices of the surface farther from the middle than half way, as bits.
fn outer(field: &HierarchicalSpline<f32>) -> Vec<[u64; 3]> {
    let frame = Frame::over(&field.lattice().world_box(), [64; 3]);
    let options = PolygonizeOptions {
        iso: ISO,
        ..Default::default()
    };
    let (mesh, _) = polygonize(field, &frame, &options).unwrap();
    let far = mesh
        .positions
        .iter()
        .filter(|p| p.distance(MIDDLE) > RADIUS - 0.5 * WALL);
    let mut all: Vec<_> = far.map(|p| p.to_array().map(f64::to_bits)).collect();
    all.sort_unstable();
    all
}

/// Share of places at random in the ball that are solid.
fn solid(field: &HierarchicalSpline<f32>) -> f64 {
    let mut draw = random(11);
    let mut place = || MIDDLE + DVec3::new(draw(-9.0, 9.0), draw(-9.0, 9.0), draw(-9.0, 9.0));
    let count = (0..20_000).filter(|_| field.value(place()) > ISO).count();
    count as f64 / 20_000.0
}

/// Tools of every kind, far larger than the ball leaves room for: all that changes lies below the wall, and the surface is the same bits.
#[test]
fn below_a_wall_the_outer_surface_stays_to_the_bit() {
    let before = ball();
    let surface = outer(&before);
    let mut field = before.clone();
    let mut last = solid(&field);
    for (text, is_less) in [
        (
            "carve = { shape = { sphere = { radius = 6.0 } }, along = [[15, 12, 12], [9, 13, 11]] }",
            Some(true),
        ),
        (
            "carve = { shape = { box = { size = [30, 2, 2] } }, along = [[12, 12, 12]] }",
            None,
        ),
        (
            "add = { shape = { cylinder = { axis = [0, 0, 1], radius = 1, height = 30 } }, along = [[12, 12, 12]] }",
            Some(false),
        ),
        (
            "sweep = { operation = 'carve', shape = { sphere = { radius = 1.2 } },
            along = { spline = { through = [[12, 12, 2], [14, 12, 12], [12, 12, 22]] } } }",
            None,
        ),
        // The wall of the cavity is no outer surface: forces draw it in and push it out.
        (
            "pull = { along = [[15, 8.1, 12]], by = [0, 1.5, 0], radius = 0.8 }",
            None,
        ),
        (
            "chisel = { along = [[15, 8.1, 12], [14, 7.9, 12]], depth = 0.5, radius = 0.8 }",
            None,
        ),
        ("inflate = { along = [[12, 12, 7]], radius = 5, by = 0.4 }", None),
        (
            "smooth = { along = [[12, 12, 12]], radius = 24, level = 2 }",
            None,
        ),
        (
            "move = { motion = { grab = { along = [[12, 12, 12], [12, 14, 12]], radius = 8 } } }",
            None,
        ),
        ("refine = { along = [[12, 12, 12]], radius = 2 }", None),
    ] {
        let left = done(&field, &format!("wall = {WALL}\n{text}"));
        let (count, least) = changed(&field, &left);
        println!("{count} functions, the shallowest {least:.3} deep: {text:.60}");
        assert!(count > 0, "{text}: {count} functions changed");
        assert!(least >= WALL, "{text}: one that is {least} deep");
        // No long lists of bits where they differ.
        assert!(outer(&left) == surface, "{text}: the surface has changed");
        let now = solid(&left);
        if let Some(is_less) = is_less {
            assert_eq!(now < last, is_less, "{text}: {now} after {last}");
        }
        (field, last) = (left, now);
    }
    assert!(last < 0.95 * solid(&before), "{last}");
}

/// The whole that can be carved is carved: what is left of the ball is not much thicker than the wall, and of one thickness.
#[test]
fn a_wall_is_hardly_thicker_than_asked() {
    for (finer, uneven) in [(0, 0.25), (1, 0.12), (2, 0.12)] {
        let text = format!(
            "wall = {WALL}\ncarve = {{ shape = {{ sphere = {{ radius = 8.5 }} }}, along = [[12, 12, 12]], finer = {finer} }}"
        );
        let left = done(&ball(), &text);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(8).build().unwrap();
        assert_eq!(pool.install(|| done(&ball(), &text)).sha256(), left.sha256());
        let mut draw = random(4);
        let thickness = |_| {
            let way = DVec3::new(draw(-1.0, 1.0), draw(-1.0, 1.0), draw(-1.0, 1.0)).normalize();
            let mut depths = (50..900).map(|i| 0.01 * f64::from(i));
            let inner = depths.find(|d| left.value(MIDDLE + (RADIUS - d) * way) < ISO);
            inner.expect("a cavity")
        };
        let all: Vec<f64> = (0..400).map(thickness).collect();
        let least = all.iter().copied().fold(f64::INFINITY, f64::min);
        let most = all.iter().copied().fold(0.0, f64::max);
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let spread = (all.iter().map(|t| (t - mean).powi(2)).sum::<f64>() / all.len() as f64).sqrt();
        println!("finer {finer}: {mean:.3} ± {spread:.3}, {least:.3} to {most:.3}");
        // The effect begins two knot intervals below the wall, and is whole after three more.
        assert!(least >= WALL && most < WALL + 3.0, "{text}: {least} to {most}");
        assert!(spread < uneven, "{text}: {spread}");
    }
}

/// Both sides of a plane keep their shells, and an even solid stays even.
#[test]
fn walls_hold_on_both_sides_of_a_plane() {
    let before = ball();
    for normal in ["[1, 0, 0]", "[1, 0.4, 0]"] {
        let text = format!(
            "wall = {WALL}\nsymmetry = {{ at = [12, 12, 12], normal = {normal} }}\n\
             carve = {{ shape = {{ sphere = {{ radius = 3 }} }}, along = [[16, 12, 12]] }}"
        );
        let left = done(&before, &text);
        let (count, least) = changed(&before, &left);
        assert!(count > 100 && least >= WALL, "{normal}: {count}, {least}");
        for p in [[16.0, 12.0, 12.0], [8.5, 10.0, 12.0]].map(DVec3::from_array) {
            assert!(left.value(p) < ISO, "{normal}: {p}");
        }
    }
}

#[test]
fn walls_that_leave_nothing_are_refused() {
    let carve = "carve = { shape = { sphere = { radius = 1 } }, along = [[12, 12, 12]] }";
    let told = refused(&ball(), &format!("wall = 9.5\n{carve}"));
    assert!(told.contains("make it thinner"), "{told}");
    let told = refused(&block(), &format!("wall = 6.1\n{carve}"));
    assert!(told.contains("deeper than 5"), "{told}");
}

use bspline::hierarchical::Lattice;
use bspline::{Field, HierarchicalSpline};

use super::*;
use crate::canvas::Canvas;

/// A ball in a box of `cells` cells of half a unit.
fn ball(cells: u32) -> HierarchicalSpline<f32> {
    let lattice = Lattice {
        world_from_lattice: glam::DAffine3::from_scale(DVec3::splat(0.5)),
        cells: [cells, cells, cells + 3],
    };
    let middle = 0.5 * lattice.world_box().size();
    HierarchicalSpline::schoenberg(lattice, 1.0, |p| 0.3 * middle.x - p.distance(middle)).unwrap()
}

fn everywhere() -> Aabb {
    Aabb::new(DVec3::splat(-1e9), DVec3::splat(1e9))
}

fn paint(text: &str) -> Paint {
    toml::from_str(text).unwrap()
}

fn laid(text: &str, field: &HierarchicalSpline<f32>, layers: &Layers) -> Result<Layers, PaintError> {
    let paint = paint(text);
    let mut layers = layers.clone();
    let layer = paint.apply(field, &layers, 0, &everywhere())?;
    layers.insert(paint.layer, layer);
    Ok(layers)
}

fn stiffness(layers: &Layers, at: [f64; 3]) -> f64 {
    values(layers, Substance::Stiffness, &[DVec3::from_array(at)]).unwrap()[0]
}

const STROKE: &str = "layer = 'stiffness'\nbrush = { value = 21, along = [[4, 4, 4]], radius = 2 }";

#[test]
fn paint_is_exact_at_centre_midpoint_and_rim() {
    let layers = laid(STROKE, &ball(16), &Layers::new()).unwrap();
    assert_eq!(stiffness(&layers, [4.0, 4.0, 4.0]), 21.0);
    assert_eq!(stiffness(&layers, [5.0, 4.0, 4.0]), 11.0);
    assert_eq!(stiffness(&layers, [4.0, 4.0, 2.0]), 1.0);
    // Between nodes it is linear.
    assert_eq!(stiffness(&layers, [4.0, 4.75, 4.0]), 13.5);
    assert_eq!(stiffness(&layers, [7.0, 7.0, 7.0]), 1.0);
    // Half the way, twice.
    let half = STROKE.replace("radius = 2", "radius = 2, rate = 0.5");
    let once = laid(&half, &ball(16), &Layers::new()).unwrap();
    assert_eq!(stiffness(&once, [4.0, 4.0, 4.0]), 11.0);
    let twice = laid(&half, &ball(16), &once).unwrap();
    assert_eq!(stiffness(&twice, [4.0, 4.0, 4.0]), 16.0);
    // A path is as wide all along, and full to where it fades.
    let path =
        "layer = 'friction'\nbrush = { value = 0.5, along = [[2, 4, 4], [6, 4, 4]], radius = 1, fade = 0.5 }";
    let layers = laid(path, &ball(16), &layers).unwrap();
    let friction = |p| values(&layers, Substance::Friction, &[p]).unwrap()[0];
    for x in [2.0, 3.0, 4.5, 6.0] {
        assert_eq!(friction(DVec3::new(x, 4.5, 4.0)), 0.5);
        assert_eq!(friction(DVec3::new(x, 5.0, 4.0)), 0.0);
    }
}

#[test]
fn paint_costs_what_it_covers_and_is_undone_by_its_difference() {
    let mut counts = Vec::new();
    for cells in [16, 120, 1000] {
        let lattice = Lattice {
            world_from_lattice: glam::DAffine3::from_scale(DVec3::splat(0.5)),
            cells: [cells; 3],
        };
        let empty = Layer::empty(&lattice, 0);
        assert!(
            empty.tree().totals_bytes() < 200_000,
            "{}",
            empty.tree().totals_bytes()
        );
        let reach = Aabb::new(DVec3::splat(2.0), DVec3::splat(6.0));
        let ball = |p: DVec3, old: f64| {
            let inside = 2.0 - p.distance(DVec3::splat(4.0));
            Ok::<_, PaintError>((inside > 0.0).then_some(old + inside))
        };
        let painted = empty.painted(&reach, ball).unwrap();
        counts.push(painted.tree().coefficient_count());
        let difference = empty.tree().difference(painted.tree()).unwrap();
        let back = painted.tree().applied(&difference.reversed()).unwrap();
        assert_eq!(back.sha256(), empty.tree().sha256());
        assert!(empty.with_tree(back).unwrap().is_empty());
    }
    assert!(counts.iter().all(|n| *n == counts[0] && *n > 100), "{counts:?}");
}

#[test]
fn many_places_are_read_as_one_by_one() {
    let mut layers = laid(STROKE, &ball(40), &Layers::new()).unwrap();
    for n in 0..12 {
        let at = [1.7 * f64::from(n), 20.0 - 1.3 * f64::from(n), 0.9 * f64::from(n)];
        let stroke =
            format!("layer = 'stiffness'\nbrush = {{ value = {n}.5, along = [{at:?}], radius = 3.3 }}");
        layers = laid(&stroke, &ball(40), &layers).unwrap();
    }
    let place = |n: u32| {
        DVec3::new(
            f64::from(n * 37 % 101),
            f64::from(n * 53 % 97),
            f64::from(n * 71 % 89),
        ) * 0.25
            - 1.0
    };
    let places: Vec<_> = (0..500).map(place).collect();
    let all = values(&layers, Substance::Stiffness, &places).unwrap();
    for (p, value) in places.iter().zip(&all) {
        assert_eq!(*value, stiffness(&layers, p.to_array()), "{p}");
        assert!((0.5..=21.0).contains(value));
    }
    assert!(all.iter().any(|v| *v > 5.0));
}

/// What a layer would round to nothing is refused, and the least that it takes is there.
#[test]
fn factors_of_matter_never_vanish() {
    let field = ball(16);
    for layer in ["mass", "stiffness"] {
        let painted = |value: &str| {
            laid(
                &format!("layer = '{layer}'\nformula = '{value}'"),
                &field,
                &Layers::new(),
            )
        };
        for value in ["0", "1e-9", "9e-7"] {
            let why = painted(value).unwrap_err().to_string();
            assert!(why.contains("it is 1e-6 or above"), "{why}");
        }
        let least = painted("1e-6").unwrap();
        let substance = *least.keys().next().unwrap();
        let there = values(&least, substance, &[DVec3::splat(4.3)]).unwrap()[0];
        assert!((there / 1e-6 - 1.0).abs() < 0.05, "{there}");
    }
}

#[test]
fn layers_are_filled_by_formula_by_calibration_and_from_stiffness() {
    let field = ball(16);
    let by_formula = laid(
        "layer = 'mass'\nformula = '1 + 9 * (x > 4)'",
        &field,
        &Layers::new(),
    )
    .unwrap();
    let mass = |x: f64| values(&by_formula, Substance::Mass, &[DVec3::new(x, 4.0, 4.0)]).unwrap()[0];
    assert_eq!([mass(4.0), mass(4.25), mass(4.5)], [1.0, 5.5, 10.0]);
    let curve = "layer = 'stiffness'\ncurve = [[-2, 1], [0, 3], [1, 13]]";
    let by_curve = laid(curve, &field, &Layers::new()).unwrap();
    for p in [[4.0, 4.0, 4.75], [4.0, 5.5, 5.0], [0.5, 0.5, 0.5]] {
        let d = field.value(DVec3::from_array(p));
        let expected = if d > 0.0 {
            3.0 + 10.0 * d.min(1.0)
        } else {
            3.0 + d.max(-2.0)
        };
        let node = p.iter().all(|c| (2.0 * c).fract() == 0.0);
        if node {
            assert!((stiffness(&by_curve, p) - expected).abs() < 1e-6, "{p:?}");
        }
    }
    let felt = laid(
        "layer = 'surface-stiffness'\nof-stiffness = 200",
        &field,
        &by_curve,
    )
    .unwrap();
    let p = DVec3::new(4.0, 4.0, 4.5);
    let newtons = values(&felt, Substance::SurfaceStiffness, &[p]).unwrap()[0];
    assert!((newtons - 200.0 * stiffness(&felt, p.to_array())).abs() < 1e-3);
    // Painting one layer leaves the others alone.
    let more = laid(STROKE, &field, &felt).unwrap();
    let same = |s| more[&s].tree().sha256() == felt[&s].tree().sha256();
    assert!(same(Substance::SurfaceStiffness) && !same(Substance::Stiffness));
}

#[test]
fn strokes_that_make_no_sense_say_why() {
    let field = ball(16);
    let why = |text: &str| laid(text, &field, &Layers::new()).unwrap_err().to_string();
    for (text, word) in [
        ("layer = 'mass'", "exactly one"),
        ("layer = 'mass'\nformula = '1'\nof-stiffness = 2", "exactly one"),
        (
            "layer = 'mass'\nbrush = { value = 0, along = [[4, 4, 4]], radius = 1 }",
            "1e-6 or above",
        ),
        (
            "layer = 'mass'\nbrush = { value = 1e9, along = [[4, 4, 4]], radius = 1 }",
            "at most",
        ),
        (
            "layer = 'mass'\nbrush = { value = 2, along = [], radius = 1 }",
            "at least one",
        ),
        (
            "layer = 'mass'\nbrush = { value = 2, along = [[4, 4, 4]], radius = 1, fade = 2 }",
            "at most 1",
        ),
        (
            "layer = 'mass'\nbrush = { value = 2, along = [[40, 4, 4]], radius = 1 }",
            "does not reach",
        ),
        ("layer = 'mass'\nformula = '1 / (x - x)'", "finite"),
        ("layer = 'mass'\nformula = '1 +'", "cannot be read"),
        ("layer = 'mass'\ncurve = []", "densities ascending"),
        ("layer = 'mass'\ncurve = [[1, 2], [0, 3]]", "densities ascending"),
        ("layer = 'stiffness'\nof-stiffness = 2", "from itself"),
        ("layer = 'friction'\nof-stiffness = -2", "0 or above"),
    ] {
        assert!(why(text).contains(word), "{text}: {}", why(text));
    }
    let unknown = toml::from_str::<Paint>("layer = 'gloss'\nformula = '1'")
        .unwrap_err()
        .to_string();
    assert!(unknown.contains("surface-stiffness"), "{unknown}");
    let large = HierarchicalSpline::<f32>::from_corrections(
        Lattice {
            world_from_lattice: glam::DAffine3::IDENTITY,
            cells: [500; 3],
        },
        1.0,
        Vec::new(),
    );
    let e = laid("layer = 'mass'\nformula = '2'", &large, &Layers::new()).unwrap_err();
    assert!(e.to_string().contains("smaller box"), "{e}");
}

#[test]
fn a_move_carries_what_is_painted() {
    let canvas = Canvas {
        layers: laid(
            &STROKE.replace("[4, 4, 4]", "[10, 10, 10]"),
            &ball(40),
            &Layers::new(),
        )
        .unwrap(),
        ..Canvas::alone(ball(40), 0.0, 0)
    };
    let text =
        "[move.motion.shift]\nregion = { min = [7, 7, 7], max = [13, 13, 13] }\nby = [2, 0, 0]\nblend = 6";
    let stroke: crate::session::Stroke = toml::from_str(text).unwrap();
    let before = canvas.layers.clone();
    let (moved, _) = stroke.apply(canvas, &mut fitting::Control::default()).unwrap();
    for p in [[12.0, 10.0, 10.0], [12.5, 10.0, 10.5], [11.0, 11.0, 9.0]] {
        let from = stiffness(&before, [p[0] - 2.0, p[1], p[2]]);
        assert!((stiffness(&moved.layers, p) - from).abs() < 1e-4, "{p:?}");
    }
    assert!(stiffness(&moved.layers, [12.0, 10.0, 10.0]) == 21.0);
}

//! Areas drawn out, and solids bent: whole surfaces brought to a goal.

use super::*;
use tools::session::Stroke;

fn tried(
    field: &HierarchicalSpline<f32>,
    text: &str,
) -> Result<(HierarchicalSpline<f32>, Vec<String>), String> {
    let stroke: Stroke = toml::from_str(text).unwrap_or_else(|e| panic!("{text}: {e}"));
    let done = stroke.apply(Canvas::alone(field.clone(), ISO, 0), &mut Control::default());
    done.map(|(left, notes)| (left.field, notes))
        .map_err(|e| e.to_string())
}

fn done(field: &HierarchicalSpline<f32>, text: &str) -> (HierarchicalSpline<f32>, Vec<String>) {
    tried(field, text).unwrap_or_else(|e| panic!("{text}: {e}"))
}

/// Whether a place lies within an outline.
fn is_in(outline: &[[f64; 2]], [x, y]: [f64; 2]) -> bool {
    let sides = (0..outline.len()).map(|i| [outline[i], outline[(i + 1) % outline.len()]]);
    let crossed = sides
        .filter(|[a, b]| (a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]));
    crossed.count() % 2 == 1
}

/// Area of the section over the surface at a share of the way, and what it does not share with the outline, over the area of that.
fn section(
    field: &HierarchicalSpline<f32>,
    outline: &[[f64; 2]],
    way: DVec3,
    share: f64,
    base: f64,
) -> [f64; 2] {
    let (mut area, mut off, mut own) = (0.0, 0.0, 0.0);
    for i in 0..160 {
        for j in 0..160 {
            let p = [i, j].map(|n| 5.0 + 14.0 * (f64::from(n) + 0.5) / 160.0);
            let inside = is_in(outline, p);
            let at = DVec3::new(p[0], p[1], base) + share * way;
            let solid = field.value(at) > ISO;
            let count = |is: bool| f64::from(u8::from(is));
            area += count(solid);
            own += count(inside);
            off += count(solid != inside);
        }
    }
    [area / own, off / own]
}

/// Outlines of several kinds on a block and a ball, drawn out by one to five widths, straight and slanted: area and shape of the section
/// are those of the outline to 5 % all along, and the end is where it was asked for.
#[test]
fn what_is_extruded_keeps_its_section() {
    let square = |a: f64| vec![[-a, -a], [a, -a], [a, a], [-a, a]];
    let round: Vec<[f64; 2]> = (0..24)
        .map(|i| {
            let (sine, cosine) = (std::f64::consts::TAU * f64::from(i) / 24.0).sin_cos();
            [3.5 * cosine, 2.7 * sine]
        })
        .collect();
    let hooked = vec![
        [-3.0, -3.0],
        [3.0, -3.0],
        [3.0, 0.2],
        [0.2, 0.2],
        [0.2, 3.0],
        [-3.0, 3.0],
    ];
    let low = field_of::<f32>(24, |p| 5.5 - p.z);
    let dome = field_of::<f32>(24, |p| 11.0 - p.distance(DVec3::new(12.0, 12.0, -2.0)));
    for (field, base, outline, by, radius) in [
        (&low, 5.5, square(1.25), [0.0, 0.0, 12.5], 0.6),
        (&low, 5.5, round, [1.5, 0.0, 6.0], 1.2),
        (&low, 5.5, hooked, [0.0, 0.0, 3.0], 0.75),
        (&dome, 9.0, square(2.6), [0.0, 0.0, 6.0], 1.0),
    ] {
        let outline: Vec<[f64; 2]> = outline.iter().map(|p| p.map(|c| c + 12.0)).collect();
        let area: Vec<[f64; 3]> = outline.iter().map(|[x, y]| [*x, *y, base]).collect();
        let text = format!("extrude = {{ area = {area:?}, by = {by:?}, radius = {radius} }}");
        let (left, notes) = done(field, &text);
        assert!(notes.is_empty(), "{text}: {notes:?}");
        let way = DVec3::from_array(by);
        // Beside the rounded edges at both ends.
        let rim = radius / way.length();
        let mut most = [0.0_f64; 2];
        for i in 0..=10 {
            let share = rim + (1.0 - 2.0 * rim) * f64::from(i) / 10.0;
            let [area, off] = section(&left, &outline, way, share, base);
            most = [most[0].max((area - 1.0).abs()), most[1].max(off)];
        }
        let end = DVec3::new(12.0, 12.0, base) + way;
        let (value, gradient) = left.value_gradient(if outline.len() == 6 {
            end - DVec3::new(1.4, 1.4, 0.0)
        } else {
            end
        });
        let short = (value - ISO) / gradient.length();
        println!(
            "area {:.4}, shape {:.4}, end {short:.4}: {text:.120}",
            most[0], most[1]
        );
        assert!(most[0] < 0.05 && most[1] < 0.08, "{text}: {most:?}");
        assert!(short.abs() < 0.1 * radius, "{text}: {short}");
    }
}

/// Matter as dense deep below its surface as next to it, as in scans: the forces that held the surface about a pillar dug a ring below it.
#[test]
fn what_is_extruded_from_a_scan_leaves_no_pocket_below_it() {
    const EDGE: f64 = 0.45;
    let (air, tissue, iso) = (-1000.0, 50.0, -300.0);
    let lattice = Lattice {
        world_from_lattice: DAffine3::IDENTITY,
        cells: [24; 3],
    };
    let density = |p: DVec3| air + 0.5 * (tissue - air) * (1.0 + libm::erf((12.0 - p.z) / EDGE));
    let field = HierarchicalSpline::<f32>::schoenberg(lattice, 500.0, density).unwrap();
    let square = "[[6, 6, 12], [18, 6, 12], [18, 18, 12], [6, 18, 12]]";
    let knots: Vec<DVec3> = (0..25 * 25 * 25)
        .map(|n| DVec3::new(f64::from(n / 625), f64::from(n / 25 % 25), f64::from(n % 25)))
        .collect();
    for mask in [
        "",
        "mask = { formula = \"x - 11.3 + 0.4*(y - 12) - 0.5*(z - 12)\" }\n",
    ] {
        let text = format!("{mask}extrude = {{ area = {square}, by = [0, 0, 5], radius = 2 }}");
        let stroke: Stroke = toml::from_str(&text).unwrap();
        let canvas = Canvas::alone(field.clone(), iso, 0);
        let (left, _) = stroke.apply(canvas, &mut Control::default()).unwrap();
        let (mut gone, mut come, mut least, mut most) = (0, 0, air, tissue);
        for p in &knots {
            let [was, is] = [&field, &left.field].map(|field| field.value(*p));
            gone += usize::from(was > iso && is < iso && p.z < 11.0);
            come += usize::from(is > iso && was < iso);
            (least, most) = (least.min(is), most.max(is));
        }
        assert!(come > 200 && gone == 0, "{mask}: {come} came, {gone} went");
        assert!(
            least > air - 400.0 && most < tissue + 900.0,
            "{mask}: {least} to {most}"
        );
    }
}

/// Against the bend of space of the same numbers, which is exact.
#[test]
fn bends_by_forces_end_where_those_of_space_do() {
    let rod = |p: DVec3| 2.5 - p.distance(DVec3::new(p.x.clamp(7.0, 17.0), 12.0, 9.0));
    let field = field_of::<f32>(48, rod);
    let radius = 0.9;
    for bend in [
        "at = [12, 12, 9], axis = [0, -1, 0], direction = [1, 0, 0], angle = 40, length = 4",
        "at = [11, 12, 9], axis = [0, 0.2, 1], direction = [-1, 0, 0], angle = -25, length = 5",
    ] {
        let (left, notes) = done(&field, &format!("bend = {{ {bend}, radius = {radius} }}"));
        assert!(notes.is_empty(), "{notes:?}");
        let (space, _) = done(
            &field,
            &format!("move = {{ motion = {{ bend = {{ {bend} }} }} }}"),
        );
        let options = PolygonizeOptions {
            iso: ISO,
            ..Default::default()
        };
        let frame = Frame::over(&field.lattice().world_box(), [48; 3]);
        let (mesh, _) = polygonize(&space, &frame, &options).unwrap();
        let off = mesh.positions.iter().map(|p| {
            let (value, gradient) = left.value_gradient(*p);
            (value - ISO).abs() / gradient.length() / radius
        });
        let mut off: Vec<f64> = off.collect();
        off.sort_by(f64::total_cmp);
        let [p95, most] = [off[off.len() * 95 / 100], off[off.len() - 1]];
        println!("p95 {p95:.4}, most {most:.4} radii: {bend}");
        assert!(p95 < 0.03 && most < 0.1, "{bend}: {p95}, {most}");
    }
}

/// Masks, a wall and boxes hold, any number of threads gives the same, and both sides of a plane are alike.
#[test]
fn whole_surfaces_keep_to_limits() {
    let field = block::<f32>(24);
    let extrude = "extrude = { area = [[9, 9, 12], [15, 9, 12], [15, 15, 12], [9, 15, 12]], by = [0, 0, 2], radius = 1.2 }";
    let bend = "bend = { at = [12, 12, 9], axis = [0, -1, 0], direction = [1, 0, 0], angle = 6, length = 6, radius = 1.2,
        region = { min = [2, 8, 9], max = [20, 16, 15] } }";
    for tool in [extrude, bend] {
        let (all, _) = done(&field, tool);
        let limit = "mask = { boxes = [{ min = [1, 1, 1], max = [13, 23, 23] }] }";
        let (kept, _) = done(&field, &format!("{limit}\n{tool}"));
        assert_ne!(kept.sha256(), field.sha256());
        for y in [8.0, 12.0, 15.5] {
            for z in [11.0, 12.0, 13.0, 14.0] {
                let p = DVec3::new(14.5, y, z);
                // No coefficient changes; finer bricks beside it round sums in another order.
                let off = (kept.value(p) - field.value(p)).abs();
                assert!(off < 1e-6 * ISO, "{tool}: {p}: {off}");
            }
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(8).build().unwrap();
        let (again, _) = pool.install(|| done(&field, tool));
        assert_eq!(again.sha256(), all.sha256(), "{tool}");
    }
    let beside = "extrude = { area = [[4, 9, 12], [9, 9, 12], [9, 15, 12], [4, 15, 12]], by = [0, 0, 1.5], radius = 1.2 }";
    let (both, _) = done(
        &field,
        &format!("symmetry = {{ at = [12, 12, 12], normal = [1, 0, 0] }}\n{beside}"),
    );
    for x in [4.3, 6.5, 8.8] {
        let [a, b] = [x, 24.0 - x].map(|x| height(&both, x, 12.0));
        assert!((a - b).abs() < 0.02 && (a > 1.3 || x != 6.5), "{x}: {a} {b}");
    }
}

#[test]
fn whole_surfaces_that_make_no_sense_are_refused() {
    let field = block::<f32>(24);
    let square = "area = [[9, 9, 12], [15, 9, 12], [15, 15, 12], [9, 15, 12]]";
    let hinge = "at = [12, 12, 9], axis = [0, -1, 0], direction = [1, 0, 0]";
    for (text, why) in [
        (format!("extrude = {{ {square}, by = [0, 0, 0], radius = 1 }}"), "no length"),
        (format!("extrude = {{ {square}, by = [0, 0, 2], radius = 2 }}"), "radii across"),
        (format!("extrude = {{ {square}, by = [0, 0, 1e300], radius = 1 }}"), "stay within"),
        (
            "extrude = { area = [[9, 9, 12], [15, 15, 12], [15, 9, 12], [9, 12, 12]], by = [0, 0, 2], radius = 1 }".into(),
            "crosses itself",
        ),
        (
            "extrude = { area = [[9, 9, 12], [15, 9, 12]], by = [0, 0, 2], radius = 1 }".into(),
            "encloses nothing",
        ),
        (
            format!("extrude = {{ {square}, by = [0, 0, 2], radius = 1, how = {{ solid = 'elastic' }} }}"),
            "spring back",
        ),
        (format!("bend = {{ {hinge}, angle = 0, length = 3, radius = 1 }}"), "not 0"),
        (
            "bend = { at = [12, 12, 9], axis = [1, 0, 0], direction = [1, 0, 0], angle = 9, length = 3, radius = 1 }".into(),
            "same way",
        ),
        (
            format!("bend = {{ {hinge}, angle = 9, length = 3, radius = 1, region = {{ min = [50, 50, 50], max = [60, 60, 60] }} }}"),
            "beside the field",
        ),
        (
            format!("bend = {{ {hinge}, angle = 9, length = 3, radius = 1, region = {{ min = [2, 2, 2], max = [9, 9, 5] }} }}"),
            "no surface",
        ),
    ] {
        let told = tried(&field, &text).map(|_| ()).unwrap_err();
        assert!(told.contains(why), "{text}: {told}");
    }
}

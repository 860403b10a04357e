//! Constraints: curves and points that strokes leave on the surface.

use super::*;
use tools::tool::ToolError;

fn canvas(field: &HierarchicalSpline<f32>) -> Canvas {
    Canvas::alone(field.clone(), ISO, 0)
}

fn played(field: &HierarchicalSpline<f32>, script: &str) -> Result<(Canvas, Vec<String>), ToolError> {
    let session: Session = toml::from_str(script).unwrap_or_else(|e| panic!("{script}: {e}"));
    let (mut left, mut notes) = (canvas(field), Vec::new());
    for stroke in &session.stroke {
        let (after, told) = stroke.apply(left, &mut Control::default())?;
        notes.extend(told);
        left = after;
    }
    Ok((left, notes))
}

/// How far the surface is from the places of all holds, at most.
fn off(canvas: &Canvas) -> f64 {
    let lines = canvas.holds.iter().flat_map(|held| &held.lines).flatten();
    let far = lines.map(|p| {
        let (value, gradient) = canvas.field.value_gradient(p.0);
        (value - ISO).abs() / gradient.length()
    });
    far.fold(0.0, f64::max)
}

#[test]
fn held_curves_stay_within_a_hundredth_of_the_drag() {
    let (block, ball) = (block::<f32>(24), ball::<f32>(24, 1.0));
    let circle = |x: f64, y: f64, r: f64| {
        format!(
            "along = {{ formulas = {{ x = '{x} + {r}*cos(t)', y = '{y} + {r}*sin(t)', z = '12', from = 0, to = 6.283185307179586 }} }}"
        )
    };
    let round =
        "along = { meet = { formulas = ['(x - 12.2)^2 + (y - 11.9)^2 - 12.96', 'z - 12'] } }".to_string();
    let drawn = "sketch = [[9, 9, 12.4], [15.3, 9.5, 11.8], [12, 15.5, 12.2], [9, 9, 12.4]]".to_string();
    let smooth =
        "sketch = { spline = { through = [[8, 14, 12], [11, 9.6, 12], [15, 10, 12], [16, 14, 12]] } }"
            .to_string();
    let point = "points = [[13.9, 12, 12], [12, 14.3, 12]]".to_string();
    let across = "sketch = { meet = { formulas = ['(x - 12)^2 + (y - 12)^2 - 9', 'z - 17'] } }".to_string();
    for (field, at, z, curve) in [
        (&block, [12.1, 11.8], 12.0, circle(12.1, 11.8, 2.4)),
        (&block, [11.5, 12.3], 12.0, circle(11.7, 12.2, 3.0)),
        (&block, [12.2, 11.9], 12.0, round),
        (&block, [12.1, 11.2], 12.0, drawn),
        (&block, [12.4, 12.2], 12.0, smooth),
        (&block, [12.0, 12.0], 12.0, point),
        (&ball, [12.0, 12.0], 18.0, across),
    ] {
        let [x, y] = at;
        for (spring, limit) in [("", 0.005), (", spring = 200", 0.01)] {
            let is_point = curve.starts_with("points");
            // Of points the stiffness is one per radius, not per length of a curve.
            let (spring, limit) = if is_point && !spring.is_empty() {
                (", spring = 1000", 0.02)
            } else {
                (spring, limit)
            };
            for (lift, r) in [(1.92_f64, R), (-1.2, R), (1.3, 1.6)] {
                let script = format!(
                    "[[stroke]]\nhold = {{ name = 'rim', {curve}{spring} }}\n\
                     [[stroke]]\npull = {{ along = [[{x}, {y}, {z}]], lift = {lift}, radius = {r} }}"
                );
                let (left, notes) = played(field, &script).unwrap_or_else(|e| panic!("{script}: {e}"));
                let off = off(&left) / lift.abs();
                println!("{off:.5} {notes:?} {curve}{spring} {lift} {r}");
                assert!(off < limit, "{script}: {off}");
                assert!(notes.is_empty(), "{script}: {notes:?}");
            }
        }
    }
    // What is freed holds nothing.
    let script = format!(
        "[[stroke]]\nhold = {{ name = 'rim', points = [[12, 12, 12]] }}\n[[stroke]]\nfree = {{}}\n\
         [[stroke]]\npull = {{ along = [[12, 12, 12]], lift = 1, radius = {R} }}"
    );
    let (left, _) = played(&block, &script).unwrap();
    assert!(left.holds.is_empty() && (height(&left.field, 12.0, 12.0) - 1.0).abs() < 0.01);
}

/// A curve does not shield what lies beyond it; a mask does.
#[test]
fn beyond_a_held_curve_a_mask_keeps_the_surface() {
    let field = block::<f32>(24);
    for (radius, lift) in [(2.4, 1.2_f64), (3.0, 1.92), (3.6, -1.92)] {
        let script = format!(
            "[[stroke]]\nhold = {{ name = 'rim', along = {{ formulas = {{ x = '12 + {radius}*cos(t)', y = '12 + {radius}*sin(t)', \
             z = '12', from = 0, to = 6.283185307179586 }} }} }}\n\
             [[stroke]]\nmask = {{ formula = '{radius} - sqrt((x - 12)^2 + (y - 12)^2)' }}\n\
             pull = {{ along = [[12, 12, 12]], lift = {lift}, radius = {R} }}"
        );
        let (left, notes) = played(&field, &script).unwrap();
        println!("{notes:?} {} of {lift}", height(&left.field, 12.0, 12.0));
        assert!(off(&left) <= 0.01 * lift.abs());
        assert!((height(&left.field, 12.0, 12.0) / lift - 1.0).abs() < 0.01);
        for i in 0..40 {
            let (sin, cos) = (0.157 * f64::from(i)).sin_cos();
            for beyond in [radius, radius + 0.4, radius + 1.5] {
                let found = height(&left.field, 12.0 + beyond * cos, 12.0 + beyond * sin);
                // But for the rounding of the finer level.
                assert!(found.abs() < 2e-6, "{found}");
            }
        }
        // Without the mask it moves there.
        let free = script.replace("mask =", "# mask =");
        let (left, _) = played(&field, &free).unwrap();
        let found = height(&left.field, 12.0 + radius + 0.6, 12.0) / lift;
        println!("beyond it {found}");
        assert!(found.abs() > 1e-3);
    }
}

#[test]
fn springs_draw_the_surface_to_where_it_is_not_yet() {
    let field = block::<f32>(24);
    let pull = format!("[[stroke]]\npull = {{ along = [[12, 12, 12]], lift = 1.2, radius = {R} }}");
    for (hold, limit) in [
        (
            "along = { formulas = { x = '12 + 2*cos(t)', y = '12 + 2*sin(t)', z = '12.5', from = 0, to = 6.283185307179586 } }, spring = 1000",
            0.01,
        ),
        ("points = [[13.5, 12, 12.5]], spring = 5000", 0.01),
    ] {
        let (left, _) = played(
            &field,
            &format!("[[stroke]]\nhold = {{ name = 'a', {hold} }}\n{pull}"),
        )
        .unwrap();
        let off = off(&left);
        println!("{off}");
        assert!(off < limit, "{hold}: {off}");
    }
    // Places within the solid, and without, as deep as asked on the flank of a pull, and about so at the next one, which tilts it.
    let next = format!("[[stroke]]\npull = {{ along = [[15.5, 12, 12]], lift = 0.6, radius = {R} }}");
    for depth in [0.5, -0.5] {
        let hold = format!(
            "[[stroke]]\nhold = {{ name = 'a', points = [[13.5, 12, 12]], depth = {depth}, spring = 5000 }}"
        );
        for (strokes, limit) in [(pull.clone(), 0.01), (format!("{pull}\n{next}"), 0.15)] {
            let (left, _) = played(&field, &format!("{hold}\n{strokes}")).unwrap();
            let found = height(&left.field, 13.5, 12.0);
            println!("{found} of {depth}");
            assert!((found / depth - 1.0).abs() < limit, "{found} of {depth}");
        }
    }
    // From farther it comes by half a radius a stroke, and without drops on the way.
    let far = "[[stroke]]\nhold = { name = 'a', points = [[13.5, 12, 12]], depth = 1.2, spring = 5000 }";
    let mut strokes = format!("{far}\n{pull}");
    for least in [0.4, 0.8, 1.1] {
        let (left, _) = played(&field, &strokes).unwrap();
        let found = height(&left.field, 13.5, 12.0);
        println!("{found} of 1.2");
        assert!(found > least && found < 1.3, "{found}");
        strokes = format!("{strokes}\n{next}");
    }
}

#[test]
fn holds_that_make_no_sense_are_refused() {
    let field = block::<f32>(24);
    for (strokes, word) in [
        (
            vec!["hold = { name = '', points = [[12, 12, 12]] }"],
            "needs a name",
        ),
        (vec!["hold = { name = 'a' }"], "exactly one"),
        (vec!["hold = { name = 'a', points = [] }"], "at least one"),
        (
            vec!["hold = { name = 'a', points = [[12, 12, 12]], sketch = [[12, 12, 12]] }"],
            "exactly one",
        ),
        (
            vec!["hold = { name = 'a', points = [[12, 12, 14]] }"],
            "give a spring",
        ),
        (
            vec!["hold = { name = 'a', points = [[12, 12, 44]] }"],
            "stay within",
        ),
        (
            vec!["hold = { name = 'a', sketch = [[12, 12, 22]] }"],
            "sketch closer",
        ),
        (
            vec!["hold = { name = 'a', points = [[12, 12, 12]], depth = 1 }"],
            "asks for a spring",
        ),
        (
            vec!["hold = { name = 'a', points = [[12, 12, 12]], spring = 1e30 }"],
            "write 1e6 at most",
        ),
        (vec!["free = {}"], "no hold"),
        (
            vec![
                "hold = { name = 'a', points = [[12, 12, 12]] }",
                "free = { name = 'b' }",
            ],
            "there are a",
        ),
        (
            vec![
                "hold = { name = 'a', points = [[12, 12, 12]] }",
                "hold = { name = 'a', points = [[12, 12, 12]] }",
            ],
            "already",
        ),
        (
            vec![
                "symmetry = { at = [12, 12, 12], normal = [1, 0, 0] }\nhold = { name = 'a', points = [[12, 12, 12]] }",
            ],
            "knows no symmetry",
        ),
    ] {
        let script: String = strokes.iter().map(|s| format!("[[stroke]]\n{s}\n")).collect();
        let told = played(&field, &script)
            .map(|_| ())
            .expect_err(&script)
            .to_string();
        assert!(told.contains(word), "{script}: {told}");
    }
}

/// The stiffest spring that is accepted can be solved for.
#[test]
fn the_stiffest_springs_are_borne() {
    let field = block::<f32>(24);
    let script = "[[stroke]]\nhold = { name = 'a', points = [[17, 12, 12]], spring = 1e6 }\n\
                  [[stroke]]\npull = { along = [[12, 12, 12]], lift = 1.5, radius = 1.2 }";
    let (left, _) = played(&field, script).unwrap();
    let risen = height(&left.field, 12.0, 12.0);
    assert!((risen - 1.5).abs() < 0.03, "{risen}");
    let held = height(&left.field, 17.0, 12.0);
    assert!(held.abs() < 0.02, "{held}");
}

/// Paths that nothing gives way to: they stay, and it is said.
#[test]
fn where_a_mask_holds_the_tool_nothing_moves() {
    let field = block::<f32>(24);
    let script = "[[stroke]]\nmask = { boxes = [{ min = [7, 7, 7], max = [17, 10, 17] }] }\n\
                  pull = { along = [[12, 14, 12]], lift = 1, radius = 1.2 }";
    let (left, notes) = played(&field, script).unwrap();
    assert_eq!(left.field.sha256(), field.sha256());
    assert!(notes.iter().any(|n| n.contains("0.0 %")), "{notes:?}");
}

/// A pull on both sides keeps a hold on the one side that has it.
#[test]
fn holds_keep_on_their_side_of_a_plane() {
    let field = block::<f32>(24);
    let pull = "symmetry = { at = [12, 12, 12], normal = [1, 0, 0] }\npull = { along = [[7, 12, 12]], lift = 1, radius = 1.5 }";
    let hold = "hold = { name = 'a', points = [[18, 12, 12]] }";
    let (left, _) = played(&field, &format!("[[stroke]]\n{hold}\n[[stroke]]\n{pull}\n")).unwrap();
    let rise = |x: f64| height(&left.field, x, 12.0);
    assert!(off(&left) < 0.02, "{}", off(&left));
    assert!((rise(7.0) - 1.0).abs() < 0.02, "{}", rise(7.0));
    // The mirrored tool pulls up beside the place that is held.
    assert!(
        (rise(17.0) - 1.0).abs() < 0.05 && rise(18.0).abs() < 0.02,
        "{} {}",
        rise(17.0),
        rise(18.0)
    );
}

/// An elastic object springs back from every force tool but those that say otherwise.
#[test]
fn strokes_ask_the_object_what_stays() {
    let field = block::<f32>(24);
    let pull =
        |how: &str| format!("[[stroke]]\npull = {{ along = [[12, 12, 12]], lift = 1, radius = 2{how} }}\n");
    let elastic = "[[stroke]]\nmaterial = { solid = 'elastic' }\n";
    let left = |script: &str| played(&field, script).unwrap().0.field;
    let rise = |script: &str| height(&left(script), 12.0, 12.0);
    assert!((rise(&pull("")) - 1.0).abs() < 0.02);
    assert_eq!(left(&format!("{elastic}{}", pull(""))).sha256(), field.sha256());
    let kept = pull(", how = { solid = 'clay' }");
    assert!((rise(&format!("{elastic}{kept}")) - 1.0).abs() < 0.02);
    let again = "[[stroke]]\nmaterial = { solid = 'clay' }\n";
    assert!((rise(&format!("{elastic}{again}{}", pull(""))) - 1.0).abs() < 0.02);
}

/// What cannot be done on the other side of a plane is told where that side is.
#[test]
fn the_other_side_is_refused_where_it_is() {
    let field = block::<f32>(24);
    let pull = "[[stroke]]\nsymmetry = { at = [14, 12, 12], normal = [1, 0, 0] }\npull = { along = [[3, 12, 12]], lift = 1, radius = 1.5 }\n";
    let told = played(&field, pull).map(|_| ()).unwrap_err().to_string();
    assert!(told.contains("goes to [25.0"), "{told}");
}

use bspline::Aabb;
use glam::DVec3;

use super::*;

fn tool(kind: Kind) -> Tool {
    Tool {
        kind,
        radius: 1.5,
        strength: 0.5,
        inverted: false,
        settings: Settings::default(),
    }
}

fn drawn() -> Drawn {
    let start = Start {
        beyond: Some(-DVec3::Z),
        ..Start::at(DVec3::Z)
    };
    let mut drawn = Drawn::new(start, Aabb::new(DVec3::splat(-9.0), DVec3::splat(9.0)));
    for p in [
        DVec3::new(3.0, 0.0, 1.0),
        DVec3::new(3.0, 3.0, 1.0),
        DVec3::new(0.0, 3.0, 1.5),
    ] {
        drawn.go_on(Some(p), p, 0.5);
    }
    drawn.part = Some(("other".into(), tool(Kind::Copy).region(DVec3::ONE)));
    drawn
}

/// Whatever is set, a tool of the palette is a stroke of a script.
#[test]
fn every_tool_makes_a_stroke() {
    let odd = Settings {
        falloff: 0.4,
        blend: 0.2,
        filter: Filter::Conical,
        gives_way: true,
        elastic: Some(true),
        keeps_volume: true,
        solid: Solid::Ring,
        spring: Some(200.0),
        ..Settings::default()
    };
    for kind in Kind::ALL {
        for inverted in [false, true] {
            for (strength, settings) in [(0.0, Settings::default()), (0.5, odd), (1.0, odd)] {
                let tool = Tool {
                    inverted,
                    strength,
                    settings,
                    ..tool(*kind)
                };
                let stroke = match (tool.acts_at_once(), *kind) {
                    (_, Kind::Copy | Kind::Lasso) => continue,
                    (true, _) => tool.made(&drawn()).unwrap(),
                    (false, _) => tool.stroke(&drawn().start),
                };
                assert!(stroke.tool().is_ok(), "{tool:?}: {:?}", stroke.tool().err());
            }
        }
    }
}

#[test]
fn what_is_missing_of_a_drawing_is_told() {
    let drawn = Drawn::new(Start::at(DVec3::ZERO), drawn().whole);
    for (kind, word) in [
        (Kind::Extrude, "round an area"),
        (Kind::Plateau, "round an area"),
        (Kind::Bend, "arrow"),
        (Kind::Trim, "arrow"),
        (Kind::Paste, "copy"),
    ] {
        let why = tool(kind).made(&drawn).unwrap_err();
        assert!(why.contains(word), "{kind:?}: {why}");
    }
}

#[test]
fn a_turn_of_a_script_is_its_axis_as_long_as_its_angle() {
    let turn = glam::DQuat::from_axis_angle(DVec3::Y, 2.0);
    let told = DVec3::from_array(turned(turn));
    assert!(told.abs_diff_eq(2.0_f64.to_degrees() * DVec3::Y, 1e-9), "{told}");
    let back = DVec3::from_array(turned(-turn));
    assert!(back.abs_diff_eq(told, 1e-9), "{back}");
    assert_eq!(turned(glam::DQuat::IDENTITY), [0.0; 3]);
}

#[test]
fn all_groups_have_tools_and_all_tools_a_name_of_their_own() {
    for group in Group::ALL {
        assert!(Kind::ALL.iter().any(|kind| kind.group() == group), "{group:?}");
    }
    for (n, one) in Kind::ALL.iter().enumerate() {
        assert!(
            Kind::ALL[..n].iter().all(|other| other.name() != one.name()),
            "{one:?}"
        );
    }
}

//! What a hand is to do.

use glam::{DQuat, DVec3};
use serde::Deserialize;
use tools::haptics::Workspace;
use tools::haptics::simulated::{Path, SimulatedHand};
use tools::session::Stroke;

/// Most targets: a day of ten a second.
const MOST: usize = 1_000_000;
/// Longest time, s.
const LONGEST: f64 = 86_400.0;

/// How a simulated hand holds a device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Grip {
    /// With the fingers.
    #[default]
    Light,
    /// With the fist.
    Firm,
}

/// Where the hand wants to be at a time.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Target {
    /// s; it is at rest there then.
    time: f64,
    /// Place in the document's world.
    at: [f64; 3],
    /// How it is turned by then: the axis of the turn, as long as its angle in degrees. As before if missing.
    turn: Option<[f64; 3]>,
    /// Buttons that are down from then on, the first counts 1, the second 2, the third 4. As before if missing.
    buttons: Option<u32>,
}

/// What a script says.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Script {
    /// How the device is held.
    #[serde(default)]
    hand: Grip,
    /// What the first button begins and ends; without it the hand only touches.
    pub stroke: Option<Stroke>,
    /// Whether the hand begins anew at the end.
    #[serde(default)]
    repeat: bool,
    #[serde(default)]
    target: Vec<Target>,
}

impl Script {
    /// What a text says: TOML, or where its first sign is a brace an object of JSON a line: those with a `time` are targets, others say the rest.
    ///
    /// # Errors
    /// A sentence.
    pub fn parse(text: &str) -> Result<Self, String> {
        let script = match text.trim_start().starts_with('{') {
            true => Self::of_lines(text)?,
            false => toml::from_str(text).map_err(|e| e.to_string().trim_end().replace('\n', " "))?,
        };
        script.checked()
    }

    fn of_lines(text: &str) -> Result<Self, String> {
        let mut script = Self::default();
        for (n, line) in text
            .lines()
            .enumerate()
            .filter(|(_, line)| !line.trim().is_empty())
        {
            let wrong = |e: serde_json::Error| format!("line {}: {e}", n + 1);
            let value: serde_json::Value = serde_json::from_str(line).map_err(wrong)?;
            if value.get("time").is_some() {
                script.target.push(serde_json::from_value(value).map_err(wrong)?);
            } else {
                let target = script.target;
                script = serde_json::from_value(value).map_err(wrong)?;
                script.target.splice(0..0, target);
            }
        }
        Ok(script)
    }

    fn checked(self) -> Result<Self, String> {
        let numbers = |t: &Target| {
            let turn = t.turn.unwrap_or_default();
            t.at.iter().chain(&turn).all(|x| x.is_finite())
        };
        for (n, target) in self.target.iter().enumerate() {
            let about = |why: String| format!("target {}: {why}", n + 1);
            if !(0.0..=LONGEST).contains(&target.time) {
                let why = format!("its time is {} s; write 0 to {LONGEST}", target.time);
                return Err(about(why));
            }
            if n > 0 && target.time <= self.target[n - 1].time {
                let why = format!(
                    "its time, {} s, is not after that of the one before; write them in their order",
                    target.time
                );
                return Err(about(why));
            }
            if !numbers(target) {
                return Err(about("a number is not finite; write finite ones".into()));
            }
        }
        match self.target.len() {
            n if n > MOST => Err(format!("there are {n} targets; write at most {MOST}")),
            _ => Ok(self),
        }
    }

    /// Whether it says where the hand is to go.
    pub fn has_targets(&self) -> bool {
        !self.target.is_empty()
    }

    /// When the last target is reached, s.
    pub fn end(&self) -> f64 {
        self.target.last().map_or(0.0, |t| t.time)
    }

    /// The hand that does it for so many seconds, in the room of a device.
    pub fn hand(&self, workspace: &Workspace, seconds: f64) -> SimulatedHand {
        let mut targets = self.target.clone();
        let end = self.end();
        let mut start = end;
        while self.repeat && end > 0.0 && start < seconds && targets.len() < MOST {
            let again = self.target.iter().filter(|t| t.time > 0.0);
            targets.extend(again.map(|t| Target {
                time: start + t.time,
                ..*t
            }));
            start += end;
        }
        let back = workspace.turn.inverse();
        let places = targets.iter().map(|t| {
            let at = DVec3::from_array(t.at) - workspace.shift;
            (t.time, back * at / workspace.scale)
        });
        let path = Path::smooth(places);
        let turns = targets.iter().filter_map(|t| {
            let turn = DVec3::from_array(t.turn?) * std::f64::consts::PI / 180.0;
            Some((t.time, back * DQuat::from_scaled_axis(turn)))
        });
        let buttons = targets.iter().filter_map(|t| Some((t.time, t.buttons?)));
        let hand = match self.hand {
            Grip::Light => SimulatedHand::light(path),
            Grip::Firm => SimulatedHand::firm(path),
        };
        hand.turning(turns).pressing(buttons)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_say_the_same() {
        let toml = r#"
            hand = "firm"
            repeat = true
            [stroke.carve]
            along = []
            shape.sphere.radius = 1
            [[target]]
            time = 0
            at = [1, 2, 3]
            [[target]]
            time = 2
            at = [1, 2, 0]
            turn = [0, 0, 90]
            buttons = 1
        "#;
        let lines = r#"{"hand": "firm", "repeat": true, "stroke": {"carve": {"along": [], "shape": {"sphere": {"radius": 1}}}}}
            {"time": 0, "at": [1, 2, 3]}

            {"time": 2, "at": [1, 2, 0], "turn": [0, 0, 90], "buttons": 1}"#;
        let script = Script::parse(toml).unwrap();
        assert_eq!(script, Script::parse(lines.trim()).unwrap());
        let workspace = Workspace {
            scale: 2.0,
            shift: DVec3::new(1.0, 2.0, 0.0),
            ..Workspace::default()
        };
        let hand = script.hand(&workspace, 5.0);
        assert_eq!(hand.path.at(0.0).0, DVec3::new(0.0, 0.0, 1.5));
        assert_eq!(hand.path.at(2.0).0, DVec3::ZERO);
        // Again and again, each time as long.
        assert_eq!(hand.path.at(4.0).0, DVec3::ZERO);
        assert_eq!(
            [hand.buttons(1.9), hand.buttons(2.1), hand.buttons(3.0)],
            [0, 1, 1]
        );
    }

    #[test]
    fn what_is_no_script_is_refused_with_its_place() {
        let refused = |text: &str| Script::parse(text).unwrap_err();
        // Enough of a device that somebody holds.
        assert!(!Script::parse("").unwrap().has_targets());
        assert!(refused("[[target]]\ntime = -1\nat = [0, 0, 0]").contains("target 1"));
        let order = "[[target]]\ntime = 1\nat = [0, 0, 0]\n[[target]]\ntime = 1\nat = [0, 0, 0]";
        assert!(refused(order).contains("target 2"));
        assert!(refused("[[target]]\ntime = 1\nat = [0, nan, 0]").contains("finite"));
        assert!(refused("hand = \"left\"").contains("light"));
        assert!(refused("{\"time\": 1}").contains("line 1"));
    }
}

//! A trajectory as a device: poses over time, so that a session without a hand is the same every time.
//!
//! A text file with a line for each pose: seconds, x, y, z in mm, then the buttons as a number (0 if left out), then the turn as
//! qx, qy, qz, qw (none if left out). Between two poses the hand goes straight and turns evenly; buttons change at the poses. Empty
//! lines and what follows a `#` do not count.

use glam::{DQuat, DVec3};
use tools::haptics::{Abilities, Device, DeviceError, Pose, Reading};

use super::clock::Clock;
use super::forceless;

/// Most poses: an hour at a thousand a second.
const MOST: usize = 3_600_000;

/// Longest reach, mm: what is further is a slip of units.
const FURTHEST: f64 = 1e4;

/// Longest trajectory, s.
const LONGEST: f64 = 86_400.0;

/// A pose and when it is reached.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Key {
    at: f64,
    pose: Pose,
    buttons: u32,
}

/// Poses over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    keys: Vec<Key>,
}

/// Why a text is no trajectory.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ScriptError {
    /// A line that is no pose.
    #[error(
        "line {line}: {what}; write seconds, x, y, z, and after them the buttons and qx, qy, qz, qw if need be"
    )]
    Line {
        /// Number, from 1.
        line: usize,
        /// What it says.
        what: String,
    },
    /// Times that go back.
    #[error("line {line}: its time is not after that of the line before; write the poses in their order")]
    Order {
        /// Number, from 1.
        line: usize,
    },
    /// No pose at all.
    #[error("it has no pose; write a line with seconds, x, y, z for each")]
    Empty,
    /// More poses than anybody needs.
    #[error("it has more than {MOST} poses; leave some out")]
    TooMany,
}

impl Trajectory {
    /// Reads a text.
    ///
    /// # Errors
    /// [`ScriptError`].
    pub fn parse(text: &str) -> Result<Self, ScriptError> {
        let mut keys: Vec<Key> = Vec::new();
        for (i, line) in text.lines().enumerate() {
            let (line_number, content) = (i + 1, line.split('#').next().unwrap_or_default());
            if content.trim().is_empty() {
                continue;
            }
            let key = key(content).map_err(|what| ScriptError::Line {
                line: line_number,
                what,
            })?;
            if keys.last().is_some_and(|last| key.at <= last.at) {
                return Err(ScriptError::Order { line: line_number });
            }
            if keys.len() == MOST {
                return Err(ScriptError::TooMany);
            }
            keys.push(key);
        }
        match keys.is_empty() {
            true => Err(ScriptError::Empty),
            false => Ok(Self { keys }),
        }
    }

    /// Pose and buttons so many seconds after the first pose; before it the first, after the last one the last.
    pub fn at(&self, seconds: f64) -> (Pose, u32) {
        let time = seconds + self.keys[0].at;
        let next = self.keys.partition_point(|key| key.at <= time);
        let Some(from) = next.checked_sub(1).map(|i| self.keys[i]) else {
            return (self.keys[0].pose, self.keys[0].buttons);
        };
        let Some(to) = self.keys.get(next) else {
            return (from.pose, from.buttons);
        };
        let share = (time - from.at) / (to.at - from.at);
        let pose = Pose {
            // Not `lerp`, by which a hand at rest would tremble in its last digit.
            at: from.pose.at + share * (to.pose.at - from.pose.at),
            turn: between(from.pose.turn, to.pose.turn, share),
        };
        (pose, from.buttons)
    }
}

/// The pose of a line, or what is wrong with it.
fn key(content: &str) -> Result<Key, String> {
    let words: Vec<&str> = content
        .split(|c: char| c.is_whitespace() || c == ',')
        .filter(|w| !w.is_empty())
        .collect();
    if !matches!(words.len(), 4 | 5 | 9) {
        return Err(format!("it has {} numbers and not 4, 5 or 9", words.len()));
    }
    let number = |i: usize| -> Result<f64, String> {
        let finite = words[i].parse::<f64>().ok().filter(|v| v.is_finite());
        finite.ok_or_else(|| format!("{:?} is no number", words[i]))
    };
    let (at, place) = (number(0)?, DVec3::new(number(1)?, number(2)?, number(3)?));
    if !(0.0..=LONGEST).contains(&at) {
        return Err(format!("{at} s is not within 0 to {LONGEST} s"));
    }
    if place.abs().max_element() > FURTHEST {
        return Err(format!(
            "({}, {}, {}) mm is further than {FURTHEST} mm away",
            place.x, place.y, place.z
        ));
    }
    let buttons = match words.get(4) {
        Some(word) => word
            .parse()
            .map_err(|_| format!("{word:?} is no number of buttons"))?,
        None => 0,
    };
    let turn = match words.len() {
        9 => DQuat::from_xyzw(number(5)?, number(6)?, number(7)?, number(8)?),
        _ => DQuat::IDENTITY,
    };
    // Written with three digits, it is of length 1 to a few thousandths.
    if (turn.length() - 1.0).abs() > 0.01 {
        return Err(format!(
            "its turn has the length {}, which should be 1",
            turn.length()
        ));
    }
    Ok(Key {
        at,
        pose: Pose {
            at: place,
            turn: turn.normalize(),
        },
        buttons,
    })
}

/// Turns evenly on the shorter way \[Shoemake85\], with the same bits on every machine.
fn between(from: DQuat, to: DQuat, share: f64) -> DQuat {
    let dot = from.dot(to);
    let to = if dot < 0.0 { -to } else { to };
    let angle = libm::acos(dot.abs().min(1.0));
    if angle < 1e-6 {
        return (from * (1.0 - share) + to * share).normalize();
    }
    let weight = |share: f64| libm::sin(share * angle) / libm::sin(angle);
    (from * weight(1.0 - share) + to * weight(share)).normalize()
}

/// A device whose hand follows a trajectory, whatever pushes it.
pub struct Scripted {
    trajectory: Trajectory,
    abilities: Abilities,
    clock: Clock,
    /// When it began: at the first look.
    start: Option<f64>,
}

impl Scripted {
    /// A hand that begins when it is first looked at.
    pub fn new(trajectory: Trajectory, clock: Clock) -> Self {
        let furthest = trajectory.keys.iter().map(|key| key.pose.at.abs().max_element());
        let abilities = forceless::abilities("script", 0.0, 0.001, furthest.fold(1.0, f64::max));
        Self {
            trajectory,
            abilities,
            clock,
            start: None,
        }
    }
}

impl Device for Scripted {
    fn abilities(&self) -> &Abilities {
        &self.abilities
    }

    fn read(&mut self) -> Result<Reading, DeviceError> {
        let now = self.clock.now();
        let start = *self.start.get_or_insert(now);
        let (pose, buttons) = self.trajectory.at(now - start);
        Ok(Reading {
            pose,
            buttons,
            age: 0.0,
        })
    }

    fn send(&mut self, _force: DVec3, _torque: DVec3) -> Result<(), DeviceError> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_hand_goes_straight_and_buttons_change_at_poses() {
        let text = "# a stroke\n0.5 0 0 10\n\n1.5, 4, 0, 10, 1  # down\n2.5 4 2 10 0 0 0 0.7071 0.7071\n";
        let clock = Clock::standing();
        let mut hand = Scripted::new(Trajectory::parse(text).unwrap(), clock.clone());
        clock.set(7.0);
        let mut at = |seconds: f64| {
            clock.set(7.0 + seconds);
            let reading = hand.read().unwrap();
            (reading.pose.at.to_array(), reading.buttons)
        };
        assert_eq!(at(0.0), ([0.0, 0.0, 10.0], 0));
        assert_eq!(at(0.25), ([1.0, 0.0, 10.0], 0));
        assert_eq!(at(1.0), ([4.0, 0.0, 10.0], 1));
        assert_eq!(at(1.5), ([4.0, 1.0, 10.0], 1));
        assert_eq!(at(9.0), ([4.0, 2.0, 10.0], 0));
        clock.set(8.5);
        let turn = hand.read().unwrap().pose.turn.to_scaled_axis();
        let half = DVec3::Z * std::f64::consts::FRAC_PI_4;
        assert!(turn.distance(half) < 1e-4, "half of a quarter turn: {turn}");
        assert_eq!(hand.abilities().reach, 10.0);
    }

    #[test]
    fn wrong_lines_are_named_with_what_would_be_right() {
        for (text, said) in [
            ("", "no pose"),
            ("# nothing\n", "no pose"),
            ("0 1 2\n", "line 1: it has 3 numbers and not 4, 5 or 9"),
            ("0 1 2 3\n1 1 x 3\n", "line 2: \"x\" is no number"),
            ("0 1 2 nan\n", "no number"),
            ("1 0 0 0\n1 0 0 0\n", "line 2: its time is not after"),
            ("-1 0 0 0\n", "not within 0 to 86400 s"),
            ("0 1e9 0 0\n", "further than 10000 mm"),
            ("0 0 0 0 -1\n", "no number of buttons"),
            ("0 0 0 0 0 1 1 0 0\n", "which should be 1"),
        ] {
            let why = Trajectory::parse(text).unwrap_err().to_string();
            assert!(why.contains(said), "{text:?}: {why}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_a_trajectory_or_says_why_not(text in "[-0-9e., #\na]{0,60}", seconds in -1.0..10.0) {
            if let Ok(trajectory) = Trajectory::parse(&text) {
                prop_assert!(trajectory.at(seconds).0.is_finite());
            }
        }
    }
}

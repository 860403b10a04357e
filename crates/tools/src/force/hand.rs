//! Tools in a hand: where they go is known step by step.
//!
//! A tool that *walks* is at a place in each step; its paths begin on its way, half a radius apart, each on the surface as it
//! was when the stroke began, so that nothing goes deeper by standing still. It works in the stages of a track: a tool that goes
//! faster than clay follows leaves its way to be done. A tool that *drags* takes hold once; its paths end where the hand is.

use glam::DVec3;

use super::ForceError;
use super::path::Path;
use super::target::Target;
use super::track::Place;

pub type Make = Box<dyn Fn(&Place) -> Result<Target, ForceError> + Send + Sync>;

/// What leads a stroke.
pub struct Hand {
    pub way: Way,
    pub is_let_go: bool,
    /// Places that no path could be made for, and why at the first.
    pub missed: Option<(usize, ForceError)>,
}

pub enum Way {
    Walk {
        make: Make,
        /// Density of the surface that paths begin on.
        iso: f64,
        /// Where the tool is.
        at: DVec3,
        /// Way since the last path.
        since: f64,
        /// Way since the first.
        along: f64,
        /// Direction of the way at the last path.
        heading: Option<DVec3>,
        /// Whether the last place was without a path.
        is_open: bool,
    },
    Drag {
        from: Vec<Place>,
        /// From the place of the surface to the hand, and as far as the paths reach.
        to: DVec3,
        reached: DVec3,
        direction: DVec3,
    },
}

impl Hand {
    pub fn new(way: Way) -> Self {
        Self {
            way,
            is_let_go: false,
            missed: None,
        }
    }

    /// Whether it may still go elsewhere.
    pub fn leads(&self) -> bool {
        let is_behind = matches!(&self.way, Way::Drag { to, reached, .. } if to != reached);
        !self.is_let_go || is_behind
    }

    /// Of a hand that drags, whether the paths end where it is.
    pub fn drags(&self) -> Option<bool> {
        match &self.way {
            Way::Drag { to, reached, .. } => Some(to == reached),
            Way::Walk { .. } => None,
        }
    }
}

/// The paths of a tool that drags all places by a vector.
pub fn dragged(from: &[Place], way: DVec3) -> Result<Vec<Target>, ForceError> {
    let target = |place: &Place| {
        Ok(Target {
            weight: place.weight,
            ..Target::single(
                Path::through([place.at, place.at + way])?,
                way.dot(place.normal) > 0.0,
            )
        })
    };
    from.iter().map(target).collect()
}

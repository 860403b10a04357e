/// What the paths of a tool are together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// A point or a curve: all paths act at once.
    Curve,
    /// An area, which takes more solves a step.
    Area,
    /// The whole surface of a goal, towards which it goes in stages.
    Whole,
    /// A track that the tool walks along, in order: those of six radii act at a time, with those near them from before.
    Track,
}

impl Extent {
    /// Most solves of a step beside the first.
    pub(super) fn solves(self) -> usize {
        match self {
            Self::Curve | Self::Track => 8,
            Self::Area | Self::Whole => 12,
        }
    }

    /// Share of its length that a path may be off after some steps with goals that stand still.
    pub(super) fn arrived_late(self) -> f64 {
        match self {
            Self::Area => 0.015,
            Self::Curve | Self::Whole | Self::Track => 0.01,
        }
    }

    /// Share of a force at hand for which paths of clay stay soft once their goals stand. With all of it they creep home as
    /// slowly as rest lengths take the force over. Areas without any ripple where their paths are many; tracks without it end
    /// farther off on thin parts.
    pub(super) fn kept_soft(self) -> f64 {
        match self {
            Self::Curve => 0.0,
            Self::Area => 0.3,
            Self::Whole | Self::Track => 1.0,
        }
    }
}

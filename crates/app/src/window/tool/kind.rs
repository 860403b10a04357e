//! The tools of the palette: their names, and how a mouse uses them.

use egui::Key;

/// What a part of the palette is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Group {
    /// Brushes of clay.
    Clay,
    /// Whole solids, and planes.
    Solids,
    /// Pulls and pushes of elastic matter.
    Force,
    /// Motions of space.
    Warp,
    /// What the object is made of, and how it feels.
    Paint,
    /// Boxes that are taken out and put in.
    Parts,
    /// How fine the field is.
    Detail,
    /// What force tools have to leave where it is.
    Hold,
}

impl Group {
    /// All, in the order of the palette.
    pub const ALL: [Self; 8] = [
        Self::Clay,
        Self::Solids,
        Self::Force,
        Self::Warp,
        Self::Paint,
        Self::Parts,
        Self::Detail,
        Self::Hold,
    ];

    /// Over its tools.
    pub fn name(self) -> &'static str {
        match self {
            Self::Clay => "Clay",
            Self::Solids => "Solids",
            Self::Force => "Force",
            Self::Warp => "Warp",
            Self::Paint => "Paint",
            Self::Parts => "Parts",
            Self::Detail => "Detail",
            Self::Hold => "Hold",
        }
    }
}

/// How a mouse uses a tool.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Use {
    /// It follows the surface, step by step.
    Brush,
    /// It takes hold where it begins, and goes with the mouse from there.
    Grip,
    /// A way over the surface is drawn; when the button comes up the tool acts on all of it.
    Line,
    /// An outline on the surface is drawn; when the button comes up the tool acts on what is within.
    Outline,
    /// From a place of the surface to another one; when the button comes up the tool acts.
    Arrow,
    /// What it would leave is shown under the mouse; a click does it.
    Click,
}

macro_rules! kinds {
    ($($(#[$doc:meta])* $kind:ident: $group:ident, $use:ident, $key:expr, $name:literal, $hint:literal;)*) => {
        /// The tools of the palette.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub enum Kind {
            $($(#[$doc])* $kind,)*
        }

        impl Kind {
            /// All, in the order of the palette.
            pub const ALL: &[Self] = &[$(Self::$kind),*];

            /// On its button.
            pub fn name(self) -> &'static str {
                match self { $(Self::$kind => $name,)* }
            }

            /// Under the pointer: what it does, and what Ctrl makes of it.
            pub fn hint(self) -> &'static str {
                match self { $(Self::$kind => $hint,)* }
            }

            /// Where it stands in the palette.
            pub fn group(self) -> Group {
                match self { $(Self::$kind => Group::$group,)* }
            }

            /// How a mouse uses it.
            pub fn by(self) -> Use {
                match self { $(Self::$kind => Use::$use,)* }
            }

            /// Key that chooses it, if nobody says another.
            pub fn key(self) -> Option<Key> {
                match self { $(Self::$kind => $key,)* }
            }
        }
    };
}

kinds! {
    /// Takes clay away.
    Carve: Clay, Brush, Some(Key::C), "Carve", "Takes clay away along the way of the mouse. Ctrl: lays clay on";
    /// Lays clay on.
    Add: Clay, Brush, Some(Key::A), "Add", "Lays clay on along the way of the mouse. Ctrl: takes clay away";
    /// Evens out.
    Smooth: Clay, Brush, Some(Key::S), "Smooth", "Evens out bumps and noise";
    /// Lifts the surface, or lowers it.
    Inflate: Clay, Brush, Some(Key::I), "Inflate", "Lifts the surface. Ctrl: lowers it";
    /// Pushes in along the normal.
    Push: Clay, Brush, Some(Key::P), "Push", "Pushes the surface in, deeper the longer. Ctrl: draws it out";

    /// Puts a solid on.
    Stamp: Solids, Click, Some(Key::O), "Stamp", "A click puts a solid on, as it is shown. Ctrl: takes it out";
    /// Carries a solid along a line.
    Sweep: Solids, Line, Some(Key::W), "Sweep", "Carries a solid along the line that is drawn. Ctrl: takes it out";
    /// Cuts off along a plane.
    Trim: Solids, Arrow, Some(Key::X), "Trim", "Cuts off what lies to the right of the line that is drawn. Ctrl: to the left";

    /// Pulls the surface by forces.
    Pull: Force, Grip, Some(Key::U), "Pull", "Takes hold of the surface and pulls it by forces: painted stiffness counts";
    /// Pulls a disc.
    Pad: Force, Grip, None, "Pad", "Takes hold of a disc as large as the tool, and pulls it by forces";
    /// Lifts a line.
    Crest: Force, Line, Some(Key::L), "Crest", "Lifts the line that is drawn, by forces. Ctrl: presses it in";
    /// Lifts an area.
    Plateau: Force, Outline, None, "Plateau", "Lifts what lies within the outline that is drawn, by forces. Ctrl: presses it in";
    /// Cuts a groove by forces.
    Chisel: Force, Brush, Some(Key::H), "Chisel", "Cuts a groove by forces, everywhere as deep. Ctrl: lays a ridge";
    /// Lays a ridge.
    Squirt: Force, Brush, Some(Key::Q), "Squirt", "Lays a ridge by forces, everywhere as high. Ctrl: cuts a groove";
    /// Makes a hole.
    Drill: Force, Brush, Some(Key::D), "Drill", "A hole straight through, away from the eye; with a way of the mouse a cut";
    /// Makes a bridge.
    Join: Force, Arrow, Some(Key::J), "Join", "A bridge through the air, from where the button goes down to where it comes up";
    /// Draws an outline out.
    Extrude: Force, Outline, Some(Key::E), "Extrude", "Draws out what lies within the outline that is drawn, with its walls. Ctrl: into the solid";
    /// Bends by forces.
    Flex: Force, Arrow, None, "Flex", "Bends by forces what lies along the arrow, about where it begins. Ctrl: the other way";

    /// Carries a part along.
    Grab: Warp, Grip, Some(Key::G), "Grab", "Carries along what lies within the radius, with all its detail";
    /// Bends.
    Bend: Warp, Arrow, Some(Key::B), "Bend", "Bends what lies along the arrow, about where it begins. Ctrl: the other way";
    /// Twists.
    Twist: Warp, Arrow, Some(Key::Y), "Twist", "Turns what lies along the arrow about it. Ctrl: the other way";
    /// Turns a ball.
    Whirl: Warp, Click, None, "Whirl", "A click turns what lies within the radius, most in its middle. Ctrl: the other way";
    /// Carries a box.
    Shift: Warp, Arrow, None, "Shift", "Carries the box under the mouse to where the button comes up";
    /// Makes sides alike.
    Mirror: Warp, Arrow, None, "Mirror", "Copies the side that the arrow points to over the other one";

    /// Makes the material stiffer, or softer.
    Stiffen: Paint, Brush, Some(Key::T), "Stiffness", "Paints the material stiffer against forces. Ctrl: softer";
    /// Makes it heavier.
    Mass: Paint, Brush, None, "Mass", "Paints the material heavier. Ctrl: lighter";
    /// Makes it more sluggish.
    Damping: Paint, Brush, None, "Damping", "Paints the material more sluggish. Ctrl: less";
    /// Makes it swell.
    RestLength: Paint, Brush, None, "Rest length", "Painted matter swells when it is let move. Ctrl: shrinks";
    /// How stiff it feels.
    SurfaceStiffness: Paint, Brush, None, "Hardness", "How hard the surface feels under a hand, N/m. Ctrl: as if not painted";
    /// How rough it feels.
    Friction: Paint, Brush, None, "Friction", "How rough the surface feels under a hand. Ctrl: smooth";

    /// Takes a box out.
    Cut: Parts, Click, None, "Cut out", "A click takes the box under the mouse out, to be pasted";
    /// Remembers a box.
    Copy: Parts, Click, None, "Copy", "A click takes the box under the mouse, to be pasted; nothing changes yet";
    /// Puts it in.
    Paste: Parts, Click, None, "Paste", "A click puts in what was copied or cut out, as it is shown";

    /// Makes the field finer.
    Refine: Detail, Line, None, "Refine", "Puts in knots along the line that is drawn: room for finer detail; nothing moves";
    /// Makes it coarser.
    Simplify: Detail, Line, None, "Simplify", "Takes out knots that matter less than the tolerance";

    /// Holds a line.
    PinLine: Hold, Line, None, "Pin line", "Force tools leave the surface where it is along the line that is drawn";
    /// Holds what lies in a box.
    PinBox: Hold, Click, None, "Pin box", "A click holds the surface within the box under the mouse: force tools leave it where it is";
    /// Bounds strokes.
    Lasso: Hold, Outline, Some(Key::K), "Lasso", "Strokes change only what is drawn round, to any depth. Ctrl: they spare it";
    /// Holds an outline.
    PinOutline: Hold, Outline, None, "Pin ring", "Force tools leave the surface where it is along the outline that is drawn";
}

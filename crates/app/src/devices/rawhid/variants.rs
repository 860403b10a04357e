//! The arms that such a board drives, by their makers' figures.
//!
//! Lengths in metres, N m/A, counts per turn of a motor. The arms whose links are parallel (Polhem v2 and v3) have kinematics
//! that nobody published, so they are not here.

/// An arm of three links with a motor each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variant {
    /// Name that opens it.
    pub name: &'static str,
    /// Name for people.
    pub title: &'static str,
    /// Diameters of the capstans.
    pub capstan: [f64; 3],
    /// Lengths of the links.
    pub length: [f64; 3],
    /// Diameters of the bodies that the capstans turn.
    pub body: [f64; 3],
    /// Middle of the room.
    pub origin: [f64; 3],
    /// Half the width of the room.
    pub radius: f64,
    /// Torque constants of the motors.
    pub torque_constant: [f64; 3],
    /// Counts of a turn of each motor.
    pub counts: [f64; 3],
    /// Counts of a turn of each joint of the gimbal, 0 without one.
    pub gimbal_counts: f64,
    /// Largest force, N.
    pub force: f64,
    /// Largest stiffness, N/m.
    pub stiffness: f64,
    /// Masses of the second and third link, kg.
    pub mass: [f64; 2],
    /// Their centres of mass, from the joint before.
    pub centre: [f64; 2],
    /// Counts in the place where the arm is put to be calibrated.
    pub preset: [i16; 6],
    /// Whether a motor turns with its body, seen along the axis about which the angle grows.
    pub is_aligned: [bool; 3],
    /// Whether an encoder of the gimbal does.
    pub gimbal_aligned: [bool; 3],
}

const WOODENHAPTICS_2019: Variant = Variant {
    name: "woodenhaptics-2019",
    title: "WoodenHaptics 2019",
    capstan: [0.010; 3],
    length: [0.080, 0.205, 0.245],
    body: [0.160, 0.120, 0.120],
    origin: [0.220, 0.0, 0.080],
    radius: 0.100,
    torque_constant: [0.321, 0.0603, 0.0603],
    counts: [2000.0; 3],
    gimbal_counts: 0.0,
    force: 5.0,
    stiffness: 1000.0,
    mass: [0.170, 0.110],
    centre: [0.051, 0.091],
    preset: [0, 0, 6000, 0, 0, 0],
    is_aligned: [false; 3],
    gimbal_aligned: [false; 3],
};

/// All of them.
pub const VARIANTS: [Variant; 5] = [
    WOODENHAPTICS_2019,
    Variant {
        name: "woodenhaptics-2015",
        title: "WoodenHaptics 2015",
        torque_constant: [0.0259; 3],
        ..WOODENHAPTICS_2019
    },
    Variant {
        name: "polhem-1",
        title: "Polhem v1",
        length: [0.058, 0.174, 0.133],
        body: [0.180, 0.100, 0.100],
        origin: [0.140, 0.0, 0.100],
        torque_constant: [0.0538; 3],
        gimbal_counts: 1024.0,
        stiffness: 800.0,
        mass: [0.080, 0.080],
        centre: [0.040, 0.070],
        preset: [0, 0, -5000, 0, 0, 0],
        is_aligned: [true; 3],
        gimbal_aligned: [false, true, false],
        ..WOODENHAPTICS_2019
    },
    Variant {
        name: "aluhaptics-2",
        title: "AluHaptics v2",
        capstan: [0.0138, 0.0098, 0.0098],
        length: [0.111, 0.140, 0.111],
        body: [0.116, 0.076, 0.076],
        origin: [0.140, 0.0, 0.0],
        torque_constant: [0.0259; 3],
        preset: [0; 6],
        ..WOODENHAPTICS_2019
    },
    Variant {
        name: "vintage",
        title: "Vintage",
        capstan: [0.013, 0.010, 0.010],
        length: [0.056, 0.138, 0.112],
        body: [0.117, 0.077, 0.077],
        origin: [0.140, 0.0, 0.0],
        torque_constant: [0.0163; 3],
        counts: [4000.0; 3],
        stiffness: 800.0,
        preset: [0; 6],
        ..WOODENHAPTICS_2019
    },
];

impl Variant {
    /// The arm of a name.
    pub fn named(name: &str) -> Option<&'static Self> {
        VARIANTS.iter().find(|v| v.name == name)
    }

    /// Sign of each motor's turn in its body's.
    fn direction(&self, motor: usize) -> f64 {
        if self.is_aligned[motor] { -1.0 } else { 1.0 }
    }

    /// Angle of a body for one of its motor.
    pub fn ratio(&self, motor: usize) -> f64 {
        self.direction(motor) * self.capstan[motor] / self.body[motor]
    }
}

//! Running a loop, and judging it.

use tools::haptics::simulated::{
    Bare, Limits, Measures, Mechanics, Preset, Rig, SimulatedDevice, SimulatedHand, Timing, Trace, World,
};
use tools::haptics::{Obstacle, Renderer};

/// The device that most scenes are told on.
pub fn omni() -> Mechanics {
    Preset::Omni.mechanics()
}

/// A loop of touch: what of it a scene chooses.
pub struct Loop {
    pub device: Mechanics,
    pub hand: SimulatedHand,
    pub stiffness: f64,
    pub radius: f64,
    pub seconds: f64,
    pub timing: Timing,
}

impl Loop {
    /// On the omni, 500 N/m, a tool of 2 mm.
    pub fn new(hand: SimulatedHand, seconds: f64) -> Self {
        Self {
            device: omni(),
            hand,
            stiffness: 500.0,
            radius: 2.0,
            seconds,
            timing: Timing::default(),
        }
    }

    pub fn limits(&self) -> Limits {
        Limits::new(
            self.stiffness,
            self.device.period,
            self.device.quantum,
            self.radius,
        )
    }

    /// Against what stays.
    pub fn touch(&self, obstacle: impl Obstacle + 'static, renderer: impl Renderer) -> Check {
        self.touch_world(World::still(obstacle), renderer)
    }

    /// Against what changes.
    pub fn touch_world(&self, world: World<'_>, renderer: impl Renderer) -> Check {
        let device = SimulatedDevice::new(self.device.clone(), self.hand.clone());
        let drive = Bare {
            renderer,
            force: self.device.force,
        };
        let mut rig = Rig::new(device, drive, world);
        rig.timing = self.timing.clone();
        let trace = rig.run(self.seconds);
        Check {
            measures: Measures::of(&trace, &self.limits()),
            limits: self.limits(),
            most: self.device.force,
            trace,
        }
    }
}

/// A trace and its criteria.
pub struct Check {
    pub trace: Trace,
    pub measures: Measures,
    pub limits: Limits,
    pub most: f64,
}

impl Check {
    /// P1: no limit cycle.
    pub fn rests(&self) -> bool {
        self.measures.ripple <= self.limits.ripple()
    }

    /// P2: a static field gives back no energy.
    pub fn is_passive(&self) -> bool {
        self.measures.returned <= 1e-4
    }

    /// P3 in locally convex free space: no change of the force that the motion does not justify.
    pub fn is_continuous(&self) -> bool {
        self.measures.jumps_over == 0 && self.is_slewed()
    }

    /// P3 everywhere: no change above the slew limit, no force above the device's.
    pub fn is_slewed(&self) -> bool {
        self.measures.jump <= self.limits.slew && self.measures.force <= self.most * (1.0 + 1e-12)
    }

    /// P4: the proxy never gets in.
    pub fn stays_out(&self) -> bool {
        self.measures.sunk == 0
    }

    /// Asserts named criteria, with all figures where one fails.
    #[track_caller]
    pub fn assert(&self, scene: &str, criteria: &[(&str, bool)]) {
        for (name, holds) in criteria {
            assert!(*holds, "{scene}: {name} fails: {:#?}", self.measures);
        }
    }
}

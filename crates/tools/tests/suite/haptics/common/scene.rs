//! Running a loop, and judging it.

use tools::haptics::gates::GateOptions;
use tools::haptics::simulated::{
    Bare, Limits, Measures, Mechanics, Preset, Rig, SimulatedDevice, SimulatedHand, Timing, Trace, World,
};
use tools::haptics::{Device, Obstacle, Renderer, Servo, ServoOptions, Workspace};

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
    pub fn touch(&self, obstacle: impl Obstacle + 'static, renderer: impl Renderer + 'static) -> Check {
        self.touch_world(World::still(obstacle), renderer)
    }

    /// Settings of a servo that takes the stiffness as it is and gives force as soon as it is armed.
    pub fn served(&self) -> ServoOptions {
        ServoOptions {
            stiffness: self.stiffness,
            is_bound: false,
            gates: GateOptions {
                ramp: 0.0,
                ..GateOptions::default()
            },
            ..ServoOptions::default()
        }
    }

    /// A whole servo, armed, with the device at the start of its hand's path. `make` makes a renderer for a stiffness, N/m.
    pub fn rig<'a>(
        &self,
        world: World<'a>,
        options: ServoOptions,
        make: impl FnOnce(f64) -> Box<dyn Renderer>,
    ) -> Rig<'a, Servo> {
        let device = SimulatedDevice::new(self.device.clone(), self.hand.clone()).fading();
        let servo = Servo::new(device.abilities(), options, |stiffness, _| make(stiffness));
        let mut servo = servo.expect("settings of scenes make sense");
        servo.arm();
        let mut rig = Rig::new(device, servo, world);
        rig.timing = self.timing.clone();
        rig
    }

    /// Behind the gates, against what stays.
    pub fn serve(
        &self,
        obstacle: impl Obstacle + 'static,
        make: impl FnOnce(f64) -> Box<dyn Renderer>,
    ) -> Check {
        let mut rig = self.rig(World::still(obstacle), self.served(), make);
        self.check(rig.run(self.seconds), &Workspace::default())
    }

    /// Judges a trace of a loop whose room is shown in a scene.
    pub fn check(&self, trace: Trace, workspace: &Workspace) -> Check {
        let mut limits = self.limits();
        // Places of the proxy are the scene's, all other figures the device's.
        limits.radius *= workspace.scale;
        limits.tolerance *= workspace.scale;
        Check {
            measures: Measures::of(&trace, &limits),
            limits,
            most: self.device.force,
            trace,
        }
    }

    /// Against what changes.
    pub fn touch_world(&self, world: World<'_>, renderer: impl Renderer + 'static) -> Check {
        let device = SimulatedDevice::new(self.device.clone(), self.hand.clone());
        let drive = Bare {
            renderer: Box::new(renderer),
            force: self.device.force,
        };
        let mut rig = Rig::new(device, drive, world);
        rig.timing = self.timing.clone();
        self.check(rig.run(self.seconds), &Workspace::default())
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
        self.measures.jump <= self.limits.slew * (1.0 + 1e-9)
            && self.measures.force <= self.most * (1.0 + 1e-12)
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

//! Where a force device has what: every report of the physical interface page is found by its usages \[Usb99\].
//!
//! Numbers, widths, the order of fields and even the kind of a field differ between makers, and some leave fields out. What is
//! missing and not needed is not written.

use super::descriptor::{Descriptor, Usage, Way};
use super::slot::{Choice, Part, Slot};

/// A usage of the physical interface page.
const fn pid(id: u16) -> Usage {
    Usage::new(0x0f, id)
}

/// Axes that take a force, in the order of the room: X, Y, Z of the generic desktop page.
pub const AXES: [Usage; 3] = [
    Usage::new(0x01, 0x30),
    Usage::new(0x01, 0x31),
    Usage::new(0x01, 0x32),
];

/// Ways of an effect.
const DIRECTIONS: [Usage; 3] = [Usage::new(0x0a, 1), Usage::new(0x0a, 2), Usage::new(0x0a, 3)];

/// Most buttons that are told.
const BUTTONS: u16 = 32;

/// What the device lacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("its descriptor has no {0}")]
pub struct Missing(pub &'static str);

/// Sets an effect up.
#[derive(Clone, Debug)]
pub struct SetEffect {
    pub index: Slot,
    pub constant: Option<Choice>,
    pub spring: Option<Choice>,
    pub duration: Option<Slot>,
    pub gain: Option<Slot>,
    pub axes: [Option<Choice>; 3],
    pub direction_enable: Option<Choice>,
    pub directions: [Option<Slot>; 3],
}

/// A constant force.
#[derive(Clone, Debug)]
pub struct SetConstant {
    pub index: Slot,
    pub magnitude: Slot,
}

/// A spring on an axis.
#[derive(Clone, Debug)]
pub struct SetCondition {
    pub index: Slot,
    /// The axis. Some devices have one only.
    pub block: Option<Slot>,
    pub centre: Slot,
    pub positive: Slot,
    pub negative: Option<Slot>,
    pub saturations: [Option<Slot>; 2],
    pub dead: Option<Slot>,
}

/// Starts and stops an effect.
#[derive(Clone, Debug)]
pub struct Operation {
    pub index: Slot,
    pub start: Choice,
    pub loops: Option<Slot>,
}

/// Commands to all of the device.
#[derive(Clone, Debug)]
pub struct Control {
    pub enable: Choice,
    pub disable: Choice,
    pub stop: Choice,
    pub reset: Option<Choice>,
}

/// Has the device make an effect.
#[derive(Clone, Debug)]
pub struct Create {
    pub report: u8,
    pub constant: Option<Choice>,
    pub spring: Option<Choice>,
}

/// What became of it.
#[derive(Clone, Debug)]
pub struct Load {
    pub index: Slot,
    pub success: Choice,
    pub full: Option<Choice>,
}

/// All of it.
#[derive(Clone, Debug)]
pub struct Layout {
    pub effect: SetEffect,
    pub constant: Option<SetConstant>,
    pub condition: Option<SetCondition>,
    pub operation: Operation,
    pub control: Control,
    pub gain: Option<Slot>,
    pub create: Create,
    pub load: Load,
    pub input: Input,
    descriptor: Descriptor,
}

/// Input reports: axes and buttons. What else is told, as the state of the motors, is let pass.
#[derive(Clone, Debug)]
pub struct Input {
    /// Axes of the room that take a force.
    pub axes: [Option<Slot>; 3],
    pub buttons: Vec<Slot>,
    /// Numbers and lengths of input reports, the byte of the number included.
    pub lengths: Vec<(u8, usize)>,
    pub is_numbered: bool,
}

impl Layout {
    /// Finds all of it.
    ///
    /// # Errors
    /// [`Missing`] of what no force is possible without.
    pub fn of(descriptor: Descriptor) -> Result<Self, Missing> {
        let out = |report: u16| Part::of(&descriptor, Way::Output).within(pid(report));
        let feature = |report: u16| Part::of(&descriptor, Way::Feature).within(pid(report));
        let layout = Self {
            effect: SetEffect::of(out(0x21)).ok_or(Missing("report to set an effect up"))?,
            constant: SetConstant::of(out(0x73)),
            condition: SetCondition::of(out(0x5f)),
            operation: Operation::of(out(0x77)).ok_or(Missing("report to start an effect"))?,
            control: Control::of(Part::of(&descriptor, Way::Output))
                .ok_or(Missing("command to enable, stop and disable its motors"))?,
            gain: out(0x7d).value(pid(0x7e)),
            create: Create::of(feature(0xab)).ok_or(Missing("report to make an effect"))?,
            load: Load::of(feature(0x89)).ok_or(Missing("report that tells the number of a new effect"))?,
            input: Input::of(&descriptor),
            descriptor,
        };
        match (layout.input.axes[0], layout.effect.axes[0]) {
            (Some(_), Some(_)) => Ok(layout),
            _ => Err(Missing("axis X that tells where it is and takes a force")),
        }
    }

    /// A report of zeros that begins with its number.
    pub fn blank(&self, way: Way, report: u8) -> Vec<u8> {
        let mut bytes = vec![0; self.descriptor.length(way, report)];
        bytes[0] = report;
        bytes
    }

    /// Axes that both tell where they are and take a force.
    pub fn has_axis(&self, axis: usize) -> bool {
        self.input.axes[axis].is_some() && self.effect.axes[axis].is_some()
    }
}

impl SetEffect {
    fn of(report: Part) -> Option<Self> {
        let kinds = report.within(pid(0x25));
        let axes = report.within(pid(0x55));
        let directions = report.within(pid(0x57));
        Some(Self {
            index: report.value(pid(0x22))?,
            constant: kinds.choice(pid(0x26)),
            spring: kinds.choice(pid(0x40)),
            duration: report.value(pid(0x50)),
            gain: report.value(pid(0x52)),
            axes: AXES.map(|axis| axes.choice(axis)),
            direction_enable: report.choice(pid(0x56)),
            directions: std::array::from_fn(|i| {
                let by_axis = || directions.value(AXES[i]);
                directions.value(DIRECTIONS[i]).or_else(by_axis)
            }),
        })
    }
}

impl SetConstant {
    fn of(report: Part) -> Option<Self> {
        let magnitude = report.value(pid(0x70))?;
        // One without a sign cannot pull.
        (magnitude.min < 0).then_some(Self {
            index: report.value(pid(0x22))?,
            magnitude,
        })
    }
}

impl SetCondition {
    fn of(report: Part) -> Option<Self> {
        Some(Self {
            index: report.value(pid(0x22))?,
            block: report.value(pid(0x23)),
            centre: report.value(pid(0x60))?,
            positive: report.value(pid(0x61))?,
            negative: report.value(pid(0x62)),
            saturations: [report.value(pid(0x63)), report.value(pid(0x64))],
            dead: report.value(pid(0x65)),
        })
    }
}

impl Operation {
    fn of(report: Part) -> Option<Self> {
        Some(Self {
            index: report.value(pid(0x22))?,
            start: report.choice(pid(0x79))?,
            loops: report.value(pid(0x7c)),
        })
    }
}

impl Control {
    fn of(reports: Part) -> Option<Self> {
        // Makers disagree which of the two usages is the report and which the field.
        let any = [0x96, 0x95].map(|usage| reports.within(pid(usage)));
        let choice = |usage: u16| any.iter().find_map(|part| part.choice(pid(usage)));
        Some(Self {
            enable: choice(0x97)?,
            disable: choice(0x98)?,
            stop: choice(0x99)?,
            reset: choice(0x9a),
        })
    }
}

impl Create {
    fn of(report: Part) -> Option<Self> {
        let kinds = report.within(pid(0x25));
        let (constant, spring) = (kinds.choice(pid(0x26)), kinds.choice(pid(0x40)));
        Some(Self {
            report: constant.or(spring)?.slot.report,
            constant,
            spring,
        })
    }
}

impl Load {
    fn of(report: Part) -> Option<Self> {
        let status = report.within(pid(0x8b));
        Some(Self {
            index: report.value(pid(0x22))?,
            success: status.choice(pid(0x8c))?,
            full: status.choice(pid(0x8d)),
        })
    }
}

impl Input {
    fn of(descriptor: &Descriptor) -> Self {
        let input = Part::of(descriptor, Way::Input);
        let mut lengths: Vec<(u8, usize)> = input
            .fields()
            .map(|f| (f.report, descriptor.length(Way::Input, f.report)))
            .collect();
        lengths.sort_unstable();
        lengths.dedup();
        Self {
            axes: AXES.map(|axis| input.value(axis)),
            buttons: (1..=BUTTONS)
                .filter_map(|n| input.value(Usage::new(0x09, n)))
                .collect(),
            lengths,
            is_numbered: descriptor.is_numbered,
        }
    }
}

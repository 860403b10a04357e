//! How a hand takes hold of a document: where its room lies, what it touches with, and what of the document it may touch.

use std::sync::{Arc, Mutex};

use clap::ValueEnum;
use document::{CommandError, DocumentError, State};
use tools::haptics::gates::GateOptions;
use tools::haptics::{
    Abilities, Coupling, Demand, MultiPoint, MultiPointOptions, PointTool, Proxy, ProxyOptions, Renderer,
    Scaled, Servo, ServoError, ServoOptions, Unresolved, Vcp, VcpOptions, Workspace,
};

use super::Show;
use super::touch::Toucher;

/// Time from step to step of the simulation, s.
pub const STEP: f64 = 1.0 / 30.0;
/// Longest time from tick to tick, s.
pub const TICK: f64 = 1e-3;
/// What may be touched is known so far about the hand, mm of the device.
const REACH: f64 = 15.0;
/// Nodes of what may be touched of an object: as many as are made anew in a step of the simulation. With all that snapshots allow, carving a scan of thin
/// parts took steps of 160 ms where these take 19.
const NODES: usize = 60_000;
/// Stiffness of a turn, N mm/rad, for each N/m of the coupling: a lever of 63 mm.
const TURN: f64 = 4.0;

/// How contact is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ContactMode {
    /// By a proxy that the solid keeps out.
    Proxy,
    /// Anew in every tick.
    Vcp,
}

/// What a hand touches with. Lengths are mm of the device.
#[derive(Clone, Debug)]
pub struct Grip {
    /// Stiffness at the hand, N/m, as far as the device holds it.
    pub stiffness: f64,
    /// Largest force, N; that of the device counts besides.
    pub force: f64,
    /// Radius of the ball that touches.
    pub radius: f64,
    /// What touches in its place.
    pub tool: Option<PointTool>,
    /// Of the ball.
    pub contact: ContactMode,
}

impl Grip {
    /// Coupling and gates as they are wished.
    ///
    /// # Errors
    /// [`ServoError`].
    pub fn servo(&self, abilities: &Abilities, workspace: Workspace) -> Result<Servo, ServoError> {
        let (scale, usual) = (workspace.scale, GateOptions::default());
        let options = ServoOptions {
            stiffness: self.stiffness,
            period: abilities.period.min(TICK),
            workspace,
            gates: GateOptions {
                force: self.force,
                // What pushes nobody may be as fast as it likes.
                speed: if abilities.force > 0.0 {
                    usual.speed
                } else {
                    f64::INFINITY
                },
                ..usual
            },
            ..ServoOptions::default()
        };
        let radius = self.radius * scale;
        Servo::new(abilities, options, |stiffness, damping| {
            if let Some(tool) = &self.tool {
                return renderer(tool, stiffness * scale, damping * scale, scale);
            }
            let coupling = Coupling { stiffness, damping };
            match self.contact {
                ContactMode::Proxy => {
                    let usual = ProxyOptions::default();
                    Box::new(Proxy::new(ProxyOptions {
                        radius,
                        coupling,
                        push_out: usual.push_out * scale,
                        tolerance: usual.tolerance * scale,
                        ..usual
                    }))
                }
                ContactMode::Vcp => {
                    let usual = VcpOptions::default();
                    Box::new(Vcp::new(VcpOptions {
                        radius,
                        coupling,
                        step: usual.step * scale,
                        ..usual
                    }))
                }
            }
        })
    }

    /// What may be touched of the states of a document, most finely of the object with a name; into `worst` goes what was too thin for it.
    ///
    /// # Errors
    /// That there is no such object, or that it has no surface.
    pub fn show(
        &self,
        state: &State,
        name: &str,
        workspace: &Workspace,
        worst: &Arc<Mutex<Option<Unresolved>>>,
    ) -> Result<Show, CommandError> {
        let object = state.object(name)?;
        if object.iso().is_none() {
            return Err(CommandError::NoSurface(name.into()));
        }
        let placed = state.placement(name)?;
        let cell = (placed * object.field.lattice().world_from_lattice).matrix3;
        let knots = cell.x_axis.length() / f64::from(1_u32 << object.detail().min(31));
        let mut toucher = Toucher::new(Demand {
            detail: knots,
            most_nodes: NODES,
            ..self.demand(workspace.scale)
        });
        let worst = Arc::clone(worst);
        Ok(Box::new(move |state, at| {
            let snapshot = toucher.show(state, at);
            // Nobody else looks before the end.
            if let (Some(now), Ok(mut worst)) = (snapshot.unresolved(), worst.lock()) {
                let before = worst.filter(|before| (before.missed, before.thin) > (now.missed, now.thin));
                *worst = before.or(Some(now));
            }
            snapshot
        }))
    }

    /// What it asks of snapshots, in a scene of which a mm of the device is `scale`.
    fn demand(&self, scale: f64) -> Demand {
        let Some(tool) = &self.tool else {
            let usual = Demand::of_ball(self.radius * scale);
            return Demand {
                reach: (REACH * scale).max(4.0 * usual.radius),
                ..usual
            };
        };
        let usual = Demand::of_points(tool);
        Demand {
            radius: scale * usual.radius,
            reach: scale * usual.reach,
            spacing: usual.spacing.map(|h| scale * h),
            ..usual
        }
    }
}

/// For a stiffness at the hand, N/m, and a damping, N s/m, in a scene of which a mm of the device is `scale`.
fn renderer(tool: &PointTool, stiffness: f64, damping: f64, scale: f64) -> Box<dyn Renderer> {
    let options = MultiPointOptions {
        coupling: Coupling { stiffness, damping },
        angular_stiffness: TURN * stiffness,
        ..MultiPointOptions::default()
    };
    let renderer = MultiPoint::new(tool.clone(), options).expect("a servo grants stiffness above zero");
    Box::new(Scaled { renderer, scale })
}

/// The object in the middle of a room that reaches so far, mm; `scale` lengths of the document are one of it, or as many as let the object
/// fit.
///
/// # Errors
/// That there is no such object.
pub fn workspace(
    state: &State,
    name: &str,
    reach: f64,
    scale: Option<f64>,
) -> Result<Workspace, DocumentError> {
    let own = state.object(name)?.field.world_box();
    let b = own.transformed(&state.placement(name)?);
    let fitting = 0.5 * b.size().max_element() / reach;
    Ok(Workspace {
        scale: scale.unwrap_or(fitting),
        shift: b.center(),
        ..Workspace::default()
    })
}

//! A device in the hand: three threads have the document, and the desk shows what they do until an order needs it back.

use std::cell::{Cell, RefCell};
use std::sync::mpsc::{Receiver, TryRecvError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use document::State;
use glam::DVec3;
use tools::curve::Along;
use tools::haptics::gates::Trip;
use tools::haptics::{Contact, Device, Embedding, TickRecord, Unresolved, Workspace};
use tools::session::Stroke;

use super::desk::Desk;
use super::orders::{News, Order};
use super::tool::{Kind, Start, Tool};
use crate::devices::{self, Force, Mouse};
use crate::threads::Session;
use crate::threads::grip::{ContactMode, Grip, STEP, TICK, workspace};
use crate::threads::sculpting::Sculpting;

/// Time from one look at the document to the next: what is seen changes no oftener.
const LOOK: Duration = Duration::from_millis(33);
/// Time from one word of the hand to the next.
const WORD: Duration = Duration::from_millis(15);
/// Time over which forces are counted.
const COUNTED: Duration = Duration::from_millis(500);
/// Radii that a solid goes into the matter in a second, with the least and the largest strength.
const RATES: [f64; 2] = [0.25, 2.0];

/// What is to be taken in the hand.
#[derive(Clone, Debug, PartialEq)]
pub struct Wanted {
    /// The device by its name; the mouse if missing.
    pub device: Option<String>,
    /// Stiffness at the hand, N/m.
    pub stiffness: f64,
    /// Largest force, N; a device that is not allowed any only tells where it is.
    pub force: Option<f64>,
    /// What its button begins. The ball that touches is as large.
    pub tool: Tool,
}

/// What is in the hand.
#[derive(Clone, Debug)]
pub struct Held {
    /// Its name.
    pub device: String,
    /// Radius of the ball that touches, a length of the world.
    pub radius: f64,
    /// Where its room lies in the world.
    pub workspace: Workspace,
    /// How the window leads it, if it is the mouse.
    pub mouse: Option<Arc<Mutex<Mouse>>>,
}

/// What a hand does and feels now; places are the world's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Where it is.
    pub hand: DVec3,
    /// Where the tool is, which the solid keeps out.
    pub proxy: DVec3,
    /// Force that is felt, N; of a device without force what would be.
    pub force: f64,
    /// What it has to do with the solid.
    pub contact: Contact,
    /// Whether the whole force comes through.
    pub is_live: bool,
    /// Why there is no force, if something took it away.
    pub trip: Option<Trip>,
}

impl Seen {
    fn of(record: &TickRecord) -> Self {
        let place = |p: [f32; 3]| DVec3::from_array(p.map(f64::from));
        Self {
            hand: place(record.hand),
            proxy: place(record.proxy),
            force: record.wished.into(),
            contact: record.status.contact(),
            is_live: record.status.is_live(),
            trip: record.status.trip(),
        }
    }
}

/// Refuses tools that a hand does not lead step by step.
fn by_hand(tool: &Tool) -> Result<(), String> {
    match tool.acts_at_once() || tool.kind == Kind::Drill {
        true => Err(format!(
            "{} is a tool for the mouse alone; choose another one to touch with",
            tool.kind.name()
        )),
        false => Ok(()),
    }
}

/// What a button begins by a tool of the palette.
fn stroke(tool: &Tool) -> Stroke {
    let mut stroke = tool.stroke(&Start::at(DVec3::ZERO));
    if let Some(pull) = &mut stroke.pull {
        // It takes hold where the hand is.
        pull.along = Along::default();
    }
    stroke
}

impl Desk {
    /// Lets the hand have the document until an order needs it, which is given back; nothing when no more orders come.
    pub(super) fn touch(&mut self, wanted: &Wanted, orders: &Receiver<Order>) -> Option<Order> {
        self.end();
        let begun = by_hand(&wanted.tool).and_then(|()| self.take(wanted));
        let felt = begun.and_then(|(held, device)| self.feel(wanted, &held, device, orders));
        felt.unwrap_or_else(|why| {
            self.tell(News::Failed(why));
            self.let_go();
            orders.recv().ok()
        })
    }

    /// Opens the device.
    fn take(&self, wanted: &Wanted) -> Result<(Held, Box<dyn Device>), String> {
        let (state, chosen) = self.chosen().ok_or("open something to touch first")?;
        let mut led = None;
        let device: Box<dyn Device> = match &wanted.device {
            None => {
                let (mouse, pointer) = devices::mouse();
                led = Some(Arc::new(Mutex::new(mouse)));
                Box::new(pointer)
            }
            Some(name) => {
                let named = name.parse().map_err(|why| format!("{name}: {why}"))?;
                let force = wanted.force.map_or(Force::Withheld, |_| Force::Allowed);
                Box::new(devices::open(&named, force).map_err(|why| why.to_string())?)
            }
        };
        let reach = device.abilities().reach;
        let held = Held {
            device: device.abilities().name.clone(),
            radius: wanted.tool.radius,
            workspace: workspace(state, chosen, reach, None).map_err(|e| e.to_string())?,
            mouse: led,
        };
        Ok((held, device))
    }

    fn feel(
        &mut self,
        wanted: &Wanted,
        held: &Held,
        device: Box<dyn Device>,
        orders: &Receiver<Order>,
    ) -> Result<Option<Order>, String> {
        let grip = Grip {
            stiffness: wanted.stiffness,
            force: wanted.force.unwrap_or(f64::INFINITY),
            radius: held.radius / held.workspace.scale,
            tool: None,
            contact: ContactMode::Proxy,
        };
        let servo = grip
            .servo(device.abilities(), held.workspace)
            .map_err(|why| why.to_string())?;
        if let Some(note) = servo.granted().note() {
            self.tell(News::Note(note));
        }
        let too_thin = Arc::<Mutex<Option<Unresolved>>>::default();
        let (state, chosen) = self.chosen().ok_or("open something to touch first")?;
        let chosen = chosen.to_string();
        let mut show = grip
            .show(state, &chosen, &held.workspace, &too_thin)
            .map_err(|why| why.to_string())?;
        let (mut state_out, mut state_in) = exchange::latest(|| None::<State>);
        let show = Box::new(move |state: &State, at: DVec3| {
            state_out.publish(Some(state.clone()));
            show(state, at)
        });
        let rate = RATES[0] + (RATES[1] - RATES[0]) * wanted.tool.strength;
        let Some(document) = self.lend() else {
            return Ok(None);
        };
        let limits = self.limits().clone();
        let stroke = move |tool: &Tool| limits.on(stroke(tool));
        let sculpting = Sculpting::new(document, chosen, Some(stroke(&wanted.tool)))
            .touching(held.radius)
            .embedding(
                Embedding {
                    rate: rate * held.radius,
                },
                STEP,
            );
        let (in_hand, titles) = (sculpting.tool(), sculpting.titles());
        self.tell(News::Held(Some(held.clone())));
        let session = Session {
            tick: Duration::from_secs_f64(device.abilities().period.min(TICK)),
            device,
            servo,
            sculpting,
            show,
            step: Duration::from_secs_f64(STEP),
        };
        let last = RefCell::new(None);
        let (ticks, mut counted) = (Cell::new(0_u32), Instant::now());
        let mut next = None;
        let (mut looked, mut told) = (Instant::now(), Instant::now());
        let mut is_over = false;
        let goes_on = || {
            while !is_over && next.is_none() {
                match orders.try_recv() {
                    Ok(Order::Tool(tool)) if tool.radius == held.radius => {
                        *in_hand.lock().unwrap_or_else(PoisonError::into_inner) = Some(stroke(&tool));
                    }
                    Ok(order) => next = Some(order),
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => is_over = true,
                }
            }
            if looked.elapsed() >= LOOK && state_in.refresh() {
                looked = Instant::now();
                if let Some(state) = state_in.get() {
                    self.look_at(state.clone());
                }
            }
            let edits = std::mem::take(&mut *titles.lock().unwrap_or_else(PoisonError::into_inner));
            if !edits.is_empty() {
                self.hear_edits(edits);
            }
            if counted.elapsed() >= COUNTED {
                let rate = f64::from(ticks.replace(0)) / counted.elapsed().as_secs_f64();
                counted = Instant::now();
                self.tell(News::Touched(rate));
            }
            if told.elapsed() >= WORD
                && let Some(seen) = last.take()
            {
                told = Instant::now();
                self.tell(News::Seen(seen));
            }
            !is_over && next.is_none()
        };
        let ran = session.run(goes_on, |record| {
            ticks.set(ticks.get() + 1);
            *last.borrow_mut() = Some(Seen::of(record));
        });
        self.tell(News::Held(None));
        let (sculpting, _) = match ran {
            Ok(ran) => ran,
            Err(why) => {
                self.return_lent(None)?;
                return Err(format!("the edit is not on the disk: {why}"));
            }
        };
        let (document, _, notes) = sculpting.close();
        self.return_lent(Some(document))?;
        notes.into_iter().for_each(|note| self.tell(News::Note(note)));
        Ok(next)
    }
}

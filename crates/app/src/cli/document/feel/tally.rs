//! What came of many ticks.

use std::io::{self, Write};

use glam::DVec3;
use serde::Serialize;
use tools::haptics::gates::{Status, held};
use tools::haptics::{Contact, TickRecord};

/// What came of many ticks, told one by one.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Tally {
    /// Ticks.
    pub ticks: u64,
    /// Their time.
    pub seconds: f64,
    /// Largest force sent.
    pub largest_force_n: f64,
    /// Largest torque that the tool felt, whether the device gives any or not.
    pub largest_torque_nmm: f64,
    /// Largest step of the force, from what the hand still felt of the last one.
    pub largest_step_n: f64,
    /// Share of ticks in contact.
    pub contact_share: f64,
    /// Most work that the hand ever got back beyond what it had put in, J.
    pub returned_j: f64,
    /// Work that the hand put in, in all, J.
    pub work_j: f64,
    /// Ticks in which passivity control damped.
    pub damped: u64,
    /// Ticks in which the force, or torque, was larger than it may be.
    pub clamped: u64,
    /// Ticks in which it changed faster than it may.
    pub slewed: u64,
    /// Ticks in which the device was warm.
    pub warm: u64,
    /// Ticks in which the simulation was not heard of for long.
    pub old_snapshot: u64,
    /// Ticks with a late pose.
    pub late_poses: u64,
    /// Ticks that came late.
    pub stalled: u64,
    /// What took all force away, if anything did.
    pub tripped: Option<String>,
    #[serde(skip)]
    in_contact: u64,
    #[serde(skip)]
    last: Option<TickRecord>,
}

impl Tally {
    /// Counts a tick; `scale` is that of the workspace.
    pub fn add(&mut self, record: &TickRecord, scale: f64) {
        let status = record.status;
        self.ticks += 1;
        self.seconds += f64::from(record.dt);
        let force = vector(record.force);
        self.largest_force_n = self.largest_force_n.max(force.length());
        self.largest_torque_nmm = self.largest_torque_nmm.max(vector(record.torque).length());
        if let Some(last) = &self.last {
            let (was, share) = (vector(last.force), held(f64::from(record.dt)));
            self.largest_step_n = self.largest_step_n.max((force - was * share).length());
            // A force is as large in the device as in the scene, a way is not.
            let way = 1e-3 * (vector(record.hand) - vector(last.hand)) / scale;
            self.work_j -= 0.5 * (1.0 + share) * was.dot(way);
            self.returned_j = self.returned_j.max(-self.work_j);
        }
        let is_contact = !matches!(status.contact(), Contact::Free | Contact::Inside);
        self.in_contact += u64::from(is_contact);
        self.contact_share = self.in_contact as f64 / self.ticks as f64;
        let counts = [
            (&mut self.damped, Status::PASSIVITY),
            (&mut self.clamped, Status::CLAMPED),
            (&mut self.slewed, Status::SLEWED),
            (&mut self.warm, Status::WARM),
            (&mut self.old_snapshot, Status::OLD_SNAPSHOT),
            (&mut self.late_poses, Status::LATE_POSE),
            (&mut self.stalled, Status::STALLED),
        ];
        for (count, bit) in counts {
            *count += u64::from(status.has(bit));
        }
        if self.tripped.is_none() {
            self.tripped = status.trip().map(|why| why.to_string());
        }
        self.last = Some(*record);
    }
}

fn vector(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

/// Columns of a trace.
const COLUMNS: &str = "seconds,contact,live,damped,clamped,slewed,warm,old_snapshot,stalled,tripped,buttons,hand_x,hand_y,hand_z,\
                       proxy_x,proxy_y,proxy_z,force_x,force_y,force_z,wished,energy,torque_x,torque_y,torque_z,torque_sent";

/// Writes records as a table of comma-separated values, one line a tick.
///
/// # Errors
/// Of writing.
pub fn write_trace(records: &[TickRecord], out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "{COLUMNS}")?;
    let mut seconds = 0.0;
    for r in records {
        seconds += f64::from(r.dt);
        let contact = match r.status.contact() {
            Contact::Free => "free",
            Contact::Slides => "slides",
            Contact::Sticks => "sticks",
            Contact::Attracted => "attracted",
            Contact::Inside => "inside",
            Contact::Pulls => "pulls",
        };
        write!(out, "{seconds:.6},{contact},{}", u8::from(r.status.is_live()))?;
        for bit in [
            Status::PASSIVITY,
            Status::CLAMPED,
            Status::SLEWED,
            Status::WARM,
            Status::OLD_SNAPSHOT,
            Status::STALLED,
        ] {
            write!(out, ",{}", u8::from(r.status.has(bit)))?;
        }
        write!(out, ",{},{}", u8::from(r.status.trip().is_some()), r.buttons)?;
        for number in r.hand.iter().chain(&r.proxy).chain(&r.force) {
            write!(out, ",{number}")?;
        }
        let [x, y, z] = r.torque;
        writeln!(out, ",{},{},{x},{y},{z},{}", r.wished, r.energy, r.torque_sent)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_steps_and_shares_are_those_of_the_records() {
        let record = |tick: u64, z: f32, force: f32| TickRecord {
            tick,
            status: Status(u32::from(force > 0.0)),
            hand: [0.0, 0.0, z],
            force: [0.0, 0.0, force],
            dt: 1e-3,
            ..TickRecord::default()
        };
        let mut tally = Tally::default();
        // 2 mm of the scene down and up against 1 N, then up by as much under 3 N: with two millimetres of the scene for one of the device.
        for (tick, (z, force)) in [(0.0, 1.0), (-2.0, 1.0), (0.0, 3.0), (2.0, 0.0)]
            .into_iter()
            .enumerate()
        {
            tally.add(&record(tick as u64, z, force), 2.0);
        }
        assert_eq!((tally.ticks, tally.contact_share), (4, 0.75));
        assert_eq!((tally.largest_force_n, tally.largest_step_n), (3.0, 3.0));
        assert!((tally.returned_j - 3e-3).abs() < 1e-9, "{tally:?}");
    }

    #[test]
    fn a_trace_has_a_number_for_every_column() {
        let mut out = Vec::new();
        write_trace(&[TickRecord::default(); 3], &mut out).unwrap();
        let text = String::from_utf8(out).unwrap();
        let columns: Vec<usize> = text.lines().map(|line| line.split(',').count()).collect();
        assert_eq!(columns, [26; 4]);
    }
}

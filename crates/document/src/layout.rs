//! What the journal's records make: a row of edits, how many of them are done, and snapshots on the way.

use formats::ReadLimits;

use crate::entry::{Kind, MoveHead};
use crate::error::damaged;
use crate::journal::{Journal, Record};
use crate::records::{followed, read_text, restored};
use crate::{DocumentError, State};

/// What the journal's records make.
#[derive(Clone, Debug, Default)]
pub(crate) struct Layout {
    /// Edits, the oldest first.
    pub edits: Vec<Record>,
    /// How many of them are done.
    pub done: usize,
    /// Snapshots, and how many edits each has in it.
    pub snapshots: Vec<(usize, Record)>,
}

impl Layout {
    /// What records make, as far as they can be understood: the first one that cannot is cut off with all behind it.
    pub fn read(
        journal: &mut Journal,
        records: &[Record],
    ) -> Result<(Self, Option<DocumentError>), DocumentError> {
        let (mut layout, mut trouble) = (Self::default(), None);
        for record in records {
            match record.kind {
                Kind::Snapshot => layout.snapshots.push((layout.done, *record)),
                Kind::Edit => {
                    layout.forget_after(layout.done);
                    layout.edits.push(*record);
                    layout.done += 1;
                }
                Kind::Move => match read_text::<MoveHead>(journal, record) {
                    Ok(head) => layout.done = (head.done as usize).min(layout.edits.len()),
                    Err(error) => {
                        journal.cut(record);
                        trouble = Some(error);
                        break;
                    }
                },
            }
        }
        match layout.snapshots.first() {
            Some((0, _)) => Ok((layout, trouble)),
            _ => Err(damaged(journal.path(), "it does not begin with its objects")),
        }
    }

    /// Drops edits from a number on, and the snapshots that have them in them.
    pub fn forget_after(&mut self, count: usize) {
        self.edits.truncate(count);
        self.snapshots.retain(|(at, _)| *at <= count);
        self.done = self.done.min(count);
    }

    /// The state that all done edits make, or the last one on the way to it that can be reached: how many edits are in it,
    /// and what was in the way.
    pub fn reach(
        &self,
        journal: &mut Journal,
        limits: &ReadLimits,
    ) -> Result<(State, usize, Option<DocumentError>), DocumentError> {
        let mut best: Option<(State, usize)> = None;
        let mut trouble = None;
        for (at, record) in self.snapshots.iter().rev().filter(|(at, _)| *at <= self.done) {
            let mut state = match restored(journal, record, limits) {
                Ok(state) => state,
                Err(error) => {
                    trouble.get_or_insert(error);
                    continue;
                }
            };
            let mut reached = *at;
            for edit in &self.edits[*at..self.done] {
                match followed(journal, edit, &state, true, limits) {
                    Ok(next) => (state, reached) = (next, reached + 1),
                    Err(error) => {
                        trouble.get_or_insert(error);
                        break;
                    }
                }
            }
            if best.as_ref().is_none_or(|(_, most)| reached > *most) {
                best = Some((state, reached));
            }
            if reached == self.done {
                break;
            }
        }
        let nothing = || damaged(journal.path(), "it does not begin with its objects");
        match best {
            Some((state, reached)) => Ok((state, reached, trouble)),
            None => Err(trouble.unwrap_or_else(nothing)),
        }
    }
}

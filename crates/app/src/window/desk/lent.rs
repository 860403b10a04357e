//! The document in the hands of a device.

use document::{Document, State};

use super::{Desk, Open};
use crate::window::limits::Limits;

impl Desk {
    /// What is open, and the name of the chosen object.
    pub(in crate::window) fn chosen(&self) -> Option<(&State, &str)> {
        let open = self.open.as_ref()?;
        Some((open.state(), &open.chosen))
    }

    /// Where strokes of the palette may act.
    pub(in crate::window) fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Lends the document to a device.
    pub(in crate::window) fn lend(&mut self) -> Option<Document> {
        self.open.as_mut()?.document.take()
    }

    /// Takes the document back; without one it was lost, and is opened anew.
    ///
    /// # Errors
    /// That it cannot be opened; then nothing is open any more.
    pub(in crate::window) fn return_lent(&mut self, document: Option<Document>) -> Result<(), String> {
        match document {
            Some(document) => self.take_back(document),
            None => self.reopen()?,
        }
        Ok(())
    }

    pub(in crate::window) fn take_back(&mut self, document: Document) {
        if let Some(open) = &mut self.open {
            open.shown = document.state().clone();
            open.document = Some(document);
        }
        self.lay_sheet();
    }

    /// A device has done edits.
    pub(in crate::window) fn hear_edits(&mut self, titles: Vec<String>) {
        if let Some(Open {
            history: (all, done), ..
        }) = &mut self.open
        {
            all.truncate(*done);
            all.extend(titles);
            *done = all.len();
        }
        self.lay_sheet();
    }

    /// Nothing is to be in the hand any more.
    pub(in crate::window) fn let_go(&mut self) {
        self.wanted = None;
    }

    /// Shows what a device made of the document.
    pub(in crate::window) fn look_at(&mut self, state: State) {
        if let Some(open) = &mut self.open {
            open.shown = state;
        }
        self.show();
    }
}

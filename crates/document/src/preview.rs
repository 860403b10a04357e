//! Edits that are shown before they are made: block sculpting \[Kim03 §6.2.2\].

use bspline::Aabb;
use fitting::Control;
use tools::live::Pose;

use crate::{Change, Command, CommandError, Document, State};

/// An edit that is shown and not yet made: the document is as it was, on the disk and in memory; dropped, it leaves nothing.
///
/// A solid or a brush is put in place as often as it takes ([`put`](Self::put)), each time on the objects as they are in the
/// document, and then acts at once ([`apply`](Self::apply)): what was shown is what the document gets, to the bit.
pub struct Preview {
    before: State,
    command: Command,
    after: State,
    notes: Vec<String>,
}

impl Preview {
    /// What a command would leave of a state.
    ///
    /// # Errors
    /// Any [`CommandError`].
    pub fn of(state: &State, command: Command, control: &mut Control) -> Result<Self, CommandError> {
        let (after, notes) = command.apply(state, control)?;
        Ok(Self {
            before: state.clone(),
            command,
            after,
            notes,
        })
    }

    /// Puts the tool of a stroke elsewhere, of the object's own world, and shows what it would leave there: a solid or a brush, whose
    /// `along` is then that one place.
    ///
    /// # Errors
    /// Any [`CommandError`]; what is shown stays as it was.
    pub fn put(&mut self, pose: Pose, control: &mut Control) -> Result<(), CommandError> {
        let mut command = self.command.clone();
        match &mut command {
            Command::Stroke { stroke, .. } => stroke.put(pose)?,
            Command::Scene { .. } | Command::Remove { .. } | Command::Rename { .. } => {
                let why = format!("{} has no place to be put to", command.title());
                return Err(CommandError::Script(why));
            }
        }
        *self = Self::of(&self.before, command, control)?;
        Ok(())
    }

    /// What is shown.
    pub fn state(&self) -> &State {
        &self.after
    }

    /// What is left to say of it, in sentences.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Boxes of the object's own world outside of which its field is shown as it is in the document.
    ///
    /// # Errors
    /// [`CommandError::Document`] for an object that is not there.
    pub fn changed(&self) -> Result<Vec<Aabb>, CommandError> {
        let [before, after] = [&self.before, &self.after].map(|state| state.object(self.command.object()));
        let (before, after) = (&before?.field, &after?.field);
        Ok(after.changed_boxes(before))
    }

    /// Makes it an edit of the document: whether anything changed.
    ///
    /// # Errors
    /// [`CommandError::Changed`] if the document is not as it was; those of writing. The document is as it was then.
    pub fn apply(self, document: &mut Document) -> Result<bool, CommandError> {
        if !Change::between(&self.before, document.state()).is_empty() {
            return Err(CommandError::Changed(self.command.object().into()));
        }
        let (title, value) = (self.command.title(), self.command.to_value());
        Ok(document.commit(&title, value, self.after)?)
    }
}

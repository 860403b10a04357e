//! Objects that go, or get another name, with all that hang on them.

use crate::{CommandError, State};

/// The state without an object. What hangs on it hangs on its parent then, and stays where it is.
pub fn removed(state: &State, name: &str) -> Result<State, CommandError> {
    let parent = state.object(name)?.properties.clone();
    if state.objects().len() == 1 {
        let why = format!("{name:?} is the only object; a document has one at least");
        return Err(CommandError::Script(why));
    }
    let mut next = state.clone();
    for child in children(state, name) {
        let mut object = state.object(&child)?.clone();
        let map = parent.parent_from_object() * object.properties.parent_from_object();
        object.properties.set_placement(map);
        object.properties.parent = parent.parent.clone();
        next = next.with(&child, object)?;
    }
    Ok(next.without(name)?)
}

/// The state with another name for an object.
pub fn renamed(state: &State, name: &str, to: &str) -> Result<State, CommandError> {
    let object = state.object(name)?.clone();
    if state.object(to).is_ok() {
        return Err(CommandError::Taken(to.into()));
    }
    let mut next = state.with(to, object)?;
    for child in children(state, name) {
        let mut object = state.object(&child)?.clone();
        object.properties.parent = Some(to.into());
        next = next.with(&child, object)?;
    }
    Ok(next.without(name)?)
}

fn children(state: &State, name: &str) -> Vec<String> {
    let all = state.objects().iter();
    let own = all.filter(|(_, object)| object.properties.parent.as_deref() == Some(name));
    own.map(|(child, _)| child.clone()).collect()
}

use std::collections::BTreeMap;

use bspline::hierarchical::MAX_LEVELS;
use glam::DAffine3;
use sha2::{Digest, Sha256};

use crate::{DocumentError, Object};

/// Longest name of an object, bytes.
const LONGEST_NAME: usize = 100;

/// All objects of a document at one moment. Cheap to copy; copies share what is equal.
#[derive(Clone, Debug, Default)]
pub struct State {
    objects: BTreeMap<String, Object>,
}

impl State {
    /// No objects.
    pub fn new() -> Self {
        Self::default()
    }

    /// All objects, by name.
    pub fn objects(&self) -> &BTreeMap<String, Object> {
        &self.objects
    }

    /// The object of a name.
    ///
    /// # Errors
    /// [`DocumentError::NoObject`].
    pub fn object(&self, name: &str) -> Result<&Object, DocumentError> {
        self.objects.get(name).ok_or_else(|| DocumentError::NoObject {
            name: name.into(),
            known: self.objects.keys().cloned().collect(),
        })
    }

    /// Map from an object's own world to that which all objects without a parent share.
    ///
    /// # Errors
    /// [`DocumentError::NoObject`].
    pub fn placement(&self, name: &str) -> Result<DAffine3, DocumentError> {
        let mut properties = &self.object(name)?.properties;
        let mut map = properties.parent_from_object();
        while let Some(parent) = &properties.parent {
            properties = &self.object(parent)?.properties;
            map = properties.parent_from_object() * map;
        }
        Ok(map)
    }

    /// With an object put in, in place of one that had the name.
    ///
    /// # Errors
    /// [`DocumentError::Name`] for a name that is empty, too long, or could be mistaken; [`DocumentError::Properties`] for
    /// a placement that is not finite or flattens, a parent that is not there, or one that hangs on the object itself.
    pub fn with(&self, name: &str, object: Object) -> Result<Self, DocumentError> {
        check_name(name)?;
        let mut next = self.clone();
        next.objects.insert(name.into(), object);
        next.check(name)?;
        Ok(next)
    }

    /// Without an object.
    ///
    /// # Errors
    /// [`DocumentError::NoObject`]; [`DocumentError::Properties`] if others have it for a parent.
    pub fn without(&self, name: &str) -> Result<Self, DocumentError> {
        self.object(name)?;
        if let Some((child, _)) = self
            .objects
            .iter()
            .find(|(_, o)| o.properties.parent.as_deref() == Some(name))
        {
            return Err(DocumentError::Properties {
                name: child.clone(),
                why: format!("{name:?} is its parent; remove it first, or give it another"),
            });
        }
        let mut next = self.clone();
        next.objects.remove(name);
        Ok(next)
    }

    /// Names all objects: equal for equal ones, to the bit.
    pub fn sha256(&self) -> [u8; 32] {
        let mut hash = Sha256::new();
        hash.update(b"isoclay-document-1");
        for (name, object) in &self.objects {
            hash.update((name.len() as u64).to_le_bytes());
            hash.update(name);
            object.hash_into(&mut hash);
        }
        hash.finalize().into()
    }

    /// Whether all objects could have been put in by [`Self::with`].
    pub(crate) fn check_all(&self) -> Result<(), DocumentError> {
        self.objects.keys().try_for_each(|name| {
            check_name(name)?;
            self.check(name)
        })
    }

    fn check(&self, name: &str) -> Result<(), DocumentError> {
        let wrong = |why: String| {
            Err(DocumentError::Properties {
                name: name.into(),
                why,
            })
        };
        let properties = &self.object(name)?.properties;
        if let Some(detail) = properties.detail.filter(|level| *level >= MAX_LEVELS) {
            return wrong(format!(
                "its detail is level {detail}; there are levels 0 to {}",
                MAX_LEVELS - 1
            ));
        }
        if let Some(iso) = properties.iso.filter(|iso| !iso.is_finite()) {
            return wrong(format!("its iso-value is {iso}; a number is needed"));
        }
        let map = properties.parent_from_object();
        if !properties.placement.as_flattened().iter().all(|v| v.is_finite()) {
            return wrong(format!(
                "its placement is {:?}; numbers are needed",
                properties.placement
            ));
        }
        if !map.inverse().is_finite() {
            return wrong(format!(
                "its placement {:?} flattens it; give three independent axes",
                properties.placement
            ));
        }
        let mut above = properties.parent.as_deref();
        for _ in 0..=self.objects.len() {
            let Some(parent) = above else { return Ok(()) };
            match self.objects.get(parent) {
                Some(object) => above = object.properties.parent.as_deref(),
                None => return wrong(format!("its parent {parent:?} is not there")),
            }
        }
        wrong("its parents go in a circle".into())
    }

    /// Without checks: for states that were checked when they were made.
    pub(crate) fn set(&mut self, name: &str, object: Option<Object>) {
        match object {
            Some(object) => drop(self.objects.insert(name.into(), object)),
            None => drop(self.objects.remove(name)),
        }
    }
}

fn check_name(name: &str) -> Result<(), DocumentError> {
    let why = if name.is_empty() {
        "it is empty"
    } else if name.len() > LONGEST_NAME {
        "it is longer than 100 bytes"
    } else if name.trim() != name {
        "it starts or ends with a space"
    } else if name.chars().any(|c| c.is_control() || c == '/' || c == '\\') {
        "it has a slash or a control character in it"
    } else {
        return Ok(());
    };
    Err(DocumentError::Name {
        name: name.into(),
        why,
    })
}

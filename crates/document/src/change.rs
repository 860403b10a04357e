//! What differs between two states, as a value that leads from either to the other.

use std::path::Path;
use std::sync::Arc;

use bspline::hierarchical::BrickDiff;
use serde::{Deserialize, Serialize};
use tools::body::BodyDiff;
use tools::paint::{Layer, Substance};

use crate::body;
use crate::bulk::{self, Bulk};
use crate::error::{damaged, fault};
use crate::layers::{self, LayerHead};
use crate::{DocumentError, Object, Properties, State};

/// What an edit does to one object.
#[derive(Clone, Debug)]
pub enum Change {
    /// Puts it in.
    Added {
        /// Its name.
        object: String,
        /// All of it.
        new: Object,
    },
    /// Takes it out.
    Removed {
        /// Its name.
        object: String,
        /// All of it.
        old: Object,
    },
    /// Changes its field.
    Field {
        /// Its name.
        object: String,
        /// The bricks, or the coefficients on knots of its own.
        diff: BodyDiff,
    },
    /// Changes bricks of what is painted on it.
    Layer {
        /// Its name.
        object: String,
        /// What is painted.
        layer: Substance,
        /// Level of the object's lattice whose knots are the nodes.
        level: usize,
        /// The bricks.
        diff: BrickDiff<f32>,
    },
    /// Changes its properties.
    Properties {
        /// Its name.
        object: String,
        /// Before.
        old: Properties,
        /// After.
        new: Properties,
    },
}

/// A [`Change`] as the journal has it: what stands in its JSON; fields and differences follow as bytes.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(tag = "change", rename_all = "lowercase", deny_unknown_fields)]
pub(crate) enum ChangeHead {
    Added {
        object: String,
        properties: Properties,
        bytes: u64,
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        layers: Vec<LayerHead>,
    },
    Removed {
        object: String,
        properties: Properties,
        bytes: u64,
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        layers: Vec<LayerHead>,
    },
    Layer {
        object: String,
        of: LayerHead,
    },
    Field {
        object: String,
        bytes: u64,
    },
    Properties {
        object: String,
        old: Properties,
        new: Properties,
    },
}

impl Change {
    /// All that leads from one state to another, in the order of names: first what goes, then what comes or changes.
    pub fn between(old: &State, new: &State) -> Vec<Self> {
        let mut changes = Vec::new();
        let mut later = Vec::new();
        for (name, before) in old.objects() {
            let object = name.clone();
            let removed = |object| Self::Removed {
                object,
                old: before.clone(),
            };
            let Some(after) = new.objects().get(name) else {
                changes.push(removed(object));
                continue;
            };
            // Fields on other lattices or knots, or with another origin, have nothing in common.
            let is_same = Arc::ptr_eq(&before.meta, &after.meta) || before.meta == after.meta;
            let Some(diff) = before.field.difference(&after.field).filter(|_| is_same) else {
                changes.push(removed(object.clone()));
                later.push(Self::Added {
                    object,
                    new: after.clone(),
                });
                continue;
            };
            if !diff.is_empty() {
                later.push(Self::Field {
                    object: object.clone(),
                    diff,
                });
            }
            layers_between(&object, before, after, &mut later);
            if before.properties != after.properties {
                let (old, new) = (before.properties.clone(), after.properties.clone());
                later.push(Self::Properties { object, old, new });
            }
        }
        let come = new
            .objects()
            .iter()
            .filter(|(name, _)| !old.objects().contains_key(*name));
        changes.extend(later);
        changes.extend(come.map(|(name, new)| Self::Added {
            object: name.clone(),
            new: new.clone(),
        }));
        changes
    }

    /// The way back.
    pub fn reversed(&self) -> Self {
        match self.clone() {
            Self::Added { object, new } => Self::Removed { object, old: new },
            Self::Removed { object, old } => Self::Added { object, new: old },
            Self::Field { object, diff } => Self::Field {
                object,
                diff: diff.reversed(),
            },
            Self::Layer {
                object,
                layer,
                level,
                diff,
            } => Self::Layer {
                object,
                layer,
                level,
                diff: diff.reversed(),
            },
            Self::Properties { object, old, new } => Self::Properties {
                object,
                old: new,
                new: old,
            },
        }
    }

    /// Takes a state from the one side of the change to the other. The message says why it is on neither.
    pub(crate) fn apply(&self, state: &mut State) -> Result<(), String> {
        match self {
            Self::Added { object, new } => state.set(object, Some(new.clone())),
            Self::Removed { object, .. } => state.set(object, None),
            Self::Field { object, diff } => {
                let mut changed = state.object(object).map_err(|e| e.to_string())?.clone();
                changed.field = changed.field.applied(diff).map_err(|e| e.to_string())?;
                state.set(object, Some(changed));
            }
            Self::Layer {
                object,
                layer,
                level,
                diff,
            } => {
                let mut changed = state.object(object).map_err(|e| e.to_string())?.clone();
                let old = changed.layers.remove(layer).filter(|old| old.level() == *level);
                let old = old.unwrap_or_else(|| Layer::empty(&changed.field.lattice(), *level));
                let new = layers::followed(&old, diff)?;
                if !new.is_empty() {
                    changed.layers.insert(*layer, new);
                }
                state.set(object, Some(changed));
            }
            Self::Properties { object, new, .. } => {
                let mut changed = state.object(object).map_err(|e| e.to_string())?.clone();
                changed.properties = new.clone();
                state.set(object, Some(changed));
            }
        }
        Ok(())
    }

    /// As the journal has it; appends what is not JSON to `bytes`.
    pub(crate) fn write(&self, path: &Path, bytes: &mut Vec<u8>) -> Result<ChangeHead, DocumentError> {
        let put = |part: Result<Vec<u8>, formats::Fault>, bytes: &mut Vec<u8>| {
            let part = part.map_err(|f| fault(path, f))?;
            Ok::<_, DocumentError>(bulk::put(part, bytes))
        };
        let painted =
            |of: &Object, bytes: &mut Vec<u8>| layers::write(&of.layers, &of.field.lattice(), path, bytes);
        Ok(match self {
            Self::Added { object, new } => ChangeHead::Added {
                object: object.clone(),
                properties: new.properties.clone(),
                bytes: put(body::encode(&new.field, &new.meta), bytes)?,
                layers: painted(new, bytes)?,
            },
            Self::Removed { object, old } => ChangeHead::Removed {
                object: object.clone(),
                properties: old.properties.clone(),
                bytes: put(body::encode(&old.field, &old.meta), bytes)?,
                layers: painted(old, bytes)?,
            },
            Self::Field { object, diff } => ChangeHead::Field {
                object: object.clone(),
                bytes: put(body::encode_difference(diff), bytes)?,
            },
            Self::Layer {
                object,
                layer,
                level,
                diff,
            } => ChangeHead::Layer {
                object: object.clone(),
                of: layers::write_difference(*layer, *level, diff, path, bytes)?,
            },
            Self::Properties { object, old, new } => ChangeHead::Properties {
                object: object.clone(),
                old: old.clone(),
                new: new.clone(),
            },
        })
    }

    /// Reads one of the changes that lead from or to `beside`, a state that has the lattices of its objects.
    pub(crate) fn read(head: &ChangeHead, bulk: &mut Bulk, beside: &State) -> Result<Self, DocumentError> {
        Ok(match head {
            ChangeHead::Added {
                object,
                properties,
                bytes,
                layers,
            } => Self::Added {
                object: object.clone(),
                new: layers::read(bulk.object(*bytes, properties)?, layers, bulk)?,
            },
            ChangeHead::Removed {
                object,
                properties,
                bytes,
                layers,
            } => Self::Removed {
                object: object.clone(),
                old: layers::read(bulk.object(*bytes, properties)?, layers, bulk)?,
            },
            ChangeHead::Field { object, bytes } => {
                let known = beside
                    .object(object)
                    .map_err(|e| damaged(bulk.path, e.to_string()))?;
                let diff = body::decode_difference(bulk.take(*bytes)?, &known.field, bulk.limits)
                    .map_err(|f| fault(bulk.path, f))?;
                Self::Field {
                    object: object.clone(),
                    diff,
                }
            }
            ChangeHead::Layer { object, of } => {
                let known = beside
                    .object(object)
                    .map_err(|e| damaged(bulk.path, e.to_string()))?;
                Self::Layer {
                    object: object.clone(),
                    layer: of.layer,
                    level: of.level,
                    diff: layers::read_difference(of, bulk, &known.field.lattice())?,
                }
            }
            ChangeHead::Properties { object, old, new } => Self::Properties {
                object: object.clone(),
                old: old.clone(),
                new: new.clone(),
            },
        })
    }
}

/// What leads from the layers of one version of an object to those of another, in the order of substances.
fn layers_between(object: &str, before: &Object, after: &Object, changes: &mut Vec<Change>) {
    let lattice = &before.field.lattice();
    let mut add = |substance: Substance, old: &Layer, new: &Layer| {
        let diff = old
            .tree()
            .difference(new.tree())
            .expect("both lie on the lattice of one object");
        changes.extend((!diff.bricks.is_empty()).then(|| Change::Layer {
            object: object.into(),
            layer: substance,
            level: old.level(),
            diff,
        }));
    };
    let mut substances: Vec<Substance> = before.layers.keys().chain(after.layers.keys()).copied().collect();
    substances.sort_unstable();
    substances.dedup();
    for substance in substances {
        let [old, new] = [before, after].map(|o| o.layers.get(&substance));
        match (old, new) {
            (Some(old), Some(new)) if old.level() == new.level() => add(substance, old, new),
            _ => {
                // By way of a layer on which nothing is painted: the two have no node in common.
                old.inspect(|old| add(substance, old, &Layer::empty(lattice, old.level())));
                new.inspect(|new| add(substance, &Layer::empty(lattice, new.level()), new));
            }
        }
    }
}

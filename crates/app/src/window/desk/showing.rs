//! What is seen of the document.

use document::{Document, State};
use glam::DVec3;

use super::{Desk, Open};
use crate::view::{Ray, Shape, Solid, pick};
use crate::window::orders::{News, Thing};

impl Desk {
    /// Makes the triangles of what is shown now.
    pub(super) fn show(&mut self) {
        let Some(open) = &mut self.open else { return };
        let is_new = open.shapes.is_empty();
        let follow = match open.live {
            Some(_) => Shape::follow_stroke,
            None => Shape::follow,
        };
        let mut told = Vec::new();
        if !open.shares.keys().eq(open.shown.objects().keys()) {
            let shares = self.triangles.shared(open.shown.objects());
            let fits =
                |name: &String, shape: &mut Shape| shares.get(name).is_none_or(|share| shape.fits(*share));
            open.shapes.retain(fits);
            open.shares = shares;
        }
        let names: Vec<String> = open.shapes.keys().cloned().collect();
        for name in names.iter().filter(|n| !open.shown.objects().contains_key(*n)) {
            open.shapes.remove(name);
            told.push(News::Gone(name.clone()));
        }
        for (name, object) in open.shown.objects() {
            let (Some(iso), Ok(placed)) = (object.iso(), open.shown.placement(name)) else {
                continue;
            };
            let share = open.shares[name];
            let kept = open
                .shapes
                .get_mut(name)
                .filter(|shape| shape.follows(object, placed));
            let followed = match kept.map(|shape| follow(shape, name, object, open.origin)) {
                Some(Ok(patches)) => Ok(patches),
                // What became too large to follow is made anew, coarser.
                _ => Shape::new(object, iso, placed, share).map(|mut shape| {
                    told.push(News::Gone(name.clone()));
                    let all = shape.all(name, open.origin);
                    open.shapes.insert(name.clone(), shape);
                    all
                }),
            };
            match followed {
                Ok(patches) if patches.is_empty() => {}
                Ok(patches) => {
                    told.push(News::Patches(patches));
                    let solid = Solid::of(object, iso, placed).map(Box::new);
                    told.extend(solid.map(|solid| News::Solid(name.clone(), solid)));
                }
                Err(why) => told.push(News::Failed(format!("{name} cannot be shown: {why}"))),
            }
        }
        let scene = is_new.then(|| open.scene());
        scene.into_iter().chain(told).for_each(|news| self.tell(news));
    }
}

impl Open {
    /// The state of the document, or what a device shows of it.
    pub(super) fn state(&self) -> &State {
        self.document.as_ref().map_or(&self.shown, Document::state)
    }

    /// Where all surfaces lie, and what is up.
    fn scene(&mut self) -> News {
        let boxes = self.shapes.values().filter_map(Shape::bounding_box);
        let is_volume = Thing::of(&self.shown, &self.chosen).is_some_and(|thing| thing.is_volume);
        let all = boxes.reduce(bspline::Aabb::hull);
        News::scene(
            self.origin,
            all,
            is_volume,
            std::mem::replace(&mut self.is_seen, true),
        )
    }

    /// A line of the world in the chosen object's.
    pub(super) fn own_ray(&self, ray: &Ray) -> Option<Ray> {
        let own = self.shown.placement(&self.chosen).ok()?.inverse();
        Some(Ray {
            from: own.transform_point3(ray.from),
            along: own.transform_vector3(ray.along).try_normalize()?,
        })
    }

    /// Where a line meets the chosen object as the stroke found it, the outward normal there, and the line, all in the object's world. So a
    /// tool that carves does not follow what it carved, deeper and deeper.
    pub(super) fn under(&self, ray: &Ray) -> Option<(DVec3, DVec3, Ray)> {
        let object = self.state().object(&self.chosen).ok()?;
        let own = self.own_ray(ray)?;
        let field = object.field.as_field();
        let (at, normal) = pick(field, object.iso()?, &object.field.world_box(), &own)?;
        Some((at, normal, own))
    }
}
